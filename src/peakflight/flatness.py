"""From a motion to what the vehicle does to fly it: attitude, rates, torques and rotor thrusts.

A quadrotor is differentially flat: position and yaw as functions of time fix everything else
(Eq. Quadrotor_model and the flat outputs below it; Mellinger and Kumar 2011).
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from peakflight.errors import InvalidProblem
from peakflight.heading import heading
from peakflight.kernels import flatness as kernels
from peakflight.kernels import jit
from peakflight.limits import GRAVITY
from peakflight.problem import derivative_name
from peakflight.result import Plan
from peakflight.trajectory import Trajectory
from peakflight.vehicle import Vehicle

Yaw: TypeAlias = Sequence[ArrayLike]
"""Yaw in rad, its rate in rad/s and its acceleration in rad/s^2, each a number or (...,)."""

_log = logging.getLogger("peakflight")


class Attitude(IntEnum):
    """Whether the motion says which way the vehicle points."""

    REGULAR = kernels.REGULAR
    """It does."""
    FREE_FALL = kernels.FREE_FALL
    """There is no thrust, so any attitude will do: that of the sample before, or upright at the
    first, and at rest but for the yaw."""
    INVERTED = kernels.INVERTED
    """Thrust points straight down, so all tilts are as short: half a turn about x."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FlatStates:
    """What a vehicle does at samples of a motion. Arrays are read-only."""

    attitude: np.ndarray
    """(..., 4) unit quaternions w, x, y, z, from the body to the world: the tilt by the shortest
    way from upright, after a turn by the yaw."""
    body_rate: np.ndarray
    """(..., 3) angular velocity in the body frame, rad/s."""
    angular_acceleration: np.ndarray
    """(..., 3) its derivative in the body frame, rad/s^2."""
    torque: np.ndarray
    """(..., 3) about x, y, z of the body, N m."""
    thrust: np.ndarray
    """(...,) of all rotors along z of the body, N."""
    thrust_acceleration: np.ndarray
    """(...,) the same over the mass, m/s^2."""
    rotor_thrust: np.ndarray
    """(..., 4) of each rotor, N; whether or not it can."""
    codes: np.ndarray
    """(...,) an `Attitude` each: where the motion does not say which way the vehicle points."""

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            array = np.asarray(getattr(self, name))
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def rotation(self) -> np.ndarray:
        """(..., 3, 3) matrices from the body to the world; their columns are the body's axes."""
        w, x, y, z = np.moveaxis(self.attitude, -1, 0)
        rows = (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        )
        return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)

    @property
    def heading(self) -> np.ndarray:
        """(...,) rad, direction of the body's x axis over ground; near the yaw, but not the same.

        The two are alike where the vehicle is level or leans along x or y of its own.
        """
        w, x, y, z = np.moveaxis(self.attitude, -1, 0)
        angles: np.ndarray = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
        return angles


def flat_states(
    derivatives: Sequence[ArrayLike], vehicle: Vehicle, *, yaw: Yaw = (0.0, 0.0, 0.0)
) -> FlatStates:
    """What a vehicle does at samples of a motion.

    Parameters
    ----------
    derivatives
        Four of (..., 3): velocity, acceleration, jerk and snap, in m/s, m/s^2, ... Velocity counts
        only where the vehicle has drag.
    yaw
        Yaw, its rate and its acceleration, each a number or (...,).

    Returns
    -------
    States with the same (...,).

    Raises
    ------
    InvalidProblem
        If there are not four derivatives and three of yaw, shapes do not fit, or a number is not
        finite; the message names it.
    """
    motion = _motion(derivatives)
    shape = motion.shape[:-2]
    turn = _turn(yaw, shape)
    mass, drag = vehicle.mass, jit.fresh(vehicle.drag)
    with jit.announced("flatness", _log):
        attitude, turning, thrust, rotors, codes = kernels.flat_states(
            motion.reshape(-1, 4, 3),
            turn.reshape(-1, 3),
            mass,
            jit.fresh(vehicle.inertia),
            drag,
            jit.fresh(vehicle.mixer),
            GRAVITY,
        )
    turning = turning.reshape(*shape, 3, 3)
    return FlatStates(
        attitude=attitude.reshape(*shape, 4),
        body_rate=turning[..., 0, :],
        angular_acceleration=turning[..., 1, :],
        torque=turning[..., 2, :],
        thrust=thrust.reshape(shape),
        thrust_acceleration=thrust.reshape(shape) / mass,
        rotor_thrust=rotors.reshape(*shape, 4),
        codes=codes.reshape(shape),
    )


