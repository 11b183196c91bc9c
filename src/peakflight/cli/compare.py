"""`peakflight compare`: methods side by side, on one course or several."""

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from peakflight.cli.compare_output import print_comparisons
from peakflight.cli.courses import UNUSED_TIMES, read_tidied
from peakflight.cli.folder import OutputFolder, file_name
from peakflight.cli.options import (
    PAPERS,
    FolderPath,
    common_options,
    limits_option,
    spline_options,
    vehicle_option,
)
from peakflight.cli.output import print_json
from peakflight.cli.progress import Progress
from peakflight.errors import InvalidFile, InvalidProblem, MissingExtra
from peakflight.files import write_atomically
from peakflight.limits import PAPER_LIMITS, Limits
from peakflight.methods import METHODS
from peakflight.problem import Problem
from peakflight.vehicle import Vehicle
from peakflight.version import __version__

if TYPE_CHECKING:
    from peakflight.compare import Comparison, Summary

TABLE_FILE, DATA_FILE = "compare.csv", "compare.json"
DIFFERENCES_FILE = "compare.png"
"""A picture of several courses together."""


def _methods(
    context: click.Context, parameter: click.Parameter, texts: tuple[str, ...]
) -> tuple[str, ...] | None:
    if not texts:
        return None
    from peakflight.compare import check_methods

    try:
        return check_methods([name.strip() for name in ",".join(texts).split(",")])
    except InvalidProblem as error:
        raise click.BadParameter(str(error), context, parameter) from None


@click.command(short_help="Compare methods on one course or several.")
@click.argument("courses", metavar="COURSE...", nargs=-1, required=True, type=Path)
@click.option(
    "--methods",
    multiple=True,
    metavar="NAME,...",
    callback=_methods,
    help=f"Methods to compare, of {', '.join(METHODS)}. Default: all.",
)
@click.option(
    "--bound",
    is_flag=True,
    help="Find about how fast any motion could be, too; takes seconds, and the extra bound.",
)
@vehicle_option
@limits_option("Limits to keep.", otherwise=PAPERS)
@spline_options
@click.option("--strict", is_flag=True, help="Refuse waypoints that are nearly alike.")
@click.option("--no-figures", is_flag=True, help="With -o, draw no pictures.")
@click.option(
    "-o",
    "--output",
    type=FolderPath(),
    metavar="DIR",
    help=f"Folder for {TABLE_FILE}, {DATA_FILE} and the pictures; by default none is written.",
)
@common_options
def compare(
    courses: tuple[Path, ...],
    methods: tuple[str, ...] | None,
    bound: bool,
    vehicle: Vehicle | None,
    limits: Limits | None,
    minimize: str,
    degree: int | None,
    continuity: int | None,
    strict: bool,
    no_figures: bool,
    output: Path | None,
    as_json: bool,
) -> int:
    """Plan every COURSE by several methods and print what each makes of it.

    A method that fails is a line of the table. With several courses, medians follow. Ends with 0 if
    every course has a certified plan by some method, 1 if not, 2 if the input is wrong.

    \b
    Example:
      peakflight compare course.csv --methods proportional,peak --bound
    """  # noqa: D301
    with Progress() as progress:
        progress.stage("reading the courses")
        names, problems, notes = [], [], []
        for path in courses:
            course, said = read_tidied(path, strict=strict)
            names.append(course.name)
            notes.append((*said, UNUSED_TIMES) if course.times is not None else said)
            problems.append(
                _problem(
                    path,
                    course.waypoints,
                    vehicle=vehicle,
                    limits=limits if vehicle else limits or PAPER_LIMITS,
                    minimize=minimize,
                    degree=degree,
                    continuity=continuity,
                )
            )
        names = _distinct(names, courses)
        files: dict[str, Path] = {}
        remarks: tuple[str, ...] = ()
        if output is None:
            comparisons = _compare(names, problems, methods, bound, progress)
            values = _values(comparisons, courses, notes)
        else:
            with OutputFolder(output) as folder:
                comparisons = _compare(names, problems, methods, bound, progress)
                values = _values(comparisons, courses, notes)
                files = _write(comparisons, values, folder)
                if not no_figures:
                    drawn, remarks = _draw(comparisons, folder, progress)
                    files = {**files, **drawn}
    if as_json:
        shown = {name: str(path) for name, path in files.items()}
        print_json({**values, "files": shown, "notes": list(remarks)})
    else:
        print_comparisons(
            comparisons,
            _summaries(comparisons),
            notes=notes,
            vehicle=vehicle,
            given_limits=limits,
            folder=output,
            files=files,
            remarks=remarks,
        )
    without = [one.name for one in comparisons if one.fastest is None]
    if without:
        click.echo(f"peakflight: no feasible trajectory for {', '.join(without)}", err=True)
    return 1 if without else 0


