"""Certified upper bounds of what limits are about, over whole pieces.

Everything here is separate from the optimisers and reads only coefficients and durations. A
derivative of a piece, in the Bernstein basis, lies in the hull of its control points; so does its
squared norm, and a quotient of polynomials lies below the largest quotient of their control points
where the denominator's are positive. Subdivision (de Casteljau, at the maximum found by Newton
steps) closes the gap between that bound and an attained value to a relative tolerance. Rounding is
bounded beforehand and added to the control points, so that the bound holds for the polynomial that
is written in the file, in exact arithmetic.

A new kind of limit is a branch in `_range` and one in `_ratio`. Norms of one derivative need no
more; tilt and least thrust are quotients (`_quotient`); kinds from TURNING on are about several
derivatives at once (`kernels.turning`), those from ROTORS on about sums of norms
(`kernels.rotors`). Kinds are numbered as in `limits.KINDS`.
"""

import numpy as np

from peakflight.kernels.bernstein import (
    EPSILON,
    bernstein_tables,
    control_points,
    falling_factorials,
)
from peakflight.kernels.jit import inner, kernel, within
from peakflight.kernels.rotors import largest_demand
from peakflight.kernels.turning import binomials, largest_turn, required_stretch

KIND_ORDERS = np.array([1, 2, 3, 4, 2, 2, 3, 4, 4, 4])
"""The highest derivative that each kind is about."""
TURNING = 6
"""Kinds from here on are about how the thrust direction turns."""
ROTORS = 8
"""Kinds from here on are about rotor thrusts: this one from above, the other from below."""
DEPTH = 24
"""Intervals that wait at any one time; beyond, the hull of an interval is taken as it is."""
NESTING = 40
"""Subdivisions of subdivisions; an interval is then 1e-12 long, or the margin would grow."""
SPLITS = 400
"""Subdivisions of one polynomial, likewise."""
NEWTON = 5
"""Steps towards the maximum before an interval is split there."""
UNBOUNDED = 1e9
"""Kappa where no bound exists, as for least thrust in free fall."""
EXCESS = 1e-9
"""A stretched trajectory may keep this much less than its limits allow, relative."""
ROUNDS = 200
"""Most rounds of the search for a uniform stretch; two or three are usual."""
LONGEST = 1e30
"""No stretch is longer than this."""


def lookup_tables(degree: int) -> tuple[np.ndarray, ...]:
    """What `certify` looks up for pieces of a degree."""
    return (*bernstein_tables(degree), falling_factorials(degree), binomials(degree))


def quotients_workspace(degree: int) -> np.ndarray:
    """Where `certify` keeps the denominators of kinds that are about quotients."""
    return np.empty((DEPTH + 3, 2 * degree + 1))


@kernel
def certify(
    coefficients, times, limits, gravity, tables, tolerance, upper, lower, place, denominators,
    turns, rotors, rounds,
):  # fmt: skip
    """Certified kappa of every piece and kind; and the smallest uniform stretch that keeps limits.

    Both in one kernel: the second needs all of the first, which would be compiled twice.

    coefficients (K, N+1, 3), times (K,), limits as `Limits.as_array`; tables: of
    `lookup_tables`; upper and lower (K, kinds) get the bound and, but for rounding, a value that
    is attained (NaN for kinds that are not limited), place (K, kinds) where, in normalised time.
    denominators: `quotients_workspace`, or None where neither tilt nor least thrust is limited;
    turns: `turning.workspace`, or None where no kind from TURNING to ROTORS is; rotors:
    `rotors.workspace`, or None where none from there on is. It is compiled without them then.

    With rounds = 1 that is all. With more, up to ROUNDS, a trajectory is then scaled until it just
    keeps every limit, certified: coefficients and times are replaced, and the stretch is returned,
    or NaN if there is none. The path stays: derivative s is divided by the stretch to the power s.
    """
    original = coefficients.copy()
    durations = times.copy()
    factor = 1.0
    infeasible = 0.0  # the largest factor that is known not to do
    best = np.inf
    for _ in range(rounds):
        _bound(
            coefficients, times, limits, gravity, tables, tolerance, upper, lower, place,
            denominators, turns, rotors,
        )  # fmt: skip
        if rounds == 1:
            return factor
        feasible = True
        needed = 0.0
        for k in range(times.size):
            for kind in range(limits.size):
                if limits[kind] > 0.0:
                    if not upper[k, kind] <= 1.0:
                        feasible = False
                    at = place[k, kind]
                    needed = max(
                        needed,
                        _needed(
                            kind,
                            coefficients,
                            k,
                            times[k],
                            at,
                            limits,
                            gravity,
                            tables[2],
                            turns,
                            rotors,
                        ),
                    )
        if feasible:
            best = min(best, factor)
        else:
            infeasible = max(infeasible, factor)
        if best <= infeasible * (1.0 + EXCESS) or (feasible and needed >= 1.0 - EXCESS):
            break
        if feasible and needed <= 0.0:
            break  # nothing moves
        # The worst sample tells the next factor, to the last bit if it stays the worst. A violation
        # that only the bound sees is closed by the tolerance itself.
        if not feasible and needed > 1.0 - 2.0 * tolerance:
            needed = max(needed, 1.0 + 2.0 * tolerance)
        factor *= needed * (1.0 + 4.0 * EPSILON)
        if not infeasible < factor < best:  # it tells nothing: search by itself
            if best < np.inf:
                factor = np.sqrt(max(infeasible, 1e-3 * best) * best)
            else:
                factor = 2.0 * infeasible
        if not factor < LONGEST:
            break
        _rescale(original, durations, factor, coefficients, times)
    if best == np.inf:
        return np.nan
    if best != factor:
        _rescale(original, durations, best, coefficients, times)
    return best


