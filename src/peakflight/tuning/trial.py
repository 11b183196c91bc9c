"""One proportion of limits, planned and flown at scales up to the fastest that is still tracked."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from peakflight.errors import PeakflightError
from peakflight.flight.conditions import Conditions
from peakflight.flight.flight import root_mean_square
from peakflight.flight.simulate import FlySettings, prepare, run
from peakflight.kernels.flight import FLEW
from peakflight.limits import Limits
from peakflight.planner import plan
from peakflight.problem import Problem
from peakflight.result import Plan
from peakflight.tuning.space import FAMILIES, Family, limits_at
from peakflight.vehicle import Vehicle

UP = 1.1
"""Step of the scale while it still flies."""
DOWN = 1.2
"""Step while it does not."""
SLOWEST, FASTEST = 0.15, 4.0
"""Range of the scale."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """Proportions of limits of one family."""

    family: int
    point: tuple[float, ...]
    scale: float
    """Where to begin."""


class Trial(NamedTuple):
    """One plan, and how it flew."""

    family: int
    point: tuple[float, ...]
    scale: float
    duration: float
    """s."""
    rms_error: float
    """m, of the worst of the flights; of the one that ended it if that crashed."""
    flew: bool
    """Whether none of them crashed."""


@dataclass(frozen=True, eq=False)
class Trying:
    """The work of the tuner, for `peakflight.batch.run`: candidates in, trials out."""

    problem: Problem
    vehicle: Vehicle
    controller: str
    fly_settings: FlySettings
    conditions: tuple[Conditions, ...]
    """What a plan has to stand, the likeliest to end it first."""
    error: float
    """m."""
    precision: float
    within: Limits | None
    name = "tune"

    @property
    def settings(self) -> Mapping[str, Any]:
        """For a store, which the tuner has not."""
        return {"error": self.error}

    def perform(self, candidate: Candidate) -> dict[str, Any]:
        """Find the border of what flies, from below."""
        trials: list[Trial] = []

        def flies(scale: float) -> bool:
            trial = self.trial(candidate, scale)
            if trial is not None:
                trials.append(trial)
            return trial is not None and trial.flew and trial.rms_error <= self.error

        good, bad = 0.0, 0.0
        scale = candidate.scale
        while SLOWEST <= scale <= FASTEST and not (good and bad):
            if flies(scale):
                good, scale = scale, scale * UP
            else:
                bad, scale = scale, scale / DOWN
        while good and bad and bad / good > 1.0 + self.precision:
            middle = (good * bad) ** 0.5
            if flies(middle):
                good = middle
            else:
                bad = middle
        return {"trials": [trial._asdict() for trial in trials]}

    def value(self, candidate: Candidate, answer: dict[str, Any]) -> list[Trial]:
        """What was tried."""
        del candidate
        return [Trial(**one) for one in answer["trials"]]

    def first(self, candidate: Candidate) -> str:
        """The first of a family compiles for the others."""
        from peakflight import methods
        from peakflight.kernels import jit

        family = FAMILIES[candidate.family]
        module = methods.find(family.method)
        problem = self.problem_at(family, np.array(candidate.point), candidate.scale)
        name = module.kernels(problem, module.Settings(**family.options_within(problem.limits)))
        return "" if jit.is_ready(name) else name

    def trial(self, candidate: Candidate, scale: float) -> Trial | None:
        """Plan and fly at a scale; None if there is no plan."""
        answer = self.plan(candidate.family, np.array(candidate.point), scale)
        if answer is None:
            return None
        rms, flew = self.judge(answer, self.conditions)
        return Trial(candidate.family, candidate.point, scale, answer.duration, rms, flew)

    def plan(self, family: int, point: np.ndarray, scale: float) -> Plan | None:
        """The certified plan of a point, if there is one."""
        kind = FAMILIES[family]
        try:
            problem = self.problem_at(kind, point, scale)
            answer = plan(problem, method=kind.method, **kind.options_within(problem.limits))
        except PeakflightError:
            return None
        return answer if answer.feasible else None

    def problem_at(self, family: Family, point: np.ndarray, scale: float) -> Problem:
        """The problem with the limits of a point."""
        limits = limits_at(self.vehicle, point, scale, self.within)
        return replace(self.problem, limits=limits, minimize=family.minimize)

    def judge(self, answer: Plan, conditions: Sequence[Conditions]) -> tuple[float, bool]:
        """The worst RMS error, m, and whether all flew; the first that fails ends it."""
        task = prepare(
            answer,
            vehicle=self.vehicle,
            controller=self.controller,
            settings=self.fly_settings,
        )
        worst = 0.0
        for one in conditions:
            outcome = run(task, one)
            worst = max(worst, root_mean_square(task.errors(outcome)))
            if outcome.code != FLEW:
                return worst, False
            if worst > self.error:
                break
        return worst, True
