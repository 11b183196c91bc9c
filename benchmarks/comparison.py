"""How long it takes to compare every method on several courses: CPU time of one thread, warm."""

from pathlib import Path
from tempfile import TemporaryDirectory

import peakflight as pf
from benchmarks.courses import JERK, walk
from benchmarks.measure import Sample, repeated, side_by_side
from benchmarks.report import Cell, Column, Row, Table, failure, judged
from benchmarks.scope import Scope
from peakflight.compare import Comparison, compare, summarise, warm_up
from peakflight.methods import METHODS

COURSES, LEGS = 10, 10
"""Random walks."""
BAR = 5.0
"""CPU seconds of all plans and their proofs."""

COLUMNS: list[Column] = [
    ("what", ""), ("courses", "d"), ("legs", "d"), ("plans", "d"), ("certified", "d"),
    ("CPU [s]", ".3f"), ("spread", ".0%"), ("files", "d"),
]  # fmt: skip


def run(scope: Scope) -> list[Table]:
    """One table: plans and proofs, and the pictures of them."""
    rounds = scope.pick(2, 5)
    problems = [JERK.problem(walk(LEGS, index)) for index in range(scope.pick(2, COURSES))]
    cells: dict[str, Cell] = {"courses": len(problems), "legs": LEGS}
    found: list[Comparison] = []

    def plans() -> None:
        found[:] = [
            compare(problem, name=f"walk {index}") for index, problem in enumerate(problems)
        ]
        summarise(found)

    what: dict[str, Cell] = {"what": "compare, all methods: plans and proofs", **cells}
    bar = f"<= {BAR:g} s"
    try:
        warm_up(problems[0])
        what |= _cost(side_by_side([repeated(plans)], rounds)[0])
        rows = [row for one in found for row in one.rows]
        what |= {"plans": len(rows), "certified": sum(row.certified for row in rows)}
    except Exception as error:  # a failure is a row
        return [_table([failure(what, error, bar)])]
    planned = judged(what, "CPU [s]", BAR, bar)
    planned.met = bool(planned.met and what["certified"] == what["plans"])
    return [_table([planned, _pictures(found, cells, rounds)])]


def _table(rows: list[Row]) -> Table:
    text = (
        f"Random walks at minimum jerk, every method ({', '.join(METHODS)}) with its defaults. CPU "
        "time of one thread, warm, for all courses together. Pictures: what the command draws "
        "with -o, written as PNG."
    )
    return Table(title="A comparison of methods", note=text, columns=COLUMNS, rows=rows)


def _pictures(found: list[Comparison], cells: dict[str, Cell], rounds: int) -> Row:
    """The pictures of each course, and that of all together."""
    what: dict[str, Cell] = {"what": "its pictures", **cells}
    try:
        with TemporaryDirectory() as name:
            folder = Path(name)
            sample = side_by_side([repeated(lambda: _draw(found, folder))], rounds)[0]
            what |= {**_cost(sample), "files": len(list(folder.iterdir()))}
    except Exception as error:  # a failure is a row
        return failure(what, error)
    return Row(cells=what)


def _draw(found: list[Comparison], folder: Path) -> None:
    from peakflight.figures import comparison_figures, differences_figure, write_figure

    for one in found:
        plans: dict[str, pf.Plan] = {
            row.method: row.plan for row in one.rows if row.certified and row.plan is not None
        }
        for name, figure in comparison_figures(plans, title=one.name).items():
            write_figure(figure, folder / f"{one.name}-{name}.png")
    values = {
        method: [one.rows[place].against_proportional for one in found]
        for place, method in enumerate(METHODS)
    }
    figure = differences_figure(
        [one.name for one in found], values, title="Methods", axis="against proportional"
    )
    write_figure(figure, folder / "compare.png")


def _cost(sample: Sample) -> dict[str, Cell]:
    return {"CPU [s]": sample.median, "spread": sample.spread}
