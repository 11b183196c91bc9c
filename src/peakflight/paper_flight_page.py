"""What the page of `peakflight paper --fly` says of the flights."""

import math
from collections.abc import Mapping

import numpy as np

from peakflight.document import Block, Picture, Points, Section, Table, as_code
from peakflight.flight.controllers import BELIEVED_MASS
from peakflight.flight.differences import ORDERS, POINTS, RATE
from peakflight.limits import KINDS, plain_unit
from peakflight.paper import DEFAULT_COURSE, RECONSTRUCTION, Reproduction, is_same
from peakflight.paper_flights import (
    AT_REST,
    DEFAULT_VEHICLE,
    Experiment,
    Flown,
    FlownComparison,
    experiment_csv,
    positions_csv,
)

NONE = "-"
"""What stands where there is no figure."""
CRASHED = "crashed"
CENTIMETRES = 100.0
"""In a metre."""
PEAKS = ("speed", "thrust_acceleration", "jerk", "snap")
"""What the paper draws of its flights."""
NOISE = 1e-4
"""m, of positions: what good motion capture has, for an example of what differences make of it."""

TABLES = {"flights.csv": experiment_csv, "flown-positions.csv": positions_csv}


def flight_sections(
    result: Reproduction, experiment: Experiment, pictures: Mapping[str, tuple[Picture, ...]]
) -> tuple[Section, ...]:
    """Say what was flown, what came out, what the paper has, and why the two differ.

    Parameters
    ----------
    pictures
        Those of each comparison by its name.
    """
    vehicle = experiment.vehicle
    text = (
        f"The plans of the paper's three methods, flown in simulation by {as_code(vehicle.name)} "
        "under a controller after the Crazyflie's firmware, in still air. Positions are sampled at "
        f"{RATE:g} Hz; derivatives are differences of neighbours with a mean of {POINTS} at each "
        "step, as the paper says of its own. A flight is at rest from when on its measured speed "
        f"stays below {AT_REST:g} m/s; how the paper took the times of its flights it does not "
        "say. RMS errors are over the time of the plan, whose beginning is known."
    )
    longer = [100.0 * (flight.slowdown - 1.0) for _, _, flight in experiment.flights]
    slower = (
        f"The paper's flights took {min(longer):.0f} to {max(longer):.0f} % longer than the plans "
        "that it names, and it does not say why. So each plan was flown once more, slower by as "
        "much as its own: the column slowed."
    )
    blocks: list[Block] = [text, times_table(experiment), errors_table(experiment), slower]
    blocks += [_reductions_table(experiment), _peaks_table(experiment)]
    crashes = tuple(_crashes(experiment))
    if crashes:
        blocks.append(Points(crashes))
    sections = [Section("The flights", tuple(blocks))]
    for one in experiment.comparisons:
        printed = one.comparison.printed
        if pictures.get(printed.name):
            sections.append(Section(f"{printed.title}, flown", pictures[printed.name]))
    sections.append(
        Section("Why the flights differ from the paper's", (Points(_reasons(result, experiment)),))
    )
    return tuple(sections)


def times_table(experiment: Experiment) -> Table:
    """Total times, of plans and of flights, beside the paper's."""
    rows = []
    for one, name, flight in experiment.flights:
        flown, plan = flight.flown, one.comparison.printed.durations[name]
        rest = NONE if flown is None else CRASHED
        if flown is not None and flown.flight.flew:
            rest = NONE if flown.rest_time is None else f"{flown.rest_time:.2f} s"
        rows.append(
            (
                _title(one, name),
                f"{plan:g} s",
                NONE if flown is None else f"{flown.plan.duration:.3f} s",
                f"{flight.printed.duration:.2f} s",
                rest,
            )
        )
    return Table(
        title="Total times, beside the paper",
        columns=("flight", ">plan, paper", ">plan, here", ">flown, paper", ">at rest, here"),
        rows=tuple(rows),
    )


def errors_table(experiment: Experiment) -> Table:
    """RMS errors beside the paper's."""
    rows = tuple(
        (
            _title(one, name),
            f"{CENTIMETRES * flight.printed.rms_error:.1f} cm",
            _error(flight.flown, "rms_error"),
            _error(flight.flown, "top_error"),
            _error(flight.slowed, "rms_error"),
        )
        for one, name, flight in experiment.flights
    )
    return Table(
        title="RMS position errors, beside the paper",
        columns=("flight", ">RMS, paper", ">RMS, here", ">top, here", ">RMS, slowed"),
        rows=rows,
    )


def crash_notes(experiment: Experiment) -> list[str]:
    """A line for each flight that crashed."""
    lines = []
    for one, name, flight in experiment.flights:
        for flown, how in ((flight.flown, ""), (flight.slowed, ", slowed")):
            if flown is not None and flown.flight.crash is not None:
                crash = flown.flight.crash
                lines.append(
                    f"{_title(one, name)}{how}: crashed at {crash.time:.2f} s, {crash.cause}"
                )
    return lines


def _reductions_table(experiment: Experiment) -> Table:
    rows = []
    for one in experiment.comparisons:
        for figure in one.beside_paper:
            if figure.unit == "%":
                ours = NONE if figure.ours is None else f"{figure.ours:.1f} %"
                title = f"{one.comparison.printed.name}: {figure.quantity}"
                rows.append((title, f"{figure.paper:g} %", ours))
    return Table(
        title="Flown times against each other, beside the paper",
        columns=("", ">paper", ">here"),
        rows=tuple(rows),
    )


