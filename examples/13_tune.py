"""The fastest plan that a vehicle still tracks: a short search, in this process."""

import peakflight as pf

waypoints = [[0, 0, 1], [0.6, 0.5, 1.2], [0.2, 0.9, 1.0], [0.9, 1.3, 1.1], [3.2, 1.2, 1.4]]
vehicle = "crazyflie-2.1-upgrade"

quick = pf.TuneSettings(scan=4, families=1, generations=2, population=6)
result = pf.tune(waypoints, vehicle=vehicle, error=0.15, settings=quick, workers=1)
cautious = pf.plan(waypoints, vehicle=vehicle)
print(f"default limits: {cautious.duration:.3f} s, tuned: {result.plan.duration:.3f} s")
print(f"{result.plans} plans flown; {result.options}, {result.limits}")

flight = pf.fly(result.plan, controller="firmware")
assert flight.within(0.15)
again = pf.plan(waypoints, vehicle=vehicle, limits=result.limits, **result.options)
assert again.duration == result.plan.duration

for point in result.front:
    print(f"{point.duration:.3f} s with an RMS error of {point.rms_error:.3f} m, {point.family}")
