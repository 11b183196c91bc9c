"""The paper's experiment in simulation: its six flights, and what its motion capture would see.

What the paper prints of its flights stands here as printed, to be put beside what comes out.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from peakflight.editing import slow
from peakflight.flight import Flight, FlightAnalysis, FlySettings, analyse, fly
from peakflight.flight.differences import RATE, Samples, differentiate, sample_positions
from peakflight.paper import (
    GUESS,
    MELLINGER,
    PEAK,
    Beside,
    Pair,
    PaperComparison,
    Reproduction,
    as_csv,
)
from peakflight.result import Plan
from peakflight.vehicle import Vehicle
from peakflight.vehicles import VehicleLike, find_vehicle

DEFAULT_VEHICLE = "crazyflie-2.1-upgrade"
"""The Crazyflie 2.1 whose model has the 15.5 m/s^2 of thrust that the paper's limits ask for; the
stock one has less."""
CONTROLLER = "firmware"
SETTINGS = FlySettings(hold=2.0)
"""Hovering at the end for long enough that the vehicle comes to rest."""
AT_REST = 0.1
"""m/s: what moves slower counts as standing still. That is above the swaying of a hovering vehicle
and below any speed that a flight passes a waypoint with."""


class PrintedFlight(NamedTuple):
    """What the paper prints of a flight."""

    duration: float
    """Time taken to complete the trajectory, s: Table `finaltime`."""
    rms_error: float
    """m."""


PRINTED_FLIGHTS: Mapping[str, Mapping[str, PrintedFlight]] = {
    "jerk": {
        GUESS: PrintedFlight(7.54, 0.079),
        MELLINGER: PrintedFlight(6.32, 0.114),
        PEAK: PrintedFlight(4.50, 0.102),
    },
    "snap": {
        GUESS: PrintedFlight(8.13, 0.122),
        MELLINGER: PrintedFlight(6.16, 0.117),
        PEAK: PrintedFlight(4.92, 0.090),
    },
}
"""Name of the comparison and of the method to the flight."""
PRINTED_REDUCTIONS: Mapping[str, Mapping[Pair, float]] = {
    "jerk": {(PEAK, GUESS): 40.0, (PEAK, MELLINGER): 29.0},
    "snap": {(PEAK, GUESS): 39.0, (PEAK, MELLINGER): 20.0},
}
"""Of the time taken, percent."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Flown:
    """A plan, its flight, and the flight as motion capture would see it."""

    plan: Plan
    flight: Flight
    samples: Samples
    """Positions at 100 Hz, up to the end of the hovering or to the crash."""
    analysis: FlightAnalysis | None
    """Of the samples, the beginning of the plan known; None if it crashed before the second."""

    @property
    def rms_error(self) -> float | None:
        """Root mean square of the distance from the plan, m; None if it crashed."""
        return self.analysis.rms_error if self.flight.flew and self.analysis else None

    @property
    def top_error(self) -> float | None:
        """Largest distance from the plan, m; None if it crashed."""
        return self.analysis.top_error if self.flight.flew and self.analysis else None

    @property
    def rest_time(self) -> float | None:
        """From when on it stands still by the samples, s after the beginning of the plan.

        None if it crashed, or moves still when the hovering ends.
        """
        velocity = differentiate(self.samples, RATE, 1)[0]
        moving = np.flatnonzero(np.linalg.norm(velocity.values, axis=1) > AT_REST)
        if not self.flight.flew or len(moving) == 0 or moving[-1] + 1 == len(velocity.times):
            return None
        return float(velocity.times[moving[-1] + 1])

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names; without the samples."""
        crash = self.flight.crash
        return {
            "plan_duration": self.plan.duration,
            "rest_time": self.rest_time,
            "rms_error": self.rms_error,
            "top_error": self.top_error,
            "crash": None if crash is None else {"cause": crash.cause, "time": crash.time},
            "saturation_share": self.flight.saturation_share,
            "analysis": None if self.analysis is None else self.analysis.to_dict(),
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class PaperFlight:
    """One of the paper's flights, and ours; None where a method has no certified plan."""

    printed: PrintedFlight
    slowdown: float
    """How much longer the paper's flight took than its plan, as a factor."""
    flown: Flown | None
    slowed: Flown | None
    """The same plan, slower by `slowdown`."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlownComparison:
    """The paper's three methods as flown."""

    comparison: PaperComparison
    flights: Mapping[str, PaperFlight]
    """By name of the method."""

    @property
    def flown(self) -> dict[str, Flown]:
        """Name of the method to its flight, where it has a plan to fly."""
        return {name: one.flown for name, one in self.flights.items() if one.flown is not None}

    @property
    def any_flew(self) -> bool:
        """Whether some flight came to its end."""
        return any(one.flight.flew for one in self.flown.values())

    def reduction(self, name: str, other: str) -> float | None:
        """By how much the time until it stands still is below another's, percent."""
        flown = self.flown
        if name not in flown or other not in flown:
            return None
        one, than = flown[name].rest_time, flown[other].rest_time
        return None if one is None or than is None else 100.0 * (1.0 - one / than)

    @property
    def beside_paper(self) -> tuple[Beside, ...]:
        """Every figure that the paper prints of these flights, with ours."""
        figures = []
        for name, one in self.flights.items():
            ours = one.flown.rest_time if one.flown else None
            figures.append(Beside(f"time taken, {name}", "s", one.printed.duration, ours))
        for name, one in self.flights.items():
            error = one.flown.rms_error if one.flown else None
            figures.append(Beside(f"RMS error, {name}", "m", one.printed.rms_error, error))
        for (name, other), value in PRINTED_REDUCTIONS[self.comparison.printed.name].items():
            quantity = f"reduction of the time taken, {name} against {other}"
            figures.append(Beside(quantity, "%", value, self.reduction(name, other)))
        return tuple(figures)


