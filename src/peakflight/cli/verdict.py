"""What is proven of a plan, as commands that change or read plans print it."""

from collections.abc import Iterator, Sequence
from typing import Any

import click

from peakflight.cli.output import Printout
from peakflight.result import Plan, Report
from peakflight.summary import limit_summaries
from peakflight.wording import amount, number, ranges, ratio_cells, rotor_notes, seconds

COLUMNS = ("limit", ">allowed", ">reached", ">ratio", ">margin", "", "segments")
"""Of a table of limits."""


def limit_rows(plan: Plan, report: Report) -> Iterator[Sequence[str]]:
    """A row for each limit: what is allowed, what is reached, and where it binds."""
    for one in limit_summaries(plan, report):
        yield (
            one.kind.label,
            amount(one.kind, one.limit),
            "" if one.reached is None else number(one.kind, one.reached),
            *ratio_cells(one.ratio),
            ranges(one.binding),
        )


def print_verdict(out: Printout, plan: Plan) -> None:
    """Say whether a plan is proven, and how near each limit it comes."""
    if plan.feasible:
        out.line("feasible: proven at every instant, from the coefficients alone", "good")
    else:
        out.line("not feasible:", "bad")
        for problem in plan.report.problems:
            out.line(f"  {problem}")
    out.table("Limits", COLUMNS, limit_rows(plan, plan.report))
    for note in rotor_notes(plan.problem):
        out.line(f"note: {note}")


def end(file: object, plan: Plan) -> int:
    """The exit code of a plan, and a line on stderr if it is not proven."""
    if plan.feasible:
        return 0
    click.echo(f"peakflight: {file}: not feasible: {plan.report.problems[0]}", err=True)
    return 1


def as_dict(plan: Plan) -> dict[str, Any]:
    """What machines get of a plan that was changed or read; the rest is in its file."""
    return {
        "status": str(plan.status),
        "duration": plan.duration,
        "segments": len(plan.trajectory),
        "limits": plan.problem.limits.to_dict(),
        "vehicle": None if plan.vehicle is None else plan.vehicle.name,
        **plan.report.to_dict(),
    }


def change(before: float, after: float) -> str:
    """Two durations, and what one is of the other."""
    if abs(after - before) < 5e-5:
        return f"{seconds(after)} s"
    return f"{seconds(after)} s, {100.0 * after / before:.4g} % of {seconds(before)} s before"
