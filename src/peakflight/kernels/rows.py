"""What `joint` sees of each kind of limit: one small unit a kind.

A unit maps the samples of a piece (velocity, F = a + g e3, jerk, snap) to values c that are at most
0 exactly when a sample keeps its limit, with their slopes by the derivatives that the kind depends
on (`KIND_TERMS`), a bend for each of those: a multiple of the identity that stands for the positive
part of the second derivative; and the largest stretch that a sample would need. Beside it stands
its kappa, peak over limit, from which the solver learns what happens between samples.

A new kind is one pair of functions, a line in `constrain` and in `kappa`, and a line in
`KIND_TERMS`. Kinds are numbered as in `limits.KINDS`. Limits are given sample by sample: the solver
lowers them where the limit would be exceeded nearby.
"""

import numpy as np

from peakflight.kernels.jit import inner, vector

KIND_TERMS: tuple[tuple[int, ...], ...] = (
    (1,),
    (2,),
    (3,),
    (4,),
    (2,),
    (2,),
    (2, 3),
    (2, 3, 4),
    (1, 2, 3, 4),
    (1, 2, 3, 4),
)
"""The derivatives that each kind depends on."""
LEANING = frozenset((4, 5))
"""Tilt and least thrust, which are compiled only where one of them is limited."""
TURNING = frozenset((6, 7))
"""Likewise those about how the thrust direction turns."""
ROTORS = 8
"""Likewise kinds from here on: rotor thrust from above, and from below."""
ROOTS = np.array([0, 0, 1, 2])
"""Square roots taken of |d|^2 / L^2 for speed, thrust, jerk and snap: they tame high orders."""
TINY = 1e-150
"""Added to what is divided by."""
BENT = 0.25
"""Squared ratio below which roots are continued by their tangent: far from a limit, quadratic."""
ROUNDNESS = 1e-2
"""Least horizontal acceleration, as a part of gravity, that tilt knows: no kink when upright."""
WEIGHTLESS = 1e-8
"""Least |F|^2, as a part of g^2, that rates of the thrust direction are divided by."""


@inner
def constrain(
    kind, leaning, turning, figures, samples, limits, gravity, values, r, first, slopes, bends
):
    """Values, slopes and bends of a kind at the samples of a piece; returns the stretch they need.

    samples (3, 4, S): axes, derivatives, samples; limits, values (R, S) of kinds, this one's in row
    r; slopes (P, 3, S) and bends (P, S) hold the terms of this kind from `first` on, in the order
    of `KIND_TERMS`; leaning, turning, figures (4,) of `kernels.rotors`: None if no kind of
    theirs is limited.
    """
    if kind == 1:
        return _thrust(samples, limits, gravity, values, r, first, slopes, bends)
    if kind < 4:
        return _norm(samples, kind, limits, ROOTS[kind], values, r, first, slopes, bends)
    if kind < 6:
        return _lean(leaning, kind, samples, limits, gravity, values, r, first, slopes, bends)
    if kind < ROTORS:
        return _turn(turning, kind, samples, limits, gravity, values, r, first, slopes, bends)
    return _rotors(figures, kind, samples, limits, gravity, values, r, first, slopes, bends)


@inner
def _lean(leaning, kind, samples, limits, gravity, values, r, first, slopes, bends):
    """Tilt and least thrust; not compiled where neither is set."""
    if leaning is None:
        return 0.0
    if kind == 4:
        return _tilt(samples, limits, gravity, values, r, first, slopes, bends)
    return _least_thrust(samples, limits, gravity, values, r, first, slopes, bends)


@inner
def _turn(turning, kind, samples, limits, gravity, values, r, first, slopes, bends):
    """Kinds about how the thrust direction turns; not compiled where none is set."""
    if turning is None:
        return 0.0
    if kind == 6:
        return _body_rate(samples, limits, gravity, values, r, first, slopes, bends)
    return _angular_acceleration(samples, limits, gravity, values, r, first, slopes, bends)


