"""`peakflight check`: proves a plan again, from its file alone."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from peakflight.cli.options import common_options, limits_option
from peakflight.cli.output import (
    Printout,
    attained,
    print_json,
    rotor_notes,
    seconds,
)
from peakflight.cli.progress import Progress
from peakflight.cli.verdict import COLUMNS, limit_rows
from peakflight.errors import LONGEST_QUOTE, InvalidFile, Status
from peakflight.files import read_json
from peakflight.limits import Limits
from peakflight.problem import derivative_name
from peakflight.result import JOINT_TOLERANCE, WAYPOINT_TOLERANCE, Plan, Report
from peakflight.yaw import ALL_LABELS

CLAIM_TOLERANCE = 1e-6
"""Two numbers agree that are this near, relative; bounds are good to 1e-10."""


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
        values = read_json(file)
        try:
            plan = Plan.from_dict(values)
        except (ValueError, OverflowError) as error:
            raise InvalidFile(f"{file}: {error}") from None
        from peakflight.certificate import certify_plan

        report = certify_plan(plan)
        false_claims = _false_claims(values, plan, report)
        if limits is not None:
            plan = replace(plan, problem=replace(plan.problem, limits=limits, vehicle=None))
            report = certify_plan(plan)
    if as_json:
        print_json(_as_dict(plan, report, false_claims))
    else:
        _print(file, plan, report, false_claims)
    if not report.feasible:
        verdict = "not feasible"
        if limits is not None:
            verdict = "not feasible within the given limits"
        elif _claims_feasible(values):
            verdict = "claims to be feasible, but is not"
        click.echo(f"peakflight: {file}: {verdict}: {report.problems[0]}", err=True)
    elif false_claims:
        click.echo(f"peakflight: {file}: false claim: {false_claims[0]}", err=True)
    return 0 if report.feasible and not false_claims else 1


def _claims_feasible(values: Mapping[str, Any]) -> bool:
    return bool(values.get("feasible", False)) or values["status"] == Status.SOLVED


def _false_claims(values: Mapping[str, Any], plan: Plan, report: Report) -> tuple[str, ...]:
    """What the file says about its trajectory that is not so, a line each."""
    lines = []
    if _claims_feasible(values) != report.feasible:
        claim = "feasible" if _claims_feasible(values) else "not feasible"
        lines.append(f"claims to be {claim}, proven is the opposite")
    duration = values.get("duration", plan.duration)
    if not _agrees(duration, plan.duration):
        claim = json.dumps(duration)[:LONGEST_QUOTE]
        lines.append(f"claims a duration of {claim} s, the segments take {plan.duration:.9g} s")
    claimed = plan.report.peaks
    for name, proven in report.peaks.items():
        if name not in claimed:
            lines.append(f"claims no peaks of {ALL_LABELS[name]}, which it limits")
        elif len(claimed[name]) != len(proven):
            lines.append(
                f"claims {len(claimed[name])} peaks of {ALL_LABELS[name]}, there are {len(proven)} "
                "segments"
            )
        else:
            wrong = ~np.isclose(claimed[name], proven, rtol=CLAIM_TOLERANCE, atol=CLAIM_TOLERANCE)
            if wrong.any():
                segment = int(wrong.argmax())
                lines.append(
                    f"claims a {ALL_LABELS[name]} of {claimed[name][segment]:.9g} times its limit "
                    f"in segment {segment}, proven is {proven[segment]:.9g}"
                )
    lines += [
        f"claims peaks of {name}, which it does not limit"
        for name in claimed
        if name not in report.peaks
    ]
    return tuple(lines)


def _agrees(claimed: Any, proven: float) -> bool:
    slack = CLAIM_TOLERANCE * proven
    return isinstance(claimed, int | float) and proven - slack <= claimed <= proven + slack


def _as_dict(plan: Plan, report: Report, false_claims: Sequence[str]) -> dict[str, Any]:
    worst = {}
    for kind, limit in plan.problem.allowed.items():
        kappa = report.peaks[kind.name]
        segment = int(kappa.argmax())
        worst[kind.name] = {
            "limit": limit,
            "reached": attained(plan.problem, kind, float(kappa[segment])),
            "unit": kind.unit,
            "ratio": float(kappa[segment]),
            "segment": segment,
            "binds": report.binding_segments(kind.name),
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
    points = plan.problem.waypoints
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
                f"({WAYPOINT_TOLERANCE * (1.0 + float(np.abs(points).max())):.1e} m allowed)",
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
