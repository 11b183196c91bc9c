"""How near the proven bounds of limits are to what is reached, from what the proofs go by."""

import math
from collections.abc import Iterator

from peakflight import certificate, twist_certificate, yaw_certificate
from peakflight.kernels import rotors, twisting
from peakflight.limits import KINDS, ROTORS
from peakflight.problem import Problem
from peakflight.yaw import ABOUT, ALL_LABELS, BODY_KINDS

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
TURNING = ("body_rate", "angular_acceleration")
"""Limits whose bounds are subdivided until what is left is rounding (`kernels.turning`)."""


def closeness(problem: Problem) -> list[str]:
    """One line for each group of limits of a problem that are proven in the same way."""
    heading = problem.heading
    limited = {kind.name for kind in problem.limits.active}
    if heading is not None:
        limited |= {kind.name for kind in heading.limits}
    lines = []
    for names, how in _groups(is_turned=heading is not None):
        found = [ALL_LABELS[name] for name in names if name in limited]
        if found:
            lines.append(f"{', '.join(found)}: {how}")
    return lines


def power_of_ten(value: float) -> str:
    """The power of ten that is nearest, as people write it."""
    return "10" + str(round(math.log10(value))).translate(RAISED)


def _groups(*, is_turned: bool) -> Iterator[tuple[tuple[str, ...], str]]:
    """Names of limits, and to what their bounds are closed; is_turned: there is a yaw."""
    others = {"tilt", *TURNING, *ROTORS}
    norms = tuple(kind.name for kind in KINDS if kind.name not in others)
    of_square = f"to {power_of_ten(certificate.TOLERANCE)} of the square"
    yield norms, of_square
    yield ("tilt",), f"{of_square} of its tangent"
    yield TURNING, f"{of_square}, and what rounding can amount to"
    alone = _of_limit(certificate.TOLERANCE, rotors.ROUGHEST)
    twisted = _of_limit(twist_certificate.TOLERANCE, twisting.ROUGHEST)
    body = tuple(kind.name for kind in BODY_KINDS)
    if is_turned:
        yield (*ROTORS, *body), f"together with the yaw, {twisted}"
    else:
        yield ROTORS, alone
    rounding = power_of_ten(yaw_certificate.ROUNDING)
    yaw = tuple(kind.name for kind in ABOUT["yaw"])
    yield yaw, f"by a formula, to rounding: {rounding} of the sum of its terms"


def _of_limit(tolerance: float, roughest: float) -> str:
    return (
        f"to {power_of_ten(tolerance)} of the limit or the value, whichever is larger; "
        f"{power_of_ten(roughest)} where rounding is in the way"
    )
