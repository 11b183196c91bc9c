"""A flight as motion capture sees it, beside its plan: how far off it was, and what limits it met.

The paper flies under motion capture at 100 Hz, takes derivatives of the positions by differences
and means of five (`differences`), and looks at the root mean square of the distance. The filter
hides quick motion and lets noise grow, so the plan goes through it too.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from peakflight.errors import InvalidProblem
from peakflight.flight.alignment import Alignment, find_start, planned_positions
from peakflight.flight.differences import (
    RATE,
    Samples,
    checked_record,
    differentiate,
    sample_positions,
)
from peakflight.limits import KINDS, UNBOUNDED, LimitKind, Limits, limited_values
from peakflight.problem import AXES, as_float_array
from peakflight.result import Plan

GAP = 2.5
"""Periods between two samples from which on some are missing between them."""
NEARLY = 1.01
"""Relative to a rate: what is this near to it counts as the same."""
JITTER = 0.1
"""Typical deviation of the steps of time from their mean, relative to it, that is worth a note."""
ELSEWHERE = 3.0
"""Times by which a shift in space makes the error smaller, from which on it is worth a note."""
MEASURED = ("speed", "thrust_acceleration", "jerk", "snap", "tilt", "least_thrust_acceleration")
"""Kinds of limit that positions tell about: those of one derivative alone."""
ALWAYS = MEASURED[:4]
"""Those that are looked at whether they are limited or not."""


class Curve(NamedTuple):
    """What a kind of limit is about, along a flight."""

    times: np.ndarray
    """(n,) s since the plan began."""
    flown: np.ndarray
    """(n,) in the unit of the kind; NaN in gaps."""
    planned: np.ndarray
    """(n,) the same of the plan, through the same filter."""


class Peak(NamedTuple):
    """The extreme of a curve: the least value of a kind that is limited from below."""

    limit: float | None
    planned: float | None
    """Of the plan as it is: certified, and never within a filter."""
    filtered: float | None
    """Of the plan through the filter."""
    flown: float | None
    """None where nothing is known: too short a record, or only gaps."""
    time: float | None
    """Of `flown`, s since the plan began."""
    ratio: float | None
    """Flown over limit, or limit over flown of a kind that is limited from below: above 1 is
    beyond the limit. None where it is not limited."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightAnalysis:
    """What a record of positions says about a flight, beside its plan. Arrays are read-only."""

    start: float
    """Time of the record at which the plan began, s."""
    start_given: bool
    """Whether that was known; otherwise it is where the record fits the plan best."""
    rate: float
    """Samples a second that derivatives are taken of, Hz."""
    duration: float
    """Of the plan, s."""
    times: np.ndarray
    """(n,) s since the plan began, of the record's samples within the plan."""
    positions: np.ndarray
    """(n, 3) m."""
    planned: np.ndarray
    """(n, 3) m, where the plan is at these times."""
    curves: Mapping[str, Curve]
    """Name of kind of limit to what it is about, against time."""
    peaks: Mapping[str, Peak]
    """Name of kind of limit to the extreme of its curve."""
    gaps: tuple[tuple[float, float], ...] = ()
    """Begin and end of what is missing, s since the plan began."""
    notes: tuple[str, ...] = ()
    """What a reader of the figures should know, a line each."""

    def __post_init__(self) -> None:
        for name, shape in (("times", (None,)), ("positions", (None, 3)), ("planned", (None, 3))):
            object.__setattr__(self, name, as_float_array(name, getattr(self, name), shape))

    @cached_property
    def errors(self) -> np.ndarray:
        """(n,) m, distance from the plan."""
        return np.linalg.norm(self.positions - self.planned, axis=1)

    @property
    def rms_error(self) -> float:
        """Root mean square of the distance from the plan, m."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def top_error(self) -> float:
        """Largest distance from the plan, m."""
        return float(self.errors.max())

    @property
    def top_error_time(self) -> float:
        """When that was, s since the plan began."""
        return float(self.times[self.errors.argmax()])

    @property
    def offset(self) -> np.ndarray:
        """(3,) m, mean of the position less the plan's."""
        return np.mean(self.positions - self.planned, axis=0)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names; without the samples."""
        peaks = {name: {**peak._asdict(), "ratio": peak.ratio} for name, peak in self.peaks.items()}
        return {
            "start": self.start,
            "start_given": self.start_given,
            "rate": self.rate,
            "duration": self.duration,
            "samples": len(self.times),
            "rms_error": self.rms_error,
            "top_error": self.top_error,
            "top_error_time": self.top_error_time,
            "offset": self.offset.tolist(),
            "peaks": peaks,
            "gaps": [list(gap) for gap in self.gaps],
            "notes": list(self.notes),
        }


def analyse(
    times: ArrayLike,
    positions: ArrayLike,
    plan: Plan,
    *,
    start: float | None = None,
    rate: float | None = None,
) -> FlightAnalysis:
    """Lay a record of positions beside the plan that was flown.

    Parameters
    ----------
    times
        (n,) s, rising.
    positions
        (n, 3) m; rows with NaN are samples without a position.
    start
        Time of the record at which the plan began, s; None to find it. What is found is where the
        record fits best, which takes the mean delay of the vehicle for a later start and hides it
        from the errors.
    rate
        Samples a second that derivatives are taken of, Hz; None for those of the record, but at
        most 100, as in the paper.

    Raises
    ------
    InvalidProblem
        If times do not rise, shapes do not fit, an argument is out of range, or the record and the
        plan have too little time in common.
    """
    stamps, places = checked_record(times, positions)
    known = np.isfinite(places).all(axis=1)
    if known.sum() < 2:
        raise InvalidProblem(f"{known.sum()} samples have a position; there must be at least 2")
    steps = np.diff(stamps[known])
    period = float(np.mean(steps[steps <= GAP * np.median(steps)]))
    rate = _rate(rate, 1.0 / period)
    trajectory, duration = plan.trajectory, plan.duration
    found: Alignment | None = None
    if start is None:
        samples = sample_positions(stamps, places, rate, gap=GAP * period)
        found = find_start(samples.times, samples.positions, trajectory, rate)
        start = found.start
    elif not math.isfinite(start):
        raise InvalidProblem(f"start is {start}; it must be finite")
    since = stamps - start
    slack = 1e-9 * (duration + float(np.abs(stamps).max()))
    within = known & (since >= -slack) & (since <= duration + slack)
    if within.sum() < 2:
        raise InvalidProblem(
            f"the plan runs from {start:g} to {start + duration:g} s, and the record, from "
            f"{stamps[0]:g} to {stamps[-1]:g} s, has {within.sum()} positions in that time; it "
            "takes at least 2"
        )
    planned = planned_positions(trajectory, since[within])
    gaps = _gaps(since[known], duration, GAP * period)
    curves = _curves(since, places, plan, rate, GAP * period)
    analysis = FlightAnalysis(
        start=float(start),
        start_given=found is None,
        rate=rate,
        duration=duration,
        times=since[within],
        positions=places[within],
        planned=planned,
        curves=curves,
        peaks=_peaks(curves, plan),
        gaps=gaps,
    )
    return replace(analysis, notes=_notes(analysis, steps, period, found))


def _rate(asked: float | None, own: float) -> float:
    """The rate that derivatives are taken at, Hz."""
    if asked is None:
        return own if own <= NEARLY * RATE else RATE
    if not (math.isfinite(asked) and 0.0 < asked <= NEARLY * own):
        raise InvalidProblem(
            f"rate is {asked:g} Hz; it must be positive and at most the record's {own:.4g} Hz"
        )
    return float(asked)


def _curves(
    since: np.ndarray, positions: np.ndarray, plan: Plan, rate: float, gap: float
) -> dict[str, Curve]:
    """What limits are about, flown and planned through the same filter, while the plan lasts."""
    flown = sample_positions(since, positions, rate, gap=gap)
    at_rest = plan.problem.is_at_rest
    planned = Samples(flown.times, planned_positions(plan.trajectory, flown.times, hover=at_rest))
    pairs = list(zip(differentiate(flown, rate), differentiate(planned, rate), strict=True))
    curves = {}
    for kind in _kinds(plan.problem.limits):
        mine, theirs = pairs[kind.order - 1]
        within = (mine.times >= 0.0) & (mine.times <= plan.duration)
        curves[kind.name] = Curve(
            mine.times[within],
            _about(kind, mine.values[within]),
            _about(kind, theirs.values[within]),
        )
    return curves


def _kinds(limits: Limits) -> list[LimitKind]:
    return [
        kind
        for kind in KINDS
        if kind.name in MEASURED and (kind.name in ALWAYS or kind in limits.active)
    ]


def _about(kind: LimitKind, values: np.ndarray) -> np.ndarray:
    """What a kind of limit is about, of (n, 3) values of the one derivative that it needs."""
    return limited_values([values] * kind.order)[kind.name]


def _peaks(curves: Mapping[str, Curve], plan: Plan) -> dict[str, Peak]:
    limits = plan.problem.limits
    peaks = {}
    for kind in _kinds(limits):
        curve = curves[kind.name]
        kappa = plan.report.peaks.get(kind.name)
        limit = getattr(limits, kind.name)
        planned = None
        if kappa is not None and limit is not None:
            planned = limits.attained(kind, float(kappa.max()))
        flown, time = _extreme(kind, curve.flown, curve.times)
        filtered, _ = _extreme(kind, curve.planned, curve.times)
        ratio = None if limit is None or flown is None else _ratio(kind, flown, limit)
        peaks[kind.name] = Peak(limit, planned, filtered, flown, time, ratio)
    return peaks


def _ratio(kind: LimitKind, value: float, limit: float) -> float:
    """How much of a limit a value takes up."""
    if kind.is_least:
        return min(limit / max(value, limit / UNBOUNDED), UNBOUNDED)
    return value / limit


def _extreme(
    kind: LimitKind, values: np.ndarray, times: np.ndarray
) -> tuple[float | None, float | None]:
    """The largest value, or the least of what is limited from below; and when."""
    if not np.isfinite(values).any():
        return None, None
    place = int(np.nanargmin(values) if kind.is_least else np.nanargmax(values))
    return float(values[place]), float(times[place])


def _gaps(known: np.ndarray, duration: float, longest: float) -> tuple[tuple[float, float], ...]:
    """What is missing of a record with samples at (n,) s since the plan began."""
    edges = np.concatenate(([0.0], known[(known > 0.0) & (known < duration)], [duration]))
    missing = np.flatnonzero(np.diff(edges) > longest)
    return tuple((float(edges[place]), float(edges[place + 1])) for place in missing)


def _notes(
    analysis: FlightAnalysis, steps: np.ndarray, period: float, found: Alignment | None
) -> tuple[str, ...]:
    lines = []
    for begin, end in analysis.gaps:
        lines.append(
            f"no positions from {begin:.3f} to {end:.3f} s of the plan; errors and derivatives "
            "leave that out"
        )
    even = steps[steps <= GAP * period]
    jitter = float(np.median(np.abs(even - period))) / period
    if jitter > JITTER:
        lines.append(
            f"steps of time differ by {100.0 * jitter:.0f} % typically, which derivatives suffer "
            "from; if the cameras run evenly, write times from the numbers of the frames"
        )
    if found is not None and found.rival is not None:
        lines.append(
            f"another start, {found.rival:.3f} s, fits about as well; is the plan flown twice? "
            "give the one that you mean"
        )
    shifted = float(np.sqrt(np.mean(analysis.errors**2) - np.sum(analysis.offset**2)))
    if analysis.rms_error > ELSEWHERE * shifted and analysis.rms_error > LEAST_SHIFT:
        where = ", ".join(
            f"{axis} {value:+.3f}" for axis, value in zip(AXES, analysis.offset, strict=True)
        )
        lines.append(
            f"the record lies beside the plan as a whole ({where} m); without that the RMS error "
            f"would be {shifted:.3f} m: is it in another frame?"
        )
    return tuple(lines)


LEAST_SHIFT = 0.02
"""m: a record that lies beside the plan by less is within what vehicles do."""