@inner
def kappa(kind, leaning, turning, figures, samples, limit, gravity, out):
    """Out (S,) <- peak over limit of each sample (Eq. kapp_i, Eq. kappa2)."""
    if kind < 4:
        _norm_kappa(samples, kind, limit, out)
    elif kind < 6:
        _lean_kappa(leaning, kind, samples, limit, out)
    elif kind < ROTORS:
        _turn_kappa(turning, kind, samples, limit, gravity, out)
    else:
        _rotors_kappa(figures, kind, samples, limit, gravity, out)


@inner
def _lean_kappa(leaning, kind, samples, limit, out):
    if leaning is None:
        return
    if kind == 4:
        _tilt_kappa(samples, limit, out)
    else:
        _least_thrust_kappa(samples, limit, out)


@inner
def _turn_kappa(turning, kind, samples, limit, gravity, out):
    if turning is None:
        return
    if kind == 6:
        _body_rate_kappa(samples, limit, gravity, out)
    else:
        _angular_acceleration_kappa(samples, limit, gravity, out)


@vector
def _norm(samples, row, limits, roots, values, r, first, slopes, bends):
    """|d|^2 / L^2, or its square or fourth root, less 1; the bend leaves out what is negative."""
    worst = 0.0
    for q in range(samples.shape[2]):
        bends[first, q] = 2.0 / (limits[r, q] * limits[r, q])
    for q in range(samples.shape[2]):
        x = samples[0, row, q]
        y = samples[1, row, q]
        z = samples[2, row, q]
        values[r, q] = 0.5 * bends[first, q] * (x * x + y * y + z * z)
    for q in range(samples.shape[2]):
        worst = max(worst, values[r, q])
    if roots > 0:
        for q in range(samples.shape[2]):
            ratio = max(values[r, q], BENT)
            raised = np.sqrt(ratio)
            if roots > 1:
                raised = np.sqrt(raised)
            steep = raised / (ratio * 2**roots)
            bends[first, q] *= steep
            values[r, q] = raised + steep * (values[r, q] - ratio)
    for q in range(samples.shape[2]):
        values[r, q] -= 1.0
    for x in range(samples.shape[0]):
        for q in range(samples.shape[2]):
            slopes[first, x, q] = bends[first, q] * samples[x, row, q]
    if row == 2:
        return np.cbrt(np.sqrt(worst))
    return np.sqrt(worst) if row == 0 else np.sqrt(np.sqrt(np.sqrt(worst)))


@vector
def _norm_kappa(samples, row, limit, out):
    inverse = 1.0 / limit
    for q in range(samples.shape[2]):
        x = samples[0, row, q]
        y = samples[1, row, q]
        z = samples[2, row, q]
        out[q] = np.sqrt(x * x + y * y + z * z) * inverse


@vector
def _thrust(samples, limits, gravity, values, r, first, slopes, bends):
    """|F|^2 / L^2 - 1; its squared stretch r solves |a|^2 + 2 g a_z r + (g^2 - L^2) r^2 = 0."""
    worst = 0.0
    for q in range(samples.shape[2]):
        bends[first, q] = 2.0 / (limits[r, q] * limits[r, q])
    for q in range(samples.shape[2]):
        x = samples[0, 1, q]
        y = samples[1, 1, q]
        z = samples[2, 1, q]
        values[r, q] = 0.5 * bends[first, q] * (x * x + y * y + z * z) - 1.0
    for q in range(samples.shape[2]):
        x = samples[0, 1, q]
        y = samples[1, 1, q]
        z = samples[2, 1, q]
        b = gravity * (z - gravity)
        room = max(limits[r, q] * limits[r, q] - gravity * gravity, 1e-3)
        own = x * x + y * y + (z - gravity) * (z - gravity)
        slopes[first, 0, q] = (b + np.sqrt(b * b + room * own)) / room
    for q in range(samples.shape[2]):
        worst = max(worst, slopes[first, 0, q])
    for x in range(samples.shape[0]):
        for q in range(samples.shape[2]):
            slopes[first, x, q] = bends[first, q] * samples[x, 1, q]
    return np.sqrt(worst)


