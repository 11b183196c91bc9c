"""The fastest plan that a vehicle still tracks within an error."""

import time
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from peakflight.batch.processes import Processes, checked_workers
from peakflight.errors import InvalidProblem
from peakflight.flight.conditions import Conditions
from peakflight.flight.numbers import number, whole
from peakflight.flight.simulate import CONTROLLERS, FlySettings
from peakflight.flight.spread import Spread
from peakflight.limits import Limits
from peakflight.planner import tidied
from peakflight.problem import Problem
from peakflight.result import Plan
from peakflight.tuning.result import Point, TuneResult
from peakflight.tuning.search import Search, prepare_kernels, require_cmaes
from peakflight.tuning.settings import TuneSettings
from peakflight.tuning.space import FAMILIES, limits_at
from peakflight.tuning.trial import Trial, Trying
from peakflight.vehicles import VehicleLike, find_vehicle

ERROR = 0.15
"""m."""
BUDGET = 60.0
"""s."""
FINAL_SHARE = 0.12
"""Of the budget, kept for the finalists."""
NEARER = 0.985
"""Of the scale, by which the next finalist of the same proportions is slower."""
SLOWER_STEPS = 4
"""Finalists of the same proportions."""
MOST_ROBUST = 1000


def tune(
    problem: Problem | ArrayLike,
    *,
    vehicle: VehicleLike | None = None,
    error: float = ERROR,
    robust: int = 0,
    limits: Limits | None = None,
    controller: str = "firmware",
    spread: Spread | None = None,
    fly_settings: FlySettings | None = None,
    settings: TuneSettings | None = None,
    budget: float | None = BUDGET,
    executor: Executor | None = None,
    workers: int | None = None,
    on_trials: Callable[[int, float, float | None], object] | None = None,
    **options: Any,
) -> TuneResult:
    """Find the fastest plan that a vehicle tracks within an error, by flying it in simulation.

    Proportions of limits are chosen by a search, for several methods; the scale of each is raised
    until the flight crashes or is further off than the error. Every plan is certified against its
    limits, as always.

    Parameters
    ----------
    problem
        A `Problem`, whose limits do not matter; or waypoints (K+1, 3) in m, with options of
        `Problem` such as `yaw` beside them.
    vehicle
        What flies; by default that of the problem.
    error
        Largest RMS error, m.
    robust
        So many vehicles that differ (`spread`) have to track it, too: the worst of them counts.
    limits
        What no plan may exceed, whatever flies.
    controller
        What steers, one of `peakflight.flight.CONTROLLERS`.
    fly_settings
        How flights are simulated and judged.
    settings
        How widely to search.
    budget
        s, after which the best so far is returned; None for the search's own end. What has to be
        compiled first, once on a machine, does not count. The result is the same for a seed,
        whatever the workers, unless the budget ends it.
    executor
        Where plans are made and flown; it is not shut down. None for processes of this machine.
    workers
        How many, without an executor; None for as many as there are processors. With 1, all is done
        in this process.
    on_trials
        Called now and then with how many plans were tried, the part that is done and the shortest
        duration so far (None if nothing is tracked yet).

    Raises
    ------
    InvalidProblem
        If what is asked makes no sense.
    MissingExtra
        If the extra tune is not installed.
    """
    began = time.perf_counter()
    require_cmaes()
    settings = TuneSettings() if settings is None else settings
    error = number("error", error, 1e-6, 1e6, "m")
    robust = whole("robust", robust, 0, MOST_ROBUST)
    if budget is not None:
        budget = number("budget", budget, 0.0, 1e9, "s")
    if controller not in CONTROLLERS:
        raise InvalidProblem(
            f"unknown controller {controller!r}; known are {', '.join(CONTROLLERS)}"
        )
    asked = _problem(problem, vehicle, limits, options)
    body = find_vehicle(asked.vehicle)  # type: ignore[arg-type]
    differing = (Spread() if spread is None else spread).draw(Conditions(), robust, settings.seed)
    work = Trying(
        problem=asked,
        vehicle=body,
        controller=controller,
        fly_settings=FlySettings() if fly_settings is None else fly_settings,
        conditions=(Conditions(), *settings.doubts, *differing),
        error=error * (1.0 - settings.error_margin),
        precision=settings.precision,
        within=limits,
    )
    with ExitStack() as stack:
        if executor is None:
            count = checked_workers(workers)
            if count > 1:
                own = stack.enter_context(Processes(count))
                own.start()
                executor = own
        elif workers is not None:
            raise InvalidProblem("workers given beside an executor, which has its own")
        ready = prepare_kernels(work, executor)
        if ready:  # what is compiled once on a machine does not count
            began = time.perf_counter()
        deadline = np.inf if budget is None else began + budget
        search = Search(
            work=work,
            settings=settings,
            executor=executor,
            deadline=deadline if budget is None else deadline - FINAL_SHARE * budget,
            on_trials=on_trials or _ignore,
        )
        search.run()
    best = _best(search, settings, deadline)
    return TuneResult(
        plan=None if best is None else best[0],
        vehicle=body,
        error=error,
        rms_error=None if best is None else work.judge(best[0], (Conditions(),))[0],
        worst_error=None if best is None else best[1],
        stood_doubts=best is not None and best[3],
        options={} if best is None else best[2],
        front=_front(search),
        plans=len(search.trials),
        robust=robust,
        seconds=time.perf_counter() - began,
        complete=not search.cut,
        seed=settings.seed,
    )


