"""`peakflight import`: what others have made, proven against limits, mended and retimed."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from peakflight.cli.folder import OutputFolder
from peakflight.cli.options import (
    PAPERS,
    FolderPath,
    common_options,
    limits_option,
    limits_source,
    vehicle_option,
)
from peakflight.cli.output import Printout, amounts, print_json
from peakflight.cli.progress import Progress
from peakflight.cli.verdict import as_dict, change, end, print_verdict
from peakflight.cli.yaw_options import parse_yaw_limits
from peakflight.errors import InvalidProblem
from peakflight.limits import PAPER_LIMITS, Limits
from peakflight.methods import METHODS
from peakflight.readers import TOLERANCE, read_trajectory_file
from peakflight.result import JOINT_TOLERANCE
from peakflight.vehicle import Vehicle
from peakflight.wording import seconds, written

if TYPE_CHECKING:
    from peakflight.importing import Imported

PLAN_FILE = "plan.json"
WORDS = ("position", "velocity", "acceleration")
SEEN = 1e-6
"""Difference of yaw that is worth a line, rad."""


def _yaw_limits(
    context: click.Context, parameter: click.Parameter, text: str | None
) -> dict[str, float | None] | None:
    try:
        return None if text is None else parse_yaw_limits(text)
    except InvalidProblem as error:
        raise click.BadParameter(str(error), context, parameter) from None


@click.command("import", short_help="Prove, mend and retime a trajectory that others have made.")
@click.argument("file", type=click.Path(path_type=Path))
@vehicle_option
@limits_option("Limits to keep.", otherwise=f"those of a plan file, else {PAPERS}")
@click.option(
    "--yaw-limits",
    metavar="NAME=VALUE,...",
    callback=_yaw_limits,
    help="How fast the nose may turn: rate in rad/s, acceleration in rad/s^2. By default not "
    "limited, or as in a plan file.",
)
@click.option("--repair", is_flag=True, help="Close small jumps where polynomials meet.")
@click.option("--retime", is_flag=True, help="Fly the path as fast as the limits allow.")
@click.option(
    "--method",
    type=click.Choice(tuple(METHODS)),
    help="Plan anew through the joints of the file as waypoints, in place of keeping its path.",
)
@click.option(
    "--tolerance",
    type=float,
    default=TOLERANCE,
    show_default=True,
    help="How near polynomials come to a file of samples, m.",
)
@click.option(
    "-o",
    "--output",
    type=FolderPath(),
    metavar="DIR",
    help="Folder for the plan.json; without it nothing is written.",
)
@common_options
def import_(
    file: Path,
    vehicle: Vehicle | None,
    limits: Limits | None,
    yaw_limits: dict[str, float | None] | None,
    repair: bool,
    retime: bool,
    method: str | None,
    tolerance: float,
    output: Path | None,
    as_json: bool,
) -> int:
    """Read FILE, a trajectory, prove it against limits, and mend or retime it.

    FILE holds polynomial pieces as Crazyswarm has them, samples (our own, those of Agilicious or
    CPC, or t,x,y,z[,yaw]), or a plan; what is in it says which. Ends with 0 if the result is
    proven to keep every limit, 1 if not, 2 if the input is wrong.

    \b
    Example:
      peakflight import eight.csv --limits speed=2,jerk=30 --retime -o new
    """  # noqa: D301
    with Progress() as progress:
        progress.stage(f"reading {file.name}")
        source = read_trajectory_file(file, tolerance=tolerance)
        from peakflight.importing import import_trajectory

        if source.plan is None and vehicle is None and limits is None:
            limits = PAPER_LIMITS
        progress.stage("proving it" if method is None else f"planning by {method}")
        found = import_trajectory(
            source,
            limits=limits,
            vehicle=vehicle,
            yaw_limits=yaw_limits,
            repair=repair,
            retime=retime,
            method=method,
        )
        plan = found.plan
        if output is not None:
            with OutputFolder(output) as folder:
                plan.save(folder.stage / PLAN_FILE)
    jumps = dict(zip(WORDS, found.jumps.tolist(), strict=True))
    notes = [*source.notes, *_jump_notes(found), *_yaw_notes(found.yaw_off)]
    if as_json:
        print_json(
            {
                **as_dict(plan),
                "form": source.form,
                "duration_before": found.file_plan.duration,
                "feasible_before": found.file_plan.feasible,
                "joint_jumps": jumps,
                "repaired_by": None if found.moved is None else found.moved.tolist(),
                "fit_errors": None if source.fit_errors is None else list(source.fit_errors),
                "yaw_off": found.yaw_off,
                "notes": notes,
                "file": None if output is None else str(output / PLAN_FILE),
            }
        )
        return end(file, plan)
    pieces = len(source.trajectory)
    out = Printout()
    samples = f"{source.samples} " if source.samples else ""
    out.path(f"{file}: {samples}{source.form}")
    given = limits_source(plan.vehicle, limits if limits is not PAPER_LIMITS else None)
    if source.plan is not None and limits is None and vehicle is None:
        given = " (of the file)"
    out.path(f"limits{given}: {written(plan.problem.limits)}")
    rows = [
        (
            "file",
            f"{pieces} piece{'' if pieces == 1 else 's'}, {seconds(source.trajectory.duration)} s",
        )
    ]
    if source.fit_errors is not None:
        rows.append(("fit", f"off the samples by {amounts(source.fit_errors)} at most"))
    rows.append(("joints", _about_joints(found, pieces)))
    if found.moved is not None:
        rows.append(("repair", f"changed it by {amounts(found.moved)} at most"))
    if source.yaw is not None:
        limited = plan.problem.heading is not None and plan.problem.heading.limits
        rows.append(("yaw", "carried" if limited else "carried; nothing limits it"))
    rows.append(("total time", change(found.file_plan.duration, plan.duration)))
    out.pairs(rows)
    for note in notes:
        out.line(f"note: {note}")
    print_verdict(out, plan)
    out.line()
    out.path(
        "nothing written; -o DIR keeps the plan"
        if output is None
        else f"wrote {output / PLAN_FILE}"
    )
    out.show()
    return end(file, plan)


def _about_joints(found: "Imported", pieces: int) -> str:
    """How well the polynomials of the file meet."""
    if pieces == 1:
        return "none"
    if found.file_plan.report.joint_residual <= JOINT_TOLERANCE:
        return f"meet; off by {amounts(found.jumps)} at most"
    return f"jump by {amounts(found.jumps)} at most"


def _jump_notes(found: "Imported") -> list[str]:
    """Where jumps at joints come from, and what can be done."""
    if found.file_plan.report.joint_residual <= JOINT_TOLERANCE or found.moved is not None:
        return []
    if not found.is_rounded:
        return ["jumps as large as at its joints do not come from rounding; --repair would bend it"]
    return ["jumps as small as at its joints come from rounded numbers; --repair closes them"]


def _yaw_notes(off: float) -> list[str]:
    if off <= SEEN:
        return []
    return [f"its yaw is up to {math.degrees(off):.2g} deg off the file's, on cubic pieces"]