@vector
def _tilt(samples, limits, gravity, values, r, first, slopes, bends):
    """(|F_xy| cot L - F_z) / g; linear in the stretch squared."""
    worst = 0.0
    for q in range(samples.shape[2]):
        cotangent = 1.0 / np.tan(limits[r, q])
        x = samples[0, 1, q]
        y = samples[1, 1, q]
        across = np.sqrt(x * x + y * y + (ROUNDNESS * gravity) ** 2)
        values[r, q] = (across * cotangent - samples[2, 1, q]) / gravity
        bends[first, q] = cotangent / (gravity * across)
        slopes[first, 0, q] = bends[first, q] * x
        slopes[first, 1, q] = bends[first, q] * y
        slopes[first, 2, q] = -1.0 / gravity
    for q in range(samples.shape[2]):
        worst = max(worst, values[r, q] + 1.0)
    return np.sqrt(worst)


@vector
def _tilt_kappa(samples, limit, out):
    for q in range(samples.shape[2]):
        x = samples[0, 1, q]
        y = samples[1, 1, q]
        out[q] = np.arctan2(np.sqrt(x * x + y * y), samples[2, 1, q]) / limit


@vector
def _least_thrust(samples, limits, gravity, values, r, first, slopes, bends):
    """(L - |F|) / g; the stretch is the larger root of |a|^2 + 2 g a_z r + (g^2 - L^2) r^2."""
    worst = 0.0
    for q in range(samples.shape[2]):
        x = samples[0, 1, q]
        y = samples[1, 1, q]
        z = samples[2, 1, q]
        norm = np.sqrt(x * x + y * y + z * z + TINY)
        values[r, q] = (limits[r, q] - norm) / gravity
        bends[first, q] = 0.0
        for axis in range(3):
            slopes[first, axis, q] = -samples[axis, 1, q] / (gravity * norm)
        b = gravity * (gravity - z)
        room = gravity * gravity - limits[r, q] * limits[r, q]
        own = x * x + y * y + (z - gravity) * (z - gravity)
        under = b * b - room * own
        needed = (b + np.sqrt(under)) / room if b > 0.0 and under > 0.0 else 0.0
        worst = max(worst, needed)
    return np.sqrt(worst)


@vector
def _least_thrust_kappa(samples, limit, out):
    for q in range(samples.shape[2]):
        x = samples[0, 1, q]
        y = samples[1, 1, q]
        z = samples[2, 1, q]
        out[q] = limit / np.sqrt(x * x + y * y + z * z + TINY)


@inner
def _turn_of(samples, q, gravity):
    """|F|^2, never quite zero, F.j / F.F and F.s / F.F of a sample."""
    square = WEIGHTLESS * gravity * gravity
    along = 0.0
    further = 0.0
    for x in range(3):
        square += samples[x, 1, q] * samples[x, 1, q]
        along += samples[x, 1, q] * samples[x, 2, q]
        further += samples[x, 1, q] * samples[x, 3, q]
    return square, along / square, further / square


@inner
def _across(samples, x, q, turn, pull):
    """One axis of j and of s - 2 r j, both across F, with r and F.s / F.F of `_turn_of`."""
    across = samples[x, 2, q] - turn * samples[x, 1, q]
    return across, samples[x, 3, q] - pull * samples[x, 1, q] - 2.0 * turn * across


@inner
def _rooted(ratio):
    """Square root of a squared ratio, by its tangent below BENT; and its slope."""
    above = max(ratio, BENT)
    steep = 0.5 / np.sqrt(above)
    return steep * (above + ratio), steep


