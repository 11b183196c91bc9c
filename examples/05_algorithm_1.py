"""The paper's Algorithm 1 to the letter, at three pairs of rates, beside the best times."""

from pathlib import Path

import peakflight as pf
from peakflight.methods import peak
from peakflight.methods.algorithm1 import Algorithm1Settings

limits = pf.Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)
RATES = ((0.4, 0.05, 0.0), (0.5, 0.1, 0.0), (0.2, 0.05, 1e-3))  # delta_1, delta_2, slack

print("time above the best segment times, and whether the convergence rule was met")
for path in sorted(Path("examples/courses").glob("*.json")):
    problem = pf.Problem(pf.read_course(path).waypoints, limits=limits)
    best = pf.plan(problem, method="peak")
    cells = []
    for first, second, slack in RATES:
        rates = Algorithm1Settings(
            learning_rate=first, neighbour_rate=second, slack=slack, iterations=500
        )
        settings = peak.Settings(variant="paper", paper=rates)
        printed = pf.plan(problem, method="peak", settings=settings)
        met = ", met" if printed.status is pf.Status.SOLVED else ""
        cells.append(f"{printed.duration / best.duration - 1.0:+.1%}{met}")
        assert printed.feasible
        assert best.duration < printed.duration
    print(f"{path.stem:16s}", *(f"{cell:12s}" for cell in cells))
