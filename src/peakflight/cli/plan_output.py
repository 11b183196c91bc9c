"""What `peakflight plan` tells a person."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from peakflight.cli.options import limits_source
from peakflight.cli.output import Printout
from peakflight.cli.yaw_options import written_yaw
from peakflight.limits import Limits
from peakflight.result import Plan
from peakflight.summary import leg_summaries, limit_summaries
from peakflight.wording import amount, number, ratio_cells, rotor_notes, seconds, written
from peakflight.yaw import ALL_LABELS

MOST_LEGS = 40
"""More legs than this are not all shown."""
ENDS = 10
"""Legs shown at either end where not all are."""
MOST_NOTES = 10


def print_plan(
    plan: Plan,
    *,
    course: str,
    variant: str | None,
    given_limits: Limits | None,
    before: Sequence[str],
    after: Sequence[str],
    folder: Path,
    files: Mapping[str, Path],
    summaries: Mapping[str, str],
) -> None:
    """Print a plan and where its files are.

    Parameters
    ----------
    given_limits
        What the user has limited; None for the defaults of the vehicle, or the paper's.
    before, after
        Notes about the course and about the files.
    files, summaries
        Where each file is, and what it is.
    """
    out = Printout()
    waypoints = len(plan.problem.waypoints)
    out.line(f"{course}: {waypoints} waypoints, {waypoints - 1} legs", "title")
    _print_notes(out, before)
    source = limits_source(plan.vehicle, given_limits)
    out.path(f"limits{source}: {written(plan.problem.limits)}")
    if plan.problem.heading is not None:
        out.path(f"yaw: {written_yaw(plan.problem.heading)}")
    out.line()
    method = f"{plan.method}, variant {variant}" if variant else plan.method
    proof = "yes, at every instant" if plan.feasible else "no"
    out.pairs(
        [
            ("total time", f"{seconds(plan.duration)} s"),
            ("status", str(plan.status)),
            ("certified", proof),
            ("method", f"{method}; degree {plan.trajectory.degree}, {_count(plan)}"),
            ("planning time", f"{plan.wall_time_s:.3g} s"),
            ("iterations", str(plan.iterations)),
        ]
    )
    out.table("Legs", ("leg", ">time (s)", "closest limit", ">ratio", ">margin", ""), _legs(plan))
    if len(plan.pieces) > MOST_LEGS:
        shown = f"the first and last {ENDS} of {len(plan.pieces)} legs"
        out.line(f"{shown}; plan.json has them all")
    out.table(
        "Limits",
        ("limit", ">allowed", ">reached", ">ratio", ">margin", "", ">leg"),
        _worst(plan),
    )
    if not plan.feasible:
        out.line()
        out.line(f"no feasible trajectory: {plan.message}", "bad")
    out.line()
    out.path(f"wrote to {folder}:")
    out.pairs((path.name, summaries[name]) for name, path in files.items())
    _print_notes(out, (*rotor_notes(plan.problem), *after))
    out.show()


def _count(plan: Plan) -> str:
    pieces = len(plan.trajectory)
    return f"{pieces} piece{'' if pieces == 1 else 's'} in {len(plan.pieces)} legs"


def _print_notes(out: Printout, notes: Sequence[str]) -> None:
    for note in notes[:MOST_NOTES]:
        out.line(f"note: {note}")
    if len(notes) > MOST_NOTES:
        out.line(f"note: {len(notes) - MOST_NOTES} more like these; plan.json has them all")


def _legs(plan: Plan) -> Iterator[Sequence[str] | None]:
    """Each leg's time and the limit that binds it, or comes closest to."""
    legs = leg_summaries(plan)
    for index, leg in enumerate(legs):
        if len(legs) > MOST_LEGS and ENDS <= index < len(legs) - ENDS:
            if index == ENDS:
                yield None
            continue
        ratio, margin, meaning = ratio_cells(leg.ratio)
        yield str(index), seconds(leg.time), ALL_LABELS[leg.closest], ratio, margin, meaning


def _worst(plan: Plan) -> Iterator[Sequence[str]]:
    """The worst ratio of each limit, and the leg where it is."""
    for one in limit_summaries(plan):
        yield (
            one.kind.label,
            amount(one.kind, one.limit),
            "" if one.reached is None else number(one.kind, one.reached),
            *ratio_cells(one.ratio),
            str(one.leg),
        )
