"""Start from the state that the vehicle is in, and end in a given one."""

import numpy as np

import peakflight as pf

limits = pf.Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)
problem = pf.Problem(
    [[0, 0, 1], [2, 1, 1.5], [4, 0, 1], [6, 1, 1.2]],
    limits=limits,
    start={"velocity": [1.5, 0.5, 0.0]},  # acceleration is zero where nothing is said
    end={"velocity": [np.nan, 0.0, 0.0]},  # any speed along x
    derivatives={2: {"velocity": [np.nan, np.nan, 0.0]}},  # level at waypoint 2
)
plan = pf.plan(problem)
print(
    f"{plan.duration:.3f} s from",
    plan.trajectory(0.0, 1),
    "m/s to",
    end := plan.trajectory(plan.duration, 1),
)
assert plan.feasible
assert np.allclose(end[1:], 0.0)
