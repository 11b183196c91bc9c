"""`peakflight export`: the file that a vehicle flies, certified as its consumer reads it."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click

from peakflight.cli.inputs import keep_inputs
from peakflight.cli.options import common_options
from peakflight.cli.output import Printout, print_json
from peakflight.cli.progress import Progress
from peakflight.errors import InvalidFile, quoted
from peakflight.formats import FLIGHT_FORMATS
from peakflight.formats.flight_files import OTHER_NAMES, find_format
from peakflight.numerals import as_number
from peakflight.result import Plan
from peakflight.wording import ratio_cells, seconds
from peakflight.yaw import ALL_LABELS


class FormatName(click.Choice):  # type: ignore[type-arg]
    """The name of a format, also by what it is called too."""

    def __init__(self) -> None:
        super().__init__(tuple(FLIGHT_FORMATS))

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Its own name."""
        return str(super().convert(OTHER_NAMES.get(value, value), param, ctx))


class Lift(click.ParamType):  # type: ignore[type-arg]
    """A number of metres, or auto."""

    name = "lift"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float | str:
        """The number, or the word."""
        if not isinstance(value, str) or value == "auto":
            return value
        try:
            return as_number(value)
        except ValueError:
            self.fail(f"{quoted(value)} is neither auto nor a number of m", param, ctx)


@click.command(short_help="Write the file that a vehicle flies, certified as it is read.")
@click.argument(
    "plans", metavar="PLAN...", nargs=-1, type=click.Path(path_type=Path), required=False
)
@click.option(
    "--to",
    "name",
    metavar="FORMAT",
    type=FormatName(),
    help=f"One of {', '.join(FLIGHT_FORMATS)}; see --list.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="By default beside the first plan, under the format's own name.",
)
@click.option(
    "--no-refit",
    is_flag=True,
    help="Neither plan again with fewer pieces nor fly slower, whatever the format does to it.",
)
@click.option(
    "--lift",
    type=Lift(),
    metavar="METRES|auto",
    help="Move the plan up first; auto puts its lowest point 0.5 m above where the vehicle starts.",
)
@click.option("--list", "show_list", is_flag=True, help="List the formats.")
@common_options
def export(
    plans: tuple[Path, ...],
    name: str | None,
    output: Path | None,
    no_refit: bool,
    lift: float | str | None,
    show_list: bool,
    as_json: bool,
) -> int:
    """Write PLAN, a plan.json, as a file that a vehicle flies; of several plans, a show.

    What is written is read back at its consumer's precision and proven again. Where a format has
    not room for all pieces, the flight is planned again with fewer; where rounding exceeds a limit,
    it is flown slower by as little as keeps it; the output says what that costs. The drones of a
    show keep their paths and stay in step. Ends with 0 if the file is proven to keep the limits, 1
    if not, 2 if the input is wrong.

    \b
    Example:
      peakflight export race/plan.json --to crazyswarm
      peakflight export race/plan.json --to px4 --lift auto -o fly.py
      peakflight export one/plan.json two/plan.json --to skyc -o show.skyc
    """  # noqa: D301
    if show_list:
        _list(as_json)
        return 0
    if not plans:
        raise click.UsageError("name a plan, such as race/plan.json")
    if name is None:
        raise click.UsageError(f"--to FORMAT is missing; one of {', '.join(FLIGHT_FORMATS)}")
    _, chosen = find_format(name)
    with Progress() as progress:
        progress.stage(f"reading {len(plans)} plan{'' if len(plans) == 1 else 's'}")
        read = [Plan.load(path) for path in plans]
        path = plans[0].parent / chosen.filename if output is None else output
        keep_inputs(path, plans)
        if output is None and name == "json":
            _keep_other_plan(path, read[0])
        progress.stage(f"writing {chosen.filename}")
        from peakflight.exporting import export as write

        report = write(
            read,
            to=name,
            path=path,
            refit=not no_refit,
            lift=0.0 if lift is None else lift,
            names=_names(plans),
        )
    if as_json:
        print_json(report.to_dict())
    else:
        _print(report)
    if not report.feasible:
        click.echo(f"peakflight: {report.path}: {report.problems[0]}", err=True)
    return 0 if report.feasible else 1


