"""Limits that follow from a vehicle's figures, where nobody has measured better ones.

The rotors have to hold the vehicle up, turn it, and correct what goes wrong. One share of the top
rotor thrust, `MARGIN`, is set aside for turning and correcting; most limits follow from that. What
else was measured by flying plans of every method in two simulators: `docs/vehicles.md`.
"""

import math

from peakflight.airframe import Airframe
from peakflight.errors import InvalidProblem
from peakflight.limits import GRAVITY, Limits

MARGIN = 0.25
"""Share of the top thrust that is kept for turning and control: of plans that stay at their limits
all the time some crashed with 0.15 and with 0.2, none with this."""
BEHIND = 1.15
"""rad/s, by how much the body rate may fall behind for the motor lag: a rate that changes by alpha
is late by alpha times the lag. Plans with twice as much crashed, whatever else they kept."""
DRAG = 0.1
"""Share of the top thrust that drag may take at the limited speed: nobody plans for it, and a
tracker that knows nothing of it lags behind by as much as it takes to hold against it."""
STEEP = math.radians(60.0)
"""Where level flight at the limited thrust leans more than this, tilt is not limited: what crashed
beyond this angle in simulation was a vehicle that cannot hold its height there."""
DIGITS = 4
"""Of a limit, but tilt, which is to a tenth of a degree; rounded to the safe side."""


def default_limits(
    airframe: Airframe,
    *,
    rotor_thrust: tuple[float, float],
    motor_lag: float,
    body_rate: float | None,
    drag: float = 0.0,
) -> tuple[Limits, dict[str, str]]:
    """Limits that leave the rotors room to do what the limits themselves ask for.

    Within the limits of thrust acceleration, least thrust acceleration and angular acceleration
    every rotor of a vehicle with J_x = J_y and no drag stays in its range at any heading, as long
    as it does not turn about its thrust axis. What a yaw, drag and unequal inertias take comes on
    top, and can be more than the margin: the note on the samples of a plan says so. Limits on the
    rotors themselves (`Vehicle.on_rotors`) count all of it.

    Parameters
    ----------
    rotor_thrust
        Least and most of one rotor, N.
    motor_lag
        Time constant of the rotors, s; 0 if they are immediate.
    body_rate
        Largest rate that the vehicle may turn at across its thrust axis, rad/s.
    drag
        Rotor drag over speed across the thrust, kg/s; 0 if there is none.

    Returns
    -------
    The limits, and name of limit to why it has its value.

    Raises
    ------
    InvalidProblem
        If the margin leaves too little to hover.
    """
    least, most = rotor_thrust
    reserve = MARGIN * most
    top = 4.0 * most / airframe.mass
    thrust = _below((1.0 - MARGIN) * top)
    if thrust <= GRAVITY:
        raise InvalidProblem(
            f"top thrust acceleration is {top:.4g} m/s^2; less the margin of {MARGIN:.0%} that is "
            f"{thrust:.4g}, which is not above gravity ({GRAVITY}); give the vehicle's limits"
        )
    lowest = -_below(-4.0 * (least + reserve) / airframe.mass)
    if lowest >= GRAVITY:
        raise InvalidProblem(
            f"least thrust acceleration with {MARGIN:.0%} of the top in reserve is {lowest:.4g} "
            f"m/s^2, which is not below gravity ({GRAVITY}); give the vehicle's limits"
        )
    tilt = math.acos(GRAVITY / thrust)
    torque = 4.0 * airframe.lever * reserve / (math.sqrt(2.0) * airframe.inertia)
    followed = BEHIND / motor_lag if motor_lag > 0.0 else math.inf
    turning = _below(min(torque, followed))
    stopping = math.sqrt(2.0 * turning * tilt)
    rate = stopping if body_rate is None else min(stopping, (1.0 - MARGIN) * body_rate)
    turned = rate * thrust
    changed = (thrust - lowest) / motor_lag if motor_lag > 0.0 else math.inf
    limits = Limits(
        speed=_below(DRAG * 4.0 * most / drag) if drag > 0.0 else None,
        thrust_acceleration=thrust,
        least_thrust_acceleration=lowest,
        tilt=None if tilt > STEEP else math.radians(math.floor(10.0 * math.degrees(tilt)) / 10.0),
        angular_acceleration=turning,
        body_rate=_below(rate),
        jerk=_below(min(turned, changed)),
        snap=_below(turning * thrust),
    )
    kept = f"{MARGIN:.0%}"
    reasons = {
        "speed": f"drag takes {DRAG:.0%} of the top thrust then",
        "thrust_acceleration": f"{kept} below the top of {top:.4g} m/s^2, which turning and "
        "control need",
        "least_thrust_acceleration": f"each rotor at its least, {least:.3g} N, and {kept} of its "
        "top above, which turning needs",
        "tilt": "beyond, the limited thrust does not hold the height",
        "angular_acceleration": f"what {kept} of each rotor's top thrust turns at, at any heading"
        if torque <= followed
        else f"the body rate is {BEHIND:g} rad/s behind then for a motor lag of {motor_lag:.3g} s",
        "body_rate": "what can be stopped within the tilt of level flight at the limited thrust"
        if rate == stopping
        else f"{kept} below the vehicle's own limit of {body_rate:.4g} rad/s",
        "jerk": "the limited thrust turned at the limited body rate"
        if turned <= changed
        else f"from the least to the largest limited thrust in one motor lag, {motor_lag:.3g} s",
        "snap": "the limited thrust turned at the limited angular acceleration",
    }
    return limits, {name: reasons[name] for name in limits.to_dict()}


def _below(value: float) -> float:
    """The next number of `DIGITS` digits below: limits are read by people."""
    unit = 10.0 ** (math.floor(math.log10(abs(value))) + 1 - DIGITS)
    return float(f"{math.floor(value / unit) * unit:.{DIGITS}g}")
