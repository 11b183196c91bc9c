"""What the optimisers see of each kind of limit: one small unit a kind.

A measure maps a sample (velocity, acceleration, jerk, snap) to m >= 0, which is at most 1 exactly
when the sample keeps the limit, and m^(1/e) with e = EXPONENTS is, exactly or nearly, how much
slower the sample would have to be passed (design's "uniform stretch"): then no kind is stiffer than
another in the barrier of `kernels.barrier`.

The slope of (log m)/e by a derivative d is given as weight * d + vertical * e3, which suits
everything that knows no direction but gravity's; kinds that know others, from TURNING on, write it
out. A new kind is one pair of functions, values and slopes, a line in `measure` and `add_slopes`,
an exponent and its orders. Kinds are numbered as in `limits.KINDS`.

How the thrust direction turns is |F x y| / F.F with F = a + g e3, for the body rate with y = j, for
its angular acceleration with y = s - 2 (F.j / F.F) j. Near free fall that is not defined; F has an
entry of GUARD g in a fourth direction here, so that turning there is fast, but finite.
"""

import numpy as np

from peakflight.kernels.jit import inner, vector

EXPONENTS = np.array([2, 2, 6, 8, 2, 2, 6, 8, 2, 2])
"""e of each kind."""
KIND_ORDERS = np.array([1, 2, 3, 4, 2, 2, 3, 4, 4, 4])
"""The highest derivative that each kind is about."""
LOWEST_ORDERS = np.array([1, 2, 3, 4, 2, 2, 2, 2, 1, 1])
"""The lowest."""
TURNING = 6
"""Kinds from here on are about how the thrust direction turns."""
ROTORS = 8
"""Kinds from here on are about rotor thrusts: this one from above, the other from below."""
TINY = 1e-150
"""Added to what is divided by: a sample at rest has measure zero and slope zero."""
ROUNDNESS = 1e-5
"""Least horizontal acceleration, as a part of gravity, that tilt knows: no kink when upright."""
SOFTNESS = 1e-3
"""How early, as a part of gravity, the measure of tilt bends on its way to zero."""
EASE = 1e-3
"""Collective acceleration, as a part of gravity, that turning takes of a rotor in any case."""
GUARD = 1e-3
"""Thrust acceleration, as a part of gravity, that the thrust direction has in any case."""


@inner
def measure(kind, samples, squares, count, row, limit, gravity, values, pulls, figures):
    """Values <- m of the first `count` samples.

    samples (3, 4, S) are derivatives 1 to 4, squares (4, S) their squared norms; row: which
    derivative the kind is about, less one; pulls, figures: as in `add_slopes`.
    """
    if figures is None:
        pass
    elif kind >= ROTORS:
        sign = 1.0 if kind == ROTORS else -1.0
        _demand(sign, samples, count, limit, gravity, figures, values)
        return
    if pulls is None:
        pass
    elif kind >= TURNING:
        _turn(samples, count, row, limit, gravity, values)
        return
    if kind == 1:
        _thrust(samples, squares, count, row, limit, gravity, values)
    elif kind == 4:
        _tilt(samples, count, row, limit, gravity, values)
    elif kind == 5:
        _least_thrust(samples, squares, count, row, limit, gravity, values)
    else:
        _norm(squares, count, row, limit, values)


@inner
def add_slopes(
    kind, samples, squares, count, row, limit, gravity, values, grown, weights, vertical,
    pulls, figures,
):  # fmt: skip
    """Weights (4, S), vertical (S,) += grown (S,) times the slope of (log m)/e; values hold m.

    Kinds from TURNING on add to pulls (3, 4, S) instead; it is None where none of them is limited,
    which is known when the kernel is compiled. So are the figures (4,) of `kernels.rotors`:
    None where no rotor thrust is limited.
    """
    if figures is None:
        pass
    elif kind >= ROTORS:
        sign = 1.0 if kind == ROTORS else -1.0
        _add_demand(sign, samples, count, limit, gravity, figures, values, grown, pulls)
        return
    if pulls is None:
        pass
    elif kind >= TURNING:
        factor = 1.0 / EXPONENTS[kind]
        _add_turn(samples, count, row, limit, gravity, factor, values, grown, pulls)
        return
    if kind == 1:
        _add_thrust(samples, count, row, limit, gravity, values, grown, weights, vertical)
    elif kind == 4:
        _add_tilt(samples, count, row, limit, gravity, grown, weights, vertical)
    elif kind == 5:
        _add_least_thrust(samples, squares, count, row, gravity, grown, weights, vertical)
    else:
        _add_norm(squares, count, row, 2.0 / EXPONENTS[kind], grown, weights)


@vector
def _norm(squares, count, row, limit, values):
    """|d|^2 / limit^2, for speed, jerk and snap (Eq. kapp_i)."""
    factor = 1.0 / (limit * limit)
    for q in range(count):
        values[q] = factor * squares[row, q]