def _problem(path: Path, waypoints: Any, **options: Any) -> Problem:
    try:
        return Problem(waypoints, **options)
    except InvalidProblem as error:
        raise InvalidFile(f"{path}: {error}") from None


def _distinct(names: Sequence[str], paths: Sequence[Path]) -> list[str]:
    """What courses are called: by their paths where several have one name."""
    counts = Counter(names)
    return [
        str(path) if counts[name] > 1 else name for name, path in zip(names, paths, strict=True)
    ]


def _compare(
    names: Sequence[str],
    problems: Sequence[Problem],
    methods: tuple[str, ...] | None,
    bound: bool,
    progress: Progress,
) -> list["Comparison"]:
    from peakflight.bound import require_casadi
    from peakflight.compare import compare as run
    from peakflight.compare import warm_up

    if bound:
        require_casadi()
    progress.stage("loading the methods")
    warm_up(problems[0], methods)
    found = []
    for done, (name, problem) in enumerate(zip(names, problems, strict=True)):
        place = f" ({done + 1} of {len(names)})" if len(names) > 1 else ""
        part = done / len(names) if len(names) > 1 else None

        def stage(text: str, label: str = f"{name}{place}", part: float | None = part) -> None:
            progress.stage(f"{label}: {text}", part)

        found.append(run(problem, methods=methods, bound=bound, name=name, on_stage=stage))
    return found


def _summaries(comparisons: Sequence["Comparison"]) -> tuple["Summary", ...]:
    from peakflight.compare import summarise

    return summarise(comparisons) if len(comparisons) > 1 else ()


def _values(
    comparisons: Sequence["Comparison"],
    paths: Sequence[Path],
    notes: Sequence[Sequence[str]],
) -> dict[str, Any]:
    """Everything, as plain numbers, lists and names."""
    problem = comparisons[0].problem
    courses = []
    for one, path, said in zip(comparisons, paths, notes, strict=True):
        values = one.to_dict()
        courses.append({**values, "file": str(path), "notes": [*said, *values["notes"]]})
    return {
        "limits": problem.limits.to_dict(),
        "vehicle": problem.to_dict()["vehicle"],
        "minimize": problem.minimize,
        "degree": problem.degree,
        "continuity": problem.continuity,
        "methods": [row.method for row in comparisons[0].rows],
        "courses": courses,
        "summary": [summary.to_dict() for summary in _summaries(comparisons)],
        "version": __version__,
    }


def _write(
    comparisons: Sequence["Comparison"], values: dict[str, Any], folder: OutputFolder
) -> dict[str, Path]:
    from peakflight.compare import as_csv

    write_atomically(folder.stage / TABLE_FILE, as_csv(comparisons))
    text = json.dumps(values, allow_nan=False, indent=1, ensure_ascii=False) + "\n"
    write_atomically(folder.stage / DATA_FILE, text)
    return {"table": folder.published(TABLE_FILE), "data": folder.published(DATA_FILE)}


def _stems(comparisons: Sequence["Comparison"]) -> list[str]:
    """What files of each course begin with; no two alike, even where case does not count."""
    stems: list[str] = []
    for one in comparisons:
        stem = name = file_name(one.name)
        taken = {other.lower() for other in stems}
        number = 1
        while stem.lower() in taken:
            number += 1
            stem = f"{name}-{number}"
        stems.append(stem)
    return stems


def _draw(
    comparisons: Sequence["Comparison"], folder: OutputFolder, progress: Progress
) -> tuple[dict[str, Path], tuple[str, ...]]:
    """Draw each course, and several courses together; what keeps pictures from being drawn."""
    try:
        from peakflight.figures import comparison_figures, differences_figure, write_figure
    except MissingExtra as error:
        return {}, (f"no pictures: {error}",)
    files, remarks = {}, []
    for done, (one, stem) in enumerate(zip(comparisons, _stems(comparisons), strict=True)):
        progress.stage(f"drawing {one.name}", done / len(comparisons))
        plans = {row.method: row.plan for row in one.rows if row.certified and row.plan is not None}
        if not plans:
            remarks.append(f"no pictures of {one.name}: no method has a certified plan")
            continue
        for name, figure in comparison_figures(plans, title=one.name).items():
            file = f"{stem}-{name}.png"
            write_figure(figure, folder.stage / file)
            files[f"{stem}-{name}"] = folder.published(file)
    if len(comparisons) > 1:
        methods = [row.method for row in comparisons[0].rows]
        values = {
            method: [one.rows[place].against_proportional for one in comparisons]
            for place, method in enumerate(methods)
        }
        figure = differences_figure(
            [one.name for one in comparisons],
            values,
            title="Total time of each method on each course",
            axis="against proportional",
        )
        write_figure(figure, folder.stage / DIFFERENCES_FILE)
        files["differences"] = folder.published(DIFFERENCES_FILE)
    return files, tuple(remarks)
