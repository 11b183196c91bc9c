"""How numbers, limits and their proof are written for people, wherever that is."""

import math
from collections.abc import Sequence

from peakflight.limits import UNBOUNDED, LimitKind, Limits
from peakflight.problem import Problem
from peakflight.result import BINDING


def seconds(time: float) -> str:
    """Print a time in s."""
    return f"{time:.4f}" if 1e-2 <= time < 1e6 else f"{time:.6g}"


def number(kind: LimitKind, value: float) -> str:
    """Print a value of a kind of limit; angles in degrees."""
    return f"{math.degrees(value) if kind.unit == 'rad' else value:.6g}"


def amount(kind: LimitKind, value: float) -> str:
    """Print a value of a kind of limit with its unit; angles in degrees."""
    return f"{number(kind, value)} {'deg' if kind.unit == 'rad' else kind.unit}"


def attained(problem: Problem, kind: LimitKind, ratio: float) -> float | None:
    """Value that a certified ratio stands for, in the unit of its kind; None where unbounded."""
    if kind in problem.limits.active:
        return problem.limits.attained(kind, ratio)
    return problem.allowed[kind] * ratio if ratio < UNBOUNDED else None


def rotor_notes(problem: Problem) -> tuple[str, ...]:
    """What limits on rotors are proven for, if there are any."""
    if not problem.limits.on_rotors:
        return ()
    nose = "the yaw of the plan" if problem.heading else "a heading that does not twist"
    return (f"rotor thrusts are proven for {nose}, with drag and unequal inertia",)


def ratio_cells(ratio: float) -> tuple[str, str, str]:
    """A ratio to a limit, the distance to the limit, and what that means in a word."""
    if ratio >= UNBOUNDED:
        return "no bound", "", "exceeded"
    if ratio > 1.0:
        return f"{ratio:.6g}", f"{100.0 * (1.0 - ratio):.3g} %", "exceeded"
    return f"{ratio:.4f}", f"{100.0 * (1.0 - ratio):.2f} %", "binds" if ratio >= BINDING else ""


def ranges(numbers: Sequence[int], most: int = 8) -> str:
    """Rising numbers as `0-3, 7`; of many parts the first, and how many numbers there are."""
    parts: list[list[int]] = []
    for number in numbers:
        if parts and number == parts[-1][1] + 1:
            parts[-1][1] = number
        else:
            parts.append([number, number])
    texts = [str(first) if first == last else f"{first}-{last}" for first, last in parts]
    if len(texts) > most:
        return f"{', '.join(texts[:most])}, ... ({len(numbers)} in all)"
    return ", ".join(texts) or "none"


def written(limits: Limits, separator: str = ",") -> str:
    """Limits as the command line reads them."""
    items = []
    for kind in limits.active:
        value = getattr(limits, kind.name)
        number = f"{math.degrees(value):.10g}deg" if kind.unit == "rad" else f"{value:.10g}"
        items.append(f"{kind.name}={number}")
    return separator.join(items)
