"""Many plans and flights on all processors; results are kept in a file, to go on with."""

import os
from pathlib import Path

import numpy as np

import peakflight as pf

FOLDER = Path(os.environ.get("PEAKFLIGHT_EXAMPLES", "out/batch"))
LIMITS = pf.Limits(speed=3.0, jerk=40.0, tilt=0.7)


def main() -> None:
    """Plan twenty random courses and fly them; interrupt it and start it again as you like."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(1)
    courses = [np.cumsum(random.uniform(-1.5, 1.5, (6, 3)), axis=0) for _ in range(20)]
    problems = [
        pf.Problem(course, vehicle="crazyflie-2.1-upgrade", limits=LIMITS) for course in courses
    ]

    plans: dict[int, pf.Plan] = {}
    for result in pf.plan_many(problems, method="peak", store=FOLDER / "plans.jsonl"):
        if result.plan is None:
            print(f"course {result.index}: {result.failure}")
        elif result.feasible:
            plans[result.index] = result.plan
    print(f"{len(plans)} of {len(problems)} courses planned")
    assert len(plans) == len(problems)

    # the second time all results are there
    again = pf.plan_many(problems, method="peak", store=FOLDER / "plans.jsonl")
    assert all(result.resumed for result in again)

    settings = pf.FlySettings(ground=None)
    for flown in pf.fly_many(plans.values(), settings=settings, store=FOLDER / "flights.jsonl"):
        assert flown.summary is not None
        crash = flown.summary.crash
        how = f"{100.0 * flown.summary.rms_error:.1f} cm RMS" if crash is None else crash.cause
        print(f"{flown.plan.duration:.2f} s: {how}")


if __name__ == "__main__":  # worker processes import this file
    main()
