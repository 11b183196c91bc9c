"""Sub-problem 1 by itself: the smoothest spline at times of your own, then what it would need."""

import numpy as np

import peakflight as pf

waypoints = np.array([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]])
times = [1.0, 1.0, 1.0]

for minimize, degree in (("jerk", 5), ("snap", 7), ("snap", 5), ({"jerk": 1.0, "snap": 0.01}, 7)):
    spline = pf.minimum_effort_spline(waypoints, times, minimize=minimize, degree=degree)
    limits = pf.Limits(speed=2.0, thrust_acceleration=12.0)
    report = pf.certify(spline, limits, waypoints=waypoints)
    stretched, factor = pf.stretch_to_limits(spline, limits)
    print(
        f"{minimize} at degree {degree}: kappa {report.worst:.3f}, feasible {report.feasible}; "
        f"{factor:.3f} times slower it takes {stretched.duration:.3f} s and just keeps the limits"
    )
