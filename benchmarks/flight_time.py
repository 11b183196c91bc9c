"""How short the flights are: against the best known times, and on courses never seen before."""

import statistics
from collections.abc import Iterator, Sequence
from unittest import mock

import numpy as np

import peakflight as pf
from benchmarks.courses import JERK, SNAP, Task, course, names, unseen, walk
from benchmarks.report import Cell, Column, Row, Table, failure, judged
from benchmarks.scope import Scope
from peakflight.methods import peak

MOST = 1.0005
"""Flight time over the best known one."""
BAR = f"ratio <= {MOST}"
TIGHTER: tuple[peak.Stage, ...] = (
    (16, 6, 1e-3),
    (16, 24, 1e-3),
    (32, 96, 1e-4),
    (64, 768, 1e-5),
    (64, 6144, 1e-6),
    (64, 49152, 1e-7),
)
"""The ladder of the reference: up to an eight times higher power, each stage run to its end."""
TIGHTER_ITERATIONS = 2000
SAME_START = "proportional"
"""The start of `peak` itself."""
PUSHES = (0.2, 0.6)
"""Standard deviations of log t in the random starts of the reference."""

COURSE_COLUMNS: list[Column] = [
    ("course", ""), ("legs", "d"), ("best known [s]", ".4f"), ("peak [s]", ".4f"),
    ("ratio", ".6f"), ("certified", ""), ("worst peak ratio", ".10f"), ("status", ""),
    ("iterations", "d"), ("proportional [s]", ".3f"), ("proportional / best", ".3f"),
]  # fmt: skip
UNSEEN_COLUMNS: list[Column] = [
    ("spline", ""), ("courses", "d"), ("failures", "d"), ("mean gap [%]", ".4f"),
    ("median gap [%]", ".4f"), ("max gap [%]", ".4f"), ("above the bar", "d"),
    ("mean iterations", ".0f"),
]  # fmt: skip
LONG_COLUMNS: list[Column] = [
    ("course", ""), ("legs", ",d"), ("peak [s]", ".2f"), ("s a leg", ".4f"),
    ("less the last stage [s]", ".2f"), ("ratio", ".6f"),
    ("median of the legs' peak ratios", ".4f"), ("certified", ""), ("status", ""),
    ("iterations", "d"),
]  # fmt: skip
WORST_COLUMNS: list[Column] = [
    ("spline", ""), ("course", ""), ("legs", "d"), ("peak [s]", ".4f"), ("reference [s]", ".4f"),
    ("gap [%]", ".4f"), ("tighter, same start [%]", ".4f"),
    ("reference from", ""), ("status", ""), ("iterations", "d"),
]  # fmt: skip


def run(scope: Scope) -> list[Table]:
    """One table for each kind of spline on the known courses, two for the unseen ones."""
    tasks = (JERK,) if scope.quick else (JERK, SNAP)
    lengths = [1_000] if scope.quick else [1_000, 10_000, 30_000]
    lengths += [100_000] if scope.full else []
    return [
        *(_known(task) for task in tasks),
        *_unseen(tasks, scope.pick(10, 50)),
        _long(lengths),
    ]


def _known(task: Task) -> Table:
    rows = []
    for name in names():
        waypoints = course(name)
        cells: dict[str, Cell] = {"course": name, "legs": len(waypoints) - 1}
        best = task.known.get(name)
        try:
            problem = task.problem(waypoints)
            plan = pf.plan(problem, method="peak")
            simple = pf.plan(problem, method="proportional")
        except Exception as error:  # a failure is a row
            rows.append(failure(cells, error, BAR))
            continue
        cells |= {
            "peak [s]": plan.duration,
            "certified": plan.feasible,
            "worst peak ratio": plan.report.worst,
            "status": str(plan.status),
            "iterations": plan.iterations,
            "proportional [s]": simple.duration,
        }
        if best is None:
            rows.append(Row(cells=cells, note="no best known time"))
            continue
        cells |= {
            "best known [s]": best,
            "ratio": plan.duration / best,
            "proportional / best": simple.duration / best,
        }
        row = judged(cells, "ratio", MOST, BAR)
        row.met = bool(row.met and plan.feasible and simple.feasible)
        rows.append(row)
    limits = ", ".join(f"{name} {value:g}" for name, value in task.limits.to_dict().items())
    return Table(
        title=f"Flight time, {task.name} (degree {task.degree})",
        note=f"Limits: {limits}. `peak` with its defaults. The bar also asks for a certificate.",
        columns=COURSE_COLUMNS,
        rows=rows,
    )


