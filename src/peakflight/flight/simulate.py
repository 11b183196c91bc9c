"""Flying a plan: the rigid body of a vehicle under a controller, in a world that may differ."""

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from peakflight.errors import InvalidProblem, quoted
from peakflight.flight.conditions import NOISES, Conditions
from peakflight.flight.controllers import (
    FirmwareSettings,
    GeometricSettings,
    Mixing,
    firmware_settings,
)
from peakflight.flight.flight import Crash, Flight
from peakflight.flight.numbers import number, whole
from peakflight.flight.rehearsal import Rehearsal, rehearse
from peakflight.flight.rotors import ROTOR_SPEEDS, RotorSpeeds, rotors_of
from peakflight.kernels import controllers as rows
from peakflight.kernels import flight as kernels
from peakflight.kernels import jit
from peakflight.kernels import rigid_body as states
from peakflight.limits import GRAVITY
from peakflight.result import Plan
from peakflight.trajectory import Trajectory
from peakflight.vehicle import Vehicle
from peakflight.vehicles import VehicleLike, find_vehicle

CONTROLLERS: Mapping[str, int] = {
    "geometric": kernels.GEOMETRIC,
    "firmware": kernels.FIRMWARE,
}
"""Name of a controller to its number in the kernel."""

_log = logging.getLogger("peakflight")


@dataclass(frozen=True, kw_only=True)
class FlySettings:
    """How a flight is simulated and judged.

    Raises
    ------
    InvalidProblem
        If a value is out of its range; the message names the field.
    """

    control_rate: float = 500.0
    """Runs of the controller in a second, Hz: that of the Crazyflie's attitude loop."""
    position_divider: int = 5
    """Runs of the firmware's controller between two of its loop of position, whose set-points come
    at 100 Hz."""
    parts: int = 2
    """Steps of integration between two runs of the controller."""
    hold: float = 1.0
    """Hovering at the end of a plan that ends at rest, s: a vehicle that passes the end upside down
    has not flown it."""
    ground: float | None = 0.0
    """Height of the ground, m; None for none."""
    clearance: float = 0.05
    """Least distance of a plan from the ground, m: where it comes nearer, or goes below, the ground
    is so far below its lowest point."""
    lost_distance: float = 1.0
    """Distance from the plan that counts as a crash, m."""
    lost_angle: float = math.radians(120.0)
    """Angle between the thrust axis and its plan that counts as a crash, rad."""
    geometric: GeometricSettings = field(default_factory=GeometricSettings)
    firmware: FirmwareSettings | None = None
    """None for `firmware_settings` of the vehicle."""
    rotors: RotorSpeeds | Literal["identified", "lag"] = "identified"
    """How rotors follow: by the speeds that were identified for the vehicle, where they were
    (`ROTOR_SPEEDS`, the Crazyflies); by the vehicle's lag alone; or as given."""

    def __post_init__(self) -> None:
        for name, least, most, unit in (
            ("control_rate", 10.0, 1e5, "Hz"),
            ("hold", 0.0, 1e3, "s"),
            ("clearance", 0.0, 1e3, "m"),
            ("lost_distance", 1e-3, 1e6, "m"),
            ("lost_angle", 1e-3, math.pi, "rad"),
        ):
            object.__setattr__(self, name, number(name, getattr(self, name), least, most, unit))
        for name in ("position_divider", "parts"):
            object.__setattr__(self, name, whole(name, getattr(self, name), 1, 1000))
        if self.ground is not None:
            object.__setattr__(self, "ground", number("ground", self.ground, -1e6, 1e6, "m"))
        if not (isinstance(self.rotors, RotorSpeeds) or self.rotors in ("identified", "lag")):
            raise InvalidProblem(
                f"rotors is {quoted(str(self.rotors))}; it must be identified, lag or RotorSpeeds"
            )

    def speeds(self, vehicle: Vehicle) -> RotorSpeeds | None:
        """How the rotors of a vehicle follow; None for its lag."""
        if isinstance(self.rotors, RotorSpeeds):
            return self.rotors
        return ROTOR_SPEEDS.get(vehicle.name) if self.rotors == "identified" else None


