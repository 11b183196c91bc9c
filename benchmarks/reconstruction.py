"""A course on which the methods need about the times that the paper prints.

The paper prints flight times but no waypoints. This searches for waypoints in a room on which
`peak`, `mellinger` and the initial guess come near its six times, from sketches with a tight start
and long legs after it. `python -m benchmarks.reconstruction` found the one in `examples/courses`;
`python -m benchmarks.reconstruction --evaluate COURSE` prints the times of a course.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import peakflight as pf
from benchmarks.courses import JERK, SNAP, Task
from benchmarks.evolution import minimise
from benchmarks.report import Column, Row, Table, as_markdown
from peakflight import paper
from peakflight.limits import limited_values
from peakflight.methods import peak
from peakflight.methods.algorithm1 import Algorithm1Settings
from peakflight.paper import GUESS, GUESS_DURATION, MELLINGER, PEAK

METHODS = {"peak": PEAK, "mellinger": MELLINGER, "proportional": GUESS}
"""Name here, and in what the paper prints."""
JERK_5 = replace(JERK, name="min jerk, degree 5", known={})
SNAP_5 = replace(SNAP, name="min snap, degree 5", degree=5, known={})
PRINTED: tuple[tuple[Task, tuple[float, ...]], ...] = tuple(
    (task, tuple(printed.durations[name] for name in METHODS.values()))
    for task, printed in zip((JERK_5, SNAP_5), paper.PRINTED, strict=True)
)
"""What the paper prints: s, for each of METHODS."""
SPEED_GAINS = tuple(
    1.0 + paper.PRINTED[0].speed_gains[PEAK, other] / 100.0 for other in (MELLINGER, GUESS)
)
"""Top speed of `peak` over those of the two others at minimum jerk, as printed."""
TIGHT_LEGS = 2
"""`peak` gives the first two segments more time than the guess of 5 s, and the others less."""
TIGHT_DURATION = 1.0
"""s: the paper's example of the initial guess breaks limits in the first second of five."""
CALM = {"speed": 0.6, "thrust_acceleration": 0.8, "jerk": 0.6, "snap": 0.6}
"""Parts of the limits that count as far below them, as the paper says of the other four seconds."""

ROOM = np.array([[0.0, 0.0, 0.4], [6.0, 6.0, 2.5]])
"""m; the paper tells that the flights were indoors, not how large the room was."""
SPACING = 0.3
"""m, least distance of neighbouring waypoints."""
LEGS = (6, 9)
"""Fewest and most."""
DECIMALS = 3
"""Of waypoints in m, in the search and in what it prints."""
OFF_BY = 0.01
"""Relative error of a time that costs 1; others of the misfit are in proportion."""
SPEED_OFF_BY, CALM_OFF_BY, SHIFT_OFF_BY, ROOM_OFF_BY, BAND_OFF_BY = 0.1, 0.1, 0.1, 0.01, 0.01
"""As OFF_BY: for top speeds, what exceeds CALM, time moved the wrong way, m outside of ROOM or
below SPACING, and kappa outside of the band of Algorithm 1."""
ALGORITHM_1 = Algorithm1Settings(iterations=60)
"""Should meet its own rule at minimum jerk; those that do mostly need fewer iterations."""
SPREAD, POLISH_SPREAD = 0.25, 0.03
"""m, of waypoints in the first generation of a run, and of the last run."""
RUN = 3000
"""Evaluations of one run from a random sketch; half of all polish the best of them."""

COLUMNS: list[Column] = [
    ("cost", ""), ("method", ""), ("paper [s]", ".1f"), ("here [s]", ".4f"), ("off by", "+.1%"),
    ("top speed [m/s]", ".2f"), ("certified", ""), ("status", ""),
]  # fmt: skip
GUESS_COLUMNS: list[Column] = [("limit", ""), ("first second", ".2f"), ("later", ".2f")]


