"""Methods side by side: what each makes of the same problem, and medians over several."""

import csv
import io
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from peakflight.bound import Bound, discretised_bound, require_casadi
from peakflight.certificate import peak_ratios
from peakflight.errors import InvalidProblem, PeakflightError
from peakflight.limits import Limits
from peakflight.methods import METHODS, find
from peakflight.planner import plan
from peakflight.problem import Problem
from peakflight.result import BINDING, Plan
from peakflight.trajectory import Trajectory

BASELINE = "proportional"
"""The method that others are measured against: the paper's initial guess."""
REFUSED, FAILED = "refused", "failed"
"""Of a method that cannot answer the problem, and of one that ends in an error of its own."""
NODES, PARTS = 16, 8
"""Of Gauss's rule for path lengths, and the parts of a piece that it is used on."""
BATCH = 2000
"""Pieces whose lengths are found at once."""
JERK_AT_REST = 1e-6
"""Jerk at an end, relative to the largest, that counts as jerk."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """What one method made of a problem. Figures are None where there is no certified flight."""

    method: str
    status: str
    """As the plan says it; or refused, or failed."""
    certified: bool
    """Whether the plan is proven to keep every limit."""
    duration: float | None = None
    """s."""
    against_proportional: float | None = None
    """By how much longer than the plan of `proportional`, percent: negative is faster."""
    above_bound: float | None = None
    """By how much longer than the discretised bound, percent."""
    top_speed: float | None = None
    """m/s, certified."""
    mean_speed: float | None = None
    """Path length over duration, m/s."""
    path_length: float | None = None
    """m."""
    binding: tuple[str, ...] = ()
    """Names of the limits that bind in some segment."""
    pieces: int | None = None
    """Polynomial pieces in all."""
    iterations: int = 0
    cpu_time_s: float = 0.0
    """Planning and proof, s; of all threads."""
    message: str = ""
    """What the user should know, such as why there is no plan."""
    plan: Plan | None = field(default=None, repr=False, compare=False)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names; without the plan."""
        values = asdict(replace(self, plan=None))
        values.pop("plan")
        return {**values, "binding": list(self.binding)}


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Several methods on one problem."""

    name: str
    """Of the course."""
    problem: Problem
    rows: tuple[Row, ...]
    """In the order of the methods."""
    proportional: float | None
    """Duration by the method `proportional`, s; None if it has no certified plan."""
    bound: Bound | None = None
    """If it was asked for."""

    @property
    def fastest(self) -> Row | None:
        """The row of the shortest certified flight."""
        flights = [row for row in self.rows if row.duration is not None]
        return min(flights, key=lambda row: row.duration or 0.0, default=None)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the figures should know, a line each."""
        lines = [
            f"{row.method}: {row.status}" + (f": {row.message}" if row.message else "")
            for row in self.rows
            if not row.certified
        ]
        if self.bound is None:
            return tuple(lines)
        if not self.bound.success:
            lines.append(f"no bound ({self.bound.status}): {self.bound.message}")
        elif self.bound.message:
            lines.append(f"bound: {self.bound.message}")
        unfair = [row.method for row in self.rows if row.plan is not None and _jerks(row.plan)]
        if self.bound.success and self.problem.is_at_rest and unfair:
            lines.append(
                f"the bound begins and ends without jerk; {', '.join(unfair)} "
                f"{'does' if len(unfair) == 1 else 'do'} not, which saves a little time"
            )
        return tuple(lines)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names."""
        return {
            "course": self.name,
            "legs": len(self.problem.waypoints) - 1,
            "proportional": self.proportional,
            "bound": None if self.bound is None else self.bound.to_dict(),
            "rows": [row.to_dict() for row in self.rows],
            "notes": list(self.notes),
        }


@dataclass(frozen=True, kw_only=True)
class Summary:
    """One method on several problems: medians over those that it has a certified plan for."""

    method: str
    courses: int
    failures: int
    """Courses without a certified plan."""
    fastest: int
    """Courses on which no other method is faster."""
    duration: float | None
    """s."""
    against_proportional: float | None
    """Percent."""
    above_bound: float | None
    """Percent."""
    mean_speed: float | None
    """m/s."""
    pieces: float | None
    iterations: float | None
    cpu_time_s: float | None
    """s."""

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and names."""
        return asdict(self)


