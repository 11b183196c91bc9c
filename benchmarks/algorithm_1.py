"""Which learning rates lead the paper's Algorithm 1 to its own convergence rule, and where.

The paper does not print its rates. This plans every course of `examples/courses` with a grid of
them, for both costs at degree 5: `python -m benchmarks.algorithm_1`.
"""

import argparse
import sys
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

import peakflight as pf
from benchmarks.courses import FOLDER, Task, course, names
from benchmarks.reconstruction import JERK_5, SNAP_5
from benchmarks.report import Cell, Column, Row, Table, as_markdown
from peakflight.methods import peak
from peakflight.methods.algorithm1 import Algorithm1Settings

RECONSTRUCTION = "paper_like"
FIRST = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7)
"""delta_1 of the grid."""
SECOND = (0.0, 0.02, 0.05, 0.1, 0.2)
"""delta_2 of the grid."""
SLACKS = (0.0, 1e-3, 1e-2)
"""0 is the paper's; see `Algorithm1Settings.slack`."""
ITERATIONS = 500
"""Most of one plan."""

SHOWN = 3
"""Pairs of rates in the second table, for each slack."""

COLUMNS: list[Column] = [
    ("course", ""), ("cost", ""), ("slack", "g"), ("default rates", ""), ("grid met", ""),
    ("delta_1", "g"), ("delta_2", "g"), ("iterations", "d"), ("time [s]", ".3f"),
    ("over peak", "+.1%"),
]  # fmt: skip
RATES_COLUMNS: list[Column] = [
    ("slack", "g"), ("delta_1", "g"), ("delta_2", "g"), ("problems met", ""),
    ("median over peak", "+.1%"),
]  # fmt: skip


class Run(NamedTuple):
    """One plan by Algorithm 1."""

    rates: Algorithm1Settings
    met: bool
    """Whether it met its own rule."""
    iterations: int
    duration: float
    """s, stretched to the limits."""


class Grid(NamedTuple):
    """One problem with every pair of rates at one slack."""

    course: str
    task: Task
    slack: float
    best: float
    """s, what `peak` needs by descent."""
    runs: list[Run]
    """In the order of `rates`."""


def main() -> int:
    """Print both tables, and progress on the error stream meanwhile."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.algorithm_1", description=__doc__)
    known = list(courses())
    parser.add_argument("--only", action="append", choices=known, help="one course; may repeat")
    chosen = parser.parse_args().only or known
    grids = []
    for name, task, slack in product(chosen, (JERK_5, SNAP_5), SLACKS):
        print(f"[algorithm_1] {name}, {task.name}, slack {slack:g}", file=sys.stderr, flush=True)
        problem = task.problem(courses()[name])
        best = pf.plan(problem, method="peak").duration
        runs = [attempt(problem, each) for each in rates(slack)]
        grids.append(Grid(name, task, slack, best, runs))
    note = (
        f"Of {len(FIRST) * len(SECOND)} pairs of rates, at most {ITERATIONS} iterations each from "
        "5 s. Default rates: time over that of peak. From delta_1 on: the fastest pair that met "
        "the rule."
    )
    rows = [_by_problem(grid) for grid in grids]
    print(as_markdown(Table(title="By problem", note=note, columns=COLUMNS, rows=rows)))
    note = f"The {SHOWN} pairs that met the rule most often, then the default."
    rows = [row for slack in SLACKS for row in _by_rates([g for g in grids if g.slack == slack])]
    print(as_markdown(Table(title="By rates", note=note, columns=RATES_COLUMNS, rows=rows)))
    return 0


def courses() -> dict[str, np.ndarray]:
    """Name to (K+1, 3) m, from short to long; the reconstruction comes first."""
    found = {RECONSTRUCTION: pf.read_course(FOLDER / f"{RECONSTRUCTION}.csv").waypoints}
    return found | {name: course(name) for name in names()}


def attempt(problem: pf.Problem, rates: Algorithm1Settings) -> Run:
    """Plan by Algorithm 1."""
    plan = pf.plan(problem, method="peak", settings=peak.Settings(variant="paper", paper=rates))
    return Run(rates, plan.status is pf.Status.SOLVED, plan.iterations, plan.duration)


def rates(slack: float) -> Iterator[Algorithm1Settings]:
    """Every pair of rates."""
    for first, second in product(FIRST, SECOND):
        yield Algorithm1Settings(
            learning_rate=first, neighbour_rate=second, slack=slack, iterations=ITERATIONS
        )


def _by_problem(grid: Grid) -> Row:
    default = grid.runs[_default(grid.slack)]
    met = [run for run in grid.runs if run.met]
    cells: dict[str, Cell] = {
        "course": grid.course,
        "cost": grid.task.name,
        "slack": grid.slack,
        "default rates": f"{default.duration / grid.best - 1.0:+.1%}{', met' * default.met}",
        "grid met": f"{len(met)} of {len(grid.runs)}",
    }
    if met:
        fastest = min(met, key=lambda run: run.duration)
        cells |= {
            "delta_1": fastest.rates.learning_rate,
            "delta_2": fastest.rates.neighbour_rate,
            "iterations": fastest.iterations,
            "time [s]": fastest.duration,
            "over peak": fastest.duration / grid.best - 1.0,
        }
    return Row(cells=cells)


def _by_rates(grids: list[Grid]) -> list[Row]:
    """The best pairs at the slack of all the grids, and the default."""
    slack = grids[0].slack
    met = np.array([[run.met for run in grid.runs] for grid in grids]).sum(axis=0)
    times = np.array([[run.duration / grid.best for run in grid.runs] for grid in grids])
    over = np.median(times, axis=0) - 1.0
    pairs = list(rates(slack))
    return [
        Row(
            cells={
                "slack": slack,
                "delta_1": pairs[i].learning_rate,
                "delta_2": pairs[i].neighbour_rate,
                "problems met": f"{met[i]} of {len(grids)}",
                "median over peak": float(over[i]),
            }
        )
        for i in [*np.lexsort((over, -met))[:SHOWN], _default(slack)]
    ]


def _default(slack: float) -> int:
    """Which of `rates` is the default."""
    return list(rates(slack)).index(Algorithm1Settings(slack=slack, iterations=ITERATIONS))


if __name__ == "__main__":
    sys.exit(main())
