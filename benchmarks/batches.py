"""Batches: the same plans in this process, on processes of this machine, and on a Dask cluster."""

import json
import time
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import peakflight as pf
from benchmarks.courses import JERK, walk
from benchmarks.report import Cell, Column, Row, Table, failure
from benchmarks.scope import Scope

PLANS, QUICK, LEGS = 1_000, 20, 10
WORKERS = 2

COLUMNS: list[Column] = [
    ("where", ""), ("plans", "d"), ("legs", "d"), ("certified", "d"), ("alike to the bit", "d"),
    ("wall [s]", ".2f"), ("plans a second", ".1f"),
]  # fmt: skip


def run(scope: Scope) -> list[Table]:
    """One table: wall time, and how many plans are those of this process to the last bit."""
    problems = [
        pf.Problem(walk(LEGS, index), limits=JERK.limits)
        for index in range(scope.pick(QUICK, PLANS))
    ]
    pf.plan(problems[0])  # compiled before anything is timed
    cells: dict[str, Cell] = {"plans": len(problems), "legs": LEGS}
    alone: dict[int, str] = {}
    rows = [_measured("this process", cells, problems, alone, workers=1)]
    processes = f"{WORKERS} processes"
    rows.append(_measured(processes, cells, problems, alone, workers=WORKERS))
    try:
        with TemporaryDirectory() as folder, _dask() as executor:
            far: dict[str, Any] = {"executor": executor, "store": Path(folder) / "store"}
            rows.append(_measured(f"Dask, {WORKERS} workers", cells, problems, alone, **far))
            rows.append(_measured("the same, resumed", cells, problems, alone, **far))
    except Exception as error:  # a failure is a row
        rows.append(failure({"where": "Dask", **cells}, error, "all alike"))
    text = (
        "Random walks by method joint with its defaults, at the paper's limits for minimum jerk. "
        "Alike: everything in the plan file but the wall time that planning took, beside the row "
        "of this process. Wall time includes starting processes, but not the cluster."
    )
    return [Table(title="Batches", note=text, columns=COLUMNS, rows=rows)]


def _measured(
    where: str,
    cells: dict[str, Cell],
    problems: list[pf.Problem],
    alone: dict[int, str],
    **options: Any,
) -> Row:
    """Plan all; the first measurement fills `alone`, which others are held against."""
    what: dict[str, Cell] = {"where": where, **cells}
    bar = "all certified and alike"
    try:
        began = time.perf_counter()
        results = list(pf.plan_many(problems, **options))
        wall = time.perf_counter() - began
    except Exception as error:  # a failure is a row
        return failure(what, error, bar)
    found = {one.index: _bits(one.plan) for one in results if one.plan is not None}
    if not alone:
        alone |= found
    alike = sum(found.get(index) == bits for index, bits in alone.items())
    certified = sum(one.feasible for one in results)
    what |= {
        "certified": certified,
        "alike to the bit": alike,
        "wall [s]": wall,
        "plans a second": len(results) / wall,
    }
    return Row(cells=what, bar=bar, met=certified == alike == len(problems))


def _bits(plan: pf.Plan) -> str:
    """The plan file without what depends on the clock; numbers are written without loss."""
    values = plan.to_dict()
    del values["wall_time_s"]
    return json.dumps(values)


@contextmanager
def _dask() -> Iterator[Executor]:
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=WORKERS, threads_per_worker=1, dashboard_address=":0") as cluster,
        Client(cluster) as client,
    ):
        yield client.get_executor()