def compare(
    problem: Problem,
    *,
    methods: Sequence[str] | None = None,
    settings: Mapping[str, Any] | None = None,
    bound: bool = False,
    name: str = "",
    on_stage: Callable[[str], None] | None = None,
) -> Comparison:
    """Answer a problem by several methods.

    A method that fails is a row that says so.

    Parameters
    ----------
    methods
        Names from `peakflight.methods.METHODS`; by default all.
    settings
        Name of a method to its settings; those that are not named have their defaults.
    bound
        Whether to compute the discretised bound too, which takes seconds.
    name
        Of the course.
    on_stage
        Told what begins.

    Raises
    ------
    InvalidProblem
        If a method is unknown or named twice, or the bound cannot hold a limit that is set.
    MissingExtra
        If the bound is asked for and CasADi is not installed.
    """
    methods = check_methods(methods)
    settings = settings or {}
    if bound:
        require_casadi()
    tell = on_stage or _ignore
    rows = {}
    for method in dict.fromkeys((*methods, BASELINE)):
        tell(method)
        rows[method] = run_method(problem, method, settings.get(method))
    found = None
    if bound:
        tell("bound")
        start = rows["peak"].plan if "peak" in rows else None
        found = discretised_bound(
            problem, start=start, on_iteration=lambda count: tell(f"bound, iteration {count}")
        )
    baseline = rows[BASELINE].duration
    return Comparison(
        name=name,
        problem=problem,
        rows=tuple(_measured(rows[method], baseline, found) for method in methods),
        proportional=baseline,
        bound=found,
    )


def run_method(problem: Problem, method: str, settings: Any = None) -> Row:
    """Answer a problem by one method, without the figures that depend on others.

    Whatever goes wrong is a row that says so.
    """
    began = time.process_time()
    try:
        answer = plan(problem, method=method, settings=settings)
    except PeakflightError as error:
        return Row(method=method, status=REFUSED, certified=False, message=str(error))
    except Exception as error:  # a comparison goes on without the method
        message = f"unexpected {type(error).__name__}: {error}; this is a bug, please report it"
        return Row(method=method, status=FAILED, certified=False, message=message)
    row = Row(
        method=method,
        status=str(answer.status),
        certified=answer.feasible,
        iterations=answer.iterations,
        cpu_time_s=time.process_time() - began,
        message=answer.message,
        plan=answer,
    )
    if not answer.feasible:
        return row
    length = path_length(answer.trajectory)
    return replace(
        row,
        duration=answer.duration,
        top_speed=float(peak_ratios(answer.trajectory, Limits(speed=1.0))[:, 0].max()),
        mean_speed=length / answer.duration,
        path_length=length,
        binding=tuple(n for n, kappa in answer.report.peaks.items() if kappa.max() >= BINDING),
        pieces=len(answer.trajectory),
    )


def check_methods(names: Sequence[str] | None) -> tuple[str, ...]:
    """The methods that are named, or all.

    Raises
    ------
    InvalidProblem
        If one is unknown, or named twice; or if none is named.
    """
    chosen = tuple(METHODS if names is None else names)
    if not chosen:
        raise InvalidProblem(f"no method is named; known are {', '.join(METHODS)}")
    for index, name in enumerate(chosen):
        find(name)
        if name in chosen[:index]:
            raise InvalidProblem(f"method {name!r} is named twice")
    return chosen


