"""`peakflight check`: proves a plan again, from its file alone."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from peakflight.claims import claims_feasible, false_claims
from peakflight.cli.options import common_options, limits_option
from peakflight.cli.output import Printout, print_json
from peakflight.cli.progress import Progress
from peakflight.cli.verdict import COLUMNS, limit_rows
from peakflight.limits import Limits
from peakflight.problem import derivative_name
from peakflight.result import JOINT_TOLERANCE, Plan, Report, allowed_miss
from peakflight.summary import limit_summaries
from peakflight.wording import rotor_notes, seconds


@click.command(short_help="Prove a plan again, from its file alone.")
@click.argument("file", metavar="PLAN", type=click.Path(path_type=Path))
@limits_option("Limits to check against.")
@common_options
def check(file: Path, limits: Limits | None, as_json: bool) -> int:
    """Prove PLAN, a plan.json, again: from its coefficients, limits and waypoints alone.

    Ends with 0 if every limit, joint and waypoint is proven and what the file claims is true, 1 if
    not, 2 if it is not a plan.

    \b
    Example:
      peakflight check course-plan/plan.json --limits speed=4,tilt=50deg
    """  # noqa: D301
    with Progress() as progress:
        progress.stage(f"checking {file.name}")
        plan, values = Plan.load_with_claims(file)
        from peakflight.certificate import certify_plan

        report = certify_plan(plan)
        wrong = false_claims(values, plan, report)
        if limits is not None:
            plan = replace(plan, problem=replace(plan.problem, limits=limits, vehicle=None))
            report = certify_plan(plan)
    if as_json:
        print_json(_as_dict(plan, report, wrong))
    else:
        _print(file, plan, report, wrong)
    if not report.feasible:
        verdict = "not feasible"
        if limits is not None:
            verdict = "not feasible within the given limits"
        elif claims_feasible(values):
            verdict = "claims to be feasible, but is not"
        click.echo(f"peakflight: {file}: {verdict}: {report.problems[0]}", err=True)
    elif wrong:
        click.echo(f"peakflight: {file}: false claim: {wrong[0]}", err=True)
    return 0 if report.feasible and not wrong else 1


def _as_dict(plan: Plan, report: Report, false_claims: Sequence[str]) -> dict[str, Any]:
    worst = {
        one.kind.name: {
            "limit": one.limit,
            "reached": one.reached,
            "unit": one.kind.unit,
            "ratio": one.ratio,
            "segment": one.segment,
            "binds": list(one.binding),
        }
        for one in limit_summaries(plan, report)
    }
    return {
        **report.to_dict(),
        "limits": plan.problem.limits.to_dict(),
        "worst": worst,
        "duration": plan.duration,
        "vehicle": None if plan.vehicle is None else plan.vehicle.name,
        "continuity": plan.problem.spline_class.continuity,
        "false_claims": list(false_claims),
    }


def _print(file: Path, plan: Plan, report: Report, false_claims: Sequence[str]) -> None:
    out = Printout()
    out.path(
        f"{file}: {seconds(plan.duration)} s, {len(plan.trajectory)} segments, by {plan.method}"
        + ("" if plan.vehicle is None else f", for {plan.vehicle.name}")
    )
    if report.feasible:
        out.line("feasible: proven at every instant, from the coefficients alone", "good")
    else:
        out.line("not feasible:", "bad")
        for problem in report.problems:
            out.line(f"  {problem}")
    out.table(
        "Limits",
        COLUMNS,
        limit_rows(plan, report),
    )
    out.line()
    out.pairs(
        [
            (
                "joints",
                f"up to {derivative_name(plan.problem.spline_class.continuity)}, largest jump "
                f"{report.joint_residual:.1e} of its size ({JOINT_TOLERANCE:.0e} allowed)",
            ),
            (
                "waypoints",
                f"missed by {report.waypoint_error:.1e} m at most "
                f"({allowed_miss(plan.problem.waypoints):.1e} m allowed)",
            ),
            (
                "claims",
                "; ".join(false_claims)
                or "feasible or not, peaks, duration and degree agree with the proof",
            ),
        ]
    )
    for note in rotor_notes(plan.problem):
        out.line(f"note: {note}")
    out.show()
