"""What a plan file claims, beside what is proven of it."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from peakflight.errors import LONGEST_QUOTE, Status
from peakflight.result import Plan, Report
from peakflight.yaw import ALL_LABELS

CLAIM_TOLERANCE = 1e-6
"""Two numbers agree that are this near, relative; bounds are good to 1e-10."""


def false_claims(values: Mapping[str, Any], plan: Plan, report: Report) -> tuple[str, ...]:
    """What a plan file says about its trajectory that is not so, a line each.

    Parameters
    ----------
    values
        The file.
    plan
        The same as a plan.
    report
        What is proven of it.
    """
    lines = []
    if claims_feasible(values) != report.feasible:
        claim = "feasible" if claims_feasible(values) else "not feasible"
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


def claims_feasible(values: Mapping[str, Any]) -> bool:
    """Whether a plan file says that the plan keeps every limit."""
    return bool(values.get("feasible", False)) or values["status"] == Status.SOLVED


def _agrees(claimed: Any, proven: float) -> bool:
    slack = CLAIM_TOLERANCE * proven
    return isinstance(claimed, int | float) and proven - slack <= claimed <= proven + slack
