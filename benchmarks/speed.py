"""How long the parts of a plan take: CPU time of one thread, warm."""

from collections.abc import Callable
from typing import Any

import numpy as np

import peakflight as pf
from benchmarks.compiled import Call, by_name, recorded, recorded_often, replays
from benchmarks.courses import JERK, SNAP, Task, even_times, sized
from benchmarks.measure import Sample, repeated, side_by_side
from benchmarks.report import Cell, Column, Row, Table, failure, in_words, judged
from benchmarks.scope import Scope

SOLVE_BARS = {10: 0.5e-6, 100: 4e-6, 10_000: 1e-3}
"""Legs to CPU seconds of one minimum-jerk solve."""
SOLVED: tuple[tuple[str, str, int, dict[int, float]], ...] = (
    ("min jerk, degree 5", "jerk", 5, SOLVE_BARS),
    ("min snap, degree 7", "snap", 7, {}),
    ("min snap, degree 5, C3", "snap", 5, {}),
)
"""Name, cost, degree and bars of the splines at fixed times."""
PEAK_BARS = {10: 1e-3, 100: 12e-3, 1_000: 200e-3}
"""Legs to CPU seconds of the optimiser and the stretch."""
CERTIFY_BAR = 4e-6
"""CPU seconds a leg."""
PYTHON_BAR = 0.3e-3
"""CPU seconds of a plan outside compiled code, at 10 legs."""
LINEAR = 2.0
"""Most that a leg may cost more on the longest courses than at 1,000 legs."""
REPLAYED = 2_000
"""On longer courses kernels are timed as Python calls them: what that adds no longer counts."""
MORE_ROUNDS = 3
"""Times as many on the shortest course, where a bar is about the difference of two figures."""
SETS = 5
"""Sets of recorded calls that take turns."""

COLUMNS: list[Column] = [
    ("what", ""), ("course", ""), ("legs", ",d"), ("CPU time", ""), ("us a leg", ".3f"),
    ("spread", ".1%"), ("iterations", "d"),
]  # fmt: skip
SHARE_COLUMNS: list[Column] = [
    ("spline", ""), ("legs", ",d"), ("part", ""), ("calls", "d"), ("CPU time", ""),
    ("share", ".1%"),
]  # fmt: skip


def run(scope: Scope) -> list[Table]:
    """Solves, the optimiser, the certificate, Python, and where the time of a plan goes."""
    rounds = scope.pick(3, 11)
    table, shares = _plans(scope, rounds)
    return [_solves(scope, rounds), table, shares]


def spline_call(waypoints: np.ndarray, minimize: str, degree: int) -> Callable[[], pf.Trajectory]:
    """The public call of a spline at times of an even speed."""
    times = even_times(waypoints)
    return lambda: pf.minimum_effort_spline(waypoints, times, minimize=minimize, degree=degree)


def core_of(call: Callable[[], Any]) -> Callable[[int], None]:
    """A contender: the kernel that solves a spline, out of its public call."""
    sets = recorded_often(call, SETS)
    return replays([by_name(calls, "classical.solve", "general.solve") for calls in sets])[0]


def _solves(scope: Scope, rounds: int) -> Table:
    rows = []
    for name, minimize, degree, bars in SOLVED[:2] if scope.quick else SOLVED:
        for legs in (10, 100) if scope.quick else (10, 100, 1_000, 10_000):
            label, waypoints = sized(legs)
            cells: dict[str, Cell] = {"what": name, "course": label, "legs": legs}
            bar = bars.get(legs)
            try:
                core = core_of(spline_call(waypoints, minimize, degree))
                sample = side_by_side([core], rounds)[0]
            except Exception as error:  # a failure is a row
                rows.append(failure(cells, error, _at_most(bar)))
                continue
            rows.append(_row(cells, sample, bar))
    return Table(
        title="One spline at fixed times, in a compiled loop",
        note="From waypoints and times to the derivatives at both ends of every piece, three axes.",
        columns=COLUMNS[:-1],
        rows=rows,
    )


def _plans(scope: Scope, rounds: int) -> tuple[Table, Table]:
    rows: list[Row] = []
    shares: list[Row] = []
    sizes = [10, 100] if scope.quick else [10, 100, 1_000, 10_000]
    sizes += [100_000] if scope.full else []
    for task in (JERK,) if scope.quick else (JERK, SNAP):
        first: Row | None = None
        for legs in sizes if task is JERK else [size for size in sizes if size <= REPLAYED]:
            label, waypoints = sized(legs)
            course = _Course(task, legs, {"course": label, "legs": legs})
            try:
                problem = task.problem(waypoints)
                if legs <= REPLAYED:
                    often = MORE_ROUNDS if legs == min(sizes) else 1
                    rows += (new := _replayed(course, problem, often * rounds, shares))
                else:
                    rows += (new := _as_called(course, problem, scope.pick(1, 3)))
            except Exception as error:  # a failure is a row
                rows.append(failure(course.cells("optimiser and stretch"), error, course.peak_bar))
                continue
            if legs == 1_000:
                first = new[0]
            if legs > 1_000 and first is not None:
                new[0].bar = f"<= {LINEAR:g} x the one at 1,000"
                new[0].met = _per_leg(new[0]) <= LINEAR * _per_leg(first)
    text = (
        "Compiled parts are replayed from a compiled loop with the arguments of real plans "
        "(beyond 1,000 legs: as Python calls them). Python is the plan less all compiled parts."
    )
    return (
        Table(title="A plan by `peak`", note=text, columns=COLUMNS, rows=rows),
        Table(title="Where the time of a plan goes", columns=SHARE_COLUMNS, rows=shares),
    )


