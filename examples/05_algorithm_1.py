"""The paper's Algorithm 1 to the letter, and what the best segment times are."""

import peakflight as pf
from peakflight.methods import peak
from peakflight.methods.algorithm1 import Algorithm1Settings

course = pf.read_course("examples/courses/mfbo_traj_2.json")
limits = pf.Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)
problem = pf.Problem(course.waypoints, limits=limits)

rates = Algorithm1Settings(learning_rate=0.4, neighbour_rate=0.05)
printed = pf.plan(problem, settings=peak.Settings(variant="paper", paper=rates))
best = pf.plan(problem)
print(f"Algorithm 1: {printed.duration:.3f} s in {printed.iterations} iterations, {printed.status}")
for iteration in (0, 5, 20):
    print("  segment times after", iteration, printed.history.segment_times[iteration].round(2))
print(f"best segment times: {best.duration:.3f} s, {best.status}")
assert best.duration < printed.duration
