"""What a report draws against time: curves, and the bounds that they should keep."""

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from peakflight.curves import ALWAYS, inner_times, peaks, sampled_curves
from peakflight.limits import KINDS, ROTORS, LimitKind
from peakflight.result import Plan
from peakflight.yaw import Heading
from peakflight.yaw_certificate import unfit

WITH_VEHICLE = ("tilt", "body_rate", "angular_acceleration")
"""Shown of a plan that has a vehicle, whether they are limited or not."""


class Curve(NamedTuple):
    """A line."""

    name: str
    values: np.ndarray
    """(n,) at the times of its panels."""
    colour: str
    """Name of a colour of `palette`, or of the page."""
    dash: str = "solid"


class Bound(NamedTuple):
    """A line across a panel that should not be crossed."""

    value: float
    text: str


class Marks(NamedTuple):
    """Points at which a limit binds a segment, or is exceeded there."""

    places: np.ndarray
    """Indices into the times."""
    exceeded: np.ndarray
    """Whether each is beyond the limit, rather than at it."""
    texts: list[str]


class Panel(NamedTuple):
    """Curves over one another."""

    label: str
    unit: str
    curves: tuple[Curve, ...]
    bounds: tuple[Bound, ...] = ()
    marks: Marks | None = None


class Panels(NamedTuple):
    """Panels under one another, with one axis of time."""

    times: np.ndarray
    """(n,) s; joints come twice, as derivatives may jump there."""
    panels: tuple[Panel, ...]


def limit_panels(plan: Plan) -> Panels:
    """Speed, thrust acceleration, jerk, snap, and what else is limited or known of a vehicle."""
    limits = plan.problem.limits
    times, curves = sampled_curves(plan.trajectory, limits.airframe)
    panels = []
    for kind in KINDS:
        shown = kind.name in ALWAYS or (kind.name in WITH_VEHICLE and plan.vehicle is not None)
        names = (kind.name, *kind.leasts)
        kinds = [one for one in limits.active if one.name in names]
        if kind.is_least or not (shown or kinds):
            continue
        if kind.name in ROTORS and plan.vehicle is not None:
            continue  # the thrust of every rotor is known
        values = curves[kind.name]
        bounds = tuple(_bound(one, getattr(limits, one.name)) for one in kinds)
        drawn = [Curve(kind.label, values.ravel(), "ink")]
        if kind.name in ROTORS:
            drawn = [
                Curve("most of any rotor", curves["rotor_thrust"].ravel(), "rotor-0"),
                Curve(
                    "least of any rotor", curves["least_rotor_thrust"].ravel(), "rotor-1", "dash"
                ),
            ]
        marks = _marks(plan, kinds, curves)
        panels.append(Panel(kind.label, kind.shown_unit, tuple(drawn), bounds, marks))
    if plan.vehicle is not None:
        with suppress(ValueError):  # nothing is known of rotors where a file is far from a flight
            panels.append(_rotor_panel(plan))
    return Panels(times.ravel(), tuple(panels))


def yaw_panels(plan: Plan) -> Panels | None:
    """Yaw, and what is limited of how it turns; None for a plan without a yaw that fits it."""
    heading, motion = plan.problem.heading, plan.yaw_motion
    if heading is None or motion is None or unfit(heading, motion, plan.trajectory):
        return None
    from peakflight.twist import turning_about_z

    times = inner_times(plan.trajectory).ravel()
    times = np.clip(times, motion.start_time, motion.end_time)
    yaw = np.degrees(plan.yaw(times))
    drawn = [*_followed(plan, heading, times), Curve("yaw", yaw, "ink")]
    if heading.is_about_body:
        turning = turning_about_z(plan.trajectory, motion, times, plan.problem.airframe)
    else:
        turning = plan.yaw(times, derivative=1), plan.yaw(times, derivative=2)
    panels = [Panel("yaw", "°", tuple(drawn))]
    for kind, values in zip(heading.kinds, turning, strict=True):
        limit = heading.limits.get(kind)
        bounds = [] if limit is None else [_bound(kind, limit), Bound(-limit, "")]
        curve = Curve(kind.label, values, "ink")
        panels.append(Panel(kind.label, kind.shown_unit, (curve,), tuple(bounds)))
    return Panels(times, tuple(panels))


def _rotor_panel(plan: Plan) -> Panel:
    """The thrust of each rotor, with what the vehicle can do, whether or not that is a limit."""
    from peakflight.flatness import planned_states

    assert plan.vehicle is not None
    thrusts = planned_states(plan, inner_times(plan.trajectory).ravel()).rotor_thrust
    dashes = ("solid", "dash", "dot", "dashdot")
    curves = tuple(
        Curve(f"rotor {rotor + 1}", thrusts[:, rotor], f"rotor-{rotor}", dash)
        for rotor, dash in enumerate(dashes)
    )
    least, most = plan.vehicle.rotor_thrust
    can = "limit" if plan.problem.limits.on_rotors else "vehicle"
    bounds = Bound(most, f"{can} {most:.4g} N"), Bound(least, f"{can} {least:.4g} N")
    return Panel("rotor thrust", "N", curves, bounds)


def _followed(plan: Plan, heading: Heading, times: np.ndarray) -> list[Curve]:
    """The direction that the yaw follows, if it follows one, in the turn in which it begins."""
    if not heading.follows:
        return []
    from peakflight.yaw_motion import followed

    target, _ = followed(heading, plan.trajectory, times)
    turns = np.round((float(plan.yaw(times[0])) - target[0]) / (2.0 * np.pi))
    names = {"velocity": "direction of the velocity", "point": "direction of the point"}
    return [
        Curve(names[heading.policy], np.degrees(target + 2.0 * np.pi * turns), "followed", "dot")
    ]


def _marks(plan: Plan, kinds: list[LimitKind], curves: dict[str, np.ndarray]) -> Marks:
    """Where the curve of each segment that a limit binds, or that exceeds it, is at its peak."""
    places, exceeded, texts = [], [], []
    for kind in kinds:
        values = curves[kind.name]
        for segment, place, kappa in zip(*peaks(plan, kind, values), strict=True):
            places.append(int(segment * values.shape[1] + place))
            exceeded.append(bool(kappa > 1.0))
            word = "exceeded" if exceeded[-1] else "binds"
            texts.append(f"{kind.label} {word} in segment {segment}: {kappa:.6f} of it")
    return Marks(np.array(places, dtype=int), np.array(exceeded, dtype=bool), texts)


def _bound(kind: LimitKind, limit: float) -> Bound:
    value, unit = float(kind.shown(limit)), kind.shown_unit
    least = "at least " if kind.is_least else "limit "
    return Bound(value, f"{least}{value:.5g}{'' if unit == '°' else ' '}{unit}")
