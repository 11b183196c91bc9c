"""How the yaw is asked for on the command line."""

import math
from collections.abc import Callable
from typing import Any, TypeVar

import click
import numpy as np

from peakflight.cli.options import named_values
from peakflight.errors import InvalidProblem, quoted
from peakflight.numerals import as_number
from peakflight.yaw import ABOUT, FIELDS, Heading

_Command = TypeVar("_Command", bound=Callable[..., Any])

POINT = "point:"
"""What a point to look at begins with."""


def yaw_options(command: _Command) -> _Command:
    """Options `--yaw`, a mapping of fields of `Heading`, and `--yaw-limits`, by the same names."""
    default = Heading(policy="velocity")
    for decorate in (
        click.option(
            "--yaw-limits",
            metavar="NAME=VALUE,...|none",
            callback=_checked(parse_yaw_limits),
            help="How fast the nose may turn: yaw_rate in rad/s, yaw_acceleration in rad/s^2; or "
            "the vehicle about its own z axis, body_rate_z and angular_acceleration_z. rate and "
            "acceleration are the latter with --rotors, else the former. What is not named is not "
            f"limited. Default: rate={default.rate:g},acceleration={default.acceleration:g}; not "
            "limited for the yaw of a course without --yaw.",
        ),
        click.option(
            "--yaw",
            metavar="ANGLE|velocity|point:X,Y,Z|waypoints|free",
            callback=_checked(parse_yaw),
            help="Where the nose points: an angle in rad, or as 90deg; along the velocity; at a "
            "point; as the course has it at its waypoints; or free, where it ends up if the "
            "vehicle does not turn about its thrust. Default: as the course has it, if it has; "
            "else 0, or free with --rotors.",
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
    names = {kind: name for name, kind in zip(FIELDS, ABOUT["yaw"], strict=True)}
    limits = [f"{names.get(kind, kind.name)}={limit:.6g}" for kind, limit in heading.limits.items()]
    return f"{asked}; limits: {','.join(limits) or 'none'}"


def heading_of(
    yaw: dict[str, Any] | None, limits: dict[str, Any] | None, course: np.ndarray | None
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
    return Heading(**fields, **(limits or {}))


def parse_yaw(text: str) -> dict[str, Any]:
    """Fields of a `Heading` from `90deg`, `velocity`, `point:1,2,0` or `waypoints`.

    Raises
    ------
    InvalidProblem
        If it is none of these.
    """
    if text in ("velocity", "waypoints", "free"):
        return {"policy": text}
    try:
        if text.startswith(POINT):
            x, y, z = (as_number(number) for number in text.removeprefix(POINT).split(","))
            return {"policy": "point", "point": (x, y, z)}
        angle = as_number(text.removesuffix("deg"))
    except ValueError:
        raise InvalidProblem(
            f"yaw is {quoted(text)}; it must be an angle in rad or such as 90deg, velocity, "
            "point:x,y,z with three numbers, waypoints or free"
        ) from None
    angle = math.radians(angle) if text.endswith("deg") else angle
    return {"policy": "fixed", "angle": angle}


def parse_yaw_limits(text: str) -> dict[str, Any]:
    """Fields of a `Heading` from `rate=3,acceleration=20`, names of kinds, or `none`.

    Limits are None where they are not named.

    Raises
    ------
    InvalidProblem
        If an item is not name=value, a name is unknown or given twice, limits are about both yaw
        and body, or a value is against a rule.
    """
    fields: dict[str, Any] = dict.fromkeys(FIELDS)
    if text.strip() == "none":
        return fields
    plain = dict(zip(FIELDS, ABOUT["yaw"], strict=True))
    named = {kind.name: kind for kinds in ABOUT.values() for kind in kinds}
    values = named_values(text, plain | named)
    for about, kinds in ABOUT.items():
        own = [kind.name for kind in kinds if kind.name in values]
        if own and len(own) < len(values):
            raise InvalidProblem(f"limit {own[0]} is given beside others than of the {about}")
        if own:
            fields["about"] = about
        fields |= {
            name: values[kind.name]
            for name, kind in zip(FIELDS, kinds, strict=True)
            if kind.name in values
        }
    fields |= {name: values[name] for name in FIELDS if name in values}
    Heading(policy="velocity", **fields)
    return fields


def _checked(parse: Callable[[str], Any]) -> Callable[..., Any]:
    def callback(context: click.Context, parameter: click.Parameter, text: str | None) -> Any:
        try:
            return None if text is None else parse(text)
        except InvalidProblem as error:
            raise click.BadParameter(str(error), context, parameter) from None

    return callback
