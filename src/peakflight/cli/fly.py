"""`peakflight fly`: flies a plan in simulation."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from peakflight.cli.fly_output import as_dict, print_flight, verdict, write_files
from peakflight.cli.folder import OutputFolder
from peakflight.cli.options import FolderPath, common_options, vehicle_of
from peakflight.cli.output import print_json
from peakflight.cli.progress import Progress
from peakflight.errors import InvalidFile, quoted
from peakflight.numerals import as_number
from peakflight.result import Plan
from peakflight.vehicle import Vehicle

if TYPE_CHECKING:
    from peakflight.flight import Conditions, Flight, SpreadResult

NAMES = ("geometric", "firmware")
"""Controllers, here so that help does not wait for kernels."""
OWN, CRAZYFLOW = "peakflight", "crazyflow"
"""Simulators."""
OF_OURS = ("controller", "flights", "wind", "gust", "latency", "noise", "mass_scale",
           "thrust_scale", "no_drag", "seed")  # fmt: skip
"""Options that only our own simulator has, by parameter."""


def check_error(
    context: click.Context, parameter: click.Parameter, value: float | None
) -> float | None:
    """Refuse an error that is not positive and finite."""
    if value is not None and not (math.isfinite(value) and value > 0.0):
        raise click.BadParameter(f"{value:g} must be positive and finite", context, parameter)
    return value


@click.command(short_help="Fly a plan in simulation.")
@click.argument("file", metavar="PLAN", type=click.Path(path_type=Path))
@click.option(
    "--vehicle",
    metavar="NAME|FILE.yaml",
    callback=vehicle_of,
    help="What flies; by default the plan's own vehicle. See peakflight vehicles.",
)
@click.option(
    "--controller",
    type=click.Choice(NAMES),
    default=NAMES[0],
    show_default=True,
    help="What steers: an ideal tracker, or one after the Crazyflie's firmware.",
)
@click.option(
    "--simulator",
    type=click.Choice((OWN, CRAZYFLOW)),
    default=OWN,
    show_default=True,
    help="Where: crazyflow is an independent simulator of the Crazyflies under their firmware's "
    "controller; it needs the extra crazyflow.",
)
@click.option(
    "--error",
    type=float,
    metavar="METRES",
    callback=check_error,
    help="Largest RMS error that counts as flown; by default only a crash does not, and 0.15 with "
    "--spread.",
)
@click.option(
    "--spread",
    "flights",
    type=int,
    metavar="N",
    help="Fly N vehicles that differ in mass, thrust, inertia, motor lag and latency too.",
)
@click.option("--wind", metavar="X,Y,Z", help="Steady wind, m/s.")
@click.option("--gust", type=float, metavar="M/S", help="Standard deviation of gusts, m/s.")
@click.option("--latency", type=float, metavar="S", help="How old the measured state is, s.")
@click.option("--noise", type=float, metavar="METRES", help="Noise of the measured position, m.")
@click.option("--mass-scale", type=float, help="True mass over the vehicle's.")
@click.option("--thrust-scale", type=float, help="True thrust over what is asked for.")
@click.option("--no-drag", is_flag=True, help="Leave rotor drag out.")
@click.option(
    "--seed", type=int, default=0, show_default=True, help="Of gusts, noise and the spread."
)
@click.option(
    "-o",
    "--output",
    type=FolderPath(),
    metavar="DIR",
    help="Folder for the samples, pictures and the animation; without it nothing is written.",
)
@common_options
def fly(
    file: Path,
    vehicle: Vehicle | None,
    controller: str,
    simulator: str,
    error: float | None,
    flights: int | None,
    output: Path | None,
    as_json: bool,
    **conditions: Any,
) -> int:
    """Fly PLAN, a plan.json, in simulation: a rigid body whose rotors lag, under a controller.

    Ends with 0 if it flew, 1 if it crashed or, with --error, was further off than that, 2 if the
    input is wrong. What the vehicles of --spread do is told, but changes nothing of this.

    \b
    Example:
      peakflight fly course-plan/plan.json --vehicle racing-quad -o flight
      peakflight fly course-plan/plan.json --controller firmware --spread 200
      peakflight fly course-plan/plan.json --simulator crazyflow
    """  # noqa: D301
    if simulator == CRAZYFLOW:
        _refuse_ours(click.get_current_context())
    with Progress() as progress:
        progress.stage(f"reading {file.name}")
        plan = Plan.load(file)
        if plan.vehicle is None and vehicle is None:
            raise InvalidFile(f"{file}: the plan names no vehicle to fly it; give --vehicle NAME")
        steered = CRAZYFLOW if simulator == CRAZYFLOW else controller
        asked = Asked(plan, vehicle, steered, _conditions(conditions), error, flights)
        if output is None:
            flight, spread = _fly(asked, progress)
            files: dict[str, Path] = {}
        else:
            with OutputFolder(output) as folder:
                flight, spread = _fly(asked, progress)
                names = write_files(flight, plan, spread, folder.stage, on_stage=progress.stage)
                files = {name: folder.published(name) for name in names}
    flew = flight.flew if error is None else flight.within(error)
    if as_json:
        print_json(as_dict(flight, flew, spread, files))
    else:
        print_flight(flight, file=file, error=error, spread=spread, files=files)
    if not flew:
        click.echo(f"peakflight: {file}: {verdict(flight, error)}", err=True)
    return 0 if flew else 1


class Asked(NamedTuple):
    """What the command line asks for."""

    plan: Plan
    vehicle: Vehicle | None
    controller: str
    """Or `CRAZYFLOW`, which has its own."""
    conditions: "Conditions"
    error: float | None
    flights: int | None


def _fly(asked: Asked, progress: Progress) -> tuple["Flight", "SpreadResult | None"]:
    """Fly once, and as often as the spread says."""
    if asked.controller == CRAZYFLOW:
        from peakflight.flight.crazyflow import fly_crazyflow

        progress.stage("flying in crazyflow")
        return fly_crazyflow([asked.plan], vehicle=asked.vehicle)[0], None
    from peakflight.flight import fly as simulate
    from peakflight.flight import fly_spread
    from peakflight.flight.spread import ERROR

    progress.stage("flying")
    shared: dict[str, Any] = {
        "vehicle": asked.vehicle,
        "controller": asked.controller,
        "conditions": asked.conditions,
    }
    flight = simulate(asked.plan, **shared)
    if asked.flights is None:
        return flight, None
    count = asked.flights

    def show(done: int) -> None:
        progress.stage(f"flying {count} vehicles that differ: {done}", done / count)

    error = ERROR if asked.error is None else asked.error
    spread = fly_spread(asked.plan, **shared, flights=count, error=error, on_flight=show)
    return flight, spread


def _refuse_ours(context: click.Context) -> None:
    """Options that mean nothing to crazyflow are not passed over in silence."""
    given = click.core.ParameterSource.COMMANDLINE
    for parameter in context.command.params:
        if parameter.name in OF_OURS and context.get_parameter_source(parameter.name) is given:
            raise click.UsageError(
                f"{parameter.opts[0]} is of our own simulator; crazyflow flies the vehicle as it "
                "is, under its firmware",
                context,
            )


def _conditions(given: dict[str, Any]) -> "Conditions":
    """Conditions from the options that were given; errors name the option."""
    from peakflight.flight import Conditions

    values = {field: given[option] for option, field in FIELDS.items() if given[option] is not None}
    if given["wind"] is not None:
        values["wind"] = _wind(given["wind"])
    return Conditions(drag=not given["no_drag"], **values)


FIELDS = {
    "gust": "gust",
    "latency": "latency",
    "noise": "position_noise",
    "mass_scale": "mass_scale",
    "thrust_scale": "thrust_scale",
    "seed": "seed",
}
"""Option to the field of `Conditions` that it sets."""


def _wind(text: str) -> tuple[float, ...]:
    try:
        return tuple(as_number(part) for part in text.split(","))
    except ValueError:
        raise click.UsageError(
            f"--wind is {quoted(text)}; it must be three numbers, such as 2,0,0"
        ) from None
