"""Fly a plan in simulation: by two controllers, in wind, and by vehicles that differ."""

import os
from pathlib import Path

import peakflight as pf
from peakflight.animation import write_animation

course = pf.read_course("examples/courses/tight_then_fast.json")
plan = pf.plan(course.waypoints, vehicle="crazyflie-2.1-upgrade", method="peak")
print(f"planned: {plan.duration:.3f} s")

for controller in ("geometric", "firmware"):
    flight = pf.fly(plan, controller=controller)
    print(f"{controller:9s} RMS {flight.rms_error:.4f} m, top {flight.top_error:.4f} m")
    assert flight.flew

windy = pf.Conditions(wind=(2.0, 0.0, 0.0), gust=0.5, latency=0.004, seed=1)
flight = pf.fly(plan, conditions=windy)
print(f"in wind   RMS {flight.rms_error:.4f} m, crash: {flight.crash}")

result = pf.fly_spread(plan, flights=50, error=0.15)
low, high = result.interval
print(f"{result.share:.0%} of 50 vehicles within 15 cm ({low:.0%} to {high:.0%})")

empty = pf.fly(plan, conditions=pf.Conditions(thrust_scale=0.5))  # less than the weight
assert empty.crash is not None
print(f"with an empty battery: {empty.crash.cause} at {empty.crash.time:.2f} s")

folder = Path(os.environ.get("PEAKFLIGHT_EXAMPLES", "."))
flight.save(folder / "flight.npz")
assert pf.Flight.load(folder / "flight.npz").rms_error == flight.rms_error
write_animation(flight, folder / "flight.html", plan=plan)
