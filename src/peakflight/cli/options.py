"""Options that several commands share, and how limits are written on the command line."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import click

from peakflight.errors import InvalidProblem, quoted
from peakflight.limits import KINDS, PAPER_LIMITS, ROTORS, LimitKind, Limits
from peakflight.numerals import as_number
from peakflight.vehicle import Vehicle
from peakflight.vehicles import VEHICLES, find_vehicle
from peakflight.wording import written

ON_ROTORS = "peakflight.on_rotors"
"""Where a command keeps whether `--rotors` was given."""
_Command = TypeVar("_Command", bound=Callable[..., Any])


class FolderPath(click.Path):
    """A folder that may not exist yet."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """As a `Path`; an empty name would be the current folder."""
        if not str(value).strip():
            self.fail("the name is empty; write . for the current folder", param, ctx)
        return super().convert(value, param, ctx)


def parse_limits(text: str) -> Limits:
    """Limits from `speed=5,tilt=50deg`, in SI units, angles in degrees if they say so.

    Raises
    ------
    InvalidProblem
        If an item is not name=value, a name is unknown or given twice, a value is not a number,
        or the limits are against their own rules.
    """
    values = named_values(text, {kind.name: kind for kind in KINDS})
    for name in ROTORS:
        if name in values:
            raise InvalidProblem(f"limit {name} is about a vehicle; write --vehicle NAME --rotors")
    return Limits.from_dict(values)


def named_values(text: str, kinds: Mapping[str, LimitKind]) -> dict[str, float]:
    """Values from `speed=5,tilt=50deg`, by names of `kinds`; errors as of `parse_limits`."""
    values: dict[str, float] = {}
    for item in text.split(","):
        name, mark, value = (part.strip() for part in item.partition("="))
        if not (name and mark and value):
            raise InvalidProblem(
                f"{quoted(item.strip())} is not a limit; write name=value, such as speed=5"
            )
        if name not in kinds:
            raise InvalidProblem(f"unknown limit {quoted(name)}; known are {', '.join(kinds)}")
        if name in values:
            raise InvalidProblem(f"limit {name} is given twice")
        values[name] = _number(kinds[name], value)
    return values


def limits_source(vehicle: Vehicle | None, given: Limits | None) -> str:
    """Where limits are from, in brackets: the vehicle, the paper, or nothing if all are given."""
    if vehicle is None:
        return "" if given else " (the paper's)"
    but = f" but {', '.join(given.to_dict())}" if given else ""
    return f" (of {vehicle.name}{but})"


def vehicle_option(command: _Command) -> _Command:
    """Options `--vehicle` and `--rotors` of a command, a `Vehicle`; None if not given."""
    command = click.option(
        "--rotors",
        is_flag=True,
        expose_value=False,
        is_eager=True,
        callback=_remember,
        help="Limit the vehicle's rotors, and its body rate across the thrust, themselves, without "
        "a margin, in place of its default limits.",
    )(command)
    return click.option(
        "--vehicle",
        metavar="NAME|FILE.yaml",
        callback=vehicle_of,
        help=f"What flies: {', '.join(VEHICLES)}, or a file of your own; see peakflight vehicles. "
        "Its limits are kept, but for those that --limits names.",
    )(command)


PAPERS = f"the paper's {written(PAPER_LIMITS, ', ')}"
"""What limits are by default where nothing else is known of them, in words."""


def limits_option(
    help: str, otherwise: str = "those in the file"
) -> Callable[[_Command], _Command]:
    """Option `--limits` of a command; it may be repeated, and is None if not given.

    otherwise: in words, what the command takes then.
    """
    return click.option(
        "--limits",
        multiple=True,
        metavar="NAME=VALUE,...",
        callback=_limits,
        help=f"{help} Known: {', '.join(kind.name for kind in KINDS)}; in SI units, angles also as "
        f"50deg. What is not named is not limited. Default: {otherwise}.",
    )


def spline_options(command: _Command) -> _Command:
    """Options that choose the class of spline."""
    for decorate in (
        click.option("--continuity", type=int, help="Highest derivative that is continuous."),
        click.option(
            "--degree", type=int, help="Degree of the polynomials; by default the method's own."
        ),
        click.option(
            "--minimize",
            type=click.Choice(("jerk", "snap", "acceleration")),
            default="jerk",
            show_default=True,
            help="Derivative whose square a spline minimizes, and which effort weighs.",
        ),
    ):
        command = decorate(command)
    return command


def common_options(command: _Command) -> _Command:
    """Options that every command has."""
    for decorate in (
        click.option(
            "--debug",
            is_flag=True,
            expose_value=False,
            help="Show where an unexpected error happened.",
        ),
        click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead."),
    ):
        command = decorate(command)
    return command


def _limits(
    context: click.Context, parameter: click.Parameter, texts: tuple[str, ...]
) -> Limits | None:
    if not texts:
        return None
    try:
        return parse_limits(",".join(texts))
    except InvalidProblem as error:
        raise click.BadParameter(str(error), context, parameter) from None


def vehicle_of(
    context: click.Context, parameter: click.Parameter, text: str | None
) -> Vehicle | None:
    """Find the vehicle that an option or argument names."""
    on_rotors = context.meta.get(ON_ROTORS, False)
    if text is None:
        if on_rotors:
            raise click.UsageError("--rotors needs --vehicle", context)
        return None
    try:
        vehicle = find_vehicle(text)
        return vehicle.on_rotors() if on_rotors else vehicle
    except InvalidProblem as error:
        raise click.BadParameter(str(error), context, parameter) from None


def _remember(context: click.Context, parameter: click.Parameter, given: bool) -> None:
    """For `vehicle_of`, which comes after it."""
    del parameter
    context.meta[ON_ROTORS] = given


def _number(kind: LimitKind, text: str) -> float:
    is_angle = kind.unit == "rad"
    in_degrees = is_angle and text.endswith("deg")
    try:
        number = as_number(text.removesuffix("deg") if in_degrees else text)
    except ValueError:
        also = ", or degrees such as 50deg" if is_angle else ""
        raise InvalidProblem(
            f"limit {kind.name} is {quoted(text)}; it must be a number, in {kind.unit}{also}"
        ) from None
    return math.radians(number) if in_degrees else number
