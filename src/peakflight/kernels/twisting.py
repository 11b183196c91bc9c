"""Certified upper bounds of how a vehicle twists about its thrust, and what its rotors give then.

Flight and yaw together say how the vehicle turns. With F, its derivatives j and s, its direction b
and epsilon as in `kernels.rotors`, and

    w = F x j / F.F,    w' = F x (s - 2 (F.j / F.F) j) / F.F,    b' = w x b,

the body, tilted to b by the shortest way after a turn by the yaw psi, has about its own z axis

    omega_z = psi' - w_3 / (1 + b_3),
    alpha_z = psi'' - w'_3 / (1 + b_3) + w_3 b'_3 / (1 + b_3)^2,

and across it the torque I w' + I_z omega_z b', where I is its inertia across z and I_z that about
it. Whatever the direction of the nose, four rotors in a square of lever l whose torque is kappa
times their thrust then give, times four and over the mass m, at most

    |F| + epsilon b.v + c |w' + r omega_z b'| + k |alpha_z|,

with c = sqrt(2) I / (l m), r = I_z / I and k = I_z / (kappa m), and at least the same with the
other signs of what turns it. If inertia differs by D between the two axes across z, and I is the
larger, that adds at most (1 + r) D / I c |omega_z| |w| and chi |w|^2, chi = D / (2 kappa m).

On intervals all of it lies within radii of lines (`kernels.lines`); bounds and subdivision are as
in `kernels.rotors`.
"""

import numpy as np

from peakflight.kernels.bernstein import EPSILON, control_points
from peakflight.kernels.jit import inner, kernel
from peakflight.kernels.lines import (
    ROUNDED,
    cross,
    drawn,
    end_norm,
    inverse,
    keep,
    line,
    negative,
    plus,
    thickness,
    times,
)
from peakflight.kernels.rotors import (
    AXIS,
    LINES,
    PULL,
    RATE,
    SMALLEST,
    TURN,
    F,
    along,
    control_columns,
    draw,
)
from peakflight.kernels.turning import DEPTH, NESTING, split

COUNT = 4
"""What is bounded: |omega_z|, |alpha_z|, and what the most and the least of a rotor's thrusts ask,
in the form of `kernels.rotors`."""
SPLITS = 4000
"""Subdivisions of one part of a piece in a pass; beyond, the bound of an interval is taken as it
is."""
PASSES, CLOSER = 4, 16.0
"""Times that a part is gone through, each closer by this than the one before: what is attained
anywhere spares many intervals later, and where subdivisions end, the pass before has its bound."""
ROUGHEST, FALL = 1e-4, 0.5
"""A gap that a subdivision did not lower to the second part of what it was is rounding, if it is
below the first part of the limit: it stays."""
SWING, TORQUE, TWIST, ROWS = LINES, LINES + 3, LINES + 6, LINES + 8
"""Rows of lines after those of `rotors`, of which TURN is w': b', w' + r omega_z b', then omega_z
and alpha_z."""
ATTAINED, PROVEN, CLOSED, HERE, INTERVAL, OWN, BOUNDS = 0, 1, 2, 3, 4, 5, 6
"""Rows of bounds: what a piece attains, and does not exceed; what a part of it does not, by all
passes and by this one; what an interval does not, and what it attains at its ends."""
PART = DEPTH + 3
"""Where the stack of intervals keeps the part that they are of."""