def fly(
    plan: Plan | Trajectory,
    *,
    vehicle: VehicleLike | None = None,
    controller: str = "geometric",
    conditions: Conditions | None = None,
    settings: FlySettings | None = None,
) -> Flight:
    """Fly a plan in simulation.

    The vehicle is the rigid body of Eq. Quadrotor_model with rotors that follow their commands with
    the vehicle's lag and within its range, and with rotor drag. It begins as planned, and hovers at
    the end for a while.

    Parameters
    ----------
    plan
        A plan, or a trajectory in three axes, which is flown with yaw 0.
    vehicle
        What flies; the plan's own if it has one.
    controller
        "geometric": an ideal tracker with full feed-forward. "firmware": after the Crazyflie's.
    conditions
        What the plan and the controller do not know; by default nothing.
    settings
        How it is simulated and judged.

    Raises
    ------
    InvalidProblem
        If no vehicle is known, or an argument is against a rule.
    """
    task = prepare(plan, vehicle=vehicle, controller=controller, settings=settings)
    conditions = Conditions() if conditions is None else conditions
    outcome = run(task, conditions)
    return task.flight(outcome, conditions)


class Outcome(NamedTuple):
    """What the kernel gives."""

    states: np.ndarray
    """(S, 13)."""
    rotor_thrusts: np.ndarray
    """(S, 4) N."""
    saturated: int
    """Samples with a rotor at an end of its range."""
    code: int


@dataclass(frozen=True, eq=False, kw_only=True)
class Task:
    """All that flights of one plan share; what differs are conditions."""

    rehearsal: Rehearsal
    vehicle: Vehicle
    controller: str
    settings: FlySettings
    planned: np.ndarray
    """(n, 20) rows that the controller sees."""
    gains: np.ndarray
    force_scale: float
    moments: np.ndarray
    bounds: np.ndarray

    def flight(self, outcome: Outcome, conditions: Conditions) -> Flight:
        """What comes out, with its samples."""
        count = len(outcome.states)
        planned, flown = self.rehearsal.rows[:count], outcome.states
        times = self.rehearsal.times[:count]
        return Flight(
            times=times,
            position=flown[:, states.POSITION : states.VELOCITY],
            velocity=flown[:, states.VELOCITY : states.ATTITUDE],
            attitude=flown[:, states.ATTITUDE : states.RATE],
            body_rates=flown[:, states.RATE :],
            rotor_thrusts=outcome.rotor_thrusts,
            planned_position=planned[:, rows.PLANNED_POSITION : rows.PLANNED_VELOCITY],
            planned_velocity=planned[:, rows.PLANNED_VELOCITY : rows.PLANNED_THRUST],
            planned_attitude=planned[:, rows.PLANNED_ATTITUDE : rows.PLANNED_RATE],
            planned_body_rates=planned[:, rows.PLANNED_RATE : rows.PLANNED_ACCELERATION],
            duration=self.rehearsal.duration,
            saturation_share=outcome.saturated / count,
            crash=self.crash(outcome),
            vehicle=self.vehicle,
            controller=self.controller,
            conditions=conditions,
        )

    def errors(self, outcome: Outcome) -> np.ndarray:
        """(S,) m, distance from the plan, at each step that was flown while it lasts."""
        count = len(outcome.states)
        flown = outcome.states[:, states.POSITION : states.VELOCITY]
        planned = self.rehearsal.rows[:count, rows.PLANNED_POSITION : rows.PLANNED_VELOCITY]
        lasts = self.rehearsal.times[:count] <= self.rehearsal.duration
        return np.linalg.norm(flown - planned, axis=1)[lasts]

    def crash(self, outcome: Outcome) -> Crash | None:
        """Why it ended early, if it did."""
        if outcome.code == kernels.FLEW:
            return None
        time = float(self.rehearsal.times[len(outcome.states) - 1])
        return Crash(cause=_CAUSES[outcome.code].format(self.settings.lost_distance), time=time)


_CAUSES = {
    kernels.ATTITUDE_LOST: "attitude lost",
    kernels.HIT_GROUND: "hit the ground",
    kernels.LEFT_PATH: "left the path by more than {:g} m",
    kernels.DIVERGED: "diverged",
}


