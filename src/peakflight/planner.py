"""From a problem to a certified plan: tidy, solve, certify."""

import logging
import time
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from peakflight import methods
from peakflight.course import Course, tidy
from peakflight.errors import InvalidProblem, Status
from peakflight.kernels import jit
from peakflight.limits import Limits, keeps, limited_values
from peakflight.problem import Problem
from peakflight.result import PLAIN, Plan
from peakflight.steering import Steered, steered
from peakflight.version import __version__
from peakflight.yaw import as_heading

_log = logging.getLogger("peakflight")

RESERVES = 3
"""Most times that a problem is solved again with less of the rotors' range."""
OFF = 3e-4
"""Part of what hovering leaves of the rotors' range that a free nose is off by at most: that of
`yaw_motion.CLOSE`."""
EASED = 1.1
"""Thrust that is set aside then, over what was lacking."""
ENOUGH = 1.003
"""A flight that the yaw makes longer by less than this factor is not solved again."""
SLOWED = 1.02
"""One that is in the end longer by more than this factor than it was without a yaw is looked for
from other starts too."""
BEGUN = "a plan"
"""What a plan says of a setting that was another plan."""


def plan(
    problem: Problem | ArrayLike,
    *,
    method: str = methods.DEFAULT_METHOD,
    settings: Any = None,
    limits: Limits | None = None,
    **options: Any,
) -> Plan:
    """Plan a trajectory and prove that it keeps the limits.

    Parameters
    ----------
    problem
        A `Problem`; or waypoints (K+1, 3) in m, with `limits`, `vehicle` or both and any of the
        other options of `Problem` beside them. Waypoints closer than 1 mm are then merged, and the
        plan says so.
    method
        One of `peakflight.methods.METHODS`.
    limits
        What to keep. Beside a vehicle, only what shall differ from its default limits.
    settings
        The `Settings` of the method's module; None for its defaults.
    options
        Options of `Problem` beside waypoints, and any field of the settings, such as `pieces`,
        `time_limit` or `effort` of method joint.

    Returns
    -------
    A plan whose `report` is certified from the coefficients, whatever the status.

    Raises
    ------
    InvalidProblem
        If what is asked makes no sense; the message names index, value and rule.
    """
    began = time.perf_counter()
    module = methods.find(method)
    tuning = {}
    if options:
        tuning = {name: options.pop(name) for name in _fields(module.Settings) & set(options)}
    notes: tuple[str, ...] = ()
    if not isinstance(problem, Problem):
        problem, notes = tidied(problem, limits, options)
    elif limits is not None or options:
        given = ", ".join(["limits"] * (limits is not None) + list(options))
        if _fields(Problem).issuperset(options):
            raise InvalidProblem(f"{given} given beside a Problem, which has its own")
        raise InvalidProblem(f"unknown option {min(set(options) - _fields(Problem))!r}")
    if settings is None:
        settings = module.Settings(**tuning)
    elif not isinstance(settings, module.Settings):
        raise InvalidProblem(
            f"settings is {settings!r}; method {method} takes its own Settings "
            f"(peakflight.methods.{method}.Settings)"
        )
    elif tuning:
        settings = replace(settings, **tuning)  # type: ignore[type-var]
    with jit.announced(module.kernels(problem, settings), _log):
        impossible = _contradiction(problem)
        outcome, flight = _answered(method, problem, settings)
        problem = outcome.problem or problem
        pieces = outcome.pieces or (1,) * (len(problem.waypoints) - 1)
    report = flight.report
    status = Status.INFEASIBLE if flight.too_fast else outcome.status
    if not report.feasible and status is not Status.INFEASIBLE:
        status = Status.NUMERICAL
    lines = [*notes, impossible or outcome.message, flight.note, *report.problems]
    return Plan(
        problem=problem,
        method=method,
        status=status,
        trajectory=flight.trajectory,
        report=report,
        pieces=pieces,
        iterations=outcome.iterations,
        wall_time_s=time.perf_counter() - began,
        settings=_chosen(settings),
        message="; ".join(line for line in lines if line),
        history=outcome.history,
        yaw_motion=flight.yaw,
        yaw_deviation=flight.deviation,
        version=__version__,
        memory=outcome.memory,
    )


