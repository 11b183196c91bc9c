"""What a controller is told of a plan: one row for each of its runs, before anything flies."""

import math
from dataclasses import dataclass

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.flatness import flat_states
from peakflight.heading import heading
from peakflight.kernels import controllers as kernels
from peakflight.limits import GRAVITY
from peakflight.result import Plan
from peakflight.trajectory import Trajectory
from peakflight.vehicle import Vehicle

REST = 1e-6
"""Speed (m/s) and acceleration (m/s^2) below which a plan ends at rest, so that a vehicle can stay
there."""
MOST_ROWS = 2_000_000
"""A flight of an hour at 500 Hz."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Rehearsal:
    """A plan and the hovering at its end, at every run of a controller. Arrays are read-only."""

    times: np.ndarray
    """(n,) s after the beginning of the plan."""
    rows: np.ndarray
    """(n, 20) as `peakflight.kernels.controllers` names them; thrust includes drag."""
    acceleration: np.ndarray
    """(n, 3) m/s^2."""
    jerk: np.ndarray
    """(n, 3) m/s^3."""
    yaw_rate: np.ndarray
    """(n,) rad/s."""
    rotor_thrusts: np.ndarray
    """(4,) N, of each rotor as it begins."""
    duration: float
    """Of the plan, s."""

    def __post_init__(self) -> None:
        for name in ("times", "rows", "acceleration", "jerk", "yaw_rate", "rotor_thrusts"):
            getattr(self, name).setflags(write=False)

    def firmware_rows(self, mass: float) -> np.ndarray:
        """(n, 20) rows as the Crazyflie's commander would give them, for a mass it believes in.

        Thrust without drag; body rates as `pptraj.c` computes them, in the frame whose y is across
        the heading.
        """
        rows = self.rows.copy()
        force = self.acceleration + np.array([0.0, 0.0, GRAVITY])
        rows[:, kernels.PLANNED_THRUST : kernels.PLANNED_YAW] = mass * force
        length = np.maximum(np.linalg.norm(force, axis=1, keepdims=True), kernels.NOTHING)
        z = force / length
        yaw = rows[:, kernels.PLANNED_YAW]
        ahead = np.stack((np.cos(yaw), np.sin(yaw), np.zeros(len(yaw))), axis=1)
        y = np.cross(z, ahead)
        y /= np.maximum(np.linalg.norm(y, axis=1, keepdims=True), kernels.NOTHING)
        x = np.cross(y, z)
        swing = (self.jerk - (self.jerk * z).sum(axis=1, keepdims=True) * z) / length
        rates = np.stack(
            (-(swing * y).sum(axis=1), (swing * x).sum(axis=1), z[:, 2] * self.yaw_rate), axis=1
        )
        rows[:, kernels.PLANNED_RATE : kernels.PLANNED_ACCELERATION] = rates
        return rows


def rehearse(plan: Plan | Trajectory, vehicle: Vehicle, *, rate: float, hold: float) -> Rehearsal:
    """What a controller that runs at a rate (Hz) is told, with `hold` seconds of hovering after.

    A plan that does not end at rest has no hovering after it.

    Raises
    ------
    InvalidProblem
        If the trajectory has not three axes, or is too long for this rate.
    """
    trajectory = plan.trajectory if isinstance(plan, Plan) else plan
    if trajectory.axes != 3:
        raise InvalidProblem(f"the trajectory has {trajectory.axes} axes; to fly it must have 3")
    duration = trajectory.duration
    if (duration + hold) * rate >= MOST_ROWS:
        raise InvalidProblem(
            f"the plan lasts {duration:g} s; at {rate:g} Hz at most {MOST_ROWS / rate:g} s can be "
            "flown"
        )
    end = trajectory.end_time
    rests = max(np.abs(trajectory(end, order)).max() for order in (1, 2)) < REST
    count = math.floor(duration * rate * (1.0 + np.finfo(float).eps)) + 1
    total = count + (math.ceil(hold * rate) if rests else 0)
    times = np.arange(total) / rate
    at = np.minimum(trajectory.start_time + times, end)
    on_plan = np.arange(total) < count
    motion = [trajectory(at, order) for order in range(5)]
    for derivative in motion[1:]:
        derivative[~on_plan] = 0.0
    turn = np.zeros((3, total))
    if isinstance(plan, Plan):
        yaw = heading(plan)
        turn = np.stack([yaw(at, order)[..., 0] for order in range(3)])
        turn[1:, ~on_plan] = 0.0
    states = flat_states(motion[1:], vehicle, yaw=tuple(turn))
    rows = np.zeros((total, kernels.PLANNED))
    rows[:, kernels.PLANNED_POSITION : kernels.PLANNED_VELOCITY] = motion[0]
    rows[:, kernels.PLANNED_VELOCITY : kernels.PLANNED_THRUST] = motion[1]
    axis = states.rotation[..., 2]
    rows[:, kernels.PLANNED_THRUST : kernels.PLANNED_YAW] = states.thrust[:, None] * axis
    rows[:, kernels.PLANNED_YAW] = turn[0]
    rows[:, kernels.PLANNED_ATTITUDE : kernels.PLANNED_RATE] = states.attitude
    rows[:, kernels.PLANNED_RATE : kernels.PLANNED_ACCELERATION] = states.body_rate
    rows[:, kernels.PLANNED_ACCELERATION :] = states.angular_acceleration
    return Rehearsal(
        times=times,
        rows=rows,
        acceleration=motion[2],
        jerk=motion[3],
        yaw_rate=turn[1],
        rotor_thrusts=np.clip(states.rotor_thrust[0], *vehicle.rotor_thrust),
        duration=duration,
    )
