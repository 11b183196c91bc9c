"""The paper's figures of planning, drawn from what was run again."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from peakflight.figures import (
    Flight,
    comparison_figures,
    in_sequence,
    overlaid_derivatives_figure,
    paths_figure,
    segment_times_figure,
    side_by_side,
)
from peakflight.paper import ALGORITHM_1, GUESS, PEAK, PaperComparison, Reproduction
from peakflight.result import History, Plan
from peakflight.spline import SplineTask

SETTLED = 1e-4
"""Iterations at the end that change no segment time by more than this part are left out."""
SHOWN = 8
"""Most iterations whose trajectories are drawn."""


class Drawn(NamedTuple):
    """A picture and what it shows."""

    name: str
    """Of its file, without the ending."""
    caption: str
    figure: Figure


def example_pictures(result: Reproduction) -> Iterator[Drawn]:
    """Draw the paper's example: Figs. Opt_derivatives, Opt_SegTimes and Opt_Traj."""
    example = result.example
    flights = [Flight.of(GUESS, result.guess, "proportional")]
    flights += side_by_side({name: plan for name, plan in example.plans.items() if name == PEAK})
    yield Drawn(
        "example-derivatives",
        "The paper's Fig. Opt_derivatives: motion derivatives of the initial guess, its total set "
        "to 5 s whatever the limits, and of the optimised trajectory; limits dashed.",
        overlaid_derivatives_figure(
            flights, example.printed.limits, title="Initial guess at 5 s, and optimised"
        ),
    )
    for name, key in ((ALGORITHM_1, "algorithm-1"), (PEAK, "peak")):
        run = example.rows[name].plan
        if run is None or run.history is None or len(run.history) < 2:
            continue
        run, left_out = _until_settled(run)
        rest = (
            f" Left out: {left_out} iterations at the end, none of which changes a leg's time by "
            f"more than {100.0 * SETTLED:g} %."
            if left_out
            else ""
        )
        yield Drawn(
            f"example-segment-times-{key}",
            f"The paper's Fig. Opt_SegTimes, by {_by(name)}: the time of each leg by iteration, "
            f"the total above.{rest}",
            segment_times_figure(run, title=f"Leg times by iteration: {name}"),
        )
        task = SplineTask.of(result.course.waypoints, run.problem.spline_class, run.problem.fixed)
        times = run.history.segment_times if run.history is not None else np.empty((0, 0))
        last = len(times) - 1
        rows = np.unique([0, *np.geomspace(1, last, SHOWN - 1).round().astype(int)])
        yield Drawn(
            f"example-paths-{key}",
            f"The paper's Fig. Opt_Traj, by {_by(name)}: the trajectory as it changes over "
            "iterations, with their total times before any stretch to the limits.",
            paths_figure(
                in_sequence({f"iteration {row}": task.solve(times[row]) for row in rows}),
                result.course.waypoints,
                title=f"Trajectory by iteration: {name}",
            ),
        )


def comparison_pictures(one: PaperComparison) -> Iterator[Drawn]:
    """Draw a comparison: its part of Figs. TrajSim, DerSim and SegTimeSim."""
    if not one.plans:
        return
    title = one.printed.title
    figures = comparison_figures(one.plans, title=title)
    for kind, said in {
        "paths": f"The paper's Fig. TrajSim, {title.lower()}: the trajectories.",
        "derivatives": f"The paper's Fig. DerSim, {title.lower()}: motion derivatives against "
        "time; limits dashed.",
        "leg-times": f"The paper's Fig. SegTimeSim, {title.lower()}: how the time is shared out.",
    }.items():
        yield Drawn(f"{one.printed.name}-{kind}", said, figures[kind])


def _by(name: str) -> str:
    return "Algorithm 1 from the guess at 5 s" if name == ALGORITHM_1 else "the default of `peak`"


def _until_settled(plan: Plan) -> tuple[Plan, int]:
    """Leave out iterations at the end that change nothing; how many these are."""
    assert plan.history is not None  # looked up by the caller
    times = plan.history.segment_times
    changes = np.abs(times[1:] / times[:-1] - 1.0).max(axis=1)
    moving = np.flatnonzero(~(changes <= SETTLED))
    count = min(int(moving[-1]) + 3 if len(moving) else 2, len(times))
    return replace(plan, history=History(segment_times=times[:count])), len(times) - count