def replan(
    last: Plan,
    *,
    waypoints: ArrayLike | None = None,
    limits: Limits | None = None,
    **options: Any,
) -> Plan:
    """Plan again after something has changed, from the last plan.

    Method joint then begins from the last trajectory and keeps its pieces, which takes a fraction
    of the time; every other method, and a course with more or fewer waypoints, begins anew.

    Parameters
    ----------
    last
        The last plan.
    waypoints, limits
        What has changed. If the problem has a vehicle, limits that are not set stay as they were;
        another `vehicle` brings its own.
    options
        Further options of `Problem`, or fields of the settings of the plan's method.

    Raises
    ------
    InvalidProblem
        As `plan`.
    """
    changes = {name: options.pop(name) for name in _fields(Problem) & set(options)}
    if waypoints is not None:
        changes["waypoints"] = waypoints
    if limits is not None or "vehicle" in changes:
        changes["limits"] = limits
    if "initial" in _fields(methods.find(last.method).Settings):
        options.setdefault("initial", last)
        if len(set(last.pieces)) == 1 and "max_pieces" not in options:
            options.setdefault("pieces", last.pieces[0])
    return plan(replace(last.problem, **changes), method=last.method, **options)


_Answer = tuple[methods.Outcome, Steered]


def _answered(method: str, problem: Problem, settings: Any) -> _Answer:
    """Solve a problem and add its yaw; where the yaw slows it much, from other starts too.

    A flight past free fall may ask for more turning about its thrust than any rotors have, and
    another flight, as fast, for none. A time limit is for all of it.
    """
    began = time.perf_counter()
    limit = getattr(settings, "time_limit", None)
    answers: list[_Answer] = []
    for one in (settings, *_others(problem, settings)):
        if answers and limit is not None:
            rest = limit - (time.perf_counter() - began)
            if rest <= 0.0:
                break
            one = replace(one, time_limit=rest)  # noqa: PLW2901
        answer, promised = _reserving(method, problem, one)
        answers.append(answer)
        if answer[1].report.feasible and answer[1].trajectory.duration <= SLOWED * promised:
            break
    return _fastest(answers)


def _others(problem: Problem, settings: Any) -> list[Any]:
    """Settings under which a method may find another flight, if it has such."""
    is_free = getattr(settings, "initial", None) == "guess"
    if not (is_free and problem.limits.rotor_rooms and problem.is_at_rest):
        return []
    return [replace(settings, initial=start) for start in methods.OTHER_STARTS]


def _reserving(method: str, problem: Problem, settings: Any) -> tuple[_Answer, float]:
    """Solve a problem and add its yaw; and how long the flight was before it had one, s.

    What turning about z takes of the rotors, the method does not know. Where they lack it, the
    problem is solved again within so much less of their range, from where it was if the method can
    begin there, the last time anew, and the fastest flight is taken.
    """
    module = methods.find(method)
    began = time.perf_counter()
    narrow, limit = _spared(problem), getattr(settings, "time_limit", None)
    outcome = module.solve(narrow, settings)
    promised = outcome.trajectory.duration
    answers = [_with_yaw(problem, outcome)]
    for left in range(RESERVES - 1, -1, -1):
        lacking = answers[-1][1].lacking
        longer = answers[-1][1].trajectory.duration / outcome.trajectory.duration
        if not lacking or (answers[-1][1].report.feasible and longer < ENOUGH):
            break
        spared = {name: EASED * demand for name, demand in lacking.items()}
        narrow = replace(narrow, limits=narrow.limits.sparing(spared))
        if limit is not None:
            rest = limit - (time.perf_counter() - began)
            if rest <= 0.0:
                break
            settings = replace(settings, time_limit=rest)
        begin = _going_on(method, problem, settings, answers[-1]) if left else settings
        outcome = module.solve(narrow, begin)
        answers.append(_with_yaw(problem, outcome))
    return _fastest(answers), promised


def _fastest(answers: list[_Answer]) -> _Answer:
    """The fastest flight, of the feasible ones if there are any, after what they all took."""
    if len(answers) == 1:
        return answers[0]
    outcome, flight = min(
        answers,
        key=lambda answer: (not answer[1].report.feasible, answer[1].trajectory.duration),
    )
    spent = sum(one.iterations for one, _ in answers)
    return replace(outcome, iterations=spent), flight


