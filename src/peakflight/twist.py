"""The yaw of a vehicle that does not turn about its thrust: where its nose is left by flying.

The attitude tilts by the shortest way from upright to the thrust direction b, after a turn by the
yaw (`kernels.flatness`). While b goes around, that tilt alone turns the vehicle about its own z
axis, by omega = -w_3 / (1 + b_3) where w = F x j / F.F is how b turns, and F is the thrust with
drag, j its derivative (`kernels.rotors`). A yaw with psi' = -omega undoes it.
"""

import math
from typing import NamedTuple

import numpy as np

from peakflight.airframe import Airframe
from peakflight.limits import GRAVITY
from peakflight.trajectory import Trajectory

UPSIDE_DOWN = 1e-9
"""1 + b_3 below this: no way to tilt there is the shortest, and the yaw stays as it is."""
HALVINGS = 8
"""Most times that a part of a yaw is halved."""
LOOKS = (0.2, 0.5, 0.8)
"""Where in a part the error is looked at: it is zero at both ends."""
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


def untwisted(
    flight: Trajectory,
    counts: np.ndarray,
    airframe: Airframe | None,
    *,
    closeness: float = math.inf,
) -> Trajectory:
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
    closeness
        Parts are halved where the acceleration is off by more, rad/s^2: a thrust that nearly points
        straight down swings round within milliseconds.

    Returns
    -------
    One axis, rad. It jumps in acceleration where the snap of the flight does.
    """
    durations = np.repeat(flight.segment_times / counts, counts)
    piece = np.repeat(np.arange(len(flight)), counts)
    begins = (np.arange(len(piece)) - (np.cumsum(counts) - counts)[piece]) * durations
    waiting = _Parts(piece, begins, durations)
    done: list[tuple[_Parts, np.ndarray]] = []
    for halving in range(HALVINGS + 1):
        fits = _fits(flight, waiting, airframe)
        is_close = np.ones(len(waiting.piece), dtype=bool)
        if closeness < math.inf and halving < HALVINGS:
            is_close = _error(flight, waiting, fits, airframe) <= closeness
        done.append((waiting.only(is_close), fits[is_close]))
        if is_close.all():
            break
        waiting = waiting.only(~is_close).halves()
    parts = _Parts(*(np.concatenate([own[k] for own, _ in done]) for k in range(3)))
    fits = np.concatenate([own for _, own in done])
    order = np.lexsort((parts.begins, parts.piece))
    durations, fits = parts.durations[order], fits[order]
    turns = fits.sum(axis=1)
    fits[:, 0] = np.cumsum(turns) - turns
    coefficients = fits / durations[:, None] ** np.arange(6)
    return Trajectory(coefficients[:, :, None], durations, flight.start_time)


def turning_about_z(
    flight: Trajectory, yaw: Trajectory, times: np.ndarray, airframe: Airframe | None
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) rad/s and rad/s^2 of a vehicle about its own z axis, at (n,) s of a flight and a yaw."""
    piece = np.searchsorted(flight.breakpoints[1:-1], times, side="right")
    rate, acceleration = _tilting(flight, piece, times - flight.breakpoints[piece], airframe)
    return yaw(times, 1)[:, 0] + rate, yaw(times, 2)[:, 0] + acceleration


class _Parts(NamedTuple):
    """Parts of the pieces of a flight, (n,) each."""

    piece: np.ndarray
    begins: np.ndarray
    """s since the piece began."""
    durations: np.ndarray

    def only(self, which: np.ndarray) -> "_Parts":
        return _Parts(*(column[which] for column in self))

    def halves(self) -> "_Parts":
        half = np.repeat(0.5 * self.durations, 2)
        begins = np.repeat(self.begins, 2)
        begins[1::2] += half[1::2]
        return _Parts(np.repeat(self.piece, 2), begins, half)


def _fits(flight: Trajectory, parts: _Parts, airframe: Airframe | None) -> np.ndarray:
    """(n, 6) coefficients of the yaw in the part's own time from 0 to 1, from 0 on."""
    piece, begins, durations = parts
    nodes = begins[:, None] + durations[:, None] * (0.5 + 0.5 * _GAUSS)
    rates, _ = _tilting(flight, np.repeat(piece, len(_GAUSS)), nodes.ravel(), airframe)
    ends = np.zeros((len(piece), 6))
    ends[:, 3] = -0.5 * durations * (rates.reshape(nodes.shape) * _WEIGHTS).sum(axis=1)
    for side in range(2):
        rate, acceleration = _tilting(flight, piece, begins + side * durations, airframe)
        ends[:, 3 * side + 1] = -rate * durations
        ends[:, 3 * side + 2] = -acceleration * durations**2
    fits: np.ndarray = ends @ _HERMITE.T
    return fits


def _error(
    flight: Trajectory, parts: _Parts, fits: np.ndarray, airframe: Airframe | None
) -> np.ndarray:
    """(n,) rad/s^2, about the largest error of the acceleration."""
    worst = np.zeros(len(fits))
    powers = np.arange(2, 6)
    for at in LOOKS:
        _, tilting = _tilting(flight, parts.piece, parts.begins + at * parts.durations, airframe)
        fitted = (fits[:, 2:] * powers * (powers - 1) * at ** (powers - 2)).sum(axis=1)
        worst = np.maximum(worst, np.abs(fitted / parts.durations**2 + tilting))
    return worst


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