def _peaks_table(experiment: Experiment) -> Table:
    rows = []
    for one, name, flight in experiment.flights:
        flown = flight.flown
        cells = [NONE] * len(PEAKS)
        if flown is not None and flown.analysis is not None and flown.flight.flew:
            peaks = [flown.analysis.peaks[kind] for kind in PEAKS]
            cells = [f"{_rounded(peak.flown)} ({_rounded(peak.filtered)})" for peak in peaks]
        rows.append((_title(one, name), *cells))
    kinds = [kind for kind in KINDS if kind.name in PEAKS]
    columns = [f">{kind.label} ({plain_unit(kind.unit)})" for kind in kinds]
    return Table(
        title="Peaks as measured, and of the plan through the same filter, of flights to the end",
        columns=("flight", *columns),
        rows=tuple(rows),
    )


def _crashes(experiment: Experiment) -> list[str]:
    """What is known of each crash."""
    saturated = {
        _title(one, name): 100.0 * flight.flown.flight.saturation_share
        for one, name, flight in experiment.flights
        if flight.flown is not None and not flight.flown.flight.flew
    }
    lines = []
    for note in crash_notes(experiment):
        share = saturated.get(note.split(":")[0])
        lines.append(
            f"{note}. Until then a rotor was at an end of its range {share:.0f} % of the time."
            if share is not None
            else f"{note}."
        )
    return lines


def _reasons(result: Reproduction, experiment: Experiment) -> tuple[str, ...]:
    course = result.course
    if is_same(course, RECONSTRUCTION):
        kind = (
            "a reconstruction that was fitted to its total times, not to how hard it is to fly: "
            "where the hard turns lie, and how they follow one another, is not known"
        )
    elif is_same(course, DEFAULT_COURSE):
        kind = "another one of the kind that it describes"
    else:
        kind = "another one"
    reasons = [
        f"The course is not the paper's, which it does not print, but {kind}. Errors in cm "
        "can be compared with the paper's only as to their size.",
        _vehicle(experiment),
        "The paper does not say which controller of the firmware flew, nor with which gains. Here "
        "it is one after `controller_mellinger.c` with the gains of the firmware. "
        + _height(experiment),
        "Here the state is measured without error or delay, and there is neither wake nor ground "
        "effect nor a battery that empties. That makes errors smaller than in a flight.",
        "The beginning of the plan is known here, so a lag behind the plan counts as error. The "
        "paper does not say how it laid record and plan on each other; it says that the drone "
        '"starts to lag behind over time when very aggressive trajectories are used".',
        f"Differences and means of {POINTS} flatten what is short, of plans as of flights; in the "
        "table of peaks the plan through the same filter stands in brackets. Noise they raise: "
        f"{1e3 * NOISE:g} mm in each position would be {_noise_in_snap():.0f} m/s⁴ in each axis of "
        "snap. Here there is none, in a record of motion capture there is.",
    ]
    if any(not one.flight.flew for each in experiment.comparisons for one in each.flown.values()):
        reasons.append(
            "The limits bound how much thrust a plan asks for and how quickly that changes, each "
            "by itself, but not what it takes to turn the vehicle at the same time. The paper says "
            'that it is "not possible to give a guarantee of feasibility when flying on the limit '
            'due to the thrust being coupled to both the acceleration and the snap". Its limits '
            "are those that its own course was flown with; on this course, by this model, they are "
            "not safe for every plan."
        )
    return tuple(reasons)


def _vehicle(experiment: Experiment) -> str:
    vehicle = experiment.vehicle
    top = vehicle.top_thrust_acceleration
    asked = max(
        one.comparison.printed.limits.thrust_acceleration or 0.0 for one in experiment.comparisons
    )
    text = (
        f"The paper flew a Crazyflie 2.1, and its limits ask for up to {asked:g} m/s² of thrust. "
        f"The model of {as_code(vehicle.name)} has {top:.1f} m/s² at the top"
    )
    if vehicle.name == DEFAULT_VEHICLE:
        return (
            f"{text}. It is the one with the thrust upgrade kit, chosen since the stock vehicle's "
            "model has less than the limits ask for. With which motors and battery the paper flew "
            "is not said."
        )
    if top < asked:
        return f"{text}, less than that: it cannot fly plans that go to the limit."
    return f"{text}."


def _height(experiment: Experiment) -> str:
    """How high above the plan the vehicle flew."""
    seen = [
        found.analysis.offset[2]
        for one in experiment.comparisons
        for found in one.flown.values()
        if found.flight.flew and found.analysis is not None
    ]
    if not seen:
        return ""
    height = CENTIMETRES * float(np.mean(seen))
    side = "high" if height >= 0.0 else "low"
    believed = (
        "That controller takes the mass and the rotors for others than they are. "
        if experiment.vehicle.name in BELIEVED_MASS
        else ""
    )
    return (
        f"{believed}The vehicle flies {abs(height):.1f} cm too {side} on average, which is part of "
        "each error."
    )


def _noise_in_snap() -> float:
    """m/s^4: what `NOISE` becomes in a component of snap; see `flight.differences`."""
    return math.sqrt(math.comb(2 * ORDERS, ORDERS)) * NOISE * (RATE / POINTS) ** ORDERS


def _title(one: FlownComparison, name: str) -> str:
    return f"{one.comparison.printed.name}, {name}"


def _error(flown: Flown | None, name: str) -> str:
    if flown is None:
        return NONE
    value = getattr(flown, name)
    return CRASHED if value is None else f"{CENTIMETRES * value:.1f} cm"


def _rounded(value: float | None) -> str:
    return NONE if value is None else f"{float(f'{value:.3g}'):g}"
