"""`peakflight show`: how near drones that fly together come to each other."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import click

from peakflight.cli.options import common_options
from peakflight.cli.output import Printout, amounts, print_json
from peakflight.cli.progress import Progress
from peakflight.errors import quoted
from peakflight.numerals import as_number
from peakflight.readers import read_trajectory_file

if TYPE_CHECKING:
    from peakflight.separation import ClosestApproach

SHOWN = 10
"""Pairs in the table, the nearest first."""
Fits: TypeAlias = dict[int, tuple[float, ...]]
"""Number of a file of samples to how far off them its polynomials are, m, m/s, m/s^2."""
DIGITS = 7
"""Decimals of a bound, which is good to 1e-6 m."""


def _delays(
    context: click.Context, parameter: click.Parameter, text: str | None
) -> list[float] | None:
    if text is None:
        return None
    delays = []
    for part in text.split(","):
        try:
            delays.append(as_number(part))
        except ValueError:
            raise click.BadParameter(
                f"{quoted(part.strip())} is not a number of seconds", context, parameter
            ) from None
    return delays


@click.command(short_help="Prove how near drones that fly together come to each other.")
@click.argument("files", metavar="PLAN PLAN...", nargs=-1, type=click.Path(path_type=Path))
@click.option("--separation", type=float, metavar="M", help="To be kept to the side, m.")
@click.option(
    "--downwash",
    type=float,
    metavar="M",
    help="To be kept above and below, m; by default as --separation.",
)
@click.option(
    "--delays",
    metavar="S,S,...",
    callback=_delays,
    help="How much later each plan starts, s, one number for each.",
)
@click.option(
    "--stagger", type=float, metavar="S", help="Each starts so much after the one before."
)
@common_options
@click.pass_context
def show(
    context: click.Context,
    files: tuple[Path, ...],
    separation: float | None,
    downwash: float | None,
    delays: list[float] | None,
    stagger: float | None,
    as_json: bool,
) -> int:
    """Prove how near the drones of several PLANs come to each other.

    Each PLAN is a plan.json or any trajectory that peakflight import reads; one may be given
    twice. A drone waits at its first point before its plan, and at its last one after it.
    Distances are in the norm of an ellipsoid, in which heights count --separation over --downwash.

    Ends with 0 if the separation is proven to be kept, or none is asked for; 1 if not; 2 if the
    input is wrong.

    \b
    Example:
      peakflight show a.json b.json --separation 0.4 --downwash 0.8 --stagger 1
    """  # noqa: D301
    if len(files) < 2:
        raise click.UsageError("name two plans at least", context)
    if delays is not None and stagger is not None:
        raise click.UsageError("--delays and --stagger exclude each other", context)
    if delays is not None and len(delays) != len(files):
        raise click.UsageError(f"{len(delays)} delays for {len(files)} plans", context)
    if stagger is not None:
        delays = [stagger * index for index in range(len(files))]
    with Progress() as progress:
        from peakflight.separation import closest_approach

        flights, fits = [], {}
        for index, file in enumerate(files):
            progress.stage(f"reading {file.name}", index / len(files))
            source = read_trajectory_file(file)
            flights.append(source.trajectory)
            if source.fit_errors is not None:
                fits[index] = source.fit_errors
        progress.stage("measuring distances")
        found = closest_approach(
            flights,
            separation=separation,
            downwash=downwash,
            delays=delays,
            off=[fits[index][0] if index in fits else 0.0 for index in range(len(files))],
        )
    if as_json:
        print_json(_as_dict(found, files, fits))
    else:
        _print(found, files, fits)
    if found.is_kept is False:
        worst = int(found.bounds.argmin())
        one, two = (_name(files, number) for number in found.pairs[worst])
        counted = ", less what they are off samples" if fits else ""
        click.echo(
            f"peakflight: {one} and {two} come as near as {found.distances[worst]:.6g} m at "
            f"{found.times[worst]:.4f} s{counted}; {separation:g} m are asked for",
            err=True,
        )
        return 1
    return 0


def _print(found: "ClosestApproach", files: tuple[Path, ...], fits: Fits) -> None:
    out = Printout()
    out.line(f"{len(files)} drones, {len(found.pairs)} pairs", "title")
    if found.is_kept is not None:
        norm = f"{found.separation:g} m to the side, {found.downwash:g} m above and below"
        if found.is_kept:
            out.line(f"kept: {norm}; proven at every instant", "good")
        else:
            out.line(f"not kept: {norm}", "bad")
    one, two = (_name(files, number) for number in found.pair)
    points = [", ".join(f"{value:.3f}" for value in point) for point in found.positions]
    out.pairs(
        [
            ("nearest", f"{one} and {two}"),
            ("time", f"{found.time:.4f} s"),
            ("distance", f"{found.distance:.6f} m"),
            ("proven", f"nowhere below {_rounded_down(found.bound)} m"),
            ("there", f"({points[0]}) and ({points[1]}) m"),
        ]
    )
    if fits:
        worst = max(fits, key=lambda index: fits[index][0])
        out.line(
            "note: the proof is about polynomials; it counts that they are off samples by "
            f"{amounts(fits[worst])} at most ({_name(files, worst)})"
        )
    nearest = found.distances.argsort(kind="stable")[:SHOWN]
    out.table(
        "Pairs" if len(found.pairs) <= SHOWN else f"The {SHOWN} nearest pairs",
        ("drone", "drone", ">time (s)", ">distance (m)", ">proven (m)"),
        (
            (
                _name(files, found.pairs[k, 0]),
                _name(files, found.pairs[k, 1]),
                f"{found.times[k]:.4f}",
                f"{found.distances[k]:.6f}",
                _rounded_down(found.bounds[k]),
            )
            for k in nearest
        ),
    )
    out.show()


def _as_dict(found: "ClosestApproach", files: tuple[Path, ...], fits: Fits) -> dict[str, object]:
    return {
        "kept": found.is_kept,
        "separation": found.separation,
        "downwash": found.downwash,
        "plans": [str(file) for file in files],
        "fit_errors": [list(fits[index]) if index in fits else None for index in range(len(files))],
        "pair": list(found.pair),
        "time": found.time,
        "distance": found.distance,
        "bound": found.bound,
        "positions": found.positions.tolist(),
        "pairs": [
            {"pair": pair, "time": time, "distance": distance, "bound": bound}
            for pair, time, distance, bound in zip(
                found.pairs.tolist(),
                found.times.tolist(),
                found.distances.tolist(),
                found.bounds.tolist(),
                strict=True,
            )
        ],
    }


def _rounded_down(bound: float) -> str:
    """What is still below a bound, to DIGITS decimals."""
    return f"{math.floor(bound * 10.0**DIGITS) / 10.0**DIGITS:.{DIGITS}f}"


def _name(files: tuple[Path, ...], number: int) -> str:
    """A plan's file, and its number where a file is given twice."""
    name = str(files[number])
    return name if files.count(files[number]) == 1 else f"{name} ({number})"
