"""The paper's planning results, run again: its example, and its comparison for jerk and for snap.

The paper does not print its waypoints, so another course takes their place. What it prints of
results stands here as printed, to be put beside what comes out.
"""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from peakflight.compare import Row, run_method
from peakflight.course import Course
from peakflight.limits import PAPER_LIMITS, Limits
from peakflight.methods.peak import Settings as PeakSettings
from peakflight.methods.scaling import proportional_times
from peakflight.problem import Problem
from peakflight.result import Plan
from peakflight.spline import minimum_effort_spline
from peakflight.trajectory import Trajectory
from peakflight.version import __version__

DEFAULT_COURSE = Course(
    np.array(
        [
            [0.0, 0.0, 1.0],
            [0.6, 0.5, 1.2],
            [0.2, 0.9, 1.0],
            [0.9, 1.3, 1.1],
            [3.2, 1.2, 1.4],
            [4.6, -0.4, 1.2],
            [3.2, -2.0, 1.0],
            [0.4, -2.0, 1.2],
            [-1.2, -0.6, 1.0],
        ]
    ),
    name="tight_then_fast",
)
"""Our own, of the kind that the paper describes: a tight section first, then long straight sections
and gentle curves. Also in examples/courses, for those who have the repository."""
RECONSTRUCTION = Course(
    np.array(
        [
            [3.828, 2.786, 1.12],
            [4.524, 2.046, 1.932],
            [4.757, 2.072, 2.183],
            [4.839, 3.116, 1.65],
            [3.46, 4.178, 0.572],
            [3.195, 4.287, 0.485],
            [2.911, 4.382, 0.472],
            [1.065, 3.758, 1.343],
            [1.183, 3.116, 1.356],
            [1.305, 0.578, 0.675],
        ]
    ),
    name="paper_like",
)
"""Searched for so that the six total times come out near the paper's; not the paper's course. Also
in examples/courses, where it says how."""
GUESS_DURATION = 5.0
"""Total time of the initial guess of the paper's example, s."""
DEGREE = 5
"""Of all polynomials in the paper's comparison."""

GUESS, MELLINGER, PEAK = "initial guess", "Mellinger", "peak"
ALGORITHM_1, JOINT = "peak, Algorithm 1", "joint"
COMPARED = (GUESS, MELLINGER, PEAK)
"""What the paper compares, by the names of the tables here."""
Pair = tuple[str, str]
"""What is measured, and against what."""


@dataclass(frozen=True, kw_only=True)
class Printed:
    """What the paper prints of one comparison."""

    name: str
    title: str
    limits: Limits
    durations: Mapping[str, float]
    """s."""
    reductions: Mapping[Pair, float]
    """Of the total time, percent."""
    speed_gains: Mapping[Pair, float]
    """Of the top speed, percent."""


PRINTED = (
    Printed(
        name="jerk",
        title="Minimum jerk",
        limits=PAPER_LIMITS,
        durations={PEAK: 3.9, MELLINGER: 5.6, GUESS: 6.7},
        reductions={(PEAK, GUESS): 42.0, (PEAK, MELLINGER): 30.0},
        speed_gains={(PEAK, GUESS): 125.0, (PEAK, MELLINGER): 88.0},
    ),
    Printed(
        name="snap",
        title="Minimum snap",
        limits=Limits(speed=5.0, thrust_acceleration=14.5, jerk=54.0, snap=800.0),
        durations={PEAK: 4.3, MELLINGER: 5.3, GUESS: 6.9},
        reductions={(PEAK, GUESS): 38.0, (MELLINGER, GUESS): 23.0},
        speed_gains={},
    ),
)


class Beside(NamedTuple):
    """A figure that the paper prints, and ours: None where a method has no certified plan."""

    quantity: str
    unit: str
    paper: float
    ours: float | None


