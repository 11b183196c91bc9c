"""The yaw of a vehicle that does not turn about its thrust: where its nose is left by flying.

The attitude tilts by the shortest way from upright to the thrust direction b, after a turn by the
yaw (`kernels.flatness`). While b goes around, that tilt alone turns the vehicle about its own z
axis, by omega = -w_3 / (1 + b_3) where w = F x j / F.F is how b turns, and F is the thrust with
drag, j its derivative (`kernels.rotors`). A yaw with psi' = -omega undoes it.
"""

import numpy as np

from peakflight.airframe import Airframe
from peakflight.limits import GRAVITY
from peakflight.trajectory import Trajectory

UPSIDE_DOWN = 1e-9
"""1 + b_3 below this: no way to tilt there is the shortest, and the yaw stays as it is."""
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_HERMITE = np.linalg.inv(
    np.array(
        [
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 2.0, 0.0, 0.0, 0.0],
            [1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
            [0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
            [0.0, 0.0, 2.0, 6.0, 12.0, 20.0],
        ]
    )
)
"""Coefficients of degree 5 from value, slope and curvature at 0 and at 1."""


def untwisted(flight: Trajectory, counts: np.ndarray, airframe: Airframe | None) -> Trajectory:
    """The yaw from 0 at which a vehicle that flies does not turn about its thrust.

    Parameters
    ----------
    flight
        (K,) pieces in three axes.
    counts
        (K,) even parts of each piece: the yaw is of degree 5 on each, right at their ends in rate
        and acceleration.
    airframe
        What flies, for its drag; None if not known.

    Returns
    -------
    One axis, rad. It jumps in acceleration where the snap of the flight does.
    """
    parts = np.repeat(flight.segment_times / counts, counts)
    piece = np.repeat(np.arange(len(flight)), counts)
    begins = (np.arange(len(piece)) - (np.cumsum(counts) - counts)[piece]) * parts
    nodes = begins[:, None] + parts[:, None] * (0.5 + 0.5 * _GAUSS)
    rates, _ = _tilting(flight, np.repeat(piece, len(_GAUSS)), nodes.ravel(), airframe)
    turns = -0.5 * parts * (rates.reshape(nodes.shape) * _WEIGHTS).sum(axis=1)
    values = np.concatenate(([0.0], np.cumsum(turns)))
    ends = np.empty((len(piece), 6))
    for side in range(2):
        rate, acceleration = _tilting(flight, piece, begins + side * parts, airframe)
        ends[:, 3 * side] = values[side : len(values) - 1 + side]
        ends[:, 3 * side + 1] = -rate * parts
        ends[:, 3 * side + 2] = -acceleration * parts**2
    coefficients = ends @ _HERMITE.T / parts[:, None] ** np.arange(6)
    return Trajectory(coefficients[:, :, None], parts, flight.start_time)


def turning_about_z(
    flight: Trajectory, yaw: Trajectory, times: np.ndarray, airframe: Airframe | None
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) rad/s and rad/s^2 of a vehicle about its own z axis, at (n,) s of a flight and a yaw."""
    piece = np.searchsorted(flight.breakpoints[1:-1], times, side="right")
    rate, acceleration = _tilting(flight, piece, times - flight.breakpoints[piece], airframe)
    return yaw(times, 1)[:, 0] + rate, yaw(times, 2)[:, 0] + acceleration


def _tilting(
    flight: Trajectory, piece: np.ndarray, local: np.ndarray, airframe: Airframe | None
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) rad/s and rad/s^2 by which tilting the shortest way turns about z, at local times."""
    velocity, acceleration, jerk, snap = (flight.at(piece, local, order) for order in range(1, 5))
    if airframe is not None and any(airframe.drag):
        drag = airframe.figures[1]
        snap, jerk = snap + drag * jerk, jerk + drag * acceleration
        acceleration = acceleration + drag * velocity
    force = acceleration + np.array([0.0, 0.0, GRAVITY])
    square = (force * force).sum(axis=1, keepdims=True)
    square[square == 0.0] = np.inf
    along = (force * jerk).sum(axis=1, keepdims=True) / square
    turn = np.cross(force, jerk) / square
    change = np.cross(force, snap - 2.0 * along * jerk)[:, 2] / square[:, 0]
    axis = force / np.sqrt(square)
    rise = 1.0 + axis[:, 2]
    rise[rise < UPSIDE_DOWN] = np.inf
    climb = turn[:, 0] * axis[:, 1] - turn[:, 1] * axis[:, 0]
    return -turn[:, 2] / rise, (turn[:, 2] * climb / rise - change) / rise