@within
def _bound(
    coefficients, times, limits, gravity, tables, tolerance, upper, lower, place, denominators,
    turns, rotors,
):  # fmt: skip
    """One round of `certify`."""
    degree = coefficients.shape[1] - 1
    points = np.empty((degree + 1, 3))
    numerators = np.empty((DEPTH + 3, 2 * degree + 1))
    ends = np.empty((DEPTH + 3, 4))
    for k in range(times.size):
        for kind in range(limits.size):
            upper[k, kind] = np.nan
            lower[k, kind] = np.nan
            place[k, kind] = 0.0
            if not limits[kind] > 0.0:
                continue
            low, high, place[k, kind] = _range(
                kind, limits[kind], coefficients, k, times[k], gravity, tables, tolerance, points,
                numerators, denominators, ends, turns, rotors,
            )  # fmt: skip
            upper[k, kind] = _ratio(kind, high, limits[kind], True)
            lower[k, kind] = _ratio(kind, low, limits[kind], False)


@inner
def _rescale(coefficients, times, factor, scaled_coefficients, scaled_times):
    for k in range(times.size):
        scaled_times[k] = times[k] * factor
        power = 1.0
        for j in range(coefficients.shape[1]):
            for d in range(coefficients.shape[2]):
                scaled_coefficients[k, j, d] = coefficients[k, j, d] / power
            power *= factor


@inner
def _needed(kind, coefficients, piece, time, place, limits, gravity, factorials, turns, rotors):
    """Uniform stretch that one kind asks for at one point of a piece."""
    order = KIND_ORDERS[kind]
    if rotors is None:
        pass
    elif kind >= ROTORS:
        return required_stretch(
            order, _sign(kind), rotors[3], coefficients, piece, time, place, limits[kind],
            gravity, factorials, rotors[2],
        )  # fmt: skip
    if turns is None:
        pass
    elif kind >= TURNING:
        return required_stretch(
            order, 0.0, turns[3], coefficients, piece, time, place, limits[kind], gravity,
            factorials, turns[2],
        )  # fmt: skip
    x = 0.0
    y = 0.0
    z = 0.0
    for j in range(coefficients.shape[1] - 1, order - 1, -1):
        x = x * (place * time) + factorials[order, j] * coefficients[piece, j, 0]
        y = y * (place * time) + factorials[order, j] * coefficients[piece, j, 1]
        z = z * (place * time) + factorials[order, j] * coefficients[piece, j, 2]
    return _required_stretch(kind, x, y, z, limits[kind], gravity)