@vector
def _add_norm(squares, count, row, factor, grown, weights):
    for q in range(count):
        weights[row, q] += factor * grown[q] / (squares[row, q] + TINY)


@vector
def _thrust(samples, squares, count, row, limit, gravity, values):
    """Square of the stretch that brings |a + g e3| to its limit (Eq. kappa2).

    The positive root alpha^2 of (L^2 - g^2) alpha^4 - 2 g a_z alpha^2 - |a|^2 = 0.
    """
    room = limit * limit - gravity * gravity
    inverse = 1.0 / room
    for q in range(count):
        b = gravity * samples[2, row, q]
        root = np.sqrt(b * b + room * squares[row, q])
        values[q] = (b + root) * inverse


@vector
def _add_thrust(samples, count, row, limit, gravity, values, grown, weights, vertical):
    room = limit * limit - gravity * gravity
    for q in range(count):
        root = values[q] * room - gravity * samples[2, row, q] + TINY
        weight = 0.5 * grown[q] / root
        weights[row, q] += weight / (values[q] + TINY)
        vertical[q] += gravity * weight


@vector
def _tilt(samples, count, row, limit, gravity, values):
    """Square of the stretch that brings the angle of a + g e3 to the limit: |a_xy| cot - a_z <= g.

    Smoothed where it would turn negative: there the sample cannot tilt too much anyway.
    """
    cotangent = 1.0 / np.tan(limit)
    for q in range(count):
        x = samples[0, row, q]
        y = samples[1, row, q]
        horizontal = np.sqrt(x * x + y * y + (ROUNDNESS * gravity) ** 2)
        excess = horizontal * cotangent - samples[2, row, q]
        root = np.sqrt(excess * excess + (SOFTNESS * gravity) ** 2)
        values[q] = 0.5 * (excess + root) / gravity


@vector
def _add_tilt(samples, count, row, limit, gravity, grown, weights, vertical):
    cotangent = 1.0 / np.tan(limit)
    for q in range(count):
        x = samples[0, row, q]
        y = samples[1, row, q]
        z = samples[2, row, q]
        horizontal = np.sqrt(x * x + y * y + (ROUNDNESS * gravity) ** 2)
        excess = horizontal * cotangent - z
        root = np.sqrt(excess * excess + (SOFTNESS * gravity) ** 2)
        push = 0.5 * grown[q] / root  # d(log m) = d(excess) / root
        along = push * cotangent / horizontal
        weights[row, q] += along
        vertical[q] -= push + along * z


@vector
def _least_thrust(samples, squares, count, row, limit, gravity, values):
    """limit^2 / |a + g e3|^2."""
    for q in range(count):
        z = samples[2, row, q]
        square = squares[row, q] + gravity * (2.0 * z + gravity)
        values[q] = limit * limit / (max(square, 0.0) + TINY)


@vector
def _add_least_thrust(samples, squares, count, row, gravity, grown, weights, vertical):
    for q in range(count):
        z = samples[2, row, q]
        square = squares[row, q] + gravity * (2.0 * z + gravity)
        push = grown[q] / (max(square, 0.0) + TINY)
        weights[row, q] -= push
        vertical[q] -= gravity * push


@vector
def _swing(samples, q, row, gravity):
    """F, 1 / F.F, r and y of a sample, with y = d - r j: d is the derivative of the row, and r is
    2 F.j / F.F for the angular acceleration, 0 for the body rate; see the top.
    """
    fx = samples[0, 1, q]
    fy = samples[1, 1, q]
    fz = samples[2, 1, q] + gravity
    inverse = 1.0 / (fx * fx + fy * fy + fz * fz + (GUARD * gravity) ** 2)
    twist = 2.0 * inverse if row == 3 else 0.0
    jx = samples[0, 2, q]
    jy = samples[1, 2, q]
    jz = samples[2, 2, q]
    r = twist * (fx * jx + fy * jy + fz * jz)
    x = samples[0, row, q] - r * jx
    y = samples[1, row, q] - r * jy
    z = samples[2, row, q] - r * jz
    return fx, fy, fz, inverse, r, x, y, z


@vector
def _turn(samples, count, row, limit, gravity, values):
    """(|F x y| / F.F)^2 / limit^2; see the top."""
    factor = 1.0 / (limit * limit)
    for q in range(count):
        values[q] = factor * _turn_of(samples, q, row, gravity)


@vector
def _turn_of(samples, q, row, gravity):
    """(|F x y| / F.F)^2 of a sample, as (y.y - (F.y)^2 / F.F) / F.F; see the top."""
    fx, fy, fz, inverse, _, x, y, z = _swing(samples, q, row, gravity)
    along = fx * x + fy * y + fz * z
    return inverse * max(x * x + y * y + z * z - along * along * inverse, 0.0)


@vector
def _add_turn(samples, count, row, limit, gravity, factor, values, grown, pulls):
    for q in range(count):
        square = limit * limit * values[q]
        _pull_turn(samples, q, row, gravity, factor * grown[q], square, pulls)


