"""Making a flight fit its format: fewer pieces where there is not room, slower where it is rounded.

Planning again is left to method joint, whose pieces are its own choice. A plan between the fastest
and the smoothest is met again by the effort that makes it as long.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from peakflight.certificate import certify
from peakflight.errors import InvalidProblem
from peakflight.formats.flight_files import Encoded, FlightFormat, Reading
from peakflight.limits import LABELS, Limits
from peakflight.methods.merging import merged
from peakflight.planner import plan as solve
from peakflight.result import Plan
from peakflight.trajectory import Trajectory

METHOD = "joint"
SNAP = 4
"""Highest derivative of position that limits are about."""
SLOWER_ROUNDS = 60
"""Most times that a flight is slowed down."""
STEP = 1.002
"""Least factor by which it is then."""
MOST_EXCESS = 1.02
"""Excess over the limits that a step answers: beyond, it may be noise."""
SLOWEST = 2.0
"""Factor of the time beyond which rounding is not fought by flying slower."""
TOLERANCE = 1e-5
"""Of planning again: finer than usual, since it makes up for pieces that are missing."""
AS_LONG = 1e-3
"""Part of its duration by which a plan made again may be shorter, to count as the same."""
EFFORT_ORDERS = {"acceleration": 2, "jerk": 3, "snap": 4}
"""Derivative that effort weighs, by what a problem minimizes."""
PIECES_A_LEG = (1.5, 1.25, 1.0)
"""Pieces in each leg that are tried too where rounding punishes short ones."""
EFFORT_ROUNDS, EFFORTS = 10, 1e6
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


class Written(NamedTuple):
    """Plans as they are written, and what is read of them."""

    plans: tuple[Plan, ...]
    encoded: Encoded
    readings: tuple[Reading, ...]
    held: tuple[Held, ...]

    @property
    def keeps(self) -> bool:
        """Whether every limit that is held is kept."""
        return not any(one.problems for one in self.held)

    @property
    def worst(self) -> float:
        """Largest ratio to a limit that is held."""
        return max(one.peaks[name] for one in self.held for name in one.names)


def fit(
    plans: Sequence[Plan], names: Sequence[str], chosen: FlightFormat, *, refit: bool
) -> Written:
    """The plans, or the shortest flights near them that fit the format and keep the limits in it.

    Several plans are a show: they keep their paths, and are slowed down together if at all.

    Raises
    ------
    InvalidProblem
        If there is not room and `refit` does not allow, or cannot make, fewer pieces.
    """
    rooms = [None if chosen.most_pieces is None else chosen.most_pieces(plan) for plan in plans]
    crowded = [
        room is not None and len(plan.trajectory) > room
        for plan, room in zip(plans, rooms, strict=True)
    ]
    if any(crowded) and (len(plans) > 1 or not refit):
        index = crowded.index(True)
        which = f"plan {index + 1}: " if len(plans) > 1 else ""
        raise InvalidProblem(
            f"{which}{_too_many(plans[index], rooms[index])}; plan with fewer (max_pieces)"
        )
    if any(crowded):
        return _refitted(plans[0], names, chosen, rooms[0], None)
    plainly = _written(plans, names, chosen)
    if not refit or plainly.keeps:
        return plainly
    slowed = _slowed(plans, names, chosen, plainly)
    if len(plans) > 1:
        return slowed or plainly
    return _refitted(plans[0], names, chosen, rooms[0], slowed, plainly)


def _refitted(
    plan: Plan,
    names: Sequence[str],
    chosen: FlightFormat,
    room: int | None,
    slowed: Written | None,
    plainly: Written | None = None,
) -> Written:
    """The shortest of a flight slowed down and those with fewer pieces, else the plain one."""
    best = slowed
    for candidate in _fewer(plan, room, chosen):
        first = _written([candidate], names, chosen)
        found = first if first.keeps else _slowed([candidate], names, chosen, first)
        if found is not None and (best is None or _duration(found) < _duration(best)):
            best = found
    if best is not None:
        return best
    if plainly is None:
        raise InvalidProblem(f"{_too_many(plan, room)}, and {_why_not_fewer(plan, room)}")
    return plainly


def _duration(written: Written) -> float:
    return written.plans[0].duration


def _written(plans: Sequence[Plan], names: Sequence[str], chosen: FlightFormat) -> Written:
    encoded = chosen.encode(plans, names)
    readings = chosen.decode(encoded.data)
    found = tuple(held(*item, chosen) for item in zip(plans, readings, strict=True))
    return Written(tuple(plans), encoded, readings, found)


def _slowed(
    plans: Sequence[Plan], names: Sequence[str], chosen: FlightFormat, found: Written
) -> Written | None:
    """Plans slowed down by as little as makes their file keep the limits; None if nothing does.

    `found` is what they are as they stand.

    Every factor is rounded anew, so what exceeds is noise in part: steps are small.
    """
    if not all(plan.problem.is_at_rest for plan in plans):
        return None
    factor = 1.0
    for _ in range(SLOWER_ROUNDS):
        excess = found.worst / (1.0 + chosen.tolerance)
        factor *= max(STEP, min(excess, MOST_EXCESS) ** 0.5)
        if factor > SLOWEST:
            return None
        found = _written(stretched(plans, factor), names, chosen)
        if found.keeps:
            return found
    return None


def stretched(plans: Sequence[Plan], factor: float) -> tuple[Plan, ...]:
    """Plans flown slower, their yaw and their delays with them, from when the first one starts."""
    first = min(plan.trajectory.start_time for plan in plans)

    def slower(motion: Trajectory) -> Trajectory:
        return motion.stretch(factor).shift((factor - 1.0) * (motion.start_time - first))

    return tuple(
        replace(
            plan,
            trajectory=slower(plan.trajectory),
            yaw_motion=None if plan.yaw_motion is None else slower(plan.yaw_motion),
        )
        for plan in plans
    )


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
            again = _again(plan, count, carefully=not chosen.coarse)
            if again.feasible:
                yield again


def _again(plan: Plan, most_pieces: int, *, carefully: bool) -> Plan:
    """The plan by method joint with at most so many pieces, and no shorter than it was.

    Carefully: with the pieces where they help most.
    """
    options: dict[str, Any] = {"max_pieces": most_pieces, "tolerance": TOLERANCE}
    if not carefully:
        options["exchanges"] = 0
    fastest = solve(plan.problem, method=METHOD, **options)
    enough = (1.0 - AS_LONG) * plan.duration
    if not fastest.feasible or fastest.duration >= enough:
        return fastest
    fewer, pieces = merged(plan.trajectory, np.array(plan.pieces), most_pieces)
    start = replace(plan, trajectory=fewer, pieces=tuple(pieces.tolist()))
    natural = plan.duration / _integral(plan, EFFORT_ORDERS.get(str(plan.problem.minimize), 3))
    low, high = np.log(natural / EFFORTS), np.log(natural)
    best = fastest
    for _ in range(EFFORT_ROUNDS):
        middle = 0.5 * (low + high)
        effort = float(np.exp(middle))
        found = solve(plan.problem, method=METHOD, initial=start, effort=effort, **options)
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
