"""Where the nose points: fixed, along the velocity, towards a point, or as each waypoint says."""

import math

import peakflight as pf

course = pf.read_course("examples/courses/tight_then_fast.json")
limits = pf.Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)
angles = [0.5 * index for index in range(len(course))]

for yaw in (
    math.radians(90),
    "velocity",
    {"point": [2.0, 0.0, 1.0], "rate": 6.0, "acceleration": 40.0},
    pf.Heading(policy="waypoints", angles=tuple(angles), rate=1.0),
):
    plan = pf.plan(course.waypoints, limits=limits, pieces=1, yaw=yaw)
    middle = plan.duration / 2.0
    print(
        f"{plan.duration:.3f} s, at {middle:.2f} s yaw {math.degrees(plan.yaw(middle)):.0f} deg, "
        f"{plan.yaw(middle, derivative=1):+.2f} rad/s, at most "
        f"{plan.report.peaks['yaw_rate'].max():.3f} of its limit. {plan.message}"
    )
    assert plan.feasible
