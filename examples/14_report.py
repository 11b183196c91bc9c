"""A plan as one page of HTML that opens without a server or a network."""

import os
from pathlib import Path

import peakflight as pf

limits = pf.Limits(speed=3.0, thrust_acceleration=14.0, jerk=50.0, snap=600.0)
waypoints = [[0, 0, 1], [1, 0.8, 1.6], [2, 0, 1.2], [1, -0.8, 1.0], [0, 0, 1]]
plan = pf.plan(waypoints, limits=limits, yaw="velocity")

page = Path(os.environ.get("PEAKFLIGHT_EXAMPLES", ".")) / "report.html"
pf.write_report(plan, page, title="Petals")
print(f"{plan.duration:.2f} s; open {page.name} in a browser")
assert "Certified" in page.read_text()
