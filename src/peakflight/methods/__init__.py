"""The methods that answer a problem, one file each, all of one signature.

A method is a module of its own with a frozen type `Settings` and two functions of a problem and
its settings: `solve` hands back an `Outcome`, `kernels` says which compiled kernels that takes. A
new one is its file and one line in `METHODS`: `plan`, the command line and the tests pick it up
from there.
"""

from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal, Protocol

import numpy as np

from peakflight.errors import InvalidProblem, Status
from peakflight.problem import Problem
from peakflight.result import History
from peakflight.trajectory import Trajectory

METHODS = {
    "proportional": "times proportional to distance, stretched until feasible",
    "mellinger": "least jerk or snap at a fixed total time, stretched until feasible",
    "bry": "least jerk or snap plus a penalty on time, raised until a limit is reached",
    "peak": "best segment times for the spline, or the paper's Algorithm 1 (variant paper)",
    "joint": "durations and coefficients together: the fastest",
}
"""Name, which is also that of the module, and what it does in a line."""
DEFAULT_METHOD = "joint"
"""What plans where none is named."""
OTHER_STARTS: tuple[Literal["peak", "proportional"], ...] = ("peak", "proportional")
"""From where `joint` is begun again under limits on rotors, if its guess leads nowhere, to a flight
much slower than it promised, or to one that its yaw slows much."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Outcome:
    """What a method hands back; the planner certifies it."""

    status: Status
    trajectory: Trajectory
    """Feasible, unless the status is INFEASIBLE: then the best there was."""
    problem: Problem | None = None
    """The problem with what it left to the method filled in; None if it left nothing."""
    pieces: tuple[int, ...] | None = None
    """(legs,) segments in each leg; None for one each."""
    iterations: int = 0
    history: History | None = None
    memory: Any = None
    """What the method wants back when it plans a similar problem; see `Plan.memory`."""
    message: str = ""
    """Why there is no solution, or what stopped the method early."""


class Method(Protocol):
    """A module of this folder that answers problems."""

    Settings: type
    """Frozen, every field with a default."""

    def kernels(self, problem: Problem, settings: Any) -> str:
        """Which set of kernels answers a problem: another one has to be compiled first."""

    def solve(self, problem: Problem, settings: Any) -> Outcome:
        """Answer a problem."""


def require(name: str, value: float, low: float, high: float) -> None:
    """Check a setting.

    Raises
    ------
    InvalidProblem
        If it is not a number from `low` to `high`.
    """
    try:
        within = bool(low <= value <= high)
    except (TypeError, ValueError):
        within = False
    if not within:
        raise InvalidProblem(f"setting {name} is {value!r}; it must be from {low:g} to {high:g}")


def require_whole(name: str, value: int, low: int, high: int) -> None:
    """As `require`, for what is counted."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise InvalidProblem(f"setting {name} is {value!r}; it must be a whole number")
    require(name, value, low, high)


def spline_kernels(problem: Problem) -> str:
    """Which kernels solve the spline of a problem and look at its limits."""
    plain = problem.spline_class.is_classical and not problem.derivatives
    spline = "plain" if plain else "general"
    return f"{problem.spline_class.degree}-{spline}{limit_kernels(problem)}"


def limit_kernels(problem: Problem) -> str:
    """Which kernels look at the limits of a problem: those not set are left out of them."""
    leaning = "-leaning" if problem.limits.on_leaning else ""
    turning = "-turning" if problem.limits.on_turning else ""
    return leaning + turning + ("-rotors" if problem.limits.figures is not None else "")


def find(name: str) -> Method:
    """The module of a method.

    Raises
    ------
    InvalidProblem
        If there is no such method.
    """
    if name not in METHODS:
        raise InvalidProblem(f"unknown method {name!r}; known are {', '.join(METHODS)}")
    return import_module(f"peakflight.methods.{name}")
