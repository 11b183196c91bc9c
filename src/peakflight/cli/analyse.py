"""`peakflight analyse`: a record of a flight, laid beside its plan."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from peakflight.cli.folder import OutputFolder
from peakflight.cli.options import FolderPath, common_options
from peakflight.cli.output import Printout, print_json
from peakflight.cli.progress import Progress
from peakflight.errors import InvalidFile, InvalidProblem, MissingExtra
from peakflight.files import write_atomically
from peakflight.formats.flight_log import read_flight_log
from peakflight.limits import KINDS
from peakflight.result import Plan
from peakflight.wording import amount, seconds

if TYPE_CHECKING:
    from peakflight.flight.motion_capture import FlightAnalysis

DATA_FILE, SAMPLES_FILE = "analysis.json", "errors.csv"
SUMMARIES = {
    DATA_FILE: "the figures of the tables",
    SAMPLES_FILE: "time, flown and planned position, and error of each sample",
    "path.png": "both paths",
    "derivatives.png": "what is limited, against time",
    "error.png": "the distance from the plan, against time",
}
NONE = "-"
"""What stands where there is no figure."""
CENTIMETRES = 100.0
"""In a metre."""


@click.command(short_help="Lay a record of a flight beside its plan.")
@click.argument("log", metavar="LOG.csv", type=click.Path(path_type=Path))
@click.option(
    "--plan",
    "plan_file",
    metavar="PLAN",
    type=click.Path(path_type=Path),
    required=True,
    help="The plan.json that was flown.",
)
@click.option(
    "--start",
    type=float,
    metavar="S",
    help="Time of the record at which the plan began, s; by default where it fits best, which "
    "hides a delay of the vehicle.",
)
@click.option(
    "--rate",
    type=float,
    metavar="HZ",
    help="Samples a second that derivatives are taken of; by default the record's, at most 100.",
)
@click.option("--no-figures", is_flag=True, help="With -o, draw no pictures.")
@click.option(
    "-o",
    "--output",
    type=FolderPath(),
    metavar="DIR",
    help=f"Folder for {DATA_FILE}, {SAMPLES_FILE} and the pictures; by default none is written.",
)
@common_options
def analyse(
    log: Path,
    plan_file: Path,
    start: float | None,
    rate: float | None,
    no_figures: bool,
    output: Path | None,
    as_json: bool,
) -> int:
    """Say how far off its plan a vehicle flew, and what limits it met, from its positions alone.

    LOG.csv has columns t,x,y,z in s and m, or a header that names them and their units, as in
    t [ms],x [mm],y [mm],z [mm]. Derivatives are taken by differences and means of five, as in the
    paper. Ends with 0, or with 2 if the input is wrong.

    \b
    Example:
      peakflight analyse vicon.csv --plan race/plan.json -o flown
    """  # noqa: D301
    from peakflight.flight.motion_capture import analyse as lay_beside

    with Progress() as progress:
        progress.stage("reading the record")
        plan = Plan.load(plan_file)
        record = read_flight_log(log)
        progress.stage("laying it beside the plan")
        try:
            analysis = lay_beside(record.times, record.positions, plan, start=start, rate=rate)
        except InvalidProblem as error:
            raise InvalidFile(f"{log}: {error}") from None
        notes = [*record.notes, *analysis.notes]
        files: list[Path] = []
        if output is not None:
            with OutputFolder(output) as folder:
                _write(analysis, notes, folder)
                files = [folder.published(name) for name in (DATA_FILE, SAMPLES_FILE)]
                if not no_figures:
                    progress.stage("drawing the pictures")
                    try:
                        files += _draw(analysis, plan, log.stem, folder)
                    except MissingExtra as error:
                        notes.append(f"no pictures: {error}")
    if as_json:
        shown = [str(path) for path in files]
        print_json({**analysis.to_dict(), "notes": notes, "files": shown})
    else:
        _print(analysis, plan, log, notes, output, files)
    return 0


def _write(analysis: "FlightAnalysis", notes: Sequence[str], folder: OutputFolder) -> None:
    values = {**analysis.to_dict(), "notes": list(notes)}
    write_atomically(folder.stage / DATA_FILE, json.dumps(values, allow_nan=False, indent=1) + "\n")
    lines = ["t [s],x [m],y [m],z [m],planned_x [m],planned_y [m],planned_z [m],error [m]"]
    for time, flown, planned, error in zip(
        analysis.times, analysis.positions, analysis.planned, analysis.errors, strict=True
    ):
        lines.append(",".join(f"{value:.9g}" for value in (time, *flown, *planned, error)))
    write_atomically(folder.stage / SAMPLES_FILE, "\n".join(lines) + "\n")


def _draw(
    analysis: "FlightAnalysis", plan: Plan, title: str, folder: OutputFolder
) -> Iterator[Path]:
    from peakflight.figures import motion_capture_figures, write_figure

    for name, figure in motion_capture_figures(analysis, plan, title=title).items():
        write_figure(figure, folder.stage / f"{name}.png")
        yield folder.published(f"{name}.png")


def _print(
    analysis: "FlightAnalysis",
    plan: Plan,
    log: Path,
    notes: Sequence[str],
    output: Path | None,
    files: Sequence[Path],
) -> None:
    out = Printout()
    out.path(
        f"{log}: {len(analysis.times)} positions within the plan of {seconds(plan.duration)} s by "
        f"{plan.method}"
    )
    how = "as given" if analysis.start_given else "where the record fits best"
    out.pairs(
        [
            ("start", f"{analysis.start:.4f} s of the record, {how}"),
            ("RMS error", f"{CENTIMETRES * analysis.rms_error:.2f} cm"),
            (
                "top error",
                f"{CENTIMETRES * analysis.top_error:.2f} cm, at {analysis.top_error_time:.3f} s",
            ),
        ]
    )
    out.table(
        f"Peaks, at {analysis.rate:.4g} Hz by means of five",
        ("limit", ">allowed", ">planned", ">as filtered", ">flown", ">at (s)", ">ratio"),
        _rows(analysis),
    )
    if output is not None:
        out.line()
        out.path(f"wrote to {output}:")
        out.pairs((path.name, SUMMARIES[path.name]) for path in files)
    for note in notes:
        out.line(f"note: {note}")
    out.show()


def _rows(analysis: "FlightAnalysis") -> Iterator[Sequence[str]]:
    for kind in KINDS:
        if kind.name not in analysis.peaks:
            continue
        peak = analysis.peaks[kind.name]
        cells = [
            NONE if value is None else amount(kind, float(f"{value:.4g}"))
            for value in (peak.limit, peak.planned, peak.filtered, peak.flown)
        ]
        cells.append(NONE if peak.time is None else f"{peak.time:.3f}")
        yield [kind.label, *cells, NONE if peak.ratio is None else f"{peak.ratio:.3f}"]
