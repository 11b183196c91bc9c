"""A plan in a few numbers: how long each leg takes, and how near it comes to which limit."""

from typing import NamedTuple

import numpy as np

from peakflight.limits import LimitKind
from peakflight.result import BINDING, Plan, Report
from peakflight.wording import attained


class LegSummary(NamedTuple):
    """A leg, from one waypoint to the next."""

    begins: float
    """s, when its first waypoint is passed."""
    time: float
    """s."""
    closest: str
    """Name of the limit that binds it, or that it comes closest to."""
    ratio: float
    """Its certified kappa: peak over limit."""

    @property
    def binds(self) -> bool:
        """Whether the limit is reached, within 0.1 %."""
        return self.ratio >= BINDING


class LimitSummary(NamedTuple):
    """A limit, and how near a plan comes to it."""

    kind: LimitKind
    limit: float
    """In the unit of the kind."""
    ratio: float
    """The largest certified kappa: peak over limit."""
    reached: float | None
    """What that stands for, in the unit of the kind; None where there is no bound."""
    segment: int
    """Where it is."""
    leg: int
    """Of which that segment is a piece."""
    binding: tuple[int, ...]
    """Segments that it binds."""


def leg_summaries(plan: Plan, report: Report | None = None) -> list[LegSummary]:
    """Each leg of a plan, in order.

    Parameters
    ----------
    report
        What is proven of the plan; by default what it says itself.
    """
    peaks = (report or plan.report).peaks
    passed = plan.waypoint_times
    first = np.cumsum((0, *plan.pieces[:-1]))
    names = list(peaks)
    kappa = np.array([np.maximum.reduceat(peaks[name], first) for name in names])
    closest = kappa.argmax(axis=0)
    return [
        LegSummary(
            float(passed[leg]),
            float(passed[leg + 1] - passed[leg]),
            names[closest[leg]],
            float(kappa[closest[leg], leg]),
        )
        for leg in range(len(plan.pieces))
    ]


def limit_summaries(plan: Plan, report: Report | None = None) -> list[LimitSummary]:
    """Each limit of a plan, of its flight and of its yaw; report as of `leg_summaries`."""
    report = report or plan.report
    legs = np.repeat(np.arange(len(plan.pieces)), plan.pieces)
    summaries = []
    for kind, limit in plan.problem.allowed.items():
        kappa = report.peaks[kind.name]
        segment = int(kappa.argmax())
        worst = float(kappa[segment])
        summaries.append(
            LimitSummary(
                kind,
                limit,
                worst,
                attained(plan.problem, kind, worst),
                segment,
                int(legs[segment]),
                tuple(report.binding_segments(kind.name)),
            )
        )
    return summaries