def warm_up(problem: Problem, methods: Sequence[str] | None = None) -> None:
    """Load what methods are compiled to, by the first two legs, so that CPU times leave it out."""
    legs = min(len(problem.waypoints) - 1, 2)
    if not problem.derivatives:
        problem = replace(problem, waypoints=problem.waypoints[: legs + 1], yaw=None)
    for method in dict.fromkeys((*check_methods(methods), BASELINE)):
        run_method(problem, method, None)


def summarise(comparisons: Sequence[Comparison]) -> tuple[Summary, ...]:
    """Medians and failures of each method over several problems."""
    names = dict.fromkeys(row.method for one in comparisons for row in one.rows)
    return tuple(_summary(name, comparisons) for name in names)


def as_csv(comparisons: Sequence[Comparison]) -> str:
    """A line for each course and method, under names with units."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for one in comparisons:
        limit = None if one.bound is None else one.bound.duration
        for row in one.rows:
            writer.writerow(
                (
                    one.name,
                    row.method,
                    row.status,
                    "yes" if row.certified else "no",
                    row.duration,
                    row.against_proportional,
                    row.above_bound,
                    row.top_speed,
                    row.mean_speed,
                    row.path_length,
                    " ".join(row.binding),
                    row.pieces,
                    row.iterations,
                    row.cpu_time_s,
                    limit,
                    row.message,
                )
            )
    return stream.getvalue()


_COLUMNS = (
    "course",
    "method",
    "status",
    "certified",
    "duration [s]",
    "against proportional [%]",
    "above bound [%]",
    "top speed [m/s]",
    "mean speed [m/s]",
    "path length [m]",
    "binding limits",
    "pieces",
    "iterations",
    "CPU time [s]",
    "bound [s]",
    "message",
)


def _measured(row: Row, baseline: float | None, bound: Bound | None) -> Row:
    """Add what a row is compared with."""
    if row.duration is None:
        return row
    return replace(
        row,
        against_proportional=None if baseline is None else 100.0 * (row.duration / baseline - 1.0),
        above_bound=None if bound is None else bound.excess(row.duration),
    )


def path_length(trajectory: Trajectory) -> float:
    """How far the vehicle flies, m."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    places = ((np.arange(PARTS)[:, None] + (nodes + 1.0) / 2.0) / PARTS).ravel()
    shares = np.tile(weights, PARTS) / (2.0 * PARTS)
    total = 0.0
    for first in range(0, len(trajectory), BATCH):
        pieces = np.arange(first, min(first + BATCH, len(trajectory)))
        times = trajectory.segment_times[pieces, None]
        speeds = np.linalg.norm(trajectory.at(pieces[:, None], times * places, 1), axis=-1)
        total += float((speeds * times @ shares).sum())
    return total


def _jerks(answer: Plan) -> bool:
    """Whether a plan begins or ends with jerk."""
    motion = answer.trajectory
    ends = np.abs(motion([motion.start_time, motion.end_time], 3)).max()
    return bool(ends > JERK_AT_REST * np.abs(motion.sample(5, 3)).max())


def _summary(name: str, comparisons: Sequence[Comparison]) -> Summary:
    rows = [row for one in comparisons for row in one.rows if row.method == name]
    flights = [row for row in rows if row.certified]

    def median(figure: str) -> float | None:
        values = [getattr(row, figure) for row in flights if getattr(row, figure) is not None]
        return float(statistics.median(values)) if values else None

    best = [one.fastest for one in comparisons]
    return Summary(
        method=name,
        courses=len(rows),
        failures=len(rows) - len(flights),
        fastest=sum(row is not None and row.method == name for row in best),
        duration=median("duration"),
        against_proportional=median("against_proportional"),
        above_bound=median("above_bound"),
        mean_speed=median("mean_speed"),
        pieces=median("pieces"),
        iterations=median("iterations"),
        cpu_time_s=median("cpu_time_s"),
    )


def _ignore(_: str) -> None:
    pass