@inner
def _required_stretch(kind, x, y, z, limit, gravity):
    """Smallest uniform stretch, at least 0, after which a derivative keeps the limit, exactly."""
    square = x * x + y * y + z * z
    if kind == 1:  # |a|^2 + 2 g a_z alpha^2 + g^2 alpha^4 = L^2 alpha^4
        room = limit * limit - gravity * gravity
        b = gravity * z
        return np.sqrt((b + np.sqrt(b * b + room * square)) / room)
    if kind == 4:  # |a_xy| cot(limit) - a_z = g alpha^2
        return np.sqrt(max(np.sqrt(x * x + y * y) / np.tan(limit) - z, 0.0) / gravity)
    if kind == 5:  # the larger root of |a|^2 + 2 g a_z alpha^2 + (g^2 - L^2) alpha^4 = 0
        room = gravity * gravity - limit * limit
        b = -gravity * z
        discriminant = b * b - room * square
        if b <= 0.0 or discriminant <= 0.0:
            return 0.0
        return np.sqrt((b + np.sqrt(discriminant)) / room)
    return (np.sqrt(square) / limit) ** (1.0 / KIND_ORDERS[kind])


@inner
def _range(
    kind, limit, coefficients, piece, time, gravity, tables, tolerance, points, numerators,
    denominators, ends, turns, rotors,
):  # fmt: skip
    """Bounds of the largest value of what a kind is about, from below and above, and where.

    Of its square, if not of rotors. A kind that is left out, for want of its workspace, has no
    bound.
    """
    if rotors is None:
        if kind >= ROTORS:
            return np.inf, np.inf, 0.0
    elif kind >= ROTORS:
        return largest_demand(
            _sign(kind), limit, coefficients, piece, time, gravity, tables, tolerance, points,
            rotors, ends,
        )  # fmt: skip
    if turns is None:
        if kind >= TURNING:
            return np.inf, np.inf, 0.0
    elif kind >= TURNING:
        return largest_turn(
            KIND_ORDERS[kind], coefficients, piece, time, gravity, tables, tolerance, points, turns,
            ends,
        )  # fmt: skip
    order = KIND_ORDERS[kind]
    gravity = gravity if order == 2 else 0.0
    degree = max(coefficients.shape[1] - 1 - order, 0)
    error, _ = control_points(
        coefficients, piece, time, order, degree, gravity, tables[0], tables[2], points
    )
    if not error < np.inf:  # overflow, or not a number
        return np.inf, np.inf, 0.0
    if denominators is None:
        if kind in (4, 5):
            return np.inf, np.inf, 0.0
    elif kind in (4, 5):
        if not _quotient(kind, points, degree, error, tables[1], numerators, denominators, ends):
            return np.inf, np.inf, 0.0
        return _largest(numerators, denominators, 2 * degree, tolerance, ends)
    _square(points, 0, degree, error, tables[1], 1.0, numerators)
    return _largest(numerators, None, 2 * degree, tolerance, ends)


@inner
def _sign(kind):
    """How the size of F enters what a kind of ROTORS is about."""
    return 1.0 if kind == ROTORS else -1.0


@inner
def _quotient(kind, points, degree, error, product, numerators, denominators, ends):
    """Control points of the quotient whose maximum a kind bounds, in row 0 of the stacks.

    points (degree+1, 3): control points of a + g e3. Returns whether the quotient is defined.
    """
    if kind == 5:  # 1 / |a + g e3|^2
        _square(points, 0, degree, error, product, -1.0, denominators)
        for i in range(2 * degree + 1):
            numerators[0, i] = 1.0
        return True
    # |a_xy|^2 / (a_z + g)^2, the squared tangent of the tilt
    for i in range(degree + 1):
        numerators[0, i] = error - points[i, 2]
    _, high, _ = _largest(numerators, None, degree, 1e-3, ends)
    if not high < 0.0:
        return False
    _square(points, 2, degree, error, product, -1.0, denominators)
    for i in range(degree + 1):
        points[i, 2] = 0.0
    _square(points, 0, degree, error, product, 1.0, numerators)
    return True


@inner
def _ratio(kind, value, limit, is_bound):
    """Kappa from the value that `_range` is about; a bound is rounded up."""
    slack = 1.0 + 4.0 * EPSILON if is_bound else 1.0
    root = value if kind >= ROTORS else np.sqrt(max(value, 0.0)) * slack
    if kind == 4:
        ratio = np.arctan(root) * slack / limit if value < np.inf else np.pi / limit
    elif kind == 5:
        ratio = root * limit
    else:
        ratio = root / limit
    return UNBOUNDED if np.isnan(ratio) else min(ratio * slack, UNBOUNDED)


