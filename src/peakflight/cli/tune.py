"""`peakflight tune`: finds the fastest plan that a vehicle still tracks, by flying it."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from peakflight.cli.courses import UNUSED_TIMES, read_tidied
from peakflight.cli.fly import check_error
from peakflight.cli.folder import OutputFolder
from peakflight.cli.options import FolderPath, common_options, limits_option, vehicle_of
from peakflight.cli.output import Printout, print_json
from peakflight.cli.plan import draw_plan, file_summaries, write_plan_files
from peakflight.cli.progress import Progress
from peakflight.cli.yaw_options import heading_of, yaw_options
from peakflight.errors import InvalidFile, InvalidProblem, MissingExtra
from peakflight.files import write_json
from peakflight.limits import Limits
from peakflight.vehicle import Vehicle
from peakflight.wording import seconds, written

if TYPE_CHECKING:
    from peakflight.tuning import Point, TuneResult

DATA_FILE, PICTURE = "tune.json", "tune.png"
MOST_POINTS = 12
"""Of the curve, in the table."""


@click.command(short_help="Find the fastest plan that a vehicle still tracks, by flying it.")
@click.argument("course", type=click.Path(path_type=Path))
@click.option(
    "--vehicle",
    metavar="NAME|FILE.yaml",
    required=True,
    callback=vehicle_of,
    help="What flies; see peakflight vehicles.",
)
@click.option(
    "--error",
    type=float,
    metavar="METRES",
    default=0.15,
    show_default=True,
    callback=check_error,
    help="Largest RMS error.",
)
@click.option(
    "--robust",
    type=int,
    metavar="N",
    default=0,
    help="Have N vehicles that differ track it, too: the worst of them counts.",
)
@limits_option("What no plan may exceed, whatever flies.", otherwise="nothing but the search's")
@yaw_options
@click.option(
    "--budget",
    type=float,
    metavar="SECONDS",
    default=60.0,
    show_default=True,
    help="Time after which the best so far counts.",
)
@click.option(
    "--workers", type=int, metavar="N", help="Processes; by default as many as processors."
)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the search.")
@click.option("--strict", is_flag=True, help="Refuse waypoints that are nearly alike.")
@click.option("--no-figures", is_flag=True, help="With -o, draw no pictures.")
@click.option(
    "-o",
    "--output",
    type=FolderPath(),
    metavar="DIR",
    help=f"Folder for the plan with its files, and {DATA_FILE}; without it nothing is written.",
)
@common_options
def tune(
    course: Path,
    vehicle: Vehicle,
    error: float,
    robust: int,
    limits: Limits | None,
    yaw: dict[str, Any] | None,
    yaw_limits: dict[str, float | None] | None,
    budget: float,
    workers: int | None,
    seed: int,
    strict: bool,
    no_figures: bool,
    output: Path | None,
    as_json: bool,
) -> int:
    """Find the fastest plan through COURSE that a vehicle tracks within an RMS error.

    Limits, effort and method are searched for; every plan is flown in simulation under the
    controller of the Crazyflie's firmware. Ends with 0 if a plan is tracked, 1 if none is, 2 if the
    input is wrong.

    \b
    Example:
      peakflight tune course.csv --vehicle crazyflie-2.1-upgrade -o tuned
      peakflight fly tuned/plan.json --controller firmware --spread 200
    """  # noqa: D301
    if not (math.isfinite(budget) and budget > 0.0):
        raise click.UsageError(f"--budget is {budget:g}; it must be positive and finite")
    with Progress() as progress:
        progress.stage("reading the course")
        read, notes = read_tidied(course, strict=strict)
        if read.times is not None:
            notes = (*notes, UNUSED_TIMES)
        from peakflight.tuning import TuneSettings
        from peakflight.tuning import tune as search

        def show(plans: int, part: float, best: float | None) -> None:
            found = "" if best is None else f", fastest {best:.3f} s"
            progress.stage(f"flying plan {plans}{found}", part)

        def run() -> "TuneResult":
            try:
                return search(
                    read.waypoints,
                    vehicle=vehicle,
                    yaw=heading_of(yaw, yaw_limits, read.yaw),
                    error=error,
                    robust=robust,
                    limits=limits,
                    settings=TuneSettings(seed=seed),
                    budget=budget,
                    workers=workers,
                    on_trials=show,
                )
            except InvalidProblem as problem:
                raise InvalidFile(f"{course}: {problem}") from None

        progress.stage("starting the search")
        files: dict[str, Path] = {}
        if output is None:
            result = run()
        else:
            with OutputFolder(output) as folder:
                result = run()
                progress.stage("writing the files")
                files, more = _write(result, folder, figures=not no_figures)
                notes = (*notes, *more)
    if as_json:
        shown = {name: str(path) for name, path in files.items()}
        print_json({"course": read.name, **result.to_dict(), "files": shown, "notes": [*notes]})
    else:
        _print(result, read.name, notes, files)
    if result.plan is None:
        click.echo(f"peakflight: {course}: no plan is tracked within {error:g} m", err=True)
    return 1 if result.plan is None else 0


def _write(
    result: "TuneResult", folder: OutputFolder, *, figures: bool
) -> tuple[dict[str, Path], tuple[str, ...]]:
    """Write the plan with its flight files, what was found, and the pictures."""
    write_json(folder.stage / DATA_FILE, result.to_dict())
    files: dict[str, Path] = {}
    notes: tuple[str, ...] = ()
    if result.plan is not None:
        files, notes = write_plan_files(result.plan, folder, ())
    files["tune"] = folder.published(DATA_FILE)
    if not figures:
        return files, notes
    if result.plan is not None:
        drawn, more = draw_plan(result.plan, folder)
        files, notes = {**files, **drawn}, (*notes, *more)
    try:
        from peakflight.figures import write_figure
        from peakflight.figures.tuning import front_figure
    except MissingExtra:  # which the pictures of the plan have said
        return files, notes
    chosen = None
    if result.plan is not None and result.worst_error is not None:
        chosen = (result.worst_error, result.plan.duration)
    figure = front_figure(
        [(point.rms_error, point.duration) for point in result.front],
        result.error,
        chosen,
        title=f"{result.vehicle.name}: {_found(result)}",
        note=f"{result.plans} plans flown",
    )
    write_figure(figure, folder.stage / PICTURE)
    return {**files, "tuning": folder.published(PICTURE)}, notes


def _print(
    result: "TuneResult", course: str, notes: tuple[str, ...], files: dict[str, Path]
) -> None:
    out = Printout()
    plan = result.plan
    out.line(f"{course}, {result.vehicle.name}: {_found(result)}", "title")
    for note in notes:
        out.line(f"note: {note}")
    if plan is not None and not result.stood_doubts:
        out.line("note: no plan has stood vehicles that differ a little; this one stood the search")
    ended = "" if result.complete else ", until the budget was spent"
    out.line(f"{result.plans} plans flown in {result.seconds:.1f} s{ended}")
    if plan is not None and result.limits is not None:
        chosen = ", ".join(f"{name}={value}" for name, value in result.options.items())
        out.line()
        out.pairs(
            [
                ("RMS error", f"{result.rms_error:.4f} m; {result.worst_error:.4f} m at worst"),
                ("made with", chosen),
            ]
        )
        out.path(f"  limits     {written(result.limits)}")
    out.table(
        "Time against error",
        (">time s", ">RMS m", "by"),
        [
            (seconds(point.duration), f"{point.rms_error:.4f}", point.family)
            for point in _some(result.front)
        ],
    )
    if files:
        summaries = {
            **file_summaries(),
            "tune": "what was found, with the whole curve",
            "tuning": "time against error",
        }
        out.line()
        for name, path in files.items():
            out.path(f"  {path}  {summaries.get(name, '')}")
    out.show()


def _found(result: "TuneResult") -> str:
    within = f"within {result.error:g} m"
    if result.plan is None:
        return f"nothing is tracked {within}"
    return f"{seconds(result.plan.duration)} s {within}"


def _some(points: "Sequence[Point]") -> "list[Point]":
    """The ends of the curve, and points between them evenly by rank."""
    if len(points) <= MOST_POINTS:
        return list(points)
    last = len(points) - 1
    return [points[round(i * last / (MOST_POINTS - 1))] for i in range(MOST_POINTS)]