def prepare(
    plan: Plan | Trajectory,
    *,
    vehicle: VehicleLike | None = None,
    controller: str = "geometric",
    settings: FlySettings | None = None,
) -> Task:
    """Gather what flights of a plan share; arguments and errors as of `fly`."""
    settings = FlySettings() if settings is None else settings
    if not isinstance(plan, Plan | Trajectory):
        raise InvalidProblem(f"{type(plan).__name__} cannot be flown; give a Plan or a Trajectory")
    if controller not in CONTROLLERS:
        raise InvalidProblem(
            f"unknown controller {quoted(str(controller))}; known are {', '.join(CONTROLLERS)}"
        )
    own = plan.vehicle if isinstance(plan, Plan) else None
    if vehicle is None and own is None:
        raise InvalidProblem("the plan names no vehicle to fly it; give vehicle=...")
    body = own if vehicle is None else find_vehicle(vehicle)
    assert body is not None
    rehearsal = rehearse(plan, body, rate=settings.control_rate, hold=settings.hold)
    firmware = settings.firmware or firmware_settings(body)
    mixing = Mixing.of(body, firmware.mass_thrust)
    is_firmware = controller == "firmware"
    return Task(
        rehearsal=rehearsal,
        vehicle=body,
        controller=controller,
        settings=settings,
        planned=rehearsal.firmware_rows(firmware.mass) if is_firmware else rehearsal.rows.copy(),
        gains=firmware.gains if is_firmware else settings.geometric.gains(body),
        force_scale=mixing.force_scale,
        moments=mixing.moments,
        bounds=np.array(
            [_ground(rehearsal, settings), settings.lost_distance, math.cos(settings.lost_angle)]
        ),
    )


def _ground(rehearsal: Rehearsal, settings: FlySettings) -> float:
    """Height of what a flight may not fall below, m; minus infinity if there is no ground."""
    lowest = float(rehearsal.rows[:, rows.PLANNED_POSITION + 2].min())
    if settings.ground is None:
        return -math.inf
    return min(settings.ground, lowest - settings.clearance)


def run(task: Task, conditions: Conditions) -> Outcome:
    """Fly a prepared plan once."""
    vehicle, settings = task.vehicle, task.settings
    pause = 1.0 / settings.control_rate
    ranges = np.array([vehicle.rotor_thrust, vehicle.rotor_thrust])
    start = np.concatenate(
        [
            task.rehearsal.rows[0, begin:end]
            for begin, end in (
                (rows.PLANNED_POSITION, rows.PLANNED_THRUST),
                (rows.PLANNED_ATTITUDE, rows.PLANNED_ACCELERATION),
            )
        ]
    )
    count = len(task.planned) if conditions.disturbed else 0
    noise = np.random.default_rng(conditions.seed).standard_normal((count, kernels.NOISE))
    late = min(round(conditions.latency * settings.control_rate), len(task.planned))
    kind, every, parts = CONTROLLERS[task.controller], settings.position_divider, settings.parts
    rotors = rotors_of(vehicle, settings.speeds(vehicle), conditions.motor_lag_scale)
    mass, gravity = vehicle.mass * conditions.mass_scale, GRAVITY
    model_mass, spool = vehicle.mass, settings.geometric.spool
    if vehicle.motor_lag == 0.0:
        spool = 1.0
    memory = math.exp(-pause / conditions.gust_time)
    force_scale, gust = task.force_scale, conditions.gust
    with jit.announced("flight", _log):
        flown, thrusts, length, saturated, code = kernels.closed_loop(
            jit.fresh(start),
            jit.fresh(task.rehearsal.rotor_thrusts),
            jit.fresh(task.planned),
            pause,
            parts,
            rotors,
            mass,
            jit.fresh(np.multiply(vehicle.inertia, conditions.inertia_scale)),
            jit.fresh(wrench_of(vehicle, conditions)),
            jit.fresh(drag_of(vehicle, conditions)),
            jit.fresh(conditions.wind),
            gravity,
            ranges,
            kind,
            jit.fresh(task.gains),
            model_mass,
            jit.fresh(vehicle.inertia),
            jit.fresh(vehicle.mixer),
            spool,
            force_scale,
            jit.fresh(task.moments),
            every,
            late,
            noise,
            np.array([getattr(conditions, name) for name in NOISES]),
            gust,
            memory,
            jit.fresh(task.bounds),
        )
    return Outcome(flown[:length], thrusts[:length], saturated, code)


def wrench_of(vehicle: Vehicle, conditions: Conditions) -> np.ndarray:
    """(4, 4) force and torques about x, y, z of each rotor, a row each, for a thrust of 1 N."""
    wrench: np.ndarray = np.linalg.inv(vehicle.mixer).T * conditions.thrust_scale
    return wrench


def drag_of(vehicle: Vehicle, conditions: Conditions) -> tuple[float, float]:
    """Drag across and along the thrust axis, kg/s."""
    if isinstance(conditions.drag, bool):
        return vehicle.drag if conditions.drag else (0.0, 0.0)
    return conditions.drag