@inner
def _square(points, first, degree, error, product, sign, out):
    """out[0] <- control points of the squared norm, over the axes from `first` on, moved by sign
    times a bound of all rounding errors, those of subdivision included.
    """
    largest = 0.0
    for i in range(2 * degree + 1):
        out[0, i] = 0.0
    for i in range(degree + 1):
        norm = 0.0
        for d in range(first, 3):
            norm += points[i, d] * points[i, d]
        largest = max(largest, norm)
        for j in range(degree + 1):
            dot = 0.0
            for d in range(first, 3):
                dot += points[i, d] * points[j, d]
            out[0, i + j] += product[degree, i, j] * dot
    rounding = (10 + 2 * degree + 8 * degree * NESTING) * EPSILON
    margin = 2.0 * error * np.sqrt(largest) + error * error + rounding * largest
    for i in range(2 * degree + 1):
        out[0, i] += sign * margin


@inner
def _largest(numerators, denominators, degree, tolerance, ends):
    """Bounds of the largest quotient over [0, 1] from the control points in row 0.

    denominators: None if they are one. Returns an attained value, an upper bound, and where the
    first is attained.
    """
    low = -np.inf
    high = -np.inf
    place = 0.0
    for side in range(2):
        value = _at_end(numerators, denominators, 0, side * degree)
        if value > low:
            low = value
            place = float(side)
    waiting = 1
    splits = 0
    ends[0, 0] = 0.0
    ends[0, 1] = 1.0
    ends[0, 2] = 0.0
    while waiting > 0:
        waiting -= 1
        bound = -np.inf
        index = 0
        for i in range(degree + 1):
            value = _at_end(numerators, denominators, waiting, i)
            if not value <= bound:
                bound = value
                index = i
        if bound <= low + tolerance * abs(low):
            high = max(high, bound)
            continue
        if np.isnan(bound):
            return low, np.inf, place
        if waiting >= DEPTH or splits > SPLITS or ends[waiting, 2] >= NESTING:
            high = max(high, bound)
            continue
        at = 0.5
        if splits < 8 and 0 < index < degree:
            at = index / degree
            if denominators is None and degree >= 2:
                at = _newton(numerators, waiting, waiting + 2, degree, at)
        middle = ends[waiting, 0] + at * (ends[waiting, 1] - ends[waiting, 0])
        _split(numerators, waiting, degree, at)
        if denominators is not None:
            _split(denominators, waiting, degree, at)
        ends[waiting + 1, 0] = ends[waiting, 0]
        ends[waiting + 1, 1] = middle
        ends[waiting, 0] = middle
        ends[waiting, 2] += 1.0
        ends[waiting + 1, 2] = ends[waiting, 2]
        value = _at_end(numerators, denominators, waiting, 0)
        if value > low and value < np.inf:
            low = value
            place = middle
        splits += 1
        waiting += 2
    return low, max(low, high), place


@inner
def _at_end(numerators, denominators, row, i):
    """Quotient of two control points; infinite where the denominator may vanish."""
    if denominators is None:
        return numerators[row, i]
    if denominators[row, i] > 0.0:
        return numerators[row, i] / denominators[row, i]
    return np.inf


@inner
def _newton(points, row, scratch, degree, at):
    """Where the polynomial of a row has its maximum, near `at`; 0.5 if that leads nowhere."""
    for _ in range(NEWTON):
        rest = 1.0 - at
        for i in range(degree + 1):
            points[scratch, i] = points[row, i]
        for level in range(degree - 2):
            for i in range(degree - level):
                points[scratch, i] = rest * points[scratch, i] + at * points[scratch, i + 1]
        curve = (
            (degree - 1) * degree
            * (points[scratch, 2] - 2.0 * points[scratch, 1] + points[scratch, 0])
        )  # fmt: skip
        first = rest * points[scratch, 0] + at * points[scratch, 1]
        second = rest * points[scratch, 1] + at * points[scratch, 2]
        if not curve < 0.0:
            break
        step = -degree * (second - first) / curve
        at += step
        if not 1e-6 < at < 1.0 - 1e-6:
            return 0.5
        if abs(step) < 1e-8:
            break
    return at if 1e-6 < at < 1.0 - 1e-6 else 0.5


@inner
def _split(points, row, degree, at):
    """De Casteljau: row + 1 <- the part before `at`, row <- the part after."""
    rest = 1.0 - at
    points[row + 1, 0] = points[row, 0]
    for level in range(degree):
        for i in range(degree - level):
            points[row, i] = rest * points[row, i] + at * points[row, i + 1]
        points[row + 1, level + 1] = points[row, 0]