@kernel
def largest(
    coefficients, durations, yaw, parts, lost, firsts, figures, limits, gravity, tables, tolerance,
    upper,
):  # fmt: skip
    """Upper bounds of what is limited over every piece of a flight, over the limits.

    Parameters
    ----------
    coefficients, durations
        (K, N+1, 3) and (K,) s of the flight.
    yaw, parts, lost, firsts
        (M, n+1, 3) with the yaw in the first axis, (M,) s, (M, 2) what its rate and acceleration
        are wrong by at most; each piece of the flight consists of whole ones of the yaw, from
        (K+1,) `firsts` on.
    figures
        (7,) c, delta, epsilon, chi, r, k, and the factor of |omega_z| |w|.
    limits
        (COUNT,); NaN where nothing is limited. The last is how far below gravity the demand on the
        least thrust may fall, as in `Limits.as_array`.
    tables
        Of `bernstein_tables` and `falling_factorials` of the larger degree of both.
    tolerance
        To which bounds are closed, relative to the limit or the value, if that is larger.
    upper
        (K, COUNT) gets the bounds; NaN where nothing is limited.
    """
    degree = max(coefficients.shape[1] - 2, yaw.shape[1] - 2, 0)
    whole = np.empty((2, degree + 1, 12))
    stack = np.empty((DEPTH + 4, degree + 1, 14))
    points = np.empty((degree + 1, 3))
    lines = np.empty((ROWS, 3))
    state = np.empty((DEPTH + 3, 3))
    turned = np.empty((2, 2))
    bounds = np.empty((BOUNDS, COUNT))
    errors = np.zeros(4)
    sizes = np.zeros(4)
    for k in range(durations.size):
        bounds[:] = 0.0
        if firsts[k] == firsts[k + 1]:  # no yaw, nothing proven
            bounds[PROVEN] = np.inf
        if not control_columns(
            coefficients, k, durations[k], figures[1], gravity, tables[0], tables[1], points, whole,
            errors, sizes,
        ):  # fmt: skip
            errors[:] = np.inf
        rest = durations[k]
        for part in range(firsts[k], firsts[k + 1]):
            row = 0
            if part + 1 < firsts[k + 1]:
                split(whole, 0, degree, parts[part] / rest)
                rest -= parts[part]
                row = 1
            for i in range(degree + 1):
                for c in range(12):
                    stack[PART, i, c] = whole[row, i, c]
            for order in range(2):
                turned[order] = control_points(
                    yaw, part, parts[part], order + 1, degree, 0.0, tables[0], tables[1], points
                )
                turned[order, 0] += lost[part, order]
                for i in range(degree + 1):
                    stack[PART, i, 12 + order] = points[i, 0]
            _close(
                float(part - firsts[k] + 1), stack, degree, state, errors, sizes, turned, figures,
                limits, gravity, tolerance, lines, bounds,
            )  # fmt: skip
        for q in range(COUNT):
            upper[k, q] = np.nan
            if limits[q] > 0.0:
                reached = max(bounds[ATTAINED, q], bounds[PROVEN, q])
                upper[k, q] = reached / limits[q] * (1.0 + 4.0 * EPSILON)


@inner
def _close(
    nesting, stack, degree, state, errors, sizes, turned, figures, limits, gravity, tolerance,
    lines, bounds,
):  # fmt: skip
    """Raise bounds, rows ATTAINED and PROVEN, by a part of a piece: its control points in row PART.

    nesting: how often it has been subdivided; turned (2, 2): error and size of the yaw's rate and
    acceleration.
    """
    bounds[CLOSED] = np.inf
    for further in range(PASSES - 1, -1, -1):
        for i in range(degree + 1):
            for c in range(14):
                stack[0, i, c] = stack[PART, i, c]
        state[0, 0] = nesting
        state[0, 1] = 0.0
        state[0, 2] = np.inf
        bounds[HERE] = 0.0
        splits = _subdivide(
            stack, degree, state, errors, sizes, turned, figures, limits, gravity,
            tolerance * CLOSER**further, lines, bounds,
        )  # fmt: skip
        is_closed = True
        for q in range(COUNT):
            bounds[CLOSED, q] = min(bounds[CLOSED, q], bounds[HERE, q])
            if limits[q] > 0.0 and not _is_close(bounds, q, CLOSED, limits[q], tolerance):
                is_closed = False
        if is_closed or splits >= SPLITS:
            break
    for q in range(COUNT):
        bounds[PROVEN, q] = max(bounds[PROVEN, q], bounds[CLOSED, q])


@inner
def _is_close(bounds, q, row, limit, tolerance):
    """Whether a bound is near what is attained, relative to that or to the limit, the larger."""
    low = bounds[ATTAINED, q]
    return bounds[row, q] <= low + tolerance * max(low, limit)


@inner
def _subdivide(
    stack, degree, state, errors, sizes, turned, figures, limits, gravity, tolerance, lines, bounds
):
    """Raise row HERE of the bounds to those of all parts of row 0; returns how many splits.

    state: how often each interval was subdivided, in all and within the part, and its gap before.
    """
    waiting = 1
    splits = 0
    while waiting > 0:
        waiting -= 1
        nesting = state[waiting, 0]
        depth = state[waiting, 1]
        bounds[INTERVAL] = np.inf
        bounds[OWN] = 0.0
        if _draw(stack, waiting, degree, errors, sizes, nesting, turned, figures, lines):
            _measure(lines, figures, gravity, bounds)
        is_closed = True
        gap = 0.0
        for q in range(COUNT):
            bounds[ATTAINED, q] = max(bounds[ATTAINED, q], bounds[OWN, q])
            if limits[q] > 0.0:
                size = max(bounds[ATTAINED, q], limits[q])
                gap = max(gap, (bounds[INTERVAL, q] - bounds[OWN, q]) / size)
                if not _is_close(bounds, q, INTERVAL, limits[q], tolerance):
                    is_closed = False
        is_rounding = gap <= ROUGHEST and gap > FALL * state[waiting, 2]
        is_last = waiting >= DEPTH or splits >= SPLITS or depth >= NESTING
        if is_closed or is_rounding or is_last:
            for q in range(COUNT):
                bounds[HERE, q] = max(bounds[HERE, q], bounds[INTERVAL, q])
            continue
        split(stack, waiting, degree, 0.5)
        for side in range(2):
            state[waiting + side, 0] = nesting + 1.0
            state[waiting + side, 1] = depth + 1.0
            state[waiting + side, 2] = gap
        splits += 1
        waiting += 2
    return splits


