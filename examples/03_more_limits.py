"""Tilt, least thrust and body rate keep a plan flyable where speed and jerk alone do not."""

import math

import peakflight as pf

course = pf.read_course("examples/courses/tight_then_fast.json")
paper = {"speed": 5.0, "thrust_acceleration": 15.5, "jerk": 62.0, "snap": 800.0}

for extra in (
    {},
    {"tilt": math.radians(40)},
    {"least_thrust_acceleration": 7.0},
    {"body_rate": 4.0, "angular_acceleration": 30.0},
):
    plan = pf.plan(course.waypoints, limits=pf.Limits(**paper, **extra))
    peaks = ", ".join(f"{name} {kappa.max():.3f}" for name, kappa in plan.report.peaks.items())
    print(f"{plan.duration:.3f} s with {extra or 'no more limits'}: {peaks}")
    assert plan.feasible
