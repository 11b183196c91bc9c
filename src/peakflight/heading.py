"""The heading that flight files give a plan: its yaw motion, or what plans without one fly."""

import numpy as np

from peakflight.result import Plan
from peakflight.trajectory import Trajectory


def heading(plan: Plan) -> Trajectory:
    """Yaw along a plan in rad: its yaw motion, over pieces of its own; zero if none is asked for.

    A plan file from before there were yaw motions has a yaw at waypoints, but none between them:
    (K, 4, 1) then, over the pieces of the plan. Each leg turns the shorter way from the yaw of its
    first waypoint to that of its last, by 3 s^2 - 2 s^3 of the turn where s is the part of the
    leg's time that has passed. So turning begins and ends at rest at every waypoint, whatever the
    number of pieces in a leg.
    """
    if plan.yaw_motion is not None:
        return plan.yaw_motion
    trajectory = plan.trajectory
    coefficients = np.zeros((len(trajectory), 4, 1))
    asked = plan.problem.heading
    if asked is not None and asked.angles is not None:
        yaw = np.unwrap(asked.angles)
        leg = np.repeat(np.arange(len(plan.pieces)), plan.pieces)
        begins, lasts = plan.waypoint_times[leg], np.diff(plan.waypoint_times)[leg]
        turn = np.diff(yaw)[leg]
        s = (trajectory.breakpoints[:-1] - begins) / lasts
        coefficients[:, 0, 0] = yaw[leg] + turn * (3.0 - 2.0 * s) * s**2
        coefficients[:, 1, 0] = turn * 6.0 * s * (1.0 - s) / lasts
        coefficients[:, 2, 0] = turn * (3.0 - 6.0 * s) / lasts**2
        coefficients[:, 3, 0] = turn * -2.0 / lasts**3
    return Trajectory(coefficients, trajectory.segment_times, trajectory.start_time)
