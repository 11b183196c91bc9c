"""Making a flight fit its format: fewer pieces where there is not room, slower where it is rounded.

Planning again is left to method joint, whose pieces are its own choice. A plan between the fastest
and the smoothest is met again by the effort that makes it as long.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from peakflight.certificate import certify
from peakflight.errors import InvalidProblem
from peakflight.formats.flight_files import FlightFormat, Reading
from peakflight.limits import LABELS, Limits
from peakflight.planner import plan as solve
from peakflight.result import Plan

METHOD = "joint"
SNAP = 4
"""Highest derivative of position that limits are about."""
SLOWER_ROUNDS = 60
"""Most times that a flight is slowed down."""
STEP = 1.002
"""Least factor by which it is then."""
SLOWEST = 2.0
"""Factor of the time beyond which rounding is not fought by flying slower."""
AS_LONG = 1e-3
"""Part of its duration by which a plan made again may be shorter, to count as the same."""
EFFORT_ORDERS = {"acceleration": 2, "jerk": 3, "snap": 4}
"""Derivative that effort weighs, by what a problem minimizes."""
PIECES_A_LEG = (1.5, 1.0)
"""Pieces in each leg that are tried too where rounding punishes short ones."""
EFFORT_ROUNDS, EFFORTS = 16, 1e6
"""Halvings of the range of efforts, and its width on either side of the natural one."""


class Held(NamedTuple):
    """What a reading keeps."""

    peaks: dict[str, float]
    """Name of limit to its largest certified ratio, of what the format fixes."""
    names: tuple[str, ...]
    """Of the limits that it is held to."""
    problems: tuple[str, ...]


def held(plan: Plan, reading: Reading, chosen: FlightFormat) -> Held:
    """Certified peaks of a reading against the limits of its plan, and what is exceeded.

    Of set-points, which fix no more than acceleration, only limits up to that are known. Rounded
    polynomials have all, but are held to those that rounding leaves a meaning.
    """
    limits = plan.problem.limits
    fixed = [kind for kind in limits.active if kind.order <= chosen.fixed]
    if not fixed:
        return Held({}, (), ())
    values = {kind.name: getattr(limits, kind.name) for kind in fixed}
    if limits.airframe is not None and chosen.fixed >= SNAP:
        values["airframe"] = limits.airframe
    report = certify(reading.trajectory, Limits(**values))
    peaks = {kind.name: float(report.peaks[kind.name].max()) for kind in fixed}
    names = tuple(kind.name for kind in fixed if kind.order <= chosen.held)
    problems = tuple(
        f"{LABELS[name]} reaches {peaks[name]:.6g} times its limit; {1.0 + chosen.tolerance:g} is "
        "allowed for rounding"
        for name in names
        if not peaks[name] <= 1.0 + chosen.tolerance
    )
    return Held(peaks, names, problems)


def fit(plan: Plan, chosen: FlightFormat, *, refit: bool) -> Plan:
    """The plan, or the shortest flight near it that fits the format and keeps the limits in it.

    Raises
    ------
    InvalidProblem
        If there is not room and `refit` does not allow, or cannot make, fewer pieces.
    """
    room = None if chosen.most_pieces is None else chosen.most_pieces(plan)
    crowded = room is not None and len(plan.trajectory) > room
    if not refit:
        if crowded:
            raise InvalidProblem(f"{_too_many(plan, room)}; refit, or plan with fewer (max_pieces)")
        return plan
    best: Plan | None = None
    if not crowded:
        best = _slowed(plan, chosen)
        if best is plan:
            return plan
    for candidate in _fewer(plan, room, chosen):
        slowed = _slowed(candidate, chosen)
        if slowed is not None and (best is None or slowed.duration < best.duration):
            best = slowed
    if best is None and crowded:
        raise InvalidProblem(f"{_too_many(plan, room)}, and {_why_not_fewer(plan, room)}")
    return best or plan


def _slowed(plan: Plan, chosen: FlightFormat) -> Plan | None:
    """The plan, slowed down by as little as makes its file keep the limits; None if nothing does.

    Every factor is rounded anew, so what exceeds is noise in part: steps are small.
    """
    factor = 1.0
    for _ in range(SLOWER_ROUNDS):
        slower = plan if factor == 1.0 else stretched(plan, factor)
        found = held(slower, chosen.decode(chosen.encode([slower], ["drone"]).data)[0], chosen)
        if not found.problems:
            return slower
        if not plan.problem.is_at_rest:
            return None
        worst = max(found.peaks[name] for name in found.names) / (1.0 + chosen.tolerance)
        factor *= max(STEP, min(worst, 1.02) ** 0.5)
        if factor > SLOWEST:
            return None
    return None


def stretched(plan: Plan, factor: float) -> Plan:
    """The plan flown slower, its yaw with it."""
    yaw = None if plan.yaw_motion is None else plan.yaw_motion.stretch(factor)
    return replace(plan, trajectory=plan.trajectory.stretch(factor), yaw_motion=yaw)


def _fewer(plan: Plan, room: int | None, chosen: FlightFormat) -> Iterator[Plan]:
    """The plan made again with fewer pieces: as many as there is room for, down to one a leg."""
    legs = len(plan.pieces)
    if plan.method != METHOD or (room is not None and legs > room):
        return
    most = len(plan.trajectory) - 1 if room is None else min(room, len(plan.trajectory) - 1)
    counts = {most}
    if chosen.coarse:
        counts |= {min(most, round(part * legs)) for part in PIECES_A_LEG}
    for count in sorted(counts, reverse=True):
        if count >= legs:
            again = _again(plan, count)
            if again.feasible:
                yield again


def _again(plan: Plan, most_pieces: int) -> Plan:
    """The plan by method joint with at most so many pieces, and no shorter than it was."""

    def with_effort(effort: float) -> Plan:
        return solve(plan.problem, method=METHOD, max_pieces=most_pieces, effort=effort)

    fastest = with_effort(0.0)
    enough = (1.0 - AS_LONG) * plan.duration
    if not fastest.feasible or fastest.duration >= enough:
        return fastest
    natural = plan.duration / _integral(plan, EFFORT_ORDERS.get(str(plan.problem.minimize), 3))
    low, high = np.log(natural / EFFORTS), np.log(natural)
    best = fastest
    for _ in range(EFFORT_ROUNDS):
        middle = 0.5 * (low + high)
        found = with_effort(float(np.exp(middle)))
        if found.feasible and found.duration >= enough:
            best, high = found, middle
        else:
            low = middle
    return best


def _integral(plan: Plan, order: int) -> float:
    """Integral of the squared derivative along a plan."""
    squared = (plan.trajectory.sample(33, order) ** 2).sum(axis=2).mean(axis=1)
    return float((squared * plan.segment_times).sum())


def _too_many(plan: Plan, room: int | None) -> str:
    return f"the flight has {len(plan.trajectory)} pieces; there is room for {room}"


def _why_not_fewer(plan: Plan, room: int | None) -> str:
    legs = len(plan.pieces)
    if room is not None and legs > room:
        return f"each of its {legs} legs needs one: split the course"
    if plan.method != METHOD:
        return f"method {plan.method} does not plan with fewer: plan with method {METHOD}"
    return f"planning again with fewer in its {legs} legs finds no flight: split the course"
