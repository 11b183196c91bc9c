"""The same motion on fewer pieces: what a file format can hold of a finer one."""

import numpy as np

from peakflight.trajectory import Trajectory

SAMPLES = 64
"""Points of a coarse piece at which the two motions are near each other."""
ENDS = 3
"""Value and derivatives that are the same at both ends of a piece."""


def coarsened(
    motion: Trajectory, segment_times: np.ndarray, degree: int
) -> tuple[Trajectory, float]:
    """The motion on (K,) longer pieces, and by how much it is off where it is farthest.

    Position, velocity and acceleration are the same at the ends of every piece; what the degree
    leaves free is the least-squares fit between them.

    Parameters
    ----------
    segment_times
        (K,) s, with the same start and end as the motion.
    degree
        5 at least, or the motion's own if it has the same pieces already.
    """
    is_constant = len(motion) == 1 and not motion.coefficients[:, 1:].any()
    if is_constant or np.array_equal(motion.segment_times, segment_times):
        elevated = motion.elevate(degree).coefficients
        whole = np.broadcast_to(elevated, (len(segment_times), *elevated.shape[1:]))
        return Trajectory(whole, segment_times, motion.start_time), 0.0
    begins = motion.start_time + np.concatenate(([0.0], np.cumsum(segment_times)))
    begins = np.clip(begins, motion.start_time, motion.end_time)
    # in the time of each piece, from 0 to 1
    scales = segment_times[:, None, None] ** np.arange(ENDS)[:, None]
    states = np.stack([motion(begins, order) for order in range(ENDS)], axis=1)
    data = np.concatenate((states[:-1] * scales, states[1:] * scales), axis=1)
    u = np.linspace(0.0, 1.0, SAMPLES)
    wanted = motion(np.minimum(begins[:-1, None] + segment_times[:, None] * u, motion.end_time))
    fixed, free = _shapes(degree)
    powers = u[:, None] ** np.arange(degree + 1)
    rest = wanted - powers @ (fixed @ data)
    fit = np.linalg.pinv(powers @ free) @ rest
    coefficients = fixed @ data + free @ fit
    off = float(np.abs(powers @ coefficients - wanted).max())
    coefficients = coefficients / segment_times[:, None, None] ** np.arange(degree + 1)[:, None]
    return Trajectory(coefficients, segment_times, motion.start_time), off


def _shapes(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Polynomials on [0, 1] of given end states, and those whose end states are zero.

    Returns
    -------
    (N+1, 2 ENDS) coefficients from the states at both ends, and (N+1, N+1-2 ENDS).
    """
    rows = np.zeros((2 * ENDS, degree + 1))
    for power in range(degree + 1):
        monomial = np.polynomial.Polynomial(np.eye(degree + 1)[power])
        for order in range(ENDS):
            rows[order, power] = monomial(0.0)
            rows[ENDS + order, power] = monomial(1.0)
            monomial = monomial.deriv()
    hermite = np.linalg.inv(rows[:, : 2 * ENDS])
    fixed = np.concatenate((hermite, np.zeros((degree + 1 - 2 * ENDS, 2 * ENDS))))
    free = np.concatenate((-hermite @ rows[:, 2 * ENDS :], np.eye(degree + 1 - 2 * ENDS)))
    return fixed, free