class _Course:
    """Which rows a course gets, and their bars."""

    def __init__(self, task: Task, legs: int, about: dict[str, Cell]) -> None:
        self.task, self.legs, self.about = task, legs, about
        self.seconds = PEAK_BARS.get(legs) if task is JERK else None
        self.peak_bar = _at_most(self.seconds)

    def cells(self, what: str) -> dict[str, Cell]:
        return {"what": f"{self.task.name}: {what}", **self.about}

    def optimiser(self, sample: Sample, plan: pf.Plan) -> Row:
        cells = {**self.cells("optimiser and stretch"), "iterations": plan.iterations}
        row = _row(cells, sample, self.seconds)
        if plan.status is not pf.Status.SOLVED:
            row.note = f"status: {plan.status}"
        return row

    def certificate(self, sample: Sample) -> Row:
        bar = CERTIFY_BAR * self.legs if self.task is JERK else None
        words = f"<= {1e6 * CERTIFY_BAR:g} us a leg"
        return _row(self.cells("certificate of four limits"), sample, bar, words)

    def whole(self, sample: Sample) -> Row:
        return _row(self.cells("pf.plan, all of it"), sample, None)

    def python(self, sample: Sample) -> Row:
        bar = PYTHON_BAR if self.task is JERK and self.legs == 10 else None
        return _row(self.cells("pf.plan, less compiled parts"), sample, bar)


def _replayed(course: _Course, problem: pf.Problem, rounds: int, shares: list[Row]) -> list[Row]:
    """Rows of one course: optimiser and stretch, the certificate, Python; and all the shares."""
    plans: list[pf.Plan] = []
    called: list[float] = []

    def call() -> None:
        plans[:] = [pf.plan(problem, method="peak")]

    def spied(count: int) -> None:
        runs = (recorded(call, warm=False) for _ in range(count))
        called.extend(sum(part.seconds for part in run) for run in runs)

    sets = recorded_often(call, SETS)
    calls = sets[0]
    whole, _, *parts = side_by_side([repeated(call), spied, *replays(sets)], rounds)
    everything = _sum(parts)
    python = Sample(tuple(a - b for a, b in zip(whole.rounds, everything.rounds, strict=False)))
    shares += _shares(course, calls, parts, whole, Sample(tuple(called)))
    solver = _optimiser(calls)
    last = calls.index(by_name(calls, "bounds.certify")[-1])
    return [
        course.optimiser(_sum([parts[calls.index(part)] for part in solver]), plans[0]),
        course.certificate(parts[last]),
        course.whole(whole),
        course.python(python),
    ]


def _optimiser(calls: list[Call]) -> list[Call]:
    """The descent, and the certificate where its last argument, rounds, asks for the stretch."""
    proofs = [part for part in by_name(calls, "bounds.certify") if part.arguments[-1] > 1]
    return [*by_name(calls, "descent.descend"), *proofs]


def _as_called(course: _Course, problem: pf.Problem, rounds: int) -> list[Row]:
    """Rows of a long course, each plan timed as it runs."""
    plans: list[pf.Plan] = []

    def call() -> None:
        plans[:] = [pf.plan(problem, method="peak")]

    runs: list[list[Call]] = []
    while len(runs) < rounds and sum(part.seconds for run in runs for part in run) < 10.0:
        runs.append(recorded(call, warm=False))
    optimiser = Sample(tuple(sum(part.seconds for part in _optimiser(run)) for run in runs))
    certificate = Sample(tuple(by_name(run, "bounds.certify")[-1].seconds for run in runs))
    return [course.optimiser(optimiser, plans[0]), course.certificate(certificate)]


def _shares(
    course: _Course, calls: list[Call], parts: list[Sample], whole: Sample, called: Sample
) -> list[Row]:
    """A row for each kernel, and what is left in two; `called`: kernels as Python calls them."""
    named: dict[str, list[float]] = {}
    for part, sample in zip(calls, parts, strict=True):
        named.setdefault(part.name, []).append(sample.median)
    replayed = sum(sample.median for sample in parts)
    named["between Python and kernels: conversion of arguments, cold memory"] = [
        called.median - replayed
    ]
    named["Python itself"] = [whole.median - called.median]
    return [
        Row(
            cells={
                "spline": course.task.name,
                "legs": course.legs,
                "part": name,
                "calls": len(times),
                "CPU time": in_words(sum(times)),
                "seconds": sum(times),
                "share": sum(times) / whole.median,
            }
        )
        for name, times in named.items()
    ]


def _row(cells: dict[str, Cell], sample: Sample, bar: float | None, words: str = "") -> Row:
    cells = {
        **cells,
        "CPU time": in_words(sample.median),
        "seconds": sample.median,
        "us a leg": 1e6 * sample.median / int(cells["legs"] or 1),
        "spread": sample.spread,
    }
    if bar is None:
        return Row(cells=cells)
    return judged(cells, "seconds", bar, words or _at_most(bar))


def _per_leg(row: Row) -> float:
    return float(row.cells["us a leg"] or np.inf)


def _sum(samples: list[Sample]) -> Sample:
    rounds = zip(*(sample.rounds for sample in samples), strict=False)
    return Sample(tuple(sum(times) for times in rounds))


def _at_most(seconds: float | None) -> str:
    return "" if seconds is None else f"<= {in_words(seconds)}"
