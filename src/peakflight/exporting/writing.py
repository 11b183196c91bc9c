"""Writing a flight file, reading it back as its consumer does, and proving what it then keeps."""

from collections.abc import Sequence
from pathlib import Path

from peakflight.certificate import certify_plan
from peakflight.errors import InvalidFile, InvalidProblem
from peakflight.exporting.fit import Held, fit
from peakflight.exporting.lifting import AUTO, lifted, lowest
from peakflight.exporting.report import (
    ExportedFlight,
    ExportReport,
    differences,
    jumps,
    yaw_difference,
)
from peakflight.exporting.whole_flight import ON_GROUND, check_above_ground, check_whole_flight
from peakflight.files import PathLike, write_atomically
from peakflight.formats.flight_files import FlightFormat, Reading, find_format
from peakflight.formats.flight_files.flight_format import POLYNOMIAL
from peakflight.result import Plan


def export(
    plan: Plan | Sequence[Plan],
    *,
    to: str,
    path: PathLike | None = None,
    refit: bool = True,
    lift: float | str = 0.0,
    names: Sequence[str] | None = None,
) -> ExportReport:
    """Write the flight file of a plan, or of several, and certify the numbers that are in it.

    The file is read back at its consumer's precision and its limits are proven again, to the
    format's tolerance. Where a format has not room for all pieces, the flight is planned again with
    fewer (method joint); where rounding exceeds a limit, it is flown slower by as little as keeps
    it. The report says what that costs. Several plans keep their paths and stay in step: they are
    slowed down together, or refused.

    Parameters
    ----------
    plan
        What to fly; several for formats that hold shows.
    to
        Name of a format of `peakflight.formats.FLIGHT_FORMATS`.
    path
        By default the format's own file name, in the current folder.
    refit
        Whether the flight may be planned with fewer pieces or flown slower. If not, one that does
        not fit is refused, and one that rounding takes beyond a limit is written and reported as
        not feasible.
    lift
        By how many m plans are moved up first, for courses that are not above a floor; or "auto",
        by as much as puts their lowest point 0.5 m above z = 0. Several plans are moved alike.
        Moved, they are proven again, and the report is about them.
    names
        Of the drones, one for each plan; by default drone_1, drone_2, ...

    Raises
    ------
    InvalidProblem
        If the format is unknown or cannot hold the flight, a plan is not proven to keep its
        limits, begins or ends in motion or goes underground where the file flies from the ground
        and back, the lift is neither "auto" nor from 0 on, or a vehicle is missing; the message
        says which.
    InvalidFile
        If the file cannot be written.
    MissingExtra
        If a format needs a library that is not installed.
    """
    name, chosen = find_format(to)
    plans = (plan,) if isinstance(plan, Plan) else tuple(plan)
    names = _names(names, len(plans))
    plans, up = lifted(plans, lift)
    _check(name, chosen, plans)
    path = Path(chosen.filename if path is None else path)
    if path.is_dir():
        raise InvalidFile(f"{path}: is a folder; name a file in it")
    written = fit(plans, names, chosen, refit=refit)
    if lift == AUTO:  # planned again, a flight may dip lower than its plan
        higher, more = lifted(written.plans, lift)
        if more > ON_GROUND:
            written = fit(higher, names, chosen, refit=refit)
            plans, up = lifted(plans, more)[0], up + more
    for index, reading in enumerate(written.readings):
        check_above_ground(name, chosen, f"{_which(index, plans)} as written", reading.trajectory)
    flights = tuple(
        _flight(*item, chosen)
        for item in zip(names, plans, written.plans, written.readings, written.held, strict=True)
    )
    write_atomically(path, written.encoded.data)
    return ExportReport(
        format=name,
        path=path,
        size=len(written.encoded.data),
        tolerance=chosen.tolerance,
        flights=flights,
        lift=up,
        notes=(
            *_lift_notes(up, flights),
            *_distance_notes(flights),
            *_cost_notes(flights),
            *written.encoded.notes,
        ),
    )


