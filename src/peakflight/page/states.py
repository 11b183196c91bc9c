"""What the vehicle does along a plan: computed where plans are, since that is compiled code."""

from dataclasses import dataclass, replace

import numpy as np

from peakflight.result import Plan
from peakflight.vehicle import Vehicle
from peakflight.vehicles import VEHICLES

MOST_POINTS, LEAST_A_LEG, MOST_A_LEG = 2400, 10, 60
"""Of the path: enough to look smooth, few enough to be sent in a frame."""
STAND_IN = replace(VEHICLES["crazyflie-2.1-upgrade"], drag=(0.0, 0.0))
"""What is drawn where no vehicle is named: its attitude without drag is that of any other."""


@dataclass(frozen=True, eq=False)
class States:
    """At the `path_times` of a plan."""

    attitude: np.ndarray
    """(P, 4) as w, x, y, z."""
    rotor_thrust: np.ndarray
    """(P, 4) N."""


def flown(plan: Plan) -> Vehicle:
    """What is drawn as flying."""
    return plan.vehicle or STAND_IN


def path_times(plan: Plan) -> np.ndarray:
    """(P,) s, through every waypoint, as many in each leg."""
    times = plan.waypoint_times
    legs = len(times) - 1
    count = int(np.clip(MOST_POINTS // legs, LEAST_A_LEG, MOST_A_LEG))
    shares = np.arange(count) / count
    inner = times[:-1, None] + shares * np.diff(times)[:, None]
    return np.append(inner.ravel(), times[-1])


def states(plan: Plan) -> States:
    """What the vehicle does, under the yaw of the plan."""
    from peakflight.flatness import states_along
    from peakflight.heading import heading

    turn = heading(plan)
    found = states_along(
        plan.trajectory,
        path_times(plan),
        flown(plan),
        yaw=lambda times: [turn(times, order)[..., 0] for order in (0, 1, 2)],
    )
    return States(found.attitude, found.rotor_thrust)
