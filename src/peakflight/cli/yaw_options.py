"""How the yaw is asked for on the command line."""

import math
from collections.abc import Callable
from typing import Any, TypeVar

import click
import numpy as np

from peakflight.cli.options import named_values
from peakflight.errors import InvalidProblem, quoted
from peakflight.yaw import YAW_KINDS, Heading, heading_field

_Command = TypeVar("_Command", bound=Callable[..., Any])

POINT = "point:"
"""What a point to look at begins with."""


def yaw_options(command: _Command) -> _Command:
    """Options `--yaw`, a mapping of fields of `Heading`, and `--yaw-limits`, by the same names."""
    default = Heading(policy="velocity")
    for decorate in (
        click.option(
            "--yaw-limits",
            metavar="NAME=VALUE,...",
            callback=_checked(parse_yaw_limits),
            help="How fast the nose may turn: rate in rad/s, acceleration in rad/s^2. What is not "
            f"named is not limited. Default: rate={default.rate:g},"
            f"acceleration={default.acceleration:g}; not limited for the yaw of a course without "
            "--yaw.",
        ),
        click.option(
            "--yaw",
            metavar="ANGLE|velocity|point:X,Y,Z|waypoints",
            callback=_checked(parse_yaw),
            help="Where the nose points: an angle in rad, or as 90deg; along the velocity; at a "
            "point; or as the course has it at its waypoints. Default: as the course has it, if "
            "it has.",
        ),
    ):
        command = decorate(command)
    return command


def written_yaw(heading: Heading) -> str:
    """What is asked of the yaw, for people."""
    asked = heading.policy
    if heading.angle is not None:
        asked = f"{math.degrees(heading.angle):.6g} deg"
    elif heading.point is not None:
        asked = POINT + ",".join(f"{value:g}" for value in heading.point)
    limits = [f"{heading_field(kind)}={value:.6g}" for kind, value in heading.limits.items()]
    return f"{asked}; limits: {','.join(limits) or 'none'}"


def heading_of(
    yaw: dict[str, Any] | None, limits: dict[str, float | None] | None, course: np.ndarray | None
) -> Heading | np.ndarray | None:
    """What a `Problem` takes as yaw.

    Parameters
    ----------
    yaw, limits
        What the two options gave.
    course
        (K+1,) rad, yaw at the waypoints of the course; None if it has none.

    Raises
    ------
    InvalidProblem
        If the yaw of the course is asked for, and it has none.
    """
    if yaw is None and limits is None:
        return course
    fields = {"policy": "waypoints"} if yaw is None else dict(yaw)
    if fields["policy"] == "waypoints":
        if course is None:
            option = "--yaw-limits limits" if yaw is None else "--yaw waypoints asks for"
            raise InvalidProblem(f"{option} the yaw of the course, which has none; give a --yaw")
        fields["angles"] = course.tolist()
    return Heading(**fields, **(limits or {}))  # type: ignore[arg-type]


def parse_yaw(text: str) -> dict[str, Any]:
    """Fields of a `Heading` from `90deg`, `velocity`, `point:1,2,0` or `waypoints`.

    Raises
    ------
    InvalidProblem
        If it is none of these.
    """
    if text in ("velocity", "waypoints"):
        return {"policy": text}
    try:
        if text.startswith(POINT):
            x, y, z = (float(number) for number in text.removeprefix(POINT).split(","))
            return {"policy": "point", "point": (x, y, z)}
        angle = float(text.removesuffix("deg"))
    except ValueError:
        raise InvalidProblem(
            f"yaw is {quoted(text)}; it must be an angle in rad or such as 90deg, velocity, "
            "point:x,y,z with three numbers, or waypoints"
        ) from None
    angle = math.radians(angle) if text.endswith("deg") else angle
    return {"policy": "fixed", "angle": angle}


def parse_yaw_limits(text: str) -> dict[str, float | None]:
    """Fields of a `Heading` from `rate=3,acceleration=20`; None for what is not named.

    Raises
    ------
    InvalidProblem
        If an item is not name=value, a name is unknown or given twice, or a value against a rule.
    """
    kinds = {heading_field(kind): kind for kind in YAW_KINDS}
    limits = dict.fromkeys(kinds) | named_values(text, kinds)
    Heading(policy="velocity", **limits)  # type: ignore[arg-type]
    return limits


def _checked(parse: Callable[[str], Any]) -> Callable[..., Any]:
    def callback(context: click.Context, parameter: click.Parameter, text: str | None) -> Any:
        try:
            return None if text is None else parse(text)
        except InvalidProblem as error:
            raise click.BadParameter(str(error), context, parameter) from None

    return callback
