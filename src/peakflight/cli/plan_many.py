"""`peakflight plan-many`: every course of a folder, on all processors."""

import csv
import io
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from peakflight.cli.courses import read_tidied
from peakflight.cli.exit_codes import BAD_INPUT
from peakflight.cli.folder import file_name
from peakflight.cli.options import (
    PAPERS,
    FolderPath,
    common_options,
    limits_option,
    limits_source,
    spline_options,
    vehicle_option,
)
from peakflight.cli.output import Printout, print_json
from peakflight.cli.progress import Progress
from peakflight.errors import InvalidFile, PeakflightError
from peakflight.files import prepare_folder, write_atomically
from peakflight.limits import PAPER_LIMITS, Limits
from peakflight.methods import DEFAULT_METHOD, METHODS
from peakflight.problem import Problem
from peakflight.vehicle import Vehicle
from peakflight.version import __version__
from peakflight.wording import seconds, written

if TYPE_CHECKING:
    from peakflight.batch import BatchResult

STORE_FILE, TABLE_FILE = "batch.jsonl", "summary.csv"
PLAN_ENDING = ".plan.json"
COURSE_ENDINGS = (".csv", ".json", ".txt", ".yaml", ".yml")
"""Of files in a folder that are taken for courses."""
COLUMNS = ("course", "file", "status", "feasible", "duration_s", "legs", "plan", "message")
UNREADABLE, FAILED = "bad input", "failed"
"""Of a course that cannot be planned at all, and of one whose planning ended in an error."""


@dataclass(frozen=True, kw_only=True)
class _Row:
    """What became of a course."""

    course: str
    file: str
    status: str
    feasible: bool = False
    duration_s: float | None = None
    legs: int | None = None
    plan: str | None = None
    """Name of the plan file."""
    message: str = ""


@click.command("plan-many", short_help="Plan many courses at once; go on after an interruption.")
@click.argument("courses", metavar="FOLDER|COURSE...", nargs=-1, required=True, type=Path)
@click.option(
    "--method",
    type=click.Choice(tuple(METHODS)),
    default=DEFAULT_METHOD,
    show_default=True,
    help="As of peakflight plan.",
)
@vehicle_option
@limits_option("Limits to keep.", otherwise=PAPERS)
@spline_options
@click.option("--strict", is_flag=True, help="Refuse waypoints that are nearly alike.")
@click.option(
    "--workers", type=int, metavar="N", help="Processes; by default as many as processors."
)
@click.option(
    "--resume", is_flag=True, help="Go on with the batch in DIR; what is done stays as it is."
)
@click.option(
    "-o",
    "--output",
    type=FolderPath(),
    metavar="DIR",
    required=True,
    help=f"Folder for a plan file of each course, {TABLE_FILE}, and {STORE_FILE}, which keeps "
    "what is done if the batch is interrupted.",
)
@common_options
def plan_many(
    courses: tuple[Path, ...],
    method: str,
    vehicle: Vehicle | None,
    limits: Limits | None,
    minimize: str,
    degree: int | None,
    continuity: int | None,
    strict: bool,
    workers: int | None,
    resume: bool,
    output: Path,
    as_json: bool,
) -> int:
    """Plan every course: files, and all course files of folders.

    Ends with 0 if every course has a plan that is proven to keep the limits, 1 if not, 2 if the
    input is wrong; a course that cannot be read does not keep others from being planned.

    \b
    Example:
      peakflight plan-many courses/ --limits speed=5,jerk=62,tilt=50deg -o plans
      peakflight plan-many courses/ --limits speed=5,jerk=62 -o plans --resume
    """  # noqa: D301
    from peakflight.batch import plan_many as run

    paths = list(_course_files(courses))
    names = _distinct([path.stem for path in paths])
    rows: dict[int, _Row] = {}
    with Progress() as progress:
        progress.stage(f"reading {len(paths)} courses")
        _require_apart(output, courses)
        store = prepare_folder(output) / STORE_FILE
        if store.exists() and not resume:
            raise InvalidFile(
                f"{store}: an earlier batch is in this folder; add --resume to go on with it, or "
                "name another folder"
            )
        if not store.exists():
            _require_new(output, names)
        problems: dict[int, Problem] = {}
        for place, path in enumerate(paths):
            try:
                problems[place] = Problem(
                    read_tidied(path, strict=strict)[0].waypoints,
                    vehicle=vehicle,
                    limits=limits if vehicle else limits or PAPER_LIMITS,  # type: ignore[arg-type]
                    minimize=minimize,
                    degree=degree,
                    continuity=continuity,
                )
            except PeakflightError as error:
                why = str(error).removeprefix(f"{path}: ")
                rows[place] = _Row(
                    course=names[place], file=str(path), status=UNREADABLE, message=why
                )
        places = list(problems)
        with closing(
            run(problems.values(), method=method, workers=workers, store=store)
        ) as results:
            progress.stage(f"planning {len(places)} courses by {method}", 0.0)
            for done, result in enumerate(results, start=1):
                place = places[result.index]
                rows[place] = _planned(result, names[place], paths[place], output)
                progress.stage(
                    f"planned {done} of {len(places)} courses by {method}", done / len(places)
                )
    ordered = [rows[place] for place in range(len(paths))]
    write_atomically(output / TABLE_FILE, _as_csv(ordered))
    if as_json:
        shown = [{name: getattr(row, name) for name in COLUMNS} for row in ordered]
        print_json({"method": method, "courses": shown, "version": __version__})
    else:
        _print(ordered, method, vehicle, limits, output)
    unreadable = sum(row.status == UNREADABLE for row in ordered)
    without = sum(not row.feasible for row in ordered) - unreadable
    for count, what in ((unreadable, "that cannot be read"), (without, "without a feasible plan")):
        if count:
            plural = "course" if count == 1 else "courses"
            click.echo(f"peakflight: {count} {plural} {what}, of {len(ordered)}", err=True)
    return BAD_INPUT if unreadable else int(without > 0)