def states_along(
    trajectory: Trajectory,
    t: ArrayLike,
    vehicle: Vehicle,
    *,
    yaw: Yaw | Callable[[np.ndarray], Yaw] = (0.0, 0.0, 0.0),
) -> FlatStates:
    """What a vehicle does at times of a trajectory.

    Parameters
    ----------
    t
        (...,) s, within the trajectory, in order of flight: in free fall the attitude is that of
        the time before. Where a derivative jumps, the later piece counts.
    yaw
        Yaw, its rate and its acceleration, each a number or (...,); or a function of the times
        that gives these three.

    Raises
    ------
    ValueError
        If a time is outside the trajectory.
    InvalidProblem
        As `flat_states`.
    """
    times = np.asarray(t, dtype=float)
    derivatives = [trajectory(times, order) for order in (1, 2, 3, 4)]
    return flat_states(derivatives, vehicle, yaw=yaw(times) if callable(yaw) else yaw)


def planned_states(plan: Plan, t: ArrayLike) -> FlatStates:
    """What the vehicle of a plan does at times of it, (...,) s, under the yaw of flight files.

    Raises
    ------
    InvalidProblem
        If the plan has no vehicle.
    """
    if plan.vehicle is None:
        raise InvalidProblem("the plan has no vehicle; plan with vehicle=...")
    turn = heading(plan)

    def yaw(times: np.ndarray) -> Yaw:
        return [turn(times, order)[..., 0] for order in (0, 1, 2)]

    return states_along(plan.trajectory, t, plan.vehicle, yaw=yaw)


def _motion(derivatives: Sequence[ArrayLike]) -> np.ndarray:
    """(..., 4, 3) from four of (..., 3)."""
    if len(derivatives) != 4:
        raise InvalidProblem(
            f"{len(derivatives)} derivatives are given; there must be four: velocity, "
            "acceleration, jerk and snap"
        )
    try:
        motion = np.stack([np.asarray(one, dtype=float) for one in derivatives], axis=-2)
    except (TypeError, ValueError):
        raise InvalidProblem("derivatives must be numbers in arrays of one shape") from None
    if motion.ndim < 2 or motion.shape[-1] != 3:
        raise InvalidProblem(
            f"derivatives have shape {motion.shape[:-2] + motion.shape[-1:]}; it must be (..., 3)"
        )
    if not np.isfinite(motion).all():
        *place, order, axis = (int(i) for i in np.argwhere(~np.isfinite(motion))[0])
        raise InvalidProblem(
            f"{derivative_name(order + 1)} of sample {place} has {'xyz'[axis]} = "
            f"{motion[(*place, order, axis)]}; it must be finite"
        )
    return jit.fresh(motion)


def _turn(yaw: Yaw, shape: tuple[int, ...]) -> np.ndarray:
    """(..., 3) yaw, rate and acceleration."""
    if len(yaw) != 3:
        raise InvalidProblem(
            f"yaw has {len(yaw)} parts; it must have three: yaw, its rate and its acceleration"
        )
    try:
        parts = [np.broadcast_to(np.asarray(one, dtype=float), shape) for one in yaw]
    except (TypeError, ValueError):
        raise InvalidProblem(f"yaw must be numbers, or arrays of shape {shape}") from None
    turn = np.stack(parts, axis=-1)
    if not np.isfinite(turn).all():
        raise InvalidProblem("yaw, its rate and its acceleration must be finite")
    return jit.fresh(turn)
