"""Waypoints and limits in, a certified trajectory out, saved and read back."""

import tempfile
from pathlib import Path

import peakflight as pf

waypoints = [[0, 0, 1], [0.6, 0.5, 1.2], [0.2, 0.9, 1.0], [0.9, 1.3, 1.1], [3.2, 1.2, 1.4]]
limits = pf.Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)

plan = pf.plan(waypoints, limits=limits)
print(f"{plan.status}: {plan.duration:.3f} s, certified: {plan.report.feasible}")
pieces = iter(zip(plan.segment_times, plan.report.binding, strict=True))
for leg, count in enumerate(plan.pieces):
    for seconds, limit in (next(pieces) for _ in range(count)):
        print(f"leg {leg}: a piece of {seconds:.3f} s, closest to its limit: {limit}")

position = plan.trajectory(0.5)
thrust = plan.trajectory(0.5, derivative=2)
thrust[2] += pf.GRAVITY
print("after half a second:", position.round(3), "thrust acceleration:", thrust.round(2))

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "plan.json"
    plan.save(path)
    again = pf.Plan.load(path)
    proof = pf.certify_plan(again)  # from the file alone
    print("read back and proven again:", proof.feasible)