def main() -> int:
    """Evaluate a file, or search and print what was found."""
    arguments = _parse()
    if arguments.evaluate:
        waypoints = pf.read_course(arguments.evaluate).waypoints
    else:
        waypoints = search(arguments.seed, arguments.evaluations)
        print("\nx,y,z", *(",".join(f"{x:g}" for x in row) for row in waypoints), sep="\n")
    for table in tables(waypoints):
        print(f"\n{as_markdown(table)}")
    return 0


def search(seed: int, evaluations: int) -> np.ndarray:
    """(K+1, 3) m, rounded: the best course found; the same for the same arguments.

    Half of the evaluations go to runs from random sketches of different numbers of legs, the other
    half to the best of them.
    """
    rng = np.random.default_rng(seed)
    best, lowest = sketch(rng), np.inf
    for run in range(max(evaluations // 2 // RUN, 1)):
        course, value = _descend(sketch(rng), SPREAD, min(RUN, evaluations // 2), rng)
        if value < lowest:
            best, lowest = course, value
        _report(f"run {run}: {len(course) - 1} legs, misfit {value:.1f}, best {lowest:.1f}")
    best, lowest = _descend(best, POLISH_SPREAD, evaluations // 2, rng)
    _report(f"polished: misfit {lowest:.1f}")
    return best


def sketch(rng: np.random.Generator) -> np.ndarray:
    """(K+1, 3) m: two to four short legs with sharp turns, then long ones with gentle turns."""
    legs = int(rng.integers(LEGS[0], LEGS[1] + 1))
    tight = int(rng.integers(2, 5))
    short = np.arange(legs) < tight
    lengths = np.where(short, rng.uniform(0.4, 1.0, legs), rng.uniform(1.2, 3.0, legs))
    turns = np.where(short, rng.uniform(1.2, 2.6, legs), rng.uniform(0.2, 1.2, legs))
    turns *= np.where(short, (-1.0) ** np.arange(legs), rng.choice((-1.0, 1.0)))
    headings = np.cumsum(turns) + rng.uniform(0.0, 2.0 * np.pi)
    steps = lengths[:, None] * np.column_stack((np.cos(headings), np.sin(headings)))
    flat = np.vstack((np.zeros(2), np.cumsum(steps, axis=0)))
    flat += ROOM.mean(axis=0)[:2] - 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    return np.column_stack((flat, rng.uniform(0.8, 1.6, legs + 1)))


def misfit(waypoints: np.ndarray) -> float:
    """How far a course is from what the paper prints; OFF_BY and the others say in which units."""
    outside = np.maximum(ROOM[0] - waypoints, waypoints - ROOM[1])
    too_close = SPACING - np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    beyond = np.maximum(np.concatenate((outside.ravel(), too_close)), 0.0)
    if beyond.max() > 1.0:  # m: too far off to be planned
        return 1e6 * (1.0 + beyond.max())
    found = plans(waypoints)
    times = np.array([[plan.duration for plan in row] for row in found])
    printed = np.array([row for _, row in PRINTED])
    speeds = np.array([top_speed(plan) for plan in found[0]])
    gains = speeds[0] / speeds[1:]
    parts = (
        (np.log(times / printed), OFF_BY),
        (np.log(gains / SPEED_GAINS), SPEED_OFF_BY),
        (_restlessness(found[0][-1]), CALM_OFF_BY),
        (_wrong_shifts(found[0][0], found[0][-1]), SHIFT_OFF_BY),
        (_outside_band(found[0][0].problem), BAND_OFF_BY),
        (beyond, ROOM_OFF_BY),
    )
    return float(sum(((np.asarray(errors) / unit) ** 2).sum() for errors, unit in parts))


def plans(waypoints: np.ndarray) -> list[list[pf.Plan]]:
    """The plan of each of METHODS, for each cost."""
    return [
        [pf.plan(task.problem(waypoints), method=method) for method in METHODS]
        for task, _ in PRINTED
    ]


def top_speed(plan: pf.Plan) -> float:
    """Largest speed, m/s, as certified."""
    assert plan.problem.limits.speed is not None  # the paper limits it
    return float(plan.report.peaks["speed"].max()) * plan.problem.limits.speed


def tables(waypoints: np.ndarray) -> list[Table]:
    """The six times beside those of the paper, and the initial guess of 5 s beside the limits."""
    found = plans(waypoints)
    times = [
        Row(
            cells={
                "cost": task.name,
                "method": method,
                "paper [s]": time,
                "here [s]": plan.duration,
                "off by": plan.duration / time - 1.0,
                "top speed [m/s]": top_speed(plan),
                "certified": plan.feasible,
                "status": str(plan.status),
            }
        )
        for (task, printed), row in zip(PRINTED, found, strict=True)
        for method, time, plan in zip(METHODS, printed, row, strict=True)
    ]
    early = guess_peaks(found[0][-1], 0.0, TIGHT_DURATION)
    late = guess_peaks(found[0][-1], TIGHT_DURATION, GUESS_DURATION)
    peaks = [
        Row(cells={"limit": name, "first second": early[name], "later": late[name]})
        for name in CALM
    ]
    return [
        Table(title="Reconstruction", columns=COLUMNS, rows=times),
        Table(
            title="The initial guess of 5 s, minimum jerk",
            note="Largest value as a part of the limit.",
            columns=GUESS_COLUMNS,
            rows=peaks,
        ),
    ]


def guess_peaks(plan: pf.Plan, since: float, until: float) -> dict[str, float]:
    """Largest values of the initial guess of 5 s between two times, as parts of the limits."""
    guess = plan.trajectory.stretch(GUESS_DURATION / plan.duration)
    t = np.linspace(since, until, 161)
    values = limited_values([guess(t, order) for order in range(1, 5)])
    limits = plan.problem.limits.to_dict()
    return {name: float(values[name].max() / limits[name]) for name in CALM}


def _restlessness(plan: pf.Plan) -> np.ndarray:
    """By how much the initial guess of 5 s exceeds CALM after its first second, for each limit."""
    peaks = guess_peaks(plan, TIGHT_DURATION, GUESS_DURATION)
    return np.array([max(peaks[name] / calm - 1.0, 0.0) for name, calm in CALM.items()])


def _wrong_shifts(best: pf.Plan, guess: pf.Plan) -> np.ndarray:
    """(K,) by how much `peak` moves time the wrong way, as logarithms; see TIGHT_LEGS."""
    shifts = np.log(best.segment_times / guess.segment_times * guess.duration / GUESS_DURATION)
    shifts[:TIGHT_LEGS] *= -1.0
    return np.maximum(shifts, 0.0)


def _outside_band(problem: pf.Problem) -> float:
    """How far Algorithm 1 stays from its own rule at best; 0 if it meets it."""
    settings = peak.Settings(variant="paper", paper=ALGORITHM_1)
    plan = pf.plan(problem, method="peak", settings=settings)
    if plan.status is pf.Status.SOLVED:
        return 0.0
    assert plan.history is not None and plan.history.kappa is not None
    kappa = np.nanmax(plan.history.kappa, axis=2)
    return float(np.abs(kappa - 1.0).max(axis=1).min()) - ALGORITHM_1.band


def _descend(
    start: np.ndarray, spread: float, evaluations: int, rng: np.random.Generator
) -> tuple[np.ndarray, float]:
    point, value = minimise(
        lambda x: misfit(x.reshape(-1, 3).round(DECIMALS)),
        start.ravel(),
        spread=spread,
        evaluations=evaluations,
        rng=rng,
    )
    return point.reshape(-1, 3).round(DECIMALS), value


def _report(line: str) -> None:
    print(f"[reconstruction] {line}", file=sys.stderr, flush=True)


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.reconstruction", description=__doc__
    )
    parser.add_argument("--seed", type=int, default=0, help="of all that is random")
    parser.add_argument("--evaluations", type=int, default=36_000, help="courses that are tried")
    parser.add_argument("--evaluate", type=Path, help="a course: print its times, search nothing")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
