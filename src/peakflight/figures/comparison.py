"""Every picture of plans that answer the same problem."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from peakflight.figures.flights import side_by_side
from peakflight.figures.leg_times import leg_times_figure
from peakflight.figures.overlaid_derivatives import overlaid_derivatives_figure
from peakflight.figures.paths import paths_figure
from peakflight.result import Plan


def comparison_figures(plans: Mapping[str, Plan], *, title: str) -> dict[str, Figure]:
    """Draw plans side by side: paths, what is limited against time, and leg times.

    Parameters
    ----------
    plans
        Plans of the same waypoints and limits by what they are called; one at least.
    title
        Of what, for the headlines.
    """
    flights = side_by_side(plans)
    problem = next(iter(plans.values())).problem
    return {
        "paths": paths_figure(flights, problem.waypoints, title=f"{title}: trajectories"),
        "derivatives": overlaid_derivatives_figure(
            flights, problem.limits, title=f"{title}: what is limited"
        ),
        "leg-times": leg_times_figure(flights, title=f"{title}: leg times"),
    }
