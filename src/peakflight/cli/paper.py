"""`peakflight paper`: the paper's figures and tables, run again."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from peakflight.cli.courses import UNUSED_TIMES, read_tidied
from peakflight.cli.folder import OutputFolder
from peakflight.cli.options import FolderPath, common_options, vehicle_of
from peakflight.cli.output import Printout, print_json
from peakflight.cli.progress import Progress
from peakflight.errors import InvalidFile, InvalidProblem
from peakflight.vehicle import Vehicle

if TYPE_CHECKING:
    from peakflight.paper import Reproduction
    from peakflight.paper_flights import Experiment

FOLDER = Path("out/paper")


@click.command(short_help="Run the paper's results again, as a page.")
@click.argument("course", required=False, type=click.Path(path_type=Path))
@click.option("--strict", is_flag=True, help="Refuse waypoints that are nearly alike.")
@click.option(
    "--fly",
    "flying",
    is_flag=True,
    help="Fly the six plans in simulation too, as the paper did in its experiment.",
)
@click.option(
    "--vehicle",
    metavar="NAME|FILE.yaml",
    callback=vehicle_of,
    help="With --fly, what flies: by default crazyflie-2.1-upgrade, whose thrust is enough for the "
    "paper's limits. See peakflight vehicles.",
)
@click.option(
    "-o",
    "--output",
    type=FolderPath(),
    metavar="DIR",
    default=FOLDER,
    help=f"Folder for the page, its pictures and its tables; by default {FOLDER.as_posix()}.",
)
@common_options
def paper(
    course: Path | None,
    strict: bool,
    flying: bool,
    vehicle: Vehicle | None,
    output: Path,
    as_json: bool,
) -> int:
    """Make every figure and table of the paper that planning can give, beside the paper's own.

    With --fly those of its experiment too, from flights in simulation.

    The paper does not print its waypoints: COURSE takes their place, by default a course of ours of
    the kind that it describes. Ends with 0 if minimum jerk and minimum snap have a certified plan
    by some method each, and with --fly a flight that does not crash; 1 if not; 2 if the input is
    wrong.

    \b
    Example:
      peakflight paper -o out/paper
      peakflight paper --fly -o out/paper
    """  # noqa: D301
    if vehicle is not None and not flying:
        raise click.UsageError("--vehicle is of --fly")
    with Progress() as progress:
        progress.stage("reading the course")
        chosen, notes = (None, ()) if course is None else read_tidied(course, strict=strict)
        if chosen is not None and chosen.times is not None:
            notes = (*notes, UNUSED_TIMES)
        from peakflight.paper import DEFAULT_COURSE, reproduce
        from peakflight.paper_page import as_dict, write_paper

        experiment = None
        with OutputFolder(output) as folder:
            try:
                result = reproduce(chosen or DEFAULT_COURSE, on_stage=progress.stage)
            except InvalidProblem as error:
                raise InvalidFile(f"{course}: {error}") from None
            if flying:
                experiment = _fly(result, vehicle, progress)
            names, more = write_paper(
                result, folder.stage, experiment=experiment, on_stage=progress.stage
            )
    files = [folder.published(name) for name in names]
    notes = (*notes, *more)
    if as_json:
        values = as_dict(result, experiment)
        print_json({**values, "files": [str(path) for path in files], "notes": [*notes]})
    else:
        _print(result, experiment, files, notes, output)
    without = [
        one.printed.title.lower()
        for one in result.comparisons
        if not any(row.certified for row in one.rows.values())
    ]
    if without:
        click.echo(f"peakflight: no feasible trajectory for {', '.join(without)}", err=True)
    crashed = (
        []
        if experiment is None
        else [
            title
            for one in experiment.comparisons
            if not one.any_flew and (title := one.comparison.printed.title.lower()) not in without
        ]
    )
    if crashed:
        click.echo(f"peakflight: no flight to the end of {', '.join(crashed)}", err=True)
    return 1 if without or crashed else 0


def _fly(result: "Reproduction", vehicle: Vehicle | None, progress: Progress) -> "Experiment":
    from peakflight.paper_flights import DEFAULT_VEHICLE, fly_paper

    return fly_paper(result, vehicle or DEFAULT_VEHICLE, on_stage=progress.stage)


def _print(
    result: "Reproduction",
    experiment: "Experiment | None",
    files: list[Path],
    notes: tuple[str, ...],
    folder: Path,
) -> None:
    from peakflight.paper_page import beside_table

    out = Printout()
    count = len(result.course)
    out.line(f"{result.course.name}: {count} waypoints, {count - 1} legs", "title")
    for note in notes:
        out.line(f"note: {note}")
    for one in result.comparisons:
        table = beside_table(one)
        out.table(table.title, table.columns, table.rows)
        for name, row in one.rows.items():
            if not row.certified:
                out.line(
                    f"note: {name}: {row.status}" + (f": {row.message}" if row.message else "")
                )
    if experiment is not None:
        _print_flights(experiment, out)
    out.line()
    pictures = sum(path.suffix == ".png" for path in files)
    out.path(f"wrote {len(files)} files, {pictures} of them pictures as PNG, to {folder}:")
    out.pairs((path.name, _SUMMARIES[path.name]) for path in files if path.name in _SUMMARIES)
    out.show()


def _print_flights(experiment: "Experiment", out: Printout) -> None:
    from peakflight.paper_flight_page import crash_notes, errors_table, times_table

    for table in (times_table(experiment), errors_table(experiment)):
        out.table(f"{table.title}: {experiment.vehicle.name}", table.columns, table.rows)
    for note in crash_notes(experiment):
        out.line(f"note: {note}")


_SUMMARIES = {
    "paper.html": "the page, complete by itself",
    "paper.md": "the same for an editor or a repository",
    "beside-paper.csv": "every figure that the paper prints, beside ours",
    "methods.csv": "what each method made of each comparison",
    "leg-times.csv": "the time of each leg by each method",
    "flights.csv": "each flight beside the paper's",
    "flown-positions.csv": "every sample of each flight, at 100 Hz",
    "paper.json": "all of it, with the waypoints",
}
