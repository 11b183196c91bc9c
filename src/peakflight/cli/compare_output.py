"""What `peakflight compare` tells a person."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from peakflight.cli.options import limits_source
from peakflight.cli.output import Printout
from peakflight.limits import Limits
from peakflight.vehicle import Vehicle
from peakflight.wording import seconds, written
from peakflight.yaw import ALL_LABELS

if TYPE_CHECKING:
    from peakflight.compare import Comparison, Summary

NONE = "-"
"""What stands where there is no figure."""


def print_comparisons(
    comparisons: Sequence["Comparison"],
    summaries: Sequence["Summary"],
    *,
    notes: Sequence[Sequence[str]],
    vehicle: Vehicle | None,
    given_limits: Limits | None,
    folder: Path | None,
    files: Mapping[str, Path],
    remarks: Sequence[str],
) -> None:
    """Print two tables a course, medians, and where the files are.

    Parameters
    ----------
    summaries
        Medians over the courses; none for a single one.
    given_limits
        What the user has limited; None for the defaults of the vehicle, or the paper's.
    notes
        About each course.
    remarks
        About the files.
    """
    out = Printout()
    problem = comparisons[0].problem
    out.path(f"limits{limits_source(vehicle, given_limits)}: {written(problem.limits)}")
    for one, said in zip(comparisons, notes, strict=True):
        out.line()
        _print_course(out, one, said)
    if summaries:
        _print_summaries(out, summaries, len(comparisons), _has_bound(comparisons))
    if folder is not None:
        out.line()
        out.path(f"wrote to {folder}:")
        out.pairs(_described(files))
    for remark in remarks:
        out.line(f"note: {remark}")
    out.show()


def _described(files: Mapping[str, Path]) -> Iterator[tuple[str, str]]:
    """Names of files and what they are; pictures of courses by their endings."""
    for name, path in files.items():
        if name in _SUMMARIES:
            yield path.name, _SUMMARIES[name]
    kinds = [kind for kind in _PICTURES if any(name.endswith(f"-{kind}") for name in files)]
    for kind in kinds:
        yield f"*-{kind}.png", _PICTURES[kind]


_SUMMARIES = {
    "table": "a line for each course and method",
    "data": "the same and more, as JSON",
    "differences": "percent against proportional, by method and course",
}
_PICTURES = {
    "paths": "of each course: the trajectories",
    "derivatives": "of each course: what is limited, against time",
    "leg-times": "of each course: how the time is shared out",
}


def _print_course(out: Printout, one: "Comparison", notes: Sequence[str]) -> None:
    waypoints = len(one.problem.waypoints)
    out.line(f"{one.name}: {waypoints} waypoints, {waypoints - 1} legs", "title")
    if one.bound is not None and one.bound.duration is not None:
        bound = one.bound
        out.line(
            f"bound: {seconds(one.bound.duration)} s, a feasible motion of {bound.intervals} "
            f"intervals of {1e3 * bound.interval:.1f} ms, in {bound.cpu_time_s:.1f} s; the true "
            "minimum is slightly below, and this one is not certified to be the fastest"
        )
    shown = one.bound is not None and one.bound.success
    columns = ["method", ">time", ">vs prop.", ">vs bound", ">top", ">mean", ">path", ">pieces"]
    out.table(
        "Flights: time in s, top and mean speed in m/s, path in m",
        [name for name in columns if shown or name != ">vs bound"],
        _flights(one, shown),
    )
    out.table(
        "How they were found",
        ("method", "certified", "status", ">iterations", ">CPU (ms)", "limits that bind"),
        _solves(one),
    )
    for note in (*notes, *one.notes):
        out.line(f"note: {note}")


def _flights(one: "Comparison", bound: bool) -> Iterator[Sequence[str]]:
    for row in one.rows:
        cells = [row.method, NONE if row.duration is None else seconds(row.duration)]
        cells.append(percent(row.against_proportional))
        if bound:
            cells.append(percent(row.above_bound))
        cells += [figure(row.top_speed), figure(row.mean_speed), figure(row.path_length)]
        yield [*cells, NONE if row.pieces is None else str(row.pieces)]


def _solves(one: "Comparison") -> Iterator[Sequence[str]]:
    for row in one.rows:
        yield (
            row.method,
            "yes" if row.certified else "no",
            row.status,
            str(row.iterations),
            f"{1e3 * row.cpu_time_s:.3g}",
            ", ".join(ALL_LABELS[name] for name in row.binding) or NONE,
        )


def _print_summaries(
    out: Printout, summaries: Sequence["Summary"], courses: int, bound: bool
) -> None:
    columns = ["method", ">failed", ">fastest", ">time", ">vs prop.", ">vs bound"]
    columns += [">iterations", ">CPU (ms)"]
    rows = []
    for one in summaries:
        cells = [one.method, str(one.failures), str(one.fastest)]
        cells += [NONE if one.duration is None else seconds(one.duration)]
        cells += [percent(one.against_proportional)]
        if bound:
            cells.append(percent(one.above_bound))
        cells.append(NONE if one.iterations is None else f"{one.iterations:g}")
        rows.append([*cells, NONE if one.cpu_time_s is None else f"{1e3 * one.cpu_time_s:.3g}"])
    out.table(
        f"Medians over {courses} courses: time in s",
        [name for name in columns if bound or name != ">vs bound"],
        rows,
    )


def _has_bound(comparisons: Sequence["Comparison"]) -> bool:
    return any(one.bound is not None and one.bound.success for one in comparisons)


def percent(value: float | None) -> str:
    """Print a difference in percent, with its sign."""
    return NONE if value is None else f"{value:+.2f} %"


def figure(value: float | None) -> str:
    """Print a figure with four digits or more."""
    if value is None:
        return NONE
    return f"{value:.3f}" if 1e-2 <= value < 1e4 else f"{value:.4g}"
