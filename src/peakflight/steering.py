"""Add the yaw that a problem asks for to a flight, slowed down as far as the limits need it."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from peakflight.certificate import certify_answer
from peakflight.limits import GRAVITY, KINDS
from peakflight.problem import Problem
from peakflight.result import Report
from peakflight.trajectory import Trajectory

if TYPE_CHECKING:
    from peakflight.yaw_motion import Turning

SLOWER = 1.05
"""Largest factor by which a flight is slowed down at a time, where it cannot be told how much."""
NEARER = 1.0002
"""Least such factor: a step that is shorter is not worth a search."""
ROUNDS = 40
"""Most such steps."""
CLOSE = 1.001
"""Ratio of the least stretch that did and the largest that did not at which the search ends."""
JUST = (1.0 + 1e-9) / CLOSE
"""Part of a stretch that did which ends the search if it does not."""
SPARE = 1e-4
"""Part of the limits of a heading that is left for rounding of the yaw: at once where it follows a
direction, for the rest where they were exceeded."""


class Steered(NamedTuple):
    """A trajectory with the yaw that is asked for, and the proof of both."""

    trajectory: Trajectory
    report: Report
    yaw: Trajectory | None = None
    deviation: float = 0.0
    """Of the yaw from what it follows, rad."""
    note: str = ""
    """What the yaw has cost, in words."""
    too_fast: bool = False
    """Whether it would have to be slower for the yaw, but motion is fixed at a waypoint."""
    lacking: Mapping[str, float] = MappingProxyType({})
    """Name of a limit on rotors to the thrust by which the yaw exceeded it at first, N."""


def steered(problem: Problem, trajectory: Trajectory, pieces: tuple[int, ...]) -> Steered:
    """A flight with the yaw of its problem, slower where that needs it; certified.

    Parameters
    ----------
    trajectory
        (K,) pieces that keep the limits of the flight.
    pieces
        (legs,) how many pieces each leg has.
    """
    if problem.heading is None:
        return Steered(trajectory, certify_answer(problem, trajectory, pieces))
    from peakflight.yaw_motion import turning  # it imports much of scipy

    turned = turning(problem, trajectory, pieces)
    note = ""
    if problem.heading.follows:
        note = (
            f"the yaw is up to {math.degrees(turned.deviation):.3g} deg off the direction it "
            "follows"
        )
    if turned.stretch > 1.0 and not problem.is_at_rest:
        note = (
            f"the yaw limits need a flight {turned.stretch:.4g} times as long, which the motion "
            "that is fixed at waypoints does not allow"
        )
        yaw = turned.yaw and turned.yaw.stretch(1.0 / turned.stretch)
        report = certify_answer(problem, trajectory, pieces, yaw=yaw)
        return Steered(trajectory, report, yaw, turned.deviation, note, too_fast=True)
    if problem.heading.is_about_body:
        return _about_body(problem, trajectory, pieces, note)
    return _about_yaw(problem, trajectory, pieces, turned, note)


def _about_yaw(
    problem: Problem, trajectory: Trajectory, pieces: tuple[int, ...], turned: "Turning", note: str
) -> Steered:
    """Limits of the yaw itself: how much slower it needs the flight to be is known."""
    yaw, stretch = turned.yaw, turned.stretch
    flight = trajectory if stretch == 1.0 else trajectory.stretch(stretch)
    report = certify_answer(problem, flight, pieces, yaw=yaw)
    if stretch > 1.0 and yaw is not None:
        # Slowing down keeps most limits by itself, but those on least thrust and on turning may
        # first be exceeded, and are kept again where the flight is slow enough.
        for _ in range(ROUNDS):
            if report.feasible:
                break
            stretch, yaw = stretch * SLOWER, yaw.stretch(SLOWER)
            flight = trajectory.stretch(stretch)
            report = certify_answer(problem, flight, pieces, yaw=yaw)
        note = _slower(stretch, "the yaw limits")
    return Steered(flight, report, yaw, turned.deviation, note)


def _about_body(
    problem: Problem, trajectory: Trajectory, pieces: tuple[int, ...], note: str
) -> Steered:
    """Limits of the body's turning, and of its rotors with it: the stretch is searched for.

    How the body turns about its thrust depends on gravity, so the yaw is found anew for every
    stretch. The least one that does is closed in between what did and what did not: what is guessed
    from an excess is mostly right, so a little less is tried first.
    """
    from peakflight.yaw_motion import turning

    best: Steered | None = None
    lacking: dict[str, float] | None = None
    slow, fast = math.inf, 0.0
    stretch, is_guess = 1.0, True
    share = 1.0 / (1.0 + SPARE) if problem.heading and problem.heading.follows else 1.0
    for _ in range(ROUNDS):
        flight = trajectory if stretch == 1.0 else trajectory.stretch(stretch)
        turned = turning(problem, flight, pieces, share=share)
        report = certify_answer(problem, flight, pieces, yaw=turned.yaw)
        found = Steered(flight, report, turned.yaw, turned.deviation, note)
        excess = _excess(problem, report)
        if report.feasible:
            best, slow = found, stretch
        elif turned.yaw is not None and 1.0 < excess.of_rounding < 2.0 and share > 0.5:
            share /= excess.of_rounding * (1.0 + SPARE)
            continue
        else:
            fast = stretch
        lacking = _lacking(problem, report) if lacking is None else lacking
        if not problem.is_at_rest or slow <= CLOSE * max(fast, 1.0):
            break
        if best is None:
            stretch *= max(turned.stretch, excess.stretch, NEARER)
        else:
            middle = math.sqrt(max(fast, 1.0) * slow)
            stretch, is_guess = max(middle, JUST * slow) if is_guess else middle, False
    if best is None:
        return found._replace(too_fast=not problem.is_at_rest, lacking=lacking or {})
    cost = _slower(slow, "the yaw and what it takes") if slow > CLOSE else ""
    return best._replace(note="; ".join(filter(None, (note, cost))), lacking=lacking or {})


def _lacking(problem: Problem, report: Report) -> dict[str, float]:
    """By how much limits on rotors are exceeded, N."""
    found = {}
    for name, room in problem.limits.rotor_rooms.items():
        excess = float(report.peaks[name].max()) - 1.0
        if excess > 0.0:
            found[name] = excess * (getattr(problem.limits, name) if name == MOST else room)
    return found


MOST = "rotor_thrust"
_INDEX = [kind.name for kind in KINDS].index(MOST)


class _Excess(NamedTuple):
    """By how much limits are exceeded."""

    stretch: float
    """How much slower the flight would have to be for that, by guess."""
    of_rounding: float
    """Ratio to the limits of a heading, where the yaw can be found within less of them."""


def _excess(problem: Problem, report: Report) -> _Excess:
    heading, limits = problem.heading, problem.limits.as_array()
    assert heading is not None
    stretch, of_rounding = 1.0, 1.0
    for name, kappa in report.peaks.items():
        worst = float(kappa.max())
        if worst <= 1.0:
            continue
        turn = {kind.name: kind.order for kind in heading.limits}.get(name)
        if turn is not None and heading.policy != "fixed":
            of_rounding = max(of_rounding, worst)
        elif turn is not None:
            stretch = max(stretch, worst ** (1.0 / turn))
        elif name == MOST:  # what is beyond gravity falls with the square
            most = limits[_INDEX]
            stretch = max(stretch, math.sqrt((worst * most - GRAVITY) / (most - GRAVITY)))
        elif name == "least_rotor_thrust":
            stretch = max(stretch, math.sqrt(worst))
        else:
            stretch = max(stretch, SLOWER)
    return _Excess(stretch, of_rounding)


def _slower(stretch: float, why: str) -> str:
    return f"slowed down by {100.0 * (stretch - 1.0):.3g} % for {why}"