@inner
def _draw(stack, row, degree, errors, sizes, nesting, turned, figures, lines):
    """Lines <- all of the quantities at the top on an interval.

    Returns whether they are defined: there is thrust all along, and it does not point straight
    down.
    """
    if not draw(stack, row, degree, errors, sizes, nesting, figures[2], lines):
        return False
    cross(lines, RATE, AXIS, SWING)
    height = line(lines, AXIS + 2)
    rise = inverse((1.0 + height[0], height[1], height[2] + ROUNDED))
    if not rise[2] < np.inf:
        return False
    for order in range(2):
        lost = turned[order, 0] + (degree * nesting + 16.0) * EPSILON * turned[order, 1]
        if not lost < np.inf:
            return False
        keep(lines, TWIST + order, drawn(stack, row, 12 + order, degree, lost))
    tilting = times(line(lines, RATE + 2), rise)
    twist = plus(line(lines, TWIST), negative(tilting))
    change = plus(line(lines, TWIST + 1), negative(times(line(lines, TURN + 2), rise)))
    change = plus(change, times(times(tilting, rise), line(lines, SWING + 2)))
    keep(lines, TWIST, twist)
    keep(lines, TWIST + 1, change)
    ratio = figures[4]
    pull = (ratio * twist[0], ratio * twist[1], ratio * twist[2])
    for d in range(3):
        swung = times(pull, line(lines, SWING + d))
        keep(lines, TORQUE + d, plus(line(lines, TURN + d), swung))
    for i in range(ROWS):  # what is not a number would be lost among the maxima below
        for part in range(3):
            if not abs(lines[i, part]) < np.inf:
                return False
    return True


@inner
def _measure(lines, figures, gravity, bounds):
    """Bounds of what is limited on an interval: above, and below its maximum.

    At an end of the interval it is within the radii of what it is at the ends of the lines.
    """
    bounds[INTERVAL] = 0.0
    reach, crossed, spin, twisting = figures[0], figures[3], figures[5], figures[6]
    centre = np.sqrt(lines[F, 0] ** 2 + lines[F + 1, 0] ** 2 + lines[F + 2, 0] ** 2)
    wide = thickness(lines, F) + reach * thickness(lines, TORQUE)
    wide += lines[PULL, 2] + spin * lines[TWIST + 1, 2]
    size = gravity
    # both of a product lie below their chords, and that of these exceeds its ends by at most this
    spread = abs(end_norm(lines, RATE, 1.0) - end_norm(lines, RATE, -1.0))
    chords = 0.5 * twisting * spread * abs(lines[TWIST, 1])
    for side in range(2):
        way = 2.0 * side - 1.0
        for order in range(2):
            end = abs(lines[TWIST + order, 0] + way * lines[TWIST + order, 1])
            radius = lines[TWIST + order, 2] + ROUNDED * end
            bounds[OWN, order] = max(bounds[OWN, order], end - radius)
            bounds[INTERVAL, order] = max(bounds[INTERVAL, order], (end + radius) * (1.0 + ROUNDED))
            change = end
        thrust = end_norm(lines, F, way)
        turning = reach * end_norm(lines, TORQUE, way) + spin * change
        pull = lines[PULL, 0] + way * lines[PULL, 1]
        size = max(size, gravity + thrust + abs(pull) + turning)
        rest = gravity - pull + turning
        rate = end_norm(lines, RATE, way)
        spun = abs(lines[TWIST, 0] + way * lines[TWIST, 1])
        slow = max(rate - thickness(lines, RATE), 0.0)
        lower = (twisting * max(spun - lines[TWIST, 2], 0.0) + crossed * slow) * slow - wide
        fast = rate + thickness(lines, RATE)
        upper = (twisting * (spun + lines[TWIST, 2]) + crossed * fast) * fast
        upper = (upper + chords + wide) * (1.0 + ROUNDED)
        bounds[OWN, 2] = max(bounds[OWN, 2], thrust + pull + turning + lower)
        bounds[OWN, 3] = max(bounds[OWN, 3], rest - thrust + lower)
        bounds[INTERVAL, 2] = max(bounds[INTERVAL, 2], thrust + pull + turning + upper)
        bounds[INTERVAL, 3] = max(bounds[INTERVAL, 3], rest - along(lines, way) / centre + upper)
    for q in range(2, COUNT):
        bounds[INTERVAL, q] += 3.0 * ROUNDED * size + SMALLEST
    for q in range(COUNT):
        if np.isnan(bounds[INTERVAL, q]):
            bounds[INTERVAL, q] = np.inf
