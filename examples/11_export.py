"""Flight files, certified again as their consumers read them; and two drones in one show."""

import os
from pathlib import Path

import peakflight as pf

folder = Path(os.environ.get("PEAKFLIGHT_EXAMPLES", "."))
course = pf.read_course("examples/courses/uzh_19wp.json")
plan = pf.plan(course.waypoints, vehicle="crazyflie-2.1")
print(f"{plan.duration:.3f} s in {len(plan.trajectory)} pieces")

for name in ("crazyswarm", "crazyflie-compressed", "agilicious", "samples"):
    report = pf.export(plan, to=name, path=folder / name)
    (flight,) = report.flights
    assert report.feasible
    print(
        f"{name:20s} {flight.pieces} pieces, {report.cost:.2f} % longer, rounded to "
        f"{flight.rounding.position:.1e} m, worst ratio to a limit that is held "
        f"{max(flight.peaks[kind] for kind in flight.held):.5f}"
    )

waypoints = [[0.0, 0.0, 1.0], [1.0, 0.5, 1.3], [2.0, 0.0, 1.0]]
left = pf.plan(waypoints, vehicle="crazyflie-2.1")
right = pf.plan([[x, y - 2.0, z] for x, y, z in waypoints], vehicle="crazyflie-2.1")
show = pf.export([left, right], to="skyc", path=folder / "show.skyc", names=["left", "right"])
print(f"show of {len(show.flights)}, {show.cost:.2f} % longer, {show.size} bytes")