def _course_files(given: Sequence[Path]) -> Iterator[Path]:
    """Files as they are given, and the course files of folders by their names."""
    for path in given:
        if not path.is_dir():
            yield path
            continue
        found = sorted(one for one in path.iterdir() if one.suffix.lower() in COURSE_ENDINGS)
        if not found:
            endings = ", ".join(COURSE_ENDINGS)
            raise InvalidFile(f"{path}: holds no course, which would end in {endings}")
        yield from found


def _require_apart(output: Path, courses: Sequence[Path]) -> None:
    """An error if plans, which end as courses may, would be written among courses."""
    for path in courses:
        if path.is_dir() and path.resolve() == output.resolve():
            raise InvalidFile(f"{output}: the courses are in this folder; name another for plans")


def _require_new(output: Path, names: Sequence[str]) -> None:
    """An error if files would be written over that no batch has made."""
    for file in (TABLE_FILE, *(f"{name}{PLAN_ENDING}" for name in names)):
        if (output / file).exists():
            raise InvalidFile(
                f"{output / file}: is there already, and not of a batch; name another folder"
            )


def _distinct(stems: Sequence[str]) -> list[str]:
    """Names of courses for files: no two alike, even where case does not count."""
    names: list[str] = []
    for stem in stems:
        name, number = first, _ = file_name(stem), 1
        while name.lower() in {other.lower() for other in names}:
            number += 1
            name = f"{first}-{number}"
        names.append(name)
    return names


def _planned(result: "BatchResult", name: str, path: Path, output: Path) -> _Row:
    """Write the plan file; what the summary says of the course."""
    legs = len(result.problem.waypoints) - 1
    if result.plan is None:
        why = "" if result.failure is None else f"{result.failure.kind}: {result.failure.text}"
        return _Row(course=name, file=str(path), status=FAILED, legs=legs, message=why)
    plan = result.plan
    file = f"{name}{PLAN_ENDING}"
    plan.save(output / file)
    return _Row(
        course=name,
        file=str(path),
        status=str(plan.status),
        feasible=plan.feasible,
        duration_s=plan.duration if plan.feasible else None,
        legs=legs,
        plan=file,
        message=plan.message,
    )


def _as_csv(rows: Sequence[_Row]) -> str:
    stream = io.StringIO()
    table = csv.writer(stream, lineterminator="\n")
    table.writerow(COLUMNS)
    for row in rows:
        table.writerow(["" if (value := getattr(row, name)) is None else value for name in COLUMNS])
    return stream.getvalue()


def _print(
    rows: Sequence[_Row],
    method: str,
    vehicle: Vehicle | None,
    given: Limits | None,
    output: Path,
) -> None:
    out = Printout()
    limits = given or PAPER_LIMITS
    if vehicle is not None:
        limits = vehicle.limits if given is None else vehicle.with_limits(given).limits
    out.path(f"limits{limits_source(vehicle, given)}: {written(limits)}")
    cells: list[tuple[str, Any, Any, Any, Any]] = [
        (
            row.course,
            "-" if row.legs is None else str(row.legs),
            "-" if row.duration_s is None else seconds(row.duration_s),
            "yes" if row.feasible else "no",
            row.status,
        )
        for row in rows
    ]
    out.table(
        f"Plans by {method}: time in s", ("course", ">legs", ">time", "certified", "status"), cells
    )
    feasible = sum(row.feasible for row in rows)
    out.line()
    out.line(f"{feasible} of {len(rows)} courses have a certified plan")
    for row in rows:
        if row.message:
            out.line(f"note: {row.course}: {row.message}")
    out.path(f"wrote to {output}:")
    out.pairs(
        [
            (f"*{PLAN_ENDING}", "a plan of each course; peakflight check proves it"),
            (TABLE_FILE, "this table"),
            (STORE_FILE, "every result, from which --resume goes on"),
        ]
    )
    out.show()
