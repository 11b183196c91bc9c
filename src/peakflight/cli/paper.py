"""`peakflight paper`: the paper's figures and tables of planning, run again."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from peakflight.cli.courses import UNUSED_TIMES, read_tidied
from peakflight.cli.folder import OutputFolder
from peakflight.cli.options import FolderPath, common_options
from peakflight.cli.output import Printout, print_json
from peakflight.cli.progress import Progress
from peakflight.errors import InvalidFile, InvalidProblem

if TYPE_CHECKING:
    from peakflight.paper import Reproduction

FOLDER = Path("out/paper")


@click.command(short_help="Run the paper's planning results again, as a page.")
@click.argument("course", required=False, type=click.Path(path_type=Path))
@click.option("--strict", is_flag=True, help="Refuse waypoints that are nearly alike.")
@click.option(
    "-o",
    "--output",
    type=FolderPath(),
    metavar="DIR",
    default=FOLDER,
    help=f"Folder for the page, its pictures and its tables; by default {FOLDER.as_posix()}.",
)
@common_options
def paper(course: Path | None, strict: bool, output: Path, as_json: bool) -> int:
    """Make every figure and table of the paper that planning can give, beside the paper's own.

    The paper does not print its waypoints: COURSE takes their place, by default a course of ours of
    the kind that it describes. Ends with 0 if minimum jerk and minimum snap have a certified plan
    by some method each, 1 if not, 2 if the input is wrong.

    \b
    Example:
      peakflight paper -o out/paper
    """  # noqa: D301
    with Progress() as progress:
        progress.stage("reading the course")
        chosen, notes = (None, ()) if course is None else read_tidied(course, strict=strict)
        if chosen is not None and chosen.times is not None:
            notes = (*notes, UNUSED_TIMES)
        from peakflight.paper import DEFAULT_COURSE, reproduce
        from peakflight.paper_page import write_paper

        with OutputFolder(output) as folder:
            try:
                result = reproduce(chosen or DEFAULT_COURSE, on_stage=progress.stage)
            except InvalidProblem as error:
                raise InvalidFile(f"{course}: {error}") from None
            names, more = write_paper(result, folder.stage, on_stage=progress.stage)
    files = [folder.published(name) for name in names]
    notes = (*notes, *more)
    if as_json:
        print_json({**result.to_dict(), "files": [str(path) for path in files], "notes": [*notes]})
    else:
        _print(result, files, notes, output)
    without = [
        one.printed.title.lower()
        for one in result.comparisons
        if not any(row.certified for row in one.rows.values())
    ]
    if without:
        click.echo(f"peakflight: no feasible trajectory for {', '.join(without)}", err=True)
    return 1 if without else 0


def _print(result: "Reproduction", files: list[Path], notes: tuple[str, ...], folder: Path) -> None:
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
    out.line()
    pictures = sum(path.suffix == ".png" for path in files)
    out.path(f"wrote {len(files)} files, {pictures} of them pictures as PNG, to {folder}:")
    out.pairs((path.name, _SUMMARIES[path.name]) for path in files if path.name in _SUMMARIES)
    out.show()


_SUMMARIES = {
    "paper.html": "the page, complete by itself",
    "paper.md": "the same for an editor or a repository",
    "beside-paper.csv": "every figure that the paper prints, beside ours",
    "methods.csv": "what each method made of each comparison",
    "leg-times.csv": "the time of each leg by each method",
    "paper.json": "all of it, with the waypoints",
}
