"""What is drawn of a plan, as plain arrays: the path and its colours, curves, legs, the vehicle."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from peakflight.curves import ALWAYS
from peakflight.limits import KINDS, ROTORS, limited_values
from peakflight.page import states
from peakflight.page.colours import along_scale
from peakflight.result import BINDING, Plan
from peakflight.vehicle import Vehicle
from peakflight.yaw import ALL_LABELS

CURVE_POINTS = 361
"""Of each plot: about one a pixel."""
AT_LIMIT = 0.995
"""Of a limit, from where on it counts as flown at."""


@dataclass(frozen=True, eq=False)
class Curve:
    """What one plot shows."""

    name: str
    title: str
    """With its unit."""
    values: tuple[np.ndarray, ...]
    """(CURVE_POINTS,) each."""
    limits: tuple[float, ...]
    """None, one or two, in the unit of the values."""


class Held(NamedTuple):
    """What one limit does on one leg."""

    label: str
    """What it is called."""
    ratio: float
    """Certified: the peak over the limit."""
    share: float
    """Part of the leg's time that is flown at the limit, sampled."""

    @property
    def binds(self) -> bool:
        """Whether the limit is reached, within 0.1 %."""
        return self.ratio >= BINDING


@dataclass(frozen=True)
class Leg:
    """What one leg is like."""

    index: int
    duration: float
    """s."""
    length: float
    """m, straight."""
    held: tuple[Held, ...]
    """By each limit: first what holds it back the longest, then what comes nearest."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """A plan as it is drawn. Nothing here is proof: that is in `plan.report`."""

    plan: Plan
    states: states.States
    """At `path_times`."""

    @cached_property
    def path_times(self) -> np.ndarray:
        """(P,) s, through every waypoint."""
        return states.path_times(self.plan)

    @cached_property
    def path(self) -> np.ndarray:
        """(P, 3) m."""
        return self.plan.trajectory(self.path_times)

    @cached_property
    def path_speeds(self) -> np.ndarray:
        """(P,) m/s."""
        return np.linalg.norm(self.plan.trajectory(self.path_times, derivative=1), axis=-1)

    @property
    def top_speed(self) -> float:
        """m/s, where the scale of colours ends: the limit, or else the fastest there is."""
        limit = self.plan.problem.limits.speed
        return limit if limit is not None else float(self.path_speeds.max())

    @cached_property
    def segments(self) -> np.ndarray:
        """(P-1, 2, 3) m, the path as lines."""
        return np.stack([self.path[:-1], self.path[1:]], axis=1).astype(np.float32)

    @cached_property
    def colours(self) -> np.ndarray:
        """(P-1, 2, 3) of 0 to 255, by speed."""
        colours = along_scale(self.path_speeds / self.top_speed)
        return np.stack([colours[:-1], colours[1:]], axis=1)

    @cached_property
    def legs(self) -> tuple[Leg, ...]:
        """One entry a leg."""
        plan = self.plan
        names = list(plan.report.peaks)
        segment = np.array([plan.report.peaks[name] for name in names])
        starts = np.concatenate(([0], np.cumsum(plan.pieces)[:-1]))
        peaks = np.maximum.reduceat(segment, starts, axis=1)
        shares = [self._shares(name) for name in names]
        durations, lengths = np.diff(plan.waypoint_times), plan.problem.leg_lengths
        legs = []
        for leg in range(len(durations)):
            held = [
                Held(ALL_LABELS[name], float(peaks[row, leg]), float(shares[row][leg]))
                for row, name in enumerate(names)
            ]
            held.sort(key=lambda one: (one.binds, one.share, one.ratio), reverse=True)
            legs.append(Leg(leg, float(durations[leg]), float(lengths[leg]), tuple(held)))
        return tuple(legs)

    @cached_property
    def _ratios(self) -> dict[str, np.ndarray]:
        """Name of limit to (P,) values over it, at `path_times`."""
        limits = self.plan.problem.limits
        derivatives = [self.plan.trajectory(self.path_times, order) for order in (1, 2, 3, 4)]
        return limits.ratios(limited_values(derivatives, limits.airframe))

    def _shares(self, name: str) -> np.ndarray:
        """(legs,) part of each leg's time at a limit; 0 for limits of the yaw."""
        legs = len(self.plan.pieces)
        ratios = self._ratios.get(name)
        if ratios is None:
            return np.zeros(legs)
        return (ratios[:-1].reshape(legs, -1) >= AT_LIMIT).mean(axis=1)

    @cached_property
    def curve_times(self) -> np.ndarray:
        """(CURVE_POINTS,) s from the beginning."""
        return np.linspace(0.0, self.plan.duration, CURVE_POINTS)

    @cached_property
    def curves(self) -> tuple[Curve, ...]:
        """One for each kind that is always shown or limited."""
        plan, limits = self.plan, self.plan.problem.limits
        begin = plan.trajectory.start_time
        times = np.clip(begin + self.curve_times, begin, plan.trajectory.end_time)
        derivatives = [plan.trajectory(times, order) for order in (1, 2, 3, 4)]
        known = plan.vehicle is not None  # else it is drawn by another's rotors
        values = limited_values(derivatives, None if known else limits.airframe)
        curves = []
        for kind in KINDS:
            bounds = [getattr(limits, name) for name in (kind.name, *kind.leasts)]
            lines = tuple(float(kind.shown(bound)) for bound in bounds if bound is not None)
            if kind.is_least or not (lines or kind.name in ALWAYS):
                continue
            if kind.name not in ROTORS:
                shown: tuple[np.ndarray, ...] = (kind.shown(values[kind.name]),)
            elif known:
                thrusts = self.states.rotor_thrust.T
                shown = tuple(np.interp(times, self.path_times, thrust) for thrust in thrusts)
            else:
                shown = tuple(values[name] for name in ROTORS)
            title = f"{kind.label[0].upper()}{kind.label[1:]} ({kind.shown_unit})"
            curves.append(Curve(kind.name, title, shown, lines))
        return tuple(curves)

    @property
    def flown(self) -> Vehicle:
        """What is drawn as flying."""
        return states.flown(self.plan)

    def at(self, seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position (3,) m, attitude (4,) as w, x, y, z and rotor thrusts (4,) N at a time, s."""
        begin = self.plan.trajectory.start_time
        times, known = self.path_times - begin, self.states
        seconds = min(max(seconds, 0.0), self.plan.duration)
        after = int(np.clip(np.searchsorted(times, seconds), 1, len(times) - 1))
        share = (seconds - times[after - 1]) / (times[after] - times[after - 1])
        one, other = known.attitude[after - 1], known.attitude[after]
        attitude = (1.0 - share) * one + share * (other if one @ other >= 0.0 else -other)
        thrusts = (1.0 - share) * known.rotor_thrust[after - 1] + share * known.rotor_thrust[after]
        position = self.plan.trajectory(min(begin + seconds, self.plan.trajectory.end_time))
        return position, attitude / np.linalg.norm(attitude), thrusts
