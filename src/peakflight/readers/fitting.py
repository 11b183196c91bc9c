"""Piecewise polynomials that pass within a tolerance of samples.

Where samples come with their derivatives, pieces go from one sample to another, as long as all
between are met, and have the derivatives of both (Hermite's polynomial): they join smoothly by
themselves. Positions alone are fitted by least squares with a quintic spline (C4) whose knots are
doubled until it is near enough.
"""

import math

import numpy as np

from peakflight.trajectory import Trajectory

INSTANT = 0.1
"""Time by which a tolerance of positions becomes one of their derivatives, s: those of velocity and
acceleration are the tolerance over it and over its square."""
CHECKED = 3
"""Derivatives, position among them, whose distance from samples is held to a tolerance."""
DEGREE = 5
"""Of splines through positions alone."""
REFINEMENTS = 4
"""Bisections between too few knots and enough."""


def through_states(times: np.ndarray, states: np.ndarray, tolerance: float) -> Trajectory:
    """Pieces of degree 2m-1 between some of the samples, near all the others.

    Parameters
    ----------
    times
        (n,) s, increasing.
    states
        (m, n, D) position and derivatives: three or four of them.
    tolerance
        m.
    """
    count = len(states)
    inverse = np.linalg.inv(end_rows(count))
    allowed = tolerance / INSTANT ** np.arange(CHECKED)
    pieces, durations, first, step = [], [], 0, 1
    last = len(times) - 1

    def piece(end: int) -> tuple[np.ndarray, float]:
        """Coefficients in normalised time of the piece from `first`, and its duration."""
        length = float(times[end] - times[first])
        scales = length ** np.arange(count)[:, None]
        data = np.concatenate((states[:, first] * scales, states[:, end] * scales))
        return inverse @ data, length

    def fits(end: int) -> bool:
        if end <= first + 1:
            return True
        coefficients, length = piece(end)
        u = (times[first + 1 : end] - times[first]) / length
        for order in range(CHECKED):
            wanted = states[order, first + 1 : end]
            off = _value(coefficients, u, order) / length**order - wanted
            if not np.abs(off).max() <= allowed[order]:
                return False
        return True

    while first < last:
        good, step = first + 1, max(step // 2, 1)
        while good + step <= last and fits(good + step):
            good += step
            step *= 2
        bad = min(good + step, last + 1)
        while bad - good > 1:
            middle = (good + bad) // 2
            if fits(middle):
                good = middle
            else:
                bad = middle
        coefficients, length = piece(good)
        pieces.append(coefficients / length ** np.arange(2 * count)[:, None])
        durations.append(length)
        step, first = good - first, good
    return Trajectory(np.array(pieces), np.array(durations), float(times[0]))


def through_positions(times: np.ndarray, points: np.ndarray, tolerance: float) -> Trajectory:
    """A quintic spline near (n, D) positions at (n,) increasing s; of lower degree below 6 samples.

    Raises
    ------
    ValueError
        If the samples are too unevenly spaced for one.
    """
    degree = min(DEGREE, len(times) - 1)
    most = len(times) - degree
    spans, tried = 1, 0
    best = None
    while best is None:
        best = _spline(times, points, degree, spans, tolerance)
        if best is None and spans == most:
            return _interpolated(times, points, degree)
        if best is None:
            tried, spans = spans, min(2 * spans, most)
    for _ in range(REFINEMENTS):
        middle = (tried + spans) // 2
        if middle in (tried, spans):
            break
        smaller = _spline(times, points, degree, middle, tolerance)
        if smaller is None:
            tried = middle
        else:
            best, spans = smaller, middle
    return best


def through_angles(times: np.ndarray, angles: np.ndarray, tolerance: float) -> Trajectory:
    """A cubic spline near (n,) angles, rad, at (n,) increasing s, at rate 0 at both ends."""
    from scipy.interpolate import CubicSpline

    best, step = None, 1
    while best is None or step < len(times):
        kept = np.unique(np.append(np.arange(0, len(times), step), len(times) - 1))
        spline = CubicSpline(times[kept], angles[kept], bc_type="clamped")
        if best is not None and not np.abs(spline(times) - angles).max() <= tolerance:
            break
        best, step = spline, 2 * step
    return Trajectory(best.c[::-1].T[:, :, None], np.diff(best.x), float(times[0]))


def end_rows(count: int) -> np.ndarray:
    """(2m, 2m): the first m derivatives at 0 and at 1, from ascending coefficients."""
    rows = np.zeros((2 * count, 2 * count))
    for order in range(count):
        rows[order, order] = math.factorial(order)
        for power in range(order, 2 * count):
            rows[count + order, power] = math.perm(power, order)
    return rows


def _value(coefficients: np.ndarray, u: np.ndarray, order: int) -> np.ndarray:
    """(n, D) derivative of a polynomial (N+1, D) at (n,) points."""
    value = np.zeros((len(u), coefficients.shape[1]))
    for power in range(len(coefficients) - 1, order - 1, -1):
        value = value * u[:, None] + math.perm(power, order) * coefficients[power]
    return value


def _spline(
    times: np.ndarray, points: np.ndarray, degree: int, spans: int, tolerance: float
) -> Trajectory | None:
    """The least-squares spline of so many pieces, each with about as many samples; None if it is
    further from a sample than the tolerance.
    """
    from scipy.interpolate import make_lsq_spline

    u, scale = _normalised(times)
    marks = np.unique(np.round(np.linspace(0, len(times) - 1, spans + 1)).astype(int))
    knots = np.concatenate((np.full(degree, u[0]), u[marks], np.full(degree, u[-1])))
    centre = points.mean(axis=0)
    try:
        spline = make_lsq_spline(u, points - centre, knots, k=degree)
    except (ValueError, np.linalg.LinAlgError):
        return None
    off = spline(u) + centre - points
    if not np.abs(off).max() <= tolerance:
        return None
    return _pieces(spline, u[marks], scale, centre, float(times[0]))


def _interpolated(times: np.ndarray, points: np.ndarray, degree: int) -> Trajectory:
    from scipy.interpolate import make_interp_spline

    u, scale = _normalised(times)
    centre = points.mean(axis=0)
    try:
        spline = make_interp_spline(u, points - centre, k=degree)
    except np.linalg.LinAlgError as error:
        raise ValueError(str(error)) from None
    return _pieces(spline, np.unique(spline.t), scale, centre, float(times[0]))


def _normalised(times: np.ndarray) -> tuple[np.ndarray, float]:
    """(n,) times in which samples are about 1 apart, and how many s that is."""
    scale = float(times[-1] - times[0]) / (len(times) - 1)
    return (times - times[0]) / scale, scale


def _pieces(
    spline: object, knots: np.ndarray, scale: float, centre: np.ndarray, start: float
) -> Trajectory:
    """A spline in normalised time as ascending polynomials."""
    degree = spline.k  # type: ignore[attr-defined]
    coefficients = np.stack(
        [
            spline.derivative(order)(knots[:-1]) / (math.factorial(order) * scale**order)  # type: ignore[attr-defined]
            for order in range(degree + 1)
        ],
        axis=1,
    )
    coefficients[:, 0] += centre
    return Trajectory(coefficients, np.diff(knots) * scale, start)
