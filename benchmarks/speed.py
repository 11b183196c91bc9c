"""How long the parts of a plan take: CPU time of one thread, warm."""

from collections.abc import Callable

import numpy as np

import peakflight as pf
from benchmarks.compiled import Call, by_name, recorded, together
from benchmarks.courses import JERK, SNAP, Task, even_times, sized
from benchmarks.measure import Sample, repeated, side_by_side
from benchmarks.report import Cell, Column, Row, Table, failure, judged
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
"""On longer courses the optimiser is timed as Python calls it: what that adds no longer counts."""

COLUMNS: list[Column] = [
    ("what", ""), ("course", ""), ("legs", ",d"), ("CPU time", ""), ("us a leg", ".3f"),
    ("spread", ".1%"),
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


def _solves(scope: Scope, rounds: int) -> Table:
    rows = []
    for name, minimize, degree, bars in SOLVED[:2] if scope.quick else SOLVED:
        for legs in (10, 100) if scope.quick else (10, 100, 1_000, 10_000):
            label, waypoints = sized(legs)
            cells: dict[str, Cell] = {"what": name, "course": label, "legs": legs}
            bar = bars.get(legs)
            try:
                calls = recorded(spline_call(waypoints, minimize, degree))
                sample = side_by_side([together(solves(calls))], rounds)[0]
            except Exception as error:  # a failure is a row
                rows.append(failure(cells, error, _at_most(bar)))
                continue
            rows.append(_row(cells, sample, legs, bar))
    return Table(
        title="One spline at fixed times, in a compiled loop",
        note="From waypoints and times to the derivatives at both ends of every piece, three axes.",
        columns=COLUMNS,
        rows=rows,
    )


def spline_call(waypoints: np.ndarray, minimize: str, degree: int) -> Callable[[], pf.Trajectory]:
    """The public call of a spline at times of an even speed."""
    times = even_times(waypoints)
    return lambda: pf.minimum_effort_spline(waypoints, times, minimize=minimize, degree=degree)


def solves(calls: list[Call]) -> list[Call]:
    """The calls that solve a spline."""
    return by_name(calls, "classical.solve", "general.solve")


def _plans(scope: Scope, rounds: int) -> tuple[Table, Table]:
    rows: list[Row] = []
    shares: list[Row] = []
    sizes = [10, 100] if scope.quick else [10, 100, 1_000, 10_000]
    sizes += [100_000] if scope.full else []
    for task in (JERK, SNAP):
        per_leg: dict[int, float] = {}
        for legs in sizes:
            if task is SNAP and (scope.quick or legs > 1_000):
                continue
            label, waypoints = sized(legs)
            cells: dict[str, Cell] = {"course": label, "legs": legs}
            try:
                problem = task.problem(waypoints)
                call = _plan_call(problem)
                calls = recorded(call, warm=legs <= REPLAYED)
                if legs <= REPLAYED:
                    new = _replayed(task, cells, calls, call, rounds, shares)
                else:
                    new = _as_called(task, cells, calls, call, rounds=scope.pick(1, 2))
            except Exception as error:  # a failure is a row
                bar = _at_most(PEAK_BARS.get(legs)) if task is JERK else ""
                what = f"peak, {task.name}: optimiser and stretch"
                rows.append(failure({"what": what, **cells}, error, bar))
                continue
            per_leg[legs] = float(new[0].cells["us a leg"] or 0.0)
            if legs > 1_000 and 1_000 in per_leg and new[0].met is None:
                new[0].bar = f"<= {LINEAR:g} x the one at 1,000"
                new[0].met = per_leg[legs] <= LINEAR * per_leg[1_000]
            rows += new
    text = (
        "Compiled parts are replayed from a compiled loop with the arguments of a real plan "
        "(beyond 1,000 legs: as they are called). Python is the plan less all compiled parts."
    )
    return (
        Table(title="A plan by `peak`", note=text, columns=COLUMNS, rows=rows),
        Table(title="Where the time of a plan goes", columns=SHARE_COLUMNS, rows=shares),
    )


def _plan_call(problem: pf.Problem) -> Callable[[], pf.Plan]:
    return lambda: pf.plan(problem)


def _replayed(
    task: Task,
    cells: dict[str, Cell],
    calls: list[Call],
    call: Callable[[], pf.Plan],
    rounds: int,
    shares: list[Row],
) -> list[Row]:
    """Rows of one course: optimiser and stretch, the certificate, Python; and all the shares."""
    legs = int(cells["legs"] or 0)
    called: list[float] = []

    def spied(count: int) -> None:
        runs = (recorded(call, warm=False) for _ in range(count))
        called.extend(sum(part.seconds for part in run) for run in runs)

    replays = (part.repeat for part in calls)
    whole, _, *parts = side_by_side([repeated(call), spied, *replays], rounds)
    solver = by_name(calls, "descent.descend", "bounds.stretch")
    optimiser = _sum([parts[calls.index(part)] for part in solver])
    certificate = parts[calls.index(by_name(calls, "bounds.certify")[-1])]
    everything = _sum(parts)
    python = Sample(tuple(a - b for a, b in zip(whole.rounds, everything.rounds, strict=False)))
    jerk = task is JERK
    rows = [
        _row(
            {"what": f"peak, {task.name}: optimiser and stretch", **cells},
            optimiser, legs, PEAK_BARS.get(legs) if jerk else None,
        ),
        _row(
            {"what": f"certificate, {task.name}: four limits", **cells},
            certificate, legs, CERTIFY_BAR * legs if jerk else None,
            words=f"<= {CERTIFY_BAR * 1e6:g} us a leg",
        ),
        _row({"what": f"pf.plan, {task.name}: all of it", **cells}, whole, legs, None),
        _row(
            {"what": f"pf.plan, {task.name}: Python", **cells},
            python, legs, PYTHON_BAR if jerk and legs == 10 else None,
        ),
    ]  # fmt: skip
    shares += _shares(task.name, legs, calls, parts, whole, Sample(tuple(called)))
    return rows


def _shares(
    spline: str, legs: int, calls: list[Call], parts: list[Sample], whole: Sample, called: Sample
) -> list[Row]:
    """A row for each kernel, and what is left in two; `called`: kernels as Python calls them."""
    named: dict[str, list[float]] = {}
    for part, sample in zip(calls, parts, strict=True):
        named.setdefault(part.name, []).append(sample.median)
    replayed = sum(sample.median for sample in parts)
    named["between Python and kernels: conversion of arguments, cold caches"] = [
        called.median - replayed
    ]
    named["Python itself"] = [whole.median - called.median]
    return [
        Row(
            cells={
                "spline": spline,
                "legs": legs,
                "part": name,
                "calls": len(times),
                "CPU time": _in_words(sum(times)),
                "seconds": sum(times),
                "share": sum(times) / whole.median,
            }
        )
        for name, times in named.items()
    ]


def _as_called(
    task: Task, cells: dict[str, Cell], calls: list[Call], call: Callable[[], object], rounds: int
) -> list[Row]:
    """Rows of a long course, each plan timed as it runs."""
    legs = int(cells["legs"] or 0)
    runs = [calls]
    while len(runs) < rounds and sum(part.seconds for part in calls) < 10.0:
        runs.append(recorded(call, warm=False))
    optimiser = Sample(
        tuple(
            sum(part.seconds for part in by_name(run, "descent.descend", "bounds.stretch"))
            for run in runs
        )
    )
    certificate = Sample(tuple(by_name(run, "bounds.certify")[-1].seconds for run in runs))
    jerk = task is JERK
    return [
        _row(
            {"what": f"peak, {task.name}: optimiser and stretch", **cells},
            optimiser, legs, PEAK_BARS.get(legs) if jerk else None,
        ),
        _row(
            {"what": f"certificate, {task.name}: four limits", **cells},
            certificate, legs, CERTIFY_BAR * legs if jerk else None,
            words=f"<= {CERTIFY_BAR * 1e6:g} us a leg",
        ),
    ]  # fmt: skip


def _row(
    cells: dict[str, Cell], sample: Sample, legs: int, bar: float | None, words: str = ""
) -> Row:
    cells = {
        **cells,
        "CPU time": _in_words(sample.median),
        "seconds": sample.median,
        "us a leg": 1e6 * sample.median / legs,
        "spread": sample.spread,
    }
    if bar is None:
        return Row(cells=cells)
    return judged(cells, "seconds", bar, words or _at_most(bar))


def _sum(samples: list[Sample]) -> Sample:
    rounds = zip(*(sample.rounds for sample in samples), strict=False)
    return Sample(tuple(sum(times) for times in rounds))


def _at_most(seconds: float | None) -> str:
    return "" if seconds is None else f"<= {_in_words(seconds)}"


def _in_words(seconds: float) -> str:
    size = abs(seconds)
    if size >= 1.0:
        return f"{seconds:.3g} s"
    return f"{1e3 * seconds:.4g} ms" if size >= 1e-3 else f"{1e6 * seconds:.4g} us"