def _long(lengths: Sequence[int]) -> Table:
    """Long courses, where one leg that ends too fast slows down all others."""
    # the last stage is replaced by the one before: as many stages, so nothing compiles again
    early = (*peak.LADDER[:-1], peak.LADDER[-2])
    rows = []
    for legs in lengths:
        cells: dict[str, Cell] = {"course": f"walk of {legs:,}", "legs": legs}
        try:
            problem = JERK.problem(walk(legs))
            plan = pf.plan(problem, method="peak")
            other = pf.plan(problem, method="peak", settings=peak.Settings(ladder=early))
        except Exception as error:  # a failure is a row
            rows.append(failure(cells, error, BAR))
            continue
        best = min(plan.duration, other.duration)
        cells |= {
            "peak [s]": plan.duration,
            "s a leg": plan.duration / legs,
            "less the last stage [s]": other.duration,
            "ratio": plan.duration / best,
            "median of the legs' peak ratios": float(np.median(plan.report.segment_peaks)),
            "certified": plan.feasible,
            "status": str(plan.status),
            "iterations": plan.iterations,
        }
        row = judged(cells, "ratio", MOST, BAR)
        row.met = bool(row.met and plan.feasible and plan.status is pf.Status.SOLVED)
        rows.append(row)
    text = (
        "Random walks, min jerk. The ratio is to the better of `peak` and `peak` without the last "
        "stage of its ladder. Where few legs come near a limit, a single one has slowed down all."
    )
    return Table(title="Long courses", note=text, columns=LONG_COLUMNS, rows=rows)


def _unseen(tasks: Sequence[Task], count: int) -> list[Table]:
    summary: list[Row] = []
    worst: list[Row] = []
    for task in tasks:
        rows = [_against_reference(task, index) for index in range(count)]
        good = [row for row in rows if row.met is not None]
        gaps = [float(row.cells["gap [%]"] or 0.0) for row in good]
        above = sum(row.met is False for row in good)
        cells: dict[str, Cell] = {
            "spline": task.name,
            "courses": count,
            "failures": count - len(good),
            "above the bar": above,
        }
        if good:
            cells |= {
                "mean gap [%]": statistics.fmean(gaps),
                "median gap [%]": statistics.median(gaps),
                "max gap [%]": max(gaps),
                "mean iterations": statistics.fmean(
                    float(row.cells["iterations"] or 0.0) for row in good
                ),
            }
        bar = f"no failure, {BAR} each"
        summary.append(Row(cells=cells, bar=bar, met=above == 0 and len(good) == count))
        rows.sort(key=lambda row: -float(row.cells.get("gap [%]") or 0.0))
        failed = [row for row in rows if row.met is None]
        shown = max(5, above)
        worst += [*failed, *[row for row in rows if row.met is not None][:shown]]
    for row in worst:
        if row.met is not None:
            row.bar, row.met, row.note = "", None, "" if row.met else f"above {MOST}"
    text = (
        "Seeded courses of 2 to 40 legs, 0.05 to 20 m (log-uniform), any direction. Gap: how much "
        "longer `peak` flies than the best of itself and a tighter ladder from five starts."
    )
    return [
        Table(title="Unseen courses", note=text, columns=UNSEEN_COLUMNS, rows=summary),
        Table(title="Unseen courses: failures and widest gaps", columns=WORST_COLUMNS, rows=worst),
    ]


def _against_reference(task: Task, index: int) -> Row:
    """A row whose `met` is None if the default plan failed."""
    waypoints = unseen(index)
    cells: dict[str, Cell] = {
        "spline": task.name,
        "course": f"unseen {index}",
        "legs": len(waypoints) - 1,
    }
    try:
        problem = task.problem(waypoints)
        plan = pf.plan(problem, method="peak")
    except Exception as error:  # a failure is a row
        return failure(cells, error)
    cells |= {
        "peak [s]": plan.duration,
        "status": str(plan.status),
        "iterations": plan.iterations,
    }
    best, source = plan.duration, "default"
    for name, other in _references(problem, index):
        if name == SAME_START:
            cells["tighter, same start [%]"] = 100.0 * (plan.duration / other.duration - 1.0)
        if other.feasible and other.duration < best:
            best, source = other.duration, name
    cells |= {"reference [s]": best, "reference from": source}
    cells["gap [%]"] = 100.0 * (plan.duration / best - 1.0)
    if not plan.feasible or plan.status is not pf.Status.SOLVED:
        return Row(cells=cells, note=f"failed: {plan.message or plan.status}")
    return Row(cells=cells, met=plan.duration <= MOST * best)


def _references(problem: pf.Problem, index: int) -> Iterator[tuple[str, pf.Plan]]:
    """Plans by a tighter ladder, from the start of `peak` and from others."""
    settings = peak.Settings(ladder=TIGHTER, stage_iterations=TIGHTER_ITERATIONS)
    rng = np.random.default_rng([index, 7])
    lengths = problem.leg_lengths
    starts = {
        SAME_START: lengths,
        "roots of lengths": np.sqrt(lengths),
        "even times": np.ones(len(lengths)),
    }
    for push in PUSHES:
        starts[f"random {push}"] = lengths * np.exp(push * rng.normal(size=len(lengths)))
    for name, start in starts.items():
        times = start * (lengths.sum() / (problem.limits.speed or 1.0) / start.sum())
        with mock.patch.object(peak, "proportional_times", lambda _, times=times: times.copy()):
            try:
                yield name, pf.plan(problem, method="peak", settings=settings)
            except pf.PeakflightError:
                continue