@vector
def _body_rate(samples, limits, gravity, values, r, first, slopes, bends):
    """|j across F| / (|F| L) - 1: how fast the thrust direction turns, against its limit."""
    worst = 0.0
    for q in range(samples.shape[2]):
        square, turn, pull = _turn_of(samples, q, gravity)
        size = 0.0
        for x in range(3):
            across, _ = _across(samples, x, q, turn, pull)
            size += across * across
        scale = 1.0 / (square * limits[r, q] * limits[r, q])
        worst = max(worst, size * scale)
        root, steep = _rooted(size * scale)
        values[r, q] = root - 1.0
        unit = 2.0 * steep * scale
        for x in range(3):
            across, _ = _across(samples, x, q, turn, pull)
            slopes[first, x, q] = -unit * (turn * across + size / square * samples[x, 1, q])
            slopes[first + 1, x, q] = unit * across
        bends[first, q] = unit * size / square
        bends[first + 1, q] = unit
    return worst ** (1.0 / 6.0)


@vector
def _body_rate_kappa(samples, limit, gravity, out):
    for q in range(samples.shape[2]):
        square, turn, pull = _turn_of(samples, q, gravity)
        size = 0.0
        for x in range(3):
            across, _ = _across(samples, x, q, turn, pull)
            size += across * across
        out[q] = np.sqrt(size / square) / limit


@vector
def _angular_acceleration(samples, limits, gravity, values, r, first, slopes, bends):
    """|s - 2 r j across F| / (|F| L) - 1 with r = F.j / F.F: how fast that turning changes."""
    worst = 0.0
    for q in range(samples.shape[2]):
        square, turn, pull = _turn_of(samples, q, gravity)
        size = _swing(samples, q, turn, pull)
        scale = 1.0 / (square * limits[r, q] * limits[r, q])
        worst = max(worst, size * scale)
        root, steep = _rooted(size * scale)
        values[r, q] = root - 1.0
        _swing_slopes(samples, q, square, turn, pull, 2.0 * steep * scale, first, slopes, bends)
    return worst**0.125


@inner
def _swing(samples, q, turn, pull):
    """|s - 2 r j across F|^2 of a sample."""
    size = 0.0
    for x in range(3):
        _, swing = _across(samples, x, q, turn, pull)
        size += swing * swing
    return size


@inner
def _swing_slopes(samples, q, square, turn, pull, unit, first, slopes, bends):
    """Slopes and bends of unit / 2 times |s - 2 r j across F|^2, over |F|^2, times |F|^2."""
    size = 0.0
    product = 0.0
    rate = 0.0
    for x in range(3):
        across, swing = _across(samples, x, q, turn, pull)
        size += swing * swing
        product += swing * across
        rate += across * across
    for x in range(3):
        thrust = samples[x, 1, q]
        across, swing = _across(samples, x, q, turn, pull)
        slopes[first, x, q] = unit * (
            (2.0 * turn * turn - pull) * swing
            - 2.0 * product / square * (across - turn * thrust)
            - size / square * thrust
        )
        slopes[first + 1, x, q] = -2.0 * unit * (turn * swing + product / square * thrust)
        slopes[first + 2, x, q] = unit * swing
    bends[first, q] = unit * size / square
    bends[first + 1, q] = 4.0 * unit * (turn * turn + rate / square)
    bends[first + 2, q] = unit


@vector
def _angular_acceleration_kappa(samples, limit, gravity, out):
    for q in range(samples.shape[2]):
        square, turn, pull = _turn_of(samples, q, gravity)
        out[q] = np.sqrt(_swing(samples, q, turn, pull) / square) / limit


@inner
def _rotors(figures, kind, samples, limits, gravity, values, r, first, slopes, bends):
    """Rotor thrusts; not compiled where they are not limited."""
    if figures is None:
        return 0.0
    sign = 1.0 if kind == ROTORS else -1.0
    return _demand(sign, figures, samples, limits, gravity, values, r, first, slopes, bends)


@vector
def _with_drag(samples, drag, gravity):
    """(3, 4, S) velocity, F with drag, and its two derivatives; samples hold F without."""
    out = np.empty_like(samples)
    for x in range(3):
        weight = gravity if x == 2 else 0.0
        for q in range(samples.shape[2]):
            out[x, 0, q] = samples[x, 0, q]
            out[x, 1, q] = samples[x, 1, q] + drag * samples[x, 0, q]
            out[x, 2, q] = samples[x, 2, q] + drag * (samples[x, 1, q] - weight)
            out[x, 3, q] = samples[x, 3, q] + drag * samples[x, 2, q]
    return out


