"""A vehicle instead of limits, and what its rotors do on the plan: flatness."""

import numpy as np

import peakflight as pf

course = pf.read_course("examples/courses/tight_then_fast.json")

for name, vehicle in pf.VEHICLES.items():
    plan = pf.plan(course.waypoints, vehicle=vehicle, method="peak")
    assert plan.feasible
    print(f"{name:22s} {plan.duration:.3f} s, at most {vehicle.limits.thrust_acceleration} m/s^2")

vehicle = pf.find_vehicle("racing-quad")
plan = pf.plan(course.waypoints, vehicle=vehicle, limits=pf.Limits(speed=6.0), pieces=1)
assert plan.problem.limits.jerk == vehicle.limits.jerk  # limits beside a vehicle change what is set
print(f"\n{vehicle.name} at most 6 m/s fast, by joint: {plan.duration:.3f} s")

times = np.linspace(0.0, plan.duration, 2001)
states = pf.planned_states(plan, times)
least, most = vehicle.rotor_thrust
thrusts = states.rotor_thrust
inside = ((thrusts >= least) & (thrusts <= most)).all(axis=1)
print(f"rotors, flown exactly at yaw 0: {thrusts.min():.2f} to {thrusts.max():.2f} N")
print(f"they have {least:.2f} to {most:.2f} N, which is enough for {inside.mean():.1%} of the time")
print(f"body rate up to {np.linalg.norm(states.body_rate[:, :2], axis=1).max():.1f} rad/s across z")

# The yaw that undoes what tilting twists, so that nothing turns about the thrust axis.
rate, acceleration = -states.body_rate[:, 2], -states.angular_acceleration[:, 2]
steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(times)
yaw = np.concatenate(([0.0], np.cumsum(steps)))
free = pf.states_along(plan.trajectory, times, vehicle, yaw=(yaw, rate, acceleration)).rotor_thrust
print(f"rotors, heading left free: {free.min():.2f} to {free.max():.2f} N")
assert least <= free.min() and free.max() <= most