@dataclass(frozen=True, kw_only=True)
class PaperComparison:
    """The paper's methods, and two more, under one set of limits."""

    printed: Printed
    problem: Problem
    """Of all methods but joint, to which degree and continuity are left."""
    rows: Mapping[str, Row]
    """Name in the tables to what the method made of the problem; the paper's three first."""

    @property
    def plans(self) -> dict[str, Plan]:
        """Name of the paper's three to the certified plan, where there is one."""
        plans = {name: certified_plan(self.rows[name]) for name in COMPARED}
        return {name: plan for name, plan in plans.items() if plan is not None}

    def reduction(self, name: str, other: str) -> float | None:
        """By how much a total time is below another, percent."""
        one, than = self.rows[name].duration, self.rows[other].duration
        return None if one is None or than is None else 100.0 * (1.0 - one / than)

    def speed_gain(self, name: str, other: str) -> float | None:
        """By how much a top speed is above another, percent."""
        one, than = self.rows[name].top_speed, self.rows[other].top_speed
        return None if one is None or than is None else 100.0 * (one / than - 1.0)

    @property
    def beside_paper(self) -> tuple[Beside, ...]:
        """Every figure that the paper prints of this comparison, with ours."""
        figures = [
            Beside(f"total time, {name}", "s", value, self.rows[name].duration)
            for name, value in self.printed.durations.items()
        ]
        for (name, other), value in self.printed.reductions.items():
            quantity = f"reduction of the total time, {name} against {other}"
            figures.append(Beside(quantity, "%", value, self.reduction(name, other)))
        for (name, other), value in self.printed.speed_gains.items():
            quantity = f"gain in top speed, {name} against {other}"
            figures.append(Beside(quantity, "%", value, self.speed_gain(name, other)))
        return tuple(figures)


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """Everything that was run."""

    course: Course
    comparisons: tuple[PaperComparison, ...]
    """For jerk and for snap."""

    @cached_property
    def guess(self) -> Trajectory:
        """The example's minimum-jerk spline with the total time set to 5 s, limits or not."""
        shares = proportional_times(self.comparisons[0].problem)
        times = shares * (GUESS_DURATION / shares.sum())
        return minimum_effort_spline(self.course.waypoints, times, minimize="jerk", degree=DEGREE)

    @property
    def example(self) -> PaperComparison:
        """The comparison that the paper's example belongs to: for jerk."""
        return self.comparisons[0]

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names."""
        return {
            "course": self.course.name,
            "waypoints": self.course.waypoints.tolist(),
            "comparisons": [_as_dict(one) for one in self.comparisons],
            "version": __version__,
        }


def reproduce(
    course: Course = DEFAULT_COURSE, *, on_stage: Callable[[str], None] | None = None
) -> Reproduction:
    """Run what the paper ran, on a course; a method that fails is a row that says so.

    Parameters
    ----------
    course
        Tidied (`peakflight.tidy`).
    on_stage
        Told what begins.

    Raises
    ------
    InvalidProblem
        If two waypoints in a row are alike.
    """
    problems = [
        Problem(course.waypoints, limits=printed.limits, minimize=printed.name, degree=DEGREE)
        for printed in PRINTED
    ]
    comparisons = []
    for printed, problem in zip(PRINTED, problems, strict=True):
        free = replace(problem, degree=None)
        runs: dict[str, tuple[Problem, str, Any]] = {
            GUESS: (problem, "proportional", None),
            MELLINGER: (problem, "mellinger", None),
            PEAK: (problem, "peak", None),
            ALGORITHM_1: (problem, "peak", PeakSettings(variant="paper")),
            JOINT: (free, "joint", None),
        }
        rows = {}
        for name, (asked, method, settings) in runs.items():
            if on_stage is not None:
                on_stage(f"{printed.title.lower()}: {name}")
            rows[name] = run_method(asked, method, settings)
        comparisons.append(PaperComparison(printed=printed, problem=problem, rows=rows))
    return Reproduction(course=course, comparisons=tuple(comparisons))


def is_same(one: Course, other: Course) -> bool:
    """Whether two courses have the same waypoints, whatever they are called."""
    return np.array_equal(one.waypoints, other.waypoints)


def certified_plan(row: Row) -> Plan | None:
    """The plan of a method, if it is proven to keep the limits."""
    return row.plan if row.certified else None


def figures_csv(result: Reproduction) -> str:
    """Every figure that the paper prints, beside ours."""
    return as_csv(
        ("comparison", "quantity", "unit", "paper", "ours"),
        ((one.printed.name, *figure) for one in result.comparisons for figure in one.beside_paper),
    )


def methods_csv(result: Reproduction) -> str:
    """A line for each comparison and method."""
    columns = {
        "duration [s]": "duration",
        "paper's duration [s]": "paper_duration",
        "reduction against initial guess [%]": "reduction_against_guess",
        "reduction against Mellinger [%]": "reduction_against_mellinger",
        "top speed [m/s]": "top_speed",
        "path length [m]": "path_length",
        "iterations": "iterations",
        "status": "status",
        "certified": "certified",
        "message": "message",
    }
    values = (
        (one.printed.name, name, *(row[key] for key in columns.values()))
        for one in result.comparisons
        for name, row in _as_dict(one)["methods"].items()
    )
    return as_csv(("comparison", "method", *columns), values)


def leg_times_csv(result: Reproduction) -> str:
    """A line for each leg, with the time of every method that has a certified plan."""

    def lines() -> Iterator[tuple[Any, ...]]:
        for one in result.comparisons:
            times = [_leg_times(row) for row in one.rows.values()]
            for leg in range(len(result.course) - 1):
                cells = [None if found is None else found[leg] for found in times]
                yield (one.printed.name, leg, *cells)

    names = (GUESS, MELLINGER, PEAK, ALGORITHM_1, JOINT)
    return as_csv(("comparison", "leg", *(f"{name} [s]" for name in names)), lines())


def _as_dict(one: PaperComparison) -> dict[str, Any]:
    methods = {}
    for name, row in one.rows.items():
        methods[name] = {
            "status": row.status,
            "certified": row.certified,
            "duration": row.duration,
            "paper_duration": one.printed.durations.get(name),
            "reduction_against_guess": one.reduction(name, GUESS),
            "reduction_against_mellinger": one.reduction(name, MELLINGER),
            "top_speed": row.top_speed,
            "path_length": row.path_length,
            "binding": list(row.binding),
            "leg_times": _leg_times(row),
            "iterations": row.iterations,
            "message": row.message,
        }
    return {
        "name": one.printed.name,
        "limits": one.printed.limits.to_dict(),
        "degree": one.problem.degree,
        "continuity": one.problem.spline_class.continuity,
        "methods": methods,
        "beside_paper": [figure._asdict() for figure in one.beside_paper],
    }


def _leg_times(row: Row) -> list[float] | None:
    plan = certified_plan(row)
    return None if plan is None else np.diff(plan.waypoint_times).tolist()


def as_csv(columns: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Columns and rows as CSV; None leaves a cell empty."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return stream.getvalue()
