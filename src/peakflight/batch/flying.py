"""Many flights: every plan of a batch flown in simulation."""

from collections.abc import Generator, Iterable, Mapping
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any, Self

from peakflight.batch.run import Done, Failure, run
from peakflight.errors import InvalidProblem
from peakflight.files import PathLike
from peakflight.flight import CONTROLLERS, Conditions, Crash, Flight, FlySettings, fly
from peakflight.kernels import jit
from peakflight.result import Plan
from peakflight.vehicle import Vehicle
from peakflight.vehicles import VehicleLike, find_vehicle

KERNELS = "flight"
"""What the simulation calls its kernels."""


@dataclass(frozen=True, kw_only=True)
class FlightSummary:
    """What a flight comes to, without its samples."""

    rms_error: float
    """Root mean square of the distance from the plan while it lasts, m."""
    top_error: float
    """Largest such distance, m."""
    saturation_share: float
    """Part of the time that a rotor was asked for its least or most thrust, or for more."""
    crash: Crash | None
    """None if it flew to the end."""

    @property
    def flew(self) -> bool:
        """Whether it did not crash."""
        return self.crash is None

    @classmethod
    def of(cls, flight: Flight) -> Self:
        """Sum a flight up."""
        return cls(
            rms_error=flight.rms_error,
            top_error=flight.top_error,
            saturation_share=flight.saturation_share,
            crash=flight.crash,
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightResult:
    """What became of one plan of a batch: a flight, crashed or not, or a failure."""

    index: int
    """Of the plan in the batch, from 0."""
    plan: Plan
    summary: FlightSummary | None = None
    """None if the simulation ended in an error."""
    flight: Flight | None = None
    """With all samples, if they were asked for."""
    failure: Failure | None = None
    """Why there is no flight."""
    resumed: bool = False
    """It was in the store from an earlier run."""


def fly_many(
    plans: Iterable[Plan],
    *,
    vehicle: VehicleLike | None = None,
    controller: str = "geometric",
    conditions: Conditions | None = None,
    settings: FlySettings | None = None,
    samples: bool = False,
    executor: Executor | None = None,
    workers: int | None = None,
    chunk: int | None = None,
    store: PathLike | None = None,
) -> Generator[FlightResult, None, None]:
    """Fly many plans in simulation, on all processors or on a cluster.

    Results come as they are done, in any order; `index` says of which plan. Flights are those of
    `fly`, bit for bit.

    Parameters
    ----------
    plans
        What to fly.
    vehicle, controller, conditions, settings
        As of `fly`, for all flights alike.
    samples
        Whether to hand back every sample, a megabyte or more a flight in a store.
    executor, workers, chunk, store
        As of `plan_many`.

    Raises
    ------
    InvalidProblem
        At once, if an argument is against a rule, or an entry is not a `Plan`.
    InvalidFile, ExecutorFailed
        As `plan_many`.
    """
    if controller not in CONTROLLERS:
        raise InvalidProblem(
            f"unknown controller {controller!r}; known are {', '.join(CONTROLLERS)}"
        )
    plans = list(plans)
    for index, plan in enumerate(plans):
        if not isinstance(plan, Plan):
            raise InvalidProblem(
                f"plan {index} is of type {type(plan).__name__}; it must be a peakflight.Plan"
            )
    work = Flying(
        vehicle=None if vehicle is None else find_vehicle(vehicle),
        controller=controller,
        conditions=Conditions() if conditions is None else conditions,
        tuning=FlySettings() if settings is None else settings,
        samples=samples,
    )
    light = [replace(plan, memory=None, history=None) for plan in plans]
    done = run(work, light, executor=executor, workers=workers, chunk=chunk, store=store)
    return _results(plans, done)


@dataclass(frozen=True, eq=False, kw_only=True)
class Flying:
    """The work of `fly_many`."""

    vehicle: Vehicle | None
    controller: str
    conditions: Conditions
    tuning: FlySettings
    samples: bool
    name = "fly"

    @property
    def settings(self) -> Mapping[str, Any]:
        """What flies, how, and in which world."""
        return {
            "vehicle": self.vehicle,
            "controller": self.controller,
            "conditions": self.conditions,
            "settings": self.tuning,
            "samples": self.samples,
        }

    def perform(self, plan: Plan) -> dict[str, Any]:
        """Fly it."""
        flight = fly(
            plan,
            vehicle=self.vehicle,
            controller=self.controller,
            conditions=self.conditions,
            settings=self.tuning,
        )
        if self.samples:
            return {"flight": flight.to_dict()}
        crash = flight.crash
        return {
            "rms_error": flight.rms_error,
            "top_error": flight.top_error,
            "saturation_share": flight.saturation_share,
            "crash": None if crash is None else {"cause": crash.cause, "time": crash.time},
        }

    def value(self, plan: Plan, answer: dict[str, Any]) -> FlightSummary | Flight:
        """The whole flight, or what it comes to."""
        del plan
        if "flight" in answer:
            return Flight.from_dict(answer["flight"])
        crash = answer["crash"]
        return FlightSummary(**{**answer, "crash": None if crash is None else Crash(**crash)})

    def first(self, plan: Plan) -> str:
        """The kernels of the simulation, if they have to be compiled."""
        del plan
        return "" if jit.is_ready(KERNELS) else KERNELS


def _results(
    plans: list[Plan], done: Generator[Done[Plan, FlightSummary | Flight], None, None]
) -> Generator[FlightResult, None, None]:
    with closing(done):
        for one in done:
            flight = one.value if isinstance(one.value, Flight) else None
            yield FlightResult(
                index=one.index,
                plan=plans[one.index],
                summary=FlightSummary.of(flight) if flight else one.value,  # type: ignore[arg-type]
                flight=flight,
                failure=one.failure,
                resumed=one.resumed,
            )
