"""How a plan can be made, proven and reported again, as commands and as Python."""

import shlex
from dataclasses import fields
from typing import Any

from peakflight.errors import InvalidProblem
from peakflight.limits import KINDS, ROTORS
from peakflight.methods import METHODS, find
from peakflight.methods.classes import is_rest
from peakflight.problem import Problem
from peakflight.result import PLAIN, Plan
from peakflight.vehicle import Vehicle
from peakflight.vehicles import VEHICLES
from peakflight.yaw import ABOUT, FIELDS, Heading

OPTIONS = ("time_penalty", "variant", "pieces", "max_pieces", "effort", "time_limit")
"""Settings of methods that are options of `peakflight plan`."""


def plan_command(plan: Plan, file: str) -> str | None:
    """The command that plans the same problem again; None if only Python can say it.

    file: the plan file, which is the course too.
    """
    problem = plan.problem
    asked = _problem_options(problem)
    if asked is None or not set(plan.settings) <= set(OPTIONS) or not _can_be_given(plan):
        return None
    words = ["peakflight", "plan", file, "--method", plan.method]
    for name, value in plan.settings.items():
        if value is None or isinstance(value, bool):
            return None
        words += [f"--{name.replace('_', '-')}", str(value)]
    return shlex.join([*words, *asked, "-o", "again"])


def plan_in_python(plan: Plan, file: str) -> str | None:
    """The lines that plan the same problem again; None if no method does with these settings."""
    if not _can_be_given(plan):
        return None
    options = {"method": plan.method, **plan.settings}
    given = "".join(f", {name}={value!r}" for name, value in options.items())
    return (
        "import peakflight as pf\n\n"
        f"plan = pf.Plan.load({file!r})\n"
        f"again = pf.plan(plan.problem{given})"
    )


def _can_be_given(plan: Plan) -> bool:
    """Whether a method made the plan, with settings that it takes as they are written.

    Not if it began from another plan; and what a file says may be anything, so only names and
    values that the method knows come into what is to be typed.
    """
    if plan.method not in METHODS:
        return False
    kind: Any = find(plan.method).Settings
    known = {one.name for one in fields(kind) if isinstance(one.default, PLAIN)}
    if not set(plan.settings) <= known:
        return False
    if not all(type(value) in PLAIN for value in plan.settings.values()):
        return False
    try:
        kind(**plan.settings)
    except InvalidProblem:
        return False
    return True


def _problem_options(problem: Problem) -> list[str] | None:
    """What the command line needs to know of a problem; None if it has no options for it."""
    if not (is_rest(problem.start) and is_rest(problem.end)) or problem.derivatives:
        return None
    if not isinstance(problem.minimize, str):
        return None
    limited, turned = _limit_options(problem), _yaw_options(problem.yaw)
    if limited is None or turned is None:
        return None
    words = [*limited, *turned, "--minimize", problem.minimize]
    for name in ("degree", "continuity"):
        value = getattr(problem, name)
        if value is not None:
            words += [f"--{name}", str(value)]
    return words


def _limit_options(problem: Problem) -> list[str] | None:
    limits, vehicle = problem.limits, problem.vehicle
    if not isinstance(vehicle, Vehicle):
        return None if limits.airframe else ["--limits", _written(limits.to_dict())]
    known = VEHICLES.get(vehicle.name)
    if known is None or _figures(known) != _figures(vehicle):
        return None
    for base, more in ((known, []), (known.on_rotors(), ["--rotors"])):
        own, wanted = base.limits.to_dict(), limits.to_dict()
        differing = {name: value for name, value in wanted.items() if own.get(name) != value}
        if set(own) <= set(wanted) and not {*ROTORS, "airframe"} & set(differing):
            given = ["--limits", _written(differing)] if differing else []
            return ["--vehicle", vehicle.name, *more, *given]
    return None


def _figures(vehicle: Vehicle) -> dict[str, Any]:
    values = vehicle.to_dict()
    return {name: values[name] for name in values if name not in ("limits", "reasons")}


def _written(values: dict[str, Any]) -> str:
    names = [kind.name for kind in KINDS if kind.name in values]
    return ",".join(f"{name}={values[name]!r}" for name in names)


def _yaw_options(yaw: Any) -> list[str] | None:
    if not isinstance(yaw, Heading):  # none, or that of the file at its waypoints
        return []
    policy = yaw.policy
    if yaw.angle is not None:
        policy = repr(yaw.angle)
    elif yaw.point is not None:
        policy = "point:" + ",".join(map(repr, yaw.point))
    values = {name: getattr(yaw, name) for name in FIELDS}
    if yaw.about is not None:
        names = zip(FIELDS, ABOUT[yaw.about], strict=True)
        values = {kind.name: values[field] for field, kind in names}
    given = [f"{name}={value!r}" for name, value in values.items() if value is not None]
    return [f"--yaw={policy}", "--yaw-limits", ",".join(given) or "none"]
