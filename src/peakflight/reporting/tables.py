"""The tables of a report."""

from collections.abc import Iterator

import numpy as np

from peakflight.formats.vehicle_file import FIGURES, shown_figure
from peakflight.limits import KINDS, LimitKind, plain_unit
from peakflight.problem import derivative_name
from peakflight.reporting.findings import Findings
from peakflight.reporting.markup import Column, Meter, Row, table
from peakflight.vehicle import Vehicle
from peakflight.wording import amount, number, ranges, ratio_cells, seconds
from peakflight.yaw import ALL_LABELS

ITSELF = "what the vehicle itself can do, without a margin"
"""Why a limit on rotors or body rate has its value."""
RATIO = Column("of the limit", "Certified peak over the limit: 1 is the limit itself", True)
MARGIN = Column("margin", "What is left up to the limit", True)
LEG_COLUMNS = (
    Column("leg", "Leg k goes from waypoint k to waypoint k + 1"),
    Column("begins (s)", "When its first waypoint is passed", True),
    Column("time (s)", "How long the leg takes", True),
    Column("path (m)", "Length of the leg along the path", True),
    Column("mean speed (m/s)", "Length over time", True),
    Column("closest limit", "The limit that binds the leg, or that it comes closest to"),
    RATIO,
    MARGIN,
    Column("", "binds: within 0.1 % of the limit"),
)
LIMIT_COLUMNS = (
    Column("limit"),
    Column("allowed", "What the plan may reach", True),
    Column("reached", "The proven bound of what it reaches", True),
    RATIO,
    MARGIN,
    Column("", "binds: within 0.1 % of the limit"),
    Column("worst in leg", "Where it comes closest to the limit", True),
    Column("binds segments", "Polynomial pieces that the limit binds; several may be in a leg"),
)
WAYPOINT_COLUMNS = (
    Column("waypoint"),
    Column("x (m)", "", True),
    Column("y (m)", "", True),
    Column("z (m)", "Up", True),
    Column("passed at (s)", "", True),
    Column("speed (m/s)", "When it is passed", True),
    Column("missed by (m)", "Distance of the path from it, of the two legs that meet there", True),
)
JOINT_COLUMNS = (
    Column("derivative", "Of position"),
    Column("largest jump", "Where one polynomial piece ends and the next begins", True),
    Column("after segment", "Where it is", True),
)


def leg_table(findings: Findings) -> str:
    """Each leg: its time, and the limit that binds it."""
    return table(LEG_COLUMNS, _leg_rows(findings), name="Legs")


def _leg_rows(findings: Findings) -> Iterator[Row]:
    pairs = zip(findings.legs, findings.leg_lengths, strict=True)
    for index, (leg, length) in enumerate(pairs):
        ratio, margin, meaning = ratio_cells(leg.ratio)
        cells = (
            str(index),
            seconds(leg.begins),
            seconds(leg.time),
            f"{length:.3f}",
            f"{length / leg.time:.3f}",
            ALL_LABELS[leg.closest],
            Meter(ratio, leg.ratio),
            margin,
            meaning,
        )
        yield Row(cells, _tone(meaning))


def limit_table(findings: Findings) -> str:
    """Each limit: what is allowed, what is reached, and where."""
    return table(LIMIT_COLUMNS, _limit_rows(findings), name="Limits")


def _limit_rows(findings: Findings) -> Iterator[Row]:
    for one in findings.limits:
        ratio, margin, meaning = ratio_cells(one.ratio)
        cells = (
            one.kind.label,
            shown_amount(one.kind, one.limit),
            "no bound" if one.reached is None else number(one.kind, one.reached),
            Meter(ratio, one.ratio),
            margin,
            meaning,
            str(one.leg),
            ranges(one.binding),
        )
        yield Row(cells, _tone(meaning))


def waypoint_table(findings: Findings) -> str:
    """Each waypoint: where it is, when it is passed, and by how much it is missed."""
    return table(WAYPOINT_COLUMNS, _waypoint_rows(findings), name="Waypoints")


def _waypoint_rows(findings: Findings) -> Iterator[Row]:
    plan = findings.plan
    passed = plan.waypoint_times
    speeds = np.linalg.norm(plan.trajectory(passed, derivative=1), axis=1)
    for index, point in enumerate(plan.problem.waypoints):
        yield Row(
            (
                str(index),
                *(f"{value:.4g}" if abs(value) < 1e4 else f"{value:.10g}" for value in point),
                seconds(float(passed[index])) if passed[index] else "0",
                f"{speeds[index]:.3f}",
                f"{findings.misses[index]:.1e}" if findings.misses[index] else "0",
            )
        )


def joint_table(findings: Findings) -> str:
    """How much each derivative that must not jump does so."""
    rows = (
        Row(
            (
                derivative_name(jump.order),
                f"{jump.size:.1e} {plain_unit(_UNITS[min(jump.order, 2)].format(jump.order))}",
                str(jump.joint),
            )
        )
        for jump in findings.jumps
    )
    return table(JOINT_COLUMNS, rows, name="Joints")


def vehicle_table(vehicle: Vehicle) -> str:
    """Each figure of a vehicle, and where it is from."""
    columns = Column("figure"), Column("value"), Column("source")
    rows = (
        Row((f"{name.replace('_', ' ')}{_remark(name)}", value, source))
        for name, value, source in (
            (name, shown_figure(vehicle, name), vehicle.sources.get(name, "")) for name in FIGURES
        )
    )
    return table(columns, rows, name="Figures of the vehicle")


def reason_table(findings: Findings) -> str:
    """Each limit of a plan that has a vehicle, and why it has its value."""
    vehicle = findings.plan.vehicle
    if vehicle is None:
        return ""
    own = {one.name: getattr(vehicle.on_rotors().limits, one.name) for one in KINDS}
    columns = Column("limit"), Column("value", "", True), Column("why")
    rows = (
        Row(
            (
                one.kind.label,
                shown_amount(one.kind, one.limit),
                vehicle.reasons.get(one.kind.name)
                or (ITSELF if own.get(one.kind.name) == one.limit else "set for this plan"),
            )
        )
        for one in findings.limits
    )
    return table(columns, rows, name="Limits of the vehicle")


def shown_amount(kind: LimitKind, value: float) -> str:
    """Print a value of a kind of limit with its unit; angles in degrees."""
    return plain_unit(amount(kind, value)).replace(" deg", "°")


_UNITS = ("m", "m/s", "m/s^{}")
"""Of position, velocity and further derivatives."""


def _remark(name: str) -> str:
    remark = FIGURES[name][1].removesuffix("; may be left out")
    return f" ({remark})" if remark else ""


def _tone(meaning: str) -> str:
    return "bad" if meaning == "exceeded" else meaning