def _spared(problem: Problem) -> Problem:
    """The problem with what a free nose is off by kept free of the rotors' range.

    A flight at its limits would exceed them by that, and may be all that is feasible far around: a
    slower one passes nearer to free fall.
    """
    rooms, heading = problem.limits.rotor_rooms, problem.heading
    if not rooms or heading is None or heading.policy != "free" or not problem.is_at_rest:
        return problem
    off = OFF * min(rooms.values())
    return replace(problem, limits=problem.limits.sparing(dict.fromkeys(rooms, off)))


def _going_on(
    method: str, problem: Problem, settings: Any, answer: tuple[methods.Outcome, Steered]
) -> Any:
    """Settings with which a method begins where it has ended, if it can."""
    outcome, flight = answer
    if "initial" not in _fields(type(settings)) or outcome.status is Status.INFEASIBLE:
        return settings
    ended = Plan(
        problem=outcome.problem or problem,
        method=method,
        status=outcome.status,
        trajectory=outcome.trajectory,
        report=flight.report,
        pieces=outcome.pieces or (1,) * (len(problem.waypoints) - 1),
        iterations=outcome.iterations,
        wall_time_s=0.0,
        memory=outcome.memory,
    )
    return replace(settings, initial=ended)


def _with_yaw(problem: Problem, outcome: methods.Outcome) -> tuple[methods.Outcome, Steered]:
    """A flight with its yaw, under the limits of the problem that it answers."""
    if outcome.problem is not None and outcome.problem.limits != problem.limits:
        whole = replace(outcome.problem, limits=problem.limits)
        outcome = replace(outcome, problem=whole)
    answered = outcome.problem or problem
    pieces = outcome.pieces or (1,) * (len(answered.waypoints) - 1)
    return outcome, steered(answered, outcome.trajectory, pieces)


def _chosen(settings: Any) -> dict[str, Any]:
    """What differs from the defaults, as far as a file can hold it."""
    values = {
        one.name: (_plain(getattr(settings, one.name)), one.default) for one in fields(settings)
    }
    return {
        name: value
        for name, (value, default) in values.items()
        if isinstance(value, PLAIN) and value != default
    }


def _plain(value: Any) -> Any:
    """A setting as a file can hold it: numbers of numpy as Python's; of a plan, that it is one."""
    if isinstance(value, Plan):
        return BEGUN
    return value.item() if isinstance(value, np.generic) else value


def _fields(kind: Any) -> set[str]:
    return set(kind.__dataclass_fields__)


def tidied(
    waypoints: ArrayLike, limits: Limits | None, options: dict[str, Any]
) -> tuple[Problem, tuple[str, ...]]:
    """The problem of waypoints with options of `Problem`, those nearly alike merged; notes on it.

    Raises
    ------
    InvalidProblem
        If an option is unknown or against a rule.
    """
    yaw = options.pop("yaw", None)
    heading = None if yaw is None else as_heading(yaw)
    asked = yaw if heading is None else heading.angles
    course, notes = tidy(Course(waypoints, yaw=asked))  # type: ignore[arg-type]
    yaw = course.yaw if heading is None else heading.with_angles(course.yaw)
    if notes and options.get("derivatives"):
        raise InvalidProblem(
            f"{notes[0]}, but derivatives name waypoints by number; merge first (peakflight.tidy)"
        )
    unknown = set(options) - _fields(Problem)
    if unknown:
        raise InvalidProblem(f"unknown option {min(unknown)!r}")
    return Problem(course.waypoints, limits=limits, yaw=yaw, **options), notes  # type: ignore[arg-type]


def _contradiction(problem: Problem) -> str:
    """Which fixed motion exceeds a limit by itself, in words; empty if none does."""
    if problem.is_at_rest:
        return ""
    for index, state in problem.fixed.items():
        known = np.isfinite(state).all(axis=1)
        complete = state[: len(state) if known.all() else int(known.argmin())]
        for name, value in limited_values(list(complete), problem.limits.airframe).items():
            limit = getattr(problem.limits, name)
            if limit is not None and not keeps(name, float(value), limit):
                return (
                    f"the motion fixed at waypoint {index} has {name} = {value:g} against a limit "
                    f"of {limit:g}"
                )
    return ""