@dataclass(frozen=True, eq=False, kw_only=True)
class Experiment:
    """All six flights."""

    vehicle: Vehicle
    comparisons: tuple[FlownComparison, ...]
    """For jerk and for snap."""

    @property
    def flights(self) -> Iterator[tuple[FlownComparison, str, PaperFlight]]:
        """Each of the six with its comparison and its method."""
        for one in self.comparisons:
            for name, flight in one.flights.items():
                yield one, name, flight

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names."""
        return {
            "vehicle": self.vehicle.name,
            "controller": CONTROLLER,
            "rate": RATE,
            "comparisons": [_as_dict(one) for one in self.comparisons],
        }


def fly_paper(
    result: Reproduction,
    vehicle: VehicleLike = DEFAULT_VEHICLE,
    *,
    on_stage: Callable[[str], None] | None = None,
) -> Experiment:
    """Fly the plans of the paper's three methods, for jerk and for snap.

    Parameters
    ----------
    result
        Of `peakflight.paper.reproduce`.
    vehicle
        What flies, under a controller after the Crazyflie's firmware.
    on_stage
        Told what begins.

    Raises
    ------
    InvalidProblem
        If the vehicle is unknown.
    """
    chosen = find_vehicle(vehicle)
    comparisons = []
    for one in result.comparisons:
        flights = {}
        for name, printed in PRINTED_FLIGHTS[one.printed.name].items():
            if on_stage is not None:
                on_stage(f"{one.printed.title.lower()}: flying {name}")
            plan, slowdown = one.plans.get(name), printed.duration / one.printed.durations[name]
            flights[name] = PaperFlight(
                printed=printed,
                slowdown=slowdown,
                flown=None if plan is None else _fly(plan, chosen),
                slowed=None if plan is None else _fly(slow(plan, 1.0 / slowdown), chosen),
            )
        comparisons.append(FlownComparison(comparison=one, flights=flights))
    return Experiment(vehicle=chosen, comparisons=tuple(comparisons))


def experiment_csv(experiment: Experiment) -> str:
    """A line for each flight."""
    kinds = ("speed", "thrust_acceleration", "jerk", "snap")
    lines = []
    for one, name, flight in experiment.flights:
        comparison = one.comparison.printed
        cells = {
            "comparison": comparison.name,
            "method": name,
            "paper's plan [s]": comparison.durations[name],
            "paper's flight [s]": flight.printed.duration,
            "paper's RMS error [m]": flight.printed.rms_error,
        }
        for prefix, flown in (("", flight.flown), ("slowed ", flight.slowed)):
            crash = flown.flight.crash if flown else None
            peaks = flown.analysis.peaks if flown and flown.analysis else {}
            cells |= {
                f"{prefix}plan [s]": flown.plan.duration if flown else None,
                f"{prefix}at rest [s]": flown.rest_time if flown else None,
                f"{prefix}RMS error [m]": flown.rms_error if flown else None,
                f"{prefix}top error [m]": flown.top_error if flown else None,
                f"{prefix}saturated": flown.flight.saturation_share if flown else None,
                f"{prefix}crash": crash.cause if crash else None,
                f"{prefix}crash [s]": crash.time if crash else None,
                **{f"{prefix}{kind}": peaks[kind].flown if peaks else None for kind in kinds},
            }
        lines.append(cells)
    return as_csv(lines[0], (line.values() for line in lines))


def positions_csv(experiment: Experiment) -> str:
    """A line for each sample of each flight while its plan lasts."""

    def lines() -> Iterator[tuple[Any, ...]]:
        for one in experiment.comparisons:
            for name, flown in one.flown.items():
                seen = flown.analysis
                if seen is None:
                    continue
                for time, place, planned, error in zip(
                    seen.times, seen.positions, seen.planned, seen.errors, strict=True
                ):
                    figures = (f"{value:.9g}" for value in (time, *place, *planned, error))
                    yield (one.comparison.printed.name, name, *figures)

    planned = (f"planned_{axis} [m]" for axis in "xyz")
    flown = (f"{axis} [m]" for axis in "xyz")
    return as_csv(("comparison", "method", "t [s]", *flown, *planned, "error [m]"), lines())


def _fly(plan: Plan, vehicle: Vehicle) -> Flown:
    flight = fly(plan, vehicle=vehicle, controller=CONTROLLER, settings=SETTINGS)
    samples = sample_positions(flight.times, flight.position)
    seen = analyse(*samples, plan, start=0.0) if len(samples.times) > 1 else None
    return Flown(plan=plan, flight=flight, samples=samples, analysis=seen)


def _as_dict(one: FlownComparison) -> dict[str, Any]:
    flights = {}
    for name, flight in one.flights.items():
        flights[name] = {
            "paper_duration": flight.printed.duration,
            "paper_rms_error": flight.printed.rms_error,
            "slowdown": flight.slowdown,
            "flown": None if flight.flown is None else flight.flown.to_dict(),
            "slowed": None if flight.slowed is None else flight.slowed.to_dict(),
        }
    return {
        "name": one.comparison.printed.name,
        "flights": flights,
        "beside_paper": [figure._asdict() for figure in one.beside_paper],
    }