def _keep_other_plan(path: Path, plan: Plan) -> None:
    """Refuse to put a plan in the place of another one that nobody named."""
    if path.is_file() and path.read_bytes() != FLIGHT_FORMATS["json"].encode([plan], [""]).data:
        raise InvalidFile(f"{path}: is there already, another plan; name the file with -o")


def _names(plans: Sequence[Path]) -> list[str]:
    """What the drones of plans are called: after their files, or the folders of these."""
    for names in (
        [path.stem for path in plans],
        [path.absolute().parent.name for path in plans],
    ):
        if len(set(names)) == len(names) and "plan" not in names and all(names):
            return names
    return [f"drone_{index + 1}" for index in range(len(plans))]


def _print(report: Any) -> None:
    """Print what a person should know of a report."""
    out = Printout()
    several = len(report.flights) > 1
    out.path(f"wrote {report.path}: {report.format}, {report.size} bytes")
    if report.feasible:
        but = "; distances between drones are no such limit" if several else ""
        out.line(
            f"proven again as it is read, to {report.tolerance:g} of each limit that is held{but}",
            "good",
        )
    else:
        out.line("not proven to keep the limits as it is read:", "bad")
        for problem in report.problems:
            out.line(f"  {problem}")
    if several:
        out.table(
            "Flights",
            ("drone", ">time (s)", ">cost", ">pieces", ">off the plan (m)", ">m/s", ">m/s²"),
            _flight_rows(report.flights),
        )
    else:
        _print_one(out, report.flights[0])
    for note in report.notes:
        out.line(f"note: {note}")
    out.show()


def _print_one(out: Printout, flight: Any) -> None:
    """Add what is known of a single flight."""
    out.line()
    pieces = f"{flight.pieces}"
    if flight.refitted:
        pieces += f" in place of the plan's {flight.plan_pieces}"
    out.pairs(
        [
            ("total time", f"{seconds(flight.duration)} s, {_cost(flight.cost)} the plan's"),
            ("pieces", pieces),
            ("yaw", f"at most {math.degrees(flight.yaw_difference):.2g}° off the plan's"),
        ]
    )
    compared = [("to the plan", flight.difference), ("jumps at joints", flight.jumps)]
    if flight.refitted:
        compared.insert(1, ("to what was written", flight.rounding))
    out.table(
        "Largest differences",
        ("", ">position (m)", ">velocity (m/s)", ">acceleration (m/s²)"),
        ((what, *(f"{value:.2g}" for value in found)) for what, found in compared),
    )
    out.table(
        "Limits",
        ("limit", ">ratio planned", ">in the file", ">margin", "", "held"),
        _limit_rows(flight),
    )


def _cost(percent: float) -> str:
    return f"{abs(percent):.3f} % {'below' if percent < 0.0 else 'above'}"


def _flight_rows(flights: Sequence[Any]) -> Iterator[Sequence[str]]:
    for flight in flights:
        yield (
            flight.name,
            seconds(flight.duration),
            f"{flight.cost:.3f} %",
            str(flight.pieces),
            *(f"{value:.2g}" for value in flight.difference),
        )


def _limit_rows(flight: Any) -> Iterator[Sequence[str]]:
    for name, ratio in flight.peaks.items():
        shown, margin, meaning = ratio_cells(ratio)
        held = name in flight.held
        meaning = "" if meaning == "exceeded" and not flight.problems else meaning
        planned = flight.plan_peaks.get(name)
        yield (
            ALL_LABELS[name],
            "" if planned is None else f"{planned:.4f}",
            shown,
            margin,
            meaning,
            "yes" if held else "no: rounding",
        )


def _list(as_json: bool) -> None:
    """Print the formats."""
    if as_json:
        print_json(
            {
                "formats": [
                    {
                        "name": name,
                        "filename": one.filename,
                        "summary": one.summary,
                        "consumer": one.consumer,
                        "numbers": one.numbers,
                        "rules": one.rules,
                        "several": one.several,
                        "tolerance": one.tolerance,
                        "precision": one.precision._asdict(),
                    }
                    for name, one in FLIGHT_FORMATS.items()
                ]
            }
        )
        return
    out = Printout()
    for name, one in FLIGHT_FORMATS.items():
        out.line(f"{name}: {one.summary}", "title")
        out.pairs(
            [
                ("file", f"{one.filename}; {'several drones' if one.several else 'one drone'}"),
                ("read by", one.consumer),
                ("numbers", one.numbers),
                ("limits", one.rules),
            ]
        )
    out.show()
