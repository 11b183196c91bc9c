"""`peakflight vehicles`: what can be flown, with the source of every figure."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import click

from peakflight.cli.options import common_options, vehicle_of
from peakflight.cli.output import Printout, print_json
from peakflight.formats.vehicle_file import FIGURES, as_yaml, shown_figure
from peakflight.limits import plain_unit
from peakflight.vehicle import Vehicle
from peakflight.vehicles import VEHICLES
from peakflight.wording import amount, written


@click.command(short_help="List vehicles, with the source of every figure.")
@click.argument("vehicle", metavar="[NAME|FILE.yaml]", required=False, callback=vehicle_of)
@click.option("--yaml", "as_file", is_flag=True, help="Print it as a YAML file to start from.")
@common_options
def vehicles(vehicle: Vehicle | None, as_file: bool, as_json: bool) -> int:
    """List the vehicles that are known; of one, every figure, its source and its limits.

    A vehicle of your own is a YAML file: print one that is near it with --yaml, change what is
    different, and name the file wherever a vehicle is asked for.

    \b
    Example:
      peakflight vehicles crazyflie-2.1
      peakflight vehicles crazyflie-2.1 --yaml > mine.yaml
      peakflight plan course.csv --vehicle mine.yaml
    """  # noqa: D301
    if as_file:
        if vehicle is None:
            raise click.UsageError("--yaml needs the name of a vehicle")
        if as_json:
            raise click.UsageError("--yaml and --json exclude each other")
        click.echo(as_yaml(vehicle), nl=False)
    elif as_json:
        chosen = VEHICLES.values() if vehicle is None else (vehicle,)
        print_json({"vehicles": [_as_dict(one) for one in chosen]})
    elif vehicle is None:
        _print_all()
    else:
        _print_one(vehicle)
    return 0


def _as_dict(vehicle: Vehicle) -> dict[str, Any]:
    return {**vehicle.to_dict(), "top_thrust_acceleration": vehicle.top_thrust_acceleration}


def _print_all() -> None:
    out = Printout()
    columns = ("name", ">mass kg", ">top m/s²", ">planned m/s²", ">tilt °", ">lag s")
    rows = [
        (
            one.name,
            f"{one.mass:g}",
            f"{one.top_thrust_acceleration:.2f}",
            f"{one.limits.thrust_acceleration or 0.0:.2f}",
            f"{math.degrees(one.limits.tilt):.1f}" if one.limits.tilt else "none",
            f"{one.motor_lag:g}",
        )
        for one in VEHICLES.values()
    ]
    out.table("Vehicles", columns, rows)
    out.line()
    out.line("top: thrust over mass with all rotors at their most; planned: the limit of it")
    out.line("peakflight vehicles NAME says where each figure is from; --yaml begins your own")
    out.show()


def _print_one(vehicle: Vehicle) -> None:
    out = Printout()
    out.line(vehicle.name, "title")
    out.pairs([("top thrust acceleration", f"{vehicle.top_thrust_acceleration:.4g} m/s²")])
    out.table("Figures", ("figure", "value", "source"), _figures(vehicle))
    out.table("Limits to plan with", ("limit", ">value", "why"), _limits(vehicle))
    out.line()
    out.path(f"as an option: --limits {written(vehicle.limits)}")
    out.show()


def _figures(vehicle: Vehicle) -> Iterator[Sequence[str]]:
    for name in FIGURES:
        yield name, shown_figure(vehicle, name), vehicle.sources.get(name, "")


def _limits(vehicle: Vehicle) -> Iterator[Sequence[str]]:
    for kind in vehicle.limits.active:
        value = amount(kind, getattr(vehicle.limits, kind.name))
        yield kind.label, plain_unit(value), vehicle.reasons.get(kind.name, "")