@vector
def _pull_turn(samples, q, row, gravity, weight, square, pulls):
    """Pulls += weight times the slope of the logarithm of `_turn_of`, which is `square`."""
    twist = 2.0 if row == 3 else 0.0
    fx, fy, fz, inverse, r, x, y, z = _swing(samples, q, row, gravity)
    jx = samples[0, 2, q]
    jy = samples[1, 2, q]
    jz = samples[2, 2, q]
    c = inverse * (fx * x + fy * y + fz * z)
    whole = 2.0 * weight
    push = whole * inverse / (square + TINY)
    x = push * (x - c * fx)  # the slope by y
    y = push * (y - c * fy)
    z = push * (z - c * fz)
    k = twist * inverse * (x * jx + y * jy + z * jz)  # minus that by F.j
    f = r * k - whole * inverse
    pulls[0, 1, q] += f * fx - c * x - k * jx
    pulls[1, 1, q] += f * fy - c * y - k * jy
    pulls[2, 1, q] += f * fz - c * z - k * jz
    pulls[0, 2, q] -= r * x + k * fx
    pulls[1, 2, q] -= r * y + k * fy
    pulls[2, 2, q] -= r * z + k * fz
    pulls[0, row, q] += x
    pulls[1, row, q] += y
    pulls[2, row, q] += z


@vector
def _with_drag(samples, count, drag):
    """(3, 4, count) velocity, F less gravity with drag, and its two derivatives."""
    out = np.empty((3, 4, count))
    for x in range(3):
        for q in range(count):
            out[x, 0, q] = samples[x, 0, q]
        for row in range(1, 4):
            for q in range(count):
                out[x, row, q] = samples[x, row, q] + drag * samples[x, row - 1, q]
    return out


@vector
def _load(sign, samples, q, gravity, figures):
    """1 / |F|, F.v / F.F, +-(T - g), c |alpha| (rounded by EASE), |alpha|^2 and |w|^2 of a sample.

    Of `_with_drag`; T = |F| + epsilon b.v, all as in `kernels.rotors`.
    """
    fx = samples[0, 1, q]
    fy = samples[1, 1, q]
    fz = samples[2, 1, q] + gravity
    square = fx * fx + fy * fy + fz * fz + TINY
    norm = np.sqrt(square)
    moved = (fx * samples[0, 0, q] + fy * samples[1, 0, q] + fz * samples[2, 0, q]) / square
    turn = _turn_of(samples, q, 3, gravity)
    rate = _turn_of(samples, q, 2, gravity)
    swing = np.sqrt(figures[0] * figures[0] * turn + (EASE * gravity) ** 2)
    over = sign * (norm * (1.0 + figures[2] * moved) - gravity)
    return 1.0 / norm, moved, over, swing, turn, rate


@vector
def _demand(sign, samples, count, limit, gravity, figures, values):
    """Square of the stretch at which a rotor would be at its limit, if demands scaled as below.

    What is limited is +-(T - g) + A with A = c |alpha| + chi |w|^2, all as in `_load`: at most the
    room that hovering leaves. Stretched by x^(-1/2), it is about the first times x and the second
    times x^2, or less; 1/x solves room/x^2 - (+-(T - g))/x - A = 0.
    """
    room = limit - gravity if sign > 0.0 else limit
    carried = _with_drag(samples, count, figures[1])
    for q in range(count):
        _, _, over, swing, _, rate = _load(sign, carried, q, gravity, figures)
        turning = swing + figures[3] * rate
        values[q] = (over + np.sqrt(over * over + 4.0 * room * turning)) / (2.0 * room)


@vector
def _add_demand(sign, samples, count, limit, gravity, figures, values, grown, pulls):
    room = limit - gravity if sign > 0.0 else limit
    carried = _with_drag(samples, count, figures[1])
    own = np.zeros((3, 4, count))
    for q in range(count):
        inverse, moved, over, swing, square, rate = _load(sign, carried, q, gravity, figures)
        root = np.sqrt(over * over + 4.0 * room * (swing + figures[3] * rate))
        push = 0.5 * grown[q] / root
        along = sign * inverse * push
        for x in range(3):
            thrust = carried[x, 1, q] + (gravity if x == 2 else 0.0)
            own[x, 0, q] = along * figures[2] * thrust
            own[x, 1, q] = along * (thrust + figures[2] * (carried[x, 0, q] - moved * thrust))
        weight = push / (values[q] + TINY)
        bent = 0.5 * weight * figures[0] * figures[0] * square / swing
        _pull_turn(carried, q, 3, gravity, bent, square, own)
        _pull_turn(carried, q, 2, gravity, weight * figures[3] * rate, rate, own)
    for x in range(3):
        for row in range(4):
            for q in range(count):
                pulls[x, row, q] += own[x, row, q]
        for row in range(3):
            for q in range(count):
                pulls[x, row, q] += figures[1] * own[x, row + 1, q]
