"""Durations and coefficients together: pieces, effort, and planning again as a waypoint moves."""

import numpy as np

import peakflight as pf
from peakflight.limits import limited_values

course = pf.read_course("examples/courses/tight_then_fast.json")
limits = pf.Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)
problem = pf.Problem(course.waypoints, limits=limits)

plans = {
    "best times for a spline": pf.plan(problem, method="peak"),
    "joint, one piece a leg": pf.plan(problem, pieces=1),
    "joint, at most 16 pieces": pf.plan(problem, max_pieces=16),
    "joint, as many as pay": pf.plan(problem),
    "joint, a little smoother": pf.plan(problem, effort=1e-5, max_pieces=16),
}
print("time, pieces, part of the flight within 1 % of a limit, integral of squared jerk in m^2/s^5")
for name, plan in plans.items():
    times = np.linspace(0.0, plan.duration, 20_001)
    motion = [plan.trajectory(times, order) for order in (1, 2, 3, 4)]
    values = limited_values(motion)
    kappa = np.max([values[kind.name] / getattr(limits, kind.name) for kind in limits.active], 0)
    effort = np.trapezoid((motion[2] ** 2).sum(axis=1), times)
    print(
        f"{name:25s} {plan.duration:.3f} s {len(plan.segment_times):3d} "
        f"{np.mean(kappa > 0.99):5.0%} {effort:6.0f}"
    )
    assert plan.feasible

last = plans["joint, as many as pay"]
moved = course.waypoints.copy()
moved[3] += [0.03, 0.04, 0.0]
again = pf.replan(last, waypoints=moved)
assert again.feasible
assert again.pieces == last.pieces
print(
    f"waypoint 3 moved by 5 cm: {again.duration:.3f} s after {again.iterations} iterations "
    f"from the last plan (which took {last.iterations}): {again.status}"
)