def _problem(
    problem: Problem | ArrayLike,
    vehicle: VehicleLike | None,
    limits: Limits | None,
    options: dict[str, Any],
) -> Problem:
    """What is planned, with a vehicle; its limits are only a beginning."""
    if isinstance(problem, Problem):
        if options:
            raise InvalidProblem(f"{', '.join(options)} given beside a Problem, which has its own")
        vehicle = problem.vehicle if vehicle is None else vehicle
    if vehicle is None:
        raise InvalidProblem("no vehicle to fly; give vehicle=...")
    body = find_vehicle(vehicle)
    if isinstance(problem, Problem):
        return replace(
            problem,
            vehicle=body,
            limits=None,  # type: ignore[arg-type]
            degree=None,
            continuity=None,
        )
    for name in ("minimize", "degree", "continuity"):
        if name in options:
            raise InvalidProblem(f"{name} is what the tuner chooses")
    return tidied(problem, None, {**options, "vehicle": body})[0]


def _best(
    search: Search, settings: TuneSettings, deadline: float
) -> tuple[Plan, float, dict[str, Any], bool] | None:
    """The fastest plan that stands a close look, its worst error, options, and whether it does.

    Of each proportions the fastest is looked at, then slower ones. After the deadline, or if none
    stands it, it is the slowest that has stood the search.
    """
    work = search.work
    spread = settings.final_spread
    doubts = Spread(
        mass=spread, thrust=spread, inertia=spread, motor_lag=2.0 * spread, latency=0.0
    ).draw(Conditions(), settings.final_doubts, settings.seed + 1)
    conditions = (*work.conditions, *doubts)
    fastest: dict[tuple[int, tuple[float, ...]], Trial] = {}
    for one in search.trials:
        key = (one.family, one.point)
        if search.is_good(one) and (key not in fastest or one.duration < fastest[key].duration):
            fastest[key] = one
    chosen = sorted(fastest.values(), key=lambda one: one.duration)[: settings.finalists]
    tries = [(one, one.scale * NEARER**step) for one in chosen for step in range(SLOWER_STEPS)]
    planned: list[tuple[float, Trial, Plan]] = []
    for one, scale in tries:
        answer = work.plan(one.family, np.array(one.point), scale)
        if answer is not None:
            planned.append((answer.duration, one, answer))
    planned.sort(key=lambda entry: entry[0])
    spare: tuple[Plan, float, dict[str, Any], bool] | None = None
    for _, one, answer in planned:
        if spare is not None and time.perf_counter() > deadline:
            break
        options = {"method": answer.method, "minimize": FAMILIES[one.family].minimize}
        options |= FAMILIES[one.family].options_within(answer.problem.limits)
        worst, flew = work.judge(answer, conditions)
        if flew and worst <= work.error:
            return answer, worst, options, True
        plain, flew = work.judge(answer, work.conditions)
        if flew and plain <= work.error:
            spare = (answer, plain, options, False)  # the slowest so far: furthest from the border
    return spare


def _front(search: Search) -> list[Point]:
    """What is best in time or error, from the fastest on."""
    front: list[Point] = []
    flown = [one for one in search.trials if one.flew]
    for one in sorted(flown, key=lambda one: (one.duration, one.rms_error)):
        if not front or one.rms_error < front[-1].rms_error:
            limits = limits_at(
                search.work.vehicle, np.array(one.point), one.scale, search.work.within
            )
            front.append(
                Point(
                    duration=one.duration,
                    rms_error=one.rms_error,
                    family=FAMILIES[one.family].name,
                    limits=limits,
                )
            )
    return front


def _ignore(_: int, __: float, ___: float | None) -> None:
    pass
