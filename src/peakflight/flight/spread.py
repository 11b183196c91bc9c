"""How often a plan is flown within an error when vehicles are not all alike."""

import math
import os
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, fields
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from peakflight.flight.conditions import LEAST_SCALE, LONGEST_LATENCY, MOST_SCALE, Conditions
from peakflight.flight.flight import root_mean_square
from peakflight.flight.numbers import number, whole
from peakflight.flight.simulate import FlySettings, Task, prepare, run
from peakflight.result import Plan
from peakflight.trajectory import Trajectory
from peakflight.vehicles import VehicleLike

ERROR = 0.15
"""RMS error that counts as flown, m."""
MOST_FLIGHTS = 1_000_000
CONFIDENCE = 1.959963984540054
"""Standard deviations of a normal distribution that hold 95 %."""


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Standard deviations of what differs from vehicle to vehicle, relative to the vehicle's.

    Scales are log-normal around those of the conditions, so that none is negative; latency is
    that of the conditions plus the magnitude of a normal distribution. Defaults are what the
    sources of the presets differ by from each other (`docs/flight.md`).
    """

    mass: float = 0.03
    thrust: float = 0.05
    inertia: float = 0.10
    motor_lag: float = 0.20
    latency: float = 0.005
    """s."""

    def __post_init__(self) -> None:
        for one in fields(self):
            most = LONGEST_LATENCY if one.name == "latency" else 1.0
            value = number(f"spread of {one.name}", getattr(self, one.name), 0.0, most)
            object.__setattr__(self, one.name, value)

    def draw(self, base: Conditions, count: int, seed: int) -> list[Conditions]:
        """Conditions of some vehicles; the first ones are the same whatever the count."""
        random = np.random.default_rng(seed).standard_normal((count, len(fields(self))))
        drawn = []
        for i, row in enumerate(random.tolist()):
            values = base.to_dict() | {"seed": (base.seed + i) % 2**63}
            for name, turn in zip(("mass", "thrust", "inertia", "motor_lag"), row, strict=False):
                scale = values[f"{name}_scale"] * math.exp(getattr(self, name) * turn)
                values[f"{name}_scale"] = min(max(scale, LEAST_SCALE), MOST_SCALE)
            latency = base.latency + self.latency * abs(row[-1])
            drawn.append(Conditions.from_dict(values | {"latency": min(latency, LONGEST_LATENCY)}))
        return drawn


class SpreadFlight(NamedTuple):
    """One flight of many."""

    conditions: Conditions
    rms_error: float
    """m, up to the crash if there was one."""
    top_error: float
    """m."""
    saturation_share: float
    crash: str | None
    """Its cause."""
    flown: float
    """s, to the end of the plan or the crash."""


@dataclass(frozen=True, kw_only=True)
class SpreadResult:
    """Flights of one plan by vehicles that differ."""

    flights: tuple[SpreadFlight, ...]
    """In the order of their draws."""
    error: float
    """RMS error that counts as flown, m."""
    spread: Spread

    @cached_property
    def successes(self) -> int:
        """Flights without a crash and within the error."""
        return sum(self._succeeded(one) for one in self.flights)

    @property
    def share(self) -> float:
        """Part of the flights within the error."""
        return self.successes / len(self.flights)

    @property
    def interval(self) -> tuple[float, float]:
        """Interval that holds the true share with a confidence of 95 %: Wilson's, 1927."""
        n, z, p = len(self.flights), CONFIDENCE, self.share
        centre = p + z * z / (2.0 * n)
        half = z * math.sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n))
        scale = 1.0 + z * z / n
        return max((centre - half) / scale, 0.0), min((centre + half) / scale, 1.0)

    @property
    def rms_errors(self) -> np.ndarray:
        """RMS errors of the flights that did not crash, m, rising."""
        return np.sort([one.rms_error for one in self.flights if one.crash is None])

    @property
    def crashes(self) -> dict[str, int]:
        """Cause of a crash to how many there were, the most frequent first."""
        causes = [one.crash for one in self.flights if one.crash is not None]
        return {
            cause: causes.count(cause)
            for cause in sorted(set(causes), key=lambda c: -causes.count(c))
        }

    def worst(self, count: int = 3) -> list[SpreadFlight]:
        """The worst flights: crashes, the earliest first, then the largest errors."""
        return sorted(
            self.flights,
            key=lambda one: (one.crash is None, one.flown if one.crash else -one.rms_error),
        )[:count]

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names."""
        rms = self.rms_errors
        quantiles = {f"{q:g}": float(np.quantile(rms, q)) for q in QUANTILES} if len(rms) else {}
        return {
            "flights": len(self.flights),
            "error": self.error,
            "within": self.successes,
            "share": self.share,
            "interval": list(self.interval),
            "crashes": self.crashes,
            "rms_quantiles": quantiles,
            "spread": {one.name: getattr(self.spread, one.name) for one in fields(self.spread)},
            "worst": [
                {**one._asdict(), "conditions": one.conditions.to_dict()} for one in self.worst()
            ],
        }

    def _succeeded(self, one: SpreadFlight) -> bool:
        return one.crash is None and one.rms_error <= self.error


QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


def fly_spread(
    plan: Plan | Trajectory,
    *,
    vehicle: VehicleLike | None = None,
    controller: str = "geometric",
    conditions: Conditions | None = None,
    settings: FlySettings | None = None,
    flights: int = 200,
    spread: Spread | None = None,
    error: float = ERROR,
    executor: Executor | None = None,
    on_flight: Callable[[int], object] | None = None,
) -> SpreadResult:
    """Fly a plan with many vehicles that differ, and count how often it stays within an error.

    Parameters
    ----------
    plan, vehicle, controller, settings
        As `fly` takes them.
    conditions
        What all flights share; its seed is that of the draws too.
    flights
        How many.
    spread
        How much vehicles differ.
    error
        RMS error that counts as flown, m.
    executor
        Where flights run, in this process or others; by default threads, one a processor. The
        result does not depend on it.
    on_flight
        Called with the number of flights that are done, after each.

    Raises
    ------
    InvalidProblem
        As `fly`, or if a number is out of its range.
    """
    flights = whole("flights", flights, 1, MOST_FLIGHTS)
    error = number("error", error, 1e-6, 1e6, "m")
    task = prepare(plan, vehicle=vehicle, controller=controller, settings=settings)
    spread = Spread() if spread is None else spread
    base = Conditions() if conditions is None else conditions
    drawn = spread.draw(base, flights, base.seed)
    found = []
    own = ThreadPoolExecutor(os.cpu_count()) if executor is None else None
    try:
        for one in (own or executor).map(partial(_summary, task), drawn):  # type: ignore[union-attr]
            found.append(one)
            if on_flight is not None:
                on_flight(len(found))
    finally:
        if own is not None:
            own.shutdown(cancel_futures=True)
    return SpreadResult(flights=tuple(found), error=error, spread=spread)


def _summary(task: Task, conditions: Conditions) -> SpreadFlight:
    """Fly once, and keep what a summary needs."""
    outcome = run(task, conditions)
    errors = task.errors(outcome)
    count = len(outcome.states)
    crash = task.crash(outcome)
    return SpreadFlight(
        conditions=conditions,
        rms_error=root_mean_square(errors),
        top_error=float(errors.max()),
        saturation_share=outcome.saturated / count,
        crash=None if crash is None else crash.cause,
        flown=float(task.rehearsal.times[count - 1]),
    )
