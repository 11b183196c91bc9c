"""A plan turned, slowed down and joined to itself; eight as a show, proven to keep apart."""

import math

import numpy as np

import peakflight as pf
from peakflight import editing

limits = pf.Limits(speed=3.0, thrust_acceleration=14.0, jerk=50.0, snap=600.0)
waypoints = [[2.0, 0.0, 1.0], [3.0, 0.8, 1.6], [4.0, 0.0, 1.2], [3.0, -0.8, 1.0]]
petal = pf.plan(waypoints, limits=limits, yaw="velocity")

slower = editing.slow(petal, 0.8)
turned = editing.rotate(slower, math.radians(90.0))
print(f"{petal.duration:.2f} s; slowed down and turned {turned.duration:.2f} s; {turned.message}")
assert turned.feasible

there_and_back = pf.join(petal, editing.reverse(petal))
larger = editing.keep_limits(editing.scale(petal, 1.5))
print(
    f"there and back {there_and_back.duration:.2f} s, half as large again {larger.duration:.2f} s"
)
assert there_and_back.feasible
assert larger.feasible

show = [editing.rotate(petal, 2.0 * math.pi * k / 8) for k in range(8)]
found = pf.closest_approach(show, separation=0.4, downwash=0.8, delays=0.2 * np.arange(8))
print(
    f"drones {found.pair} come as near as {found.distance:.4f} m at {found.time:.2f} s; "
    f"nowhere nearer than {found.bound:.6f} m"
)
assert found.is_kept