@inner
def _pulled(samples, q):
    """F.v of a sample."""
    total = 0.0
    for x in range(3):
        total += samples[x, 1, q] * samples[x, 0, q]
    return total


@inner
def _rate(samples, q, turn, pull):
    """|j across F|^2 of a sample."""
    size = 0.0
    for x in range(3):
        across, _ = _across(samples, x, q, turn, pull)
        size += across * across
    return size


@vector
def _demand(sign, figures, samples, limits, gravity, values, r, first, slopes, bends):
    """(T + A) / L - 1 for the most, (g - T + A - L) / g for the least thrust.

    T = |F| + epsilon b.v and A = c |alpha| + chi |w|^2, of which c |alpha| is rounded by ROUNDNESS,
    to the safe side; all as in `kernels.rotors`. The stretch x^-2 is that at which +-(T - g) x +
    A x^2 would meet the limit. What is found by F with drag and its derivatives is carried over to
    those of position.
    """
    reach, drag, along_drag, crossed = figures[0], figures[1], figures[2], figures[3]
    carried = _with_drag(samples, drag, gravity)
    worst = 0.0
    for q in range(samples.shape[2]):
        square, turn, pull = _turn_of(carried, q, gravity)
        norm = np.sqrt(square)
        moved = _pulled(carried, q) / square
        size = _swing(carried, q, turn, pull)
        swing = np.sqrt(reach * reach * size / square + (ROUNDNESS * gravity) ** 2)
        rate = _rate(carried, q, turn, pull) / square
        room = limits[r, q] - gravity if sign > 0.0 else limits[r, q]
        over = sign * (norm * (1.0 + along_drag * moved) - gravity)
        turning = swing + crossed * rate
        worst = max(worst, (over + np.sqrt(over * over + 4.0 * room * turning)) / (2.0 * room))
        unit = 1.0 / limits[r, q] if sign > 0.0 else 1.0 / gravity
        values[r, q] = unit * (over + turning - room)
        bend = unit * reach * reach / (swing * square)
        _swing_slopes(carried, q, square, turn, pull, bend, first + 1, slopes, bends)
        whirl = 2.0 * unit * crossed / square
        push = sign * unit / norm
        for x in range(3):
            thrust = carried[x, 1, q]
            velocity = carried[x, 0, q]
            own = thrust + along_drag * (velocity - moved * thrust)
            across, _ = _across(carried, x, q, turn, pull)
            slopes[first + 1, x, q] += push * own - whirl * (turn * across + rate * thrust)
            slopes[first + 2, x, q] += whirl * across
            slopes[first, x, q] = push * along_drag * thrust + drag * slopes[first + 1, x, q]
            for term in range(1, 3):
                slopes[first + term, x, q] += drag * slopes[first + term + 1, x, q]
        bends[first + 1, q] += max(push, 0.0) + whirl * rate
        bends[first + 2, q] += whirl
        bends[first, q] = drag * drag * bends[first + 1, q]
        for term in range(1, 3):
            bends[first + term, q] += drag * drag * bends[first + term + 1, q]
    return np.sqrt(worst)


@inner
def _rotors_kappa(figures, kind, samples, limit, gravity, out):
    if figures is None:
        return
    sign = 1.0 if kind == ROTORS else -1.0
    _demand_kappa(sign, figures, samples, limit, gravity, out)


@vector
def _demand_kappa(sign, figures, samples, limit, gravity, out):
    carried = _with_drag(samples, figures[1], gravity)
    rest = gravity if sign < 0.0 else 0.0
    for q in range(samples.shape[2]):
        square, turn, pull = _turn_of(carried, q, gravity)
        norm = np.sqrt(square)
        thrust = norm + figures[2] * _pulled(carried, q) / norm
        turning = figures[0] * np.sqrt(_swing(carried, q, turn, pull) / square)
        turning += figures[3] * _rate(carried, q, turn, pull) / square
        out[q] = (rest + sign * thrust + turning) / limit
