"""The search: a scan of every family, then an evolution strategy in the best of them.

Each generation is asked for before any of it is flown, and told in order, so that the result does
not depend on how many workers there are.
"""

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from peakflight.batch.run import run
from peakflight.errors import MissingExtra
from peakflight.tuning.settings import TuneSettings
from peakflight.tuning.space import FAMILIES, HIGH, LOW
from peakflight.tuning.trial import Candidate, Trial, Trying

FIRST_SCALE = 0.75
"""Where the first candidates begin, relative to the reference: most of them fly there."""
BEGIN = 0.9
"""Of the scale at which the last ones ended, where the next begin: just below the border."""
FAILED = 1e3
"""Value of what never flies; logarithms of durations are far below."""

OnTrials = Callable[[int, float, float | None], object]
"""Called with how many plans were tried, the part that is done, and the shortest duration."""


@dataclass(eq=False)
class Search:
    """What has been tried."""

    work: Trying
    settings: TuneSettings
    executor: Executor | None
    """None for this process."""
    deadline: float
    """By `time.perf_counter`."""
    on_trials: OnTrials
    trials: list[Trial] = field(default_factory=list)
    cut: bool = False
    """Whether the deadline has ended it."""
    _done: int = 0
    _total: int = 1

    def run(self) -> None:
        """Scan, then refine."""
        settings = self.settings
        chosen = min(settings.families, len(FAMILIES))
        each = settings.generations * settings.population
        self._total = len(FAMILIES) * settings.scan + chosen * each
        points = _spread_points(settings.scan, settings.seed)
        candidates = [
            Candidate(family, tuple(point.tolist()), FIRST_SCALE)
            for point in points
            for family in range(len(FAMILIES))
        ]
        found = self.fly(candidates)
        best: dict[int, tuple[float, Candidate, float]] = {}
        for candidate, trials in zip(candidates, found, strict=True):
            value, scale = self.value(trials)
            if value < best.get(candidate.family, (FAILED,))[0]:
                best[candidate.family] = (value, candidate, scale)
        order = sorted(best, key=lambda family: best[family][0])[:chosen]
        strategies = [
            _Strategy(family, best[family][1], best[family][2], settings) for family in order
        ]
        for _ in range(settings.generations):
            if self.cut:
                break
            asked = [strategy.ask() for strategy in strategies]
            flat = [candidate for group in asked for candidate in group]
            found = self.fly(flat)
            if self.cut:
                break
            for strategy, group in zip(strategies, asked, strict=True):
                mine, found = found[: len(group)], found[len(group) :]
                strategy.tell(group, [self.value(trials) for trials in mine])

    def fly(self, candidates: Sequence[Candidate]) -> list[list[Trial]]:
        """Trials of each candidate; of those that time was up for, none."""
        found: list[list[Trial]] = [[] for _ in candidates]
        if time.perf_counter() >= self.deadline:
            self.cut = True
            return found
        workers = 1 if self.executor is None else None
        results = run(self.work, candidates, executor=self.executor, workers=workers, chunk=1)
        with closing(results):
            for one in results:
                if one.failure is not None:
                    raise RuntimeError(f"{one.failure.kind}: {one.failure.text}")
                found[one.index] = one.value or []
                self._done += 1
                self.trials += found[one.index]
                self._tell()
                if time.perf_counter() >= self.deadline:
                    self.cut = True
                    break
        return found

    def value(self, trials: Sequence[Trial]) -> tuple[float, float]:
        """What is minimised, and the scale where it is: the shortest flight that is tracked."""
        flown = [one for one in trials if self.is_good(one)]
        if not flown:
            return FAILED, FIRST_SCALE
        best = min(flown, key=lambda one: one.duration)
        return math.log(best.duration), best.scale

    def is_good(self, trial: Trial) -> bool:
        """Whether it is tracked."""
        return trial.flew and trial.rms_error <= self.work.error

    def _tell(self) -> None:
        flown = [one.duration for one in self.trials if self.is_good(one)]
        part = min(self._done / self._total, 1.0)
        self.on_trials(len(self.trials), part, min(flown) if flown else None)


class _Strategy:
    """CMA-ES (Hansen 2016) in one family, on the logarithm of the shortest tracked flight."""

    def __init__(self, family: int, begin: Candidate, scale: float, settings: TuneSettings) -> None:
        require_cmaes()
        from cmaes import CMA

        self._family = family
        self._scale = scale
        self._cma = CMA(
            mean=np.clip(begin.point, LOW, HIGH),
            sigma=settings.sigma,
            bounds=np.stack((LOW, HIGH), axis=1),
            seed=settings.seed,
            population_size=settings.population,
        )

    def ask(self) -> list[Candidate]:
        """Candidates of the next generation."""
        size = self._cma.population_size
        points = [tuple(self._cma.ask().tolist()) for _ in range(size)]
        return [Candidate(self._family, point, BEGIN * self._scale) for point in points]

    def tell(self, candidates: Sequence[Candidate], values: Sequence[tuple[float, float]]) -> None:
        """What became of them."""
        self._cma.tell(
            [
                (np.array(candidate.point), value)
                for candidate, (value, _) in zip(candidates, values, strict=True)
            ]
        )
        scales = [scale for value, scale in values if value < FAILED]
        if scales:
            self._scale = float(np.median(scales))


def prepare_kernels(work: Trying, executor: Executor | None) -> bool:
    """Have the kernels of every family compiled, each once; whether there was anything to do."""
    origin = tuple(np.zeros(len(LOW)).tolist())
    missing = [
        candidate
        for candidate in (Candidate(n, origin, FIRST_SCALE) for n in range(len(FAMILIES)))
        if work.first(candidate)
    ]
    if missing:
        workers = 1 if executor is None else None
        for _ in run(work, missing, executor=executor, workers=workers, chunk=1):
            pass
    return bool(missing)


def require_cmaes() -> Any:
    """Import the evolution strategy.

    Raises
    ------
    MissingExtra
        If it is not installed.
    """
    try:
        import cmaes
    except ImportError:
        raise MissingExtra("tuning needs the extra tune: pip install 'peakflight[tune]'") from None
    return cmaes


def _spread_points(count: int, seed: int) -> list[np.ndarray]:
    """Points that fill the middle of the space evenly: the origin, then Sobol's sequence."""
    from scipy.stats import qmc

    sampler = qmc.Sobol(len(LOW), seed=seed)
    drawn = sampler.random_base2(max(math.ceil(math.log2(max(count - 1, 1))), 1))
    middle = qmc.scale(drawn, 0.7 * LOW, 0.7 * HIGH)
    return [np.zeros(len(LOW)), *middle[: count - 1]]