def _names(names: Sequence[str] | None, count: int) -> tuple[str, ...]:
    if names is None:
        return tuple(f"drone_{index + 1}" for index in range(count))
    if len(names) != count:
        raise InvalidProblem(f"{len(names)} names are given for {count} plans")
    for index, name in enumerate(names):
        if name in names[:index]:
            raise InvalidProblem(f"two drones are called {name!r}")
    return tuple(names)


def _check(name: str, chosen: FlightFormat, plans: Sequence[Plan]) -> None:
    """Refuse what no file of the format is about."""
    if not plans:
        raise InvalidProblem("no plan is given")
    if len(plans) > 1 and not chosen.several:
        raise InvalidProblem(f"format {name} holds one drone; {len(plans)} plans are given")
    for index, plan in enumerate(plans):
        which = _which(index, plans)
        if chosen.needs_vehicle and plan.vehicle is None:
            raise InvalidProblem(
                f"format {name} needs a vehicle, and {which} has none; plan with vehicle=... "
                "(--vehicle)"
            )
        check_whole_flight(name, chosen, which, plan)
        proof = certify_plan(plan)
        if not proof.feasible:
            raise InvalidProblem(f"{which} is not proven to keep its limits: {proof.problems[0]}")


def _which(index: int, plans: Sequence[Plan]) -> str:
    return f"plan {index + 1}" if len(plans) > 1 else "the plan"


def _flight(
    name: str, plan: Plan, fitted: Plan, reading: Reading, kept: Held, chosen: FlightFormat
) -> ExportedFlight:
    flown = reading.trajectory
    return ExportedFlight(
        name=name,
        duration=flown.duration,
        plan_duration=plan.duration,
        pieces=len(flown if chosen.fixed == POLYNOMIAL else fitted.trajectory),
        plan_pieces=len(plan.trajectory),
        refitted=len(fitted.trajectory) != len(plan.trajectory),
        difference=differences(plan.trajectory, flown),
        rounding=differences(fitted.trajectory, flown),
        jumps=jumps(flown),
        yaw_difference=yaw_difference(plan, reading.yaw),
        peaks=kept.peaks,
        plan_peaks={kind: float(kappa.max()) for kind, kappa in plan.report.peaks.items()},
        held=kept.names,
        problems=kept.problems,
        trajectory=flown,
    )


def _lift_notes(up: float, flights: Sequence[ExportedFlight]) -> list[str]:
    """How far up plans were moved, and where that leaves them."""
    if up == 0.0:
        return []
    height, time = min(lowest(flight.trajectory) for flight in flights)
    return [
        f"moved up by {up:.3f} m: the lowest point, at {time:.3f} s, is {height:.3f} m above z = 0;"
        " differences are to the plan there"
    ]


def _distance_notes(flights: Sequence[ExportedFlight]) -> list[str]:
    """How near drones come to each other in the file: no limit that it is held to."""
    if len(flights) < 2:
        return []
    from peakflight.separation import closest_approach

    nearest = closest_approach([flight.trajectory for flight in flights])
    first, second = (flights[index].name for index in nearest.pair)
    return [
        f"{first} and {second} come nearest, at {nearest.time:.3f} s: {nearest.distance:.3f} m, "
        f"no two are ever nearer than {nearest.bound:.6f} m, which is proven; whether that is far "
        "enough is not"
    ]


def _cost_notes(flights: Sequence[ExportedFlight]) -> list[str]:
    """What a refit has cost, in words."""
    notes = []
    for flight in flights:
        which = f"{flight.name}: " if len(flights) > 1 else ""
        if flight.refitted:
            notes.append(
                f"{which}planned again with {flight.pieces} pieces in place of "
                f"{flight.plan_pieces}: {abs(flight.cost):.2g} % "
                f"{'longer' if flight.cost > 0.0 else 'shorter'}, and up to "
                f"{flight.difference.position:.2g} m from the plan between waypoints"
            )
        elif flight.cost > SLOWER:
            notes.append(f"{which}flown {flight.cost:.2g} % slower, so that rounding keeps limits")
    return notes


SLOWER = 0.05
"""Percent of a flight's time that is not worth a word."""
