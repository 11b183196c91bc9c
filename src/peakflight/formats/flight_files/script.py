"""Scripts that fly a plan: a template with the numbers of the flight in it.

The templates in `templates/` are whole programs but for `$names`; libraries of vehicles are
imported by them alone, never here.
"""

import ast
import re
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np

from peakflight.errors import InvalidFile
from peakflight.limits import plain_unit
from peakflight.result import Plan
from peakflight.version import __version__

FOLDER = "templates"
HEIGHT = 0.5
"""m: take-off goes at least as high before the vehicle flies to the start."""
HARMFUL = re.compile(r"[^\w .+-]")
"""Characters of a name that could end or change a docstring, or its line."""


def script(template: str, **values: Any) -> bytes:
    """A script: the template's `$names` replaced by values, text as it is."""
    return Template(template_text(template)).substitute(version=__version__, **values).encode()


def template_text(name: str) -> str:
    """The text of a template, or of a part that several of them have."""
    return files("peakflight.formats.flight_files").joinpath(FOLDER, name).read_text("utf-8")


def described(plan: Plan, held: int) -> str:
    """A flight in a line: how long, for which vehicle, within which limits.

    Limits on derivatives above `held` are left out: the script is not held to them. The line goes
    into a docstring, so that of the vehicle's name only harmless characters stay.
    """
    limits = ", ".join(
        f"{kind.label} {getattr(plan.problem.limits, kind.name):g} {plain_unit(kind.unit)}"
        for kind in plan.problem.limits.active
        if kind.order <= held
    )
    vehicle = "" if plan.vehicle is None else f" for {HARMFUL.sub('_', plan.vehicle.name)}"
    return f"{plan.duration:.2f} s{vehicle}" + (f"; planned within: {limits}" if limits else "")


def rows_text(rows: np.ndarray) -> str:
    """The lines of a list of tuples, numbers with 9 digits."""
    row = "    (" + ", ".join(["%.9g"] * rows.shape[1]) + "),"
    return "\n".join(row % tuple(values) for values in (rows + 0.0).tolist())


def value_in(data: bytes, name: str) -> Any:
    """What a script assigns to a name, without running it.

    Raises
    ------
    InvalidFile
        If it is not such a script.
    """
    try:
        for statement in ast.parse(data.decode()).body:
            if isinstance(statement, ast.Assign) and any(
                isinstance(target, ast.Name) and target.id == name for target in statement.targets
            ):
                return ast.literal_eval(statement.value)
    except (SyntaxError, ValueError, UnicodeDecodeError) as error:
        raise InvalidFile(f"the file is not a script of peakflight ({error})") from None
    raise InvalidFile(f"the file is not a script of peakflight (no {name} in it)")
