"""`peakflight plan`: from a course file to a certified plan, flight files and pictures."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from peakflight.cli.courses import UNUSED_TIMES, read_tidied
from peakflight.cli.export import FormatName
from peakflight.cli.folder import OutputFolder, folder_for
from peakflight.cli.options import (
    PAPERS,
    FolderPath,
    common_options,
    limits_option,
    spline_options,
    vehicle_option,
)
from peakflight.cli.output import print_json
from peakflight.cli.plan_output import print_plan
from peakflight.cli.progress import Progress
from peakflight.cli.yaw_options import heading_of, yaw_options
from peakflight.errors import InvalidProblem, MissingExtra
from peakflight.formats import FLIGHT_FORMATS
from peakflight.formats.flight_files import USUAL
from peakflight.limits import PAPER_LIMITS, Limits
from peakflight.methods import DEFAULT_METHOD, METHODS
from peakflight.problem import Problem
from peakflight.result import Plan
from peakflight.vehicle import Vehicle

PLAN_FILE = "plan.json"
PICTURES = {
    "course": "the path, coloured by speed",
    "derivatives": "what is limited, against time",
    "segment_times": "times of the legs, by iteration",
    "yaw": "yaw, its rate and its acceleration, against time",
    "rotors": "rotor thrusts and body rates, against time",
}
"""Name without .png, and what it shows."""
VARIANTS = ("descent", "paper")
METHOD_OPTIONS = {
    "bry": ("time_penalty",),
    "peak": ("variant",),
    "joint": ("pieces", "max_pieces", "effort", "time_limit"),
}
"""Fields of the settings of methods that are options here."""


class Pieces(click.ParamType):  # type: ignore[type-arg]
    """A whole number from 1, or auto."""

    name = "N|auto"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | str:
        """The number, or the word."""
        if value == "auto":
            return "auto"
        try:
            return int(value)
        except ValueError:
            self.fail(f"{value!r} is neither a whole number nor auto", param, ctx)


@click.command(short_help="Plan a course; write plan, flight files and pictures.")
@click.argument("course", type=click.Path(path_type=Path))
@click.option(
    "--method",
    type=click.Choice(tuple(METHODS)),
    help="; ".join(f"{name}: {summary}" for name, summary in METHODS.items())
    + f". Default: {DEFAULT_METHOD}, or the method that a given option is of.",
)
@click.option(
    "--time-penalty",
    type=float,
    help="Of method bry: weight of the total time beside the effort; by default as much as the "
    "limits allow.",
)
@click.option(
    "--variant",
    type=click.Choice(VARIANTS),
    help="Of method peak: descent, the default, or the paper's Algorithm 1.",
)
@click.option(
    "--pieces",
    type=Pieces(),
    help="Of method joint: polynomials in each leg, or auto, the default: where it pays.",
)
@click.option("--max-pieces", type=int, help="Of method joint: most polynomials in all.")
@click.option(
    "--effort",
    type=float,
    help="Of method joint: weight of the integral of the squared derivative that --minimize names, "
    "from 0, the fastest, towards the smoothest.",
)
@click.option(
    "--time-limit", type=float, help="Of method joint: s, after which the best so far counts."
)
@vehicle_option
@limits_option("Limits to keep.", otherwise=PAPERS)
@yaw_options
@spline_options
@click.option("--strict", is_flag=True, help="Refuse waypoints that are nearly alike.")
@click.option(
    "--export",
    "exports",
    multiple=True,
    metavar="FORMAT",
    type=FormatName(),
    help=f"Flight file to write; may be repeated. By default {' and '.join(USUAL)}; peakflight "
    "export --list shows all.",
)
@click.option("--no-figures", is_flag=True, help="Draw no pictures, which saves half a second.")
@click.option(
    "-o",
    "--output",
    type=FolderPath(),
    metavar="DIR",
    help="Folder for the files; by default COURSE-plan, after the name of the course.",
)
@common_options
def plan(
    course: Path,
    method: str | None,
    time_penalty: float | None,
    variant: str | None,
    pieces: int | str | None,
    max_pieces: int | None,
    effort: float | None,
    time_limit: float | None,
    vehicle: Vehicle | None,
    limits: Limits | None,
    yaw: dict[str, Any] | None,
    yaw_limits: dict[str, float | None] | None,
    minimize: str,
    degree: int | None,
    continuity: int | None,
    strict: bool,
    exports: tuple[str, ...],
    no_figures: bool,
    output: Path | None,
    as_json: bool,
) -> int:
    """Plan the fastest trajectory through COURSE, a CSV, YAML or JSON file of waypoints.

    Writes plan.json, the flight files and the pictures into a folder. Ends with 0 if the plan is
    proven to keep every limit, 1 if there is no such plan, 2 if the input is wrong.

    \b
    Example:
      peakflight plan course.csv --limits speed=5,jerk=62,tilt=50deg -o race
      peakflight plan course.csv --vehicle crazyflie-2.1-upgrade --limits speed=3
    """  # noqa: D301
    tuning = {
        "time_penalty": time_penalty,
        "variant": variant,
        "pieces": pieces,
        "max_pieces": max_pieces,
        "effort": effort,
        "time_limit": time_limit,
    }
    tuning = {name: value for name, value in tuning.items() if value is not None}
    method = _method(method, tuning)
    for name in exports:
        if FLIGHT_FORMATS[name].needs_vehicle and vehicle is None:
            raise click.UsageError(f"--export {name} needs --vehicle")
    with Progress() as progress:
        progress.stage("reading the course")
        read, notes = read_tidied(course, strict=strict)
        problem = Problem(
            read.waypoints,
            vehicle=vehicle,
            limits=limits if vehicle else limits or PAPER_LIMITS,  # type: ignore[arg-type]
            minimize=minimize,
            degree=degree,
            continuity=continuity,
            yaw=heading_of(yaw, yaw_limits, read.yaw),
        )
        with OutputFolder(output or folder_for(read.name)) as folder:
            progress.stage(f"planning {len(read)} waypoints by {method}")
            answer = _solve(problem, method, tuning)
            remarks = (answer.message,) if answer.message and answer.feasible else ()
            if notes:
                said = (*notes, answer.message) if answer.message else notes
                answer = replace(answer, message="; ".join(said))
            progress.stage("writing the files")
            files, more = write_plan_files(answer, folder, exports)
            more = (*remarks, *more)
            if not no_figures:
                progress.stage("drawing the pictures")
                drawn, why_not = draw_plan(answer, folder)
                files, more = {**files, **drawn}, (*more, *why_not)
        if read.times is not None:
            notes = (*notes, UNUSED_TIMES)
        stale = _stale(folder, files)
        if stale:
            more = (*more, f"from an earlier run in this folder: {', '.join(stale)}")
    if as_json:
        shown = {key: value for key, value in answer.to_dict().items() if key != "history"}
        written = {name: str(path) for name, path in files.items()}
        print_json({"course": read.name, **shown, "files": written, "notes": [*notes, *more]})
    else:
        print_plan(
            answer,
            course=read.name,
            variant=variant,
            given_limits=limits,
            before=notes,
            after=more,
            folder=folder.path,
            files=files,
            summaries=file_summaries(),
        )
    if not answer.feasible:
        click.echo(f"peakflight: no feasible trajectory ({answer.status})", err=True)
    return 0 if answer.feasible else 1


def _method(method: str | None, tuning: dict[str, Any]) -> str:
    """The method to plan with; options of other methods are refused."""
    owners = {option: owner for owner, options in METHOD_OPTIONS.items() for option in options}
    for name in tuning:
        method = method or owners[name]
        if method != owners[name]:
            option = f"--{name.replace('_', '-')}"
            raise click.UsageError(
                f"{option} is of method {owners[name]}; method {method} has none"
            )
    return method or DEFAULT_METHOD


def _solve(problem: Problem, method: str, tuning: dict[str, Any]) -> Plan:
    from peakflight.planner import plan as solve

    return solve(problem, method=method, **tuning)


def write_plan_files(
    plan: Plan, folder: OutputFolder, exports: tuple[str, ...]
) -> tuple[dict[str, Path], tuple[str, ...]]:
    """Write the plan and, if it may be flown, its flight files; notes for whoever flies them."""
    plan.save(folder.stage / PLAN_FILE)
    files = {"plan": folder.published(PLAN_FILE)}
    if not plan.feasible:
        return files, ("no flight files: the plan is not proven to keep the limits",)
    from peakflight.exporting import export

    notes: list[str] = []
    for name in dict.fromkeys(exports or USUAL):
        filename = FLIGHT_FORMATS[name].filename
        try:
            report = export(plan, to=name, path=folder.stage / filename)
        except (InvalidProblem, MissingExtra) as error:
            notes.append(f"no {filename}: {error}")
            continue
        notes += [f"{filename}: {said}" for said in (*report.problems, *report.notes)]
        files[name] = folder.published(filename)
    return files, tuple(notes)


def draw_plan(plan: Plan, folder: OutputFolder) -> tuple[dict[str, Path], tuple[str, ...]]:
    """Draw the pictures of a plan; or a note why there are none."""
    try:
        from peakflight.figures import save_figures
    except MissingExtra as error:
        return {}, (f"no pictures: {error}",)
    drawn = save_figures(plan, folder.stage)
    return {path.stem: folder.published(path.name) for path in drawn}, ()


def _stale(folder: OutputFolder, files: dict[str, Path]) -> list[str]:
    """Files of an earlier plan that this one has not replaced."""
    flight_files = [one.filename for one in FLIGHT_FORMATS.values() if one.filename != PLAN_FILE]
    names = [*flight_files, *(f"{name}.png" for name in PICTURES)]
    written = {path.name for path in files.values()}
    return [name for name in names if name not in written and folder.published(name).exists()]


def file_summaries() -> dict[str, str]:
    """What each file is, by the names of files."""
    flight_files = {name: one.summary for name, one in FLIGHT_FORMATS.items()}
    return {"plan": "the plan itself; peakflight check proves it", **flight_files, **PICTURES}
