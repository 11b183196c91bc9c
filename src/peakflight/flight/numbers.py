"""Checks of numbers that settings of a flight are made of."""

import math
from typing import Any

from peakflight.errors import InvalidProblem, quoted


def number(name: str, value: Any, least: float, most: float, unit: str = "") -> float:
    """Take a finite number within bounds.

    Raises
    ------
    InvalidProblem
        If it is none; the message names it, the value and the bounds.
    """
    found = _float(name, value)
    if not least <= found <= most:
        raise InvalidProblem(
            f"{name} is {found:g}; it must be from {least:g} to {most:g} {unit}".rstrip()
        )
    return found


def vector(name: str, value: Any, most: float, unit: str = "") -> tuple[float, float, float]:
    """Take three finite numbers of a size; errors as of `number`."""
    try:
        parts = list(value)
    except TypeError:
        parts = []
    if isinstance(value, str) or len(parts) != 3:
        raise InvalidProblem(f"{name} is {quoted(str(value))}; it must be three numbers: x, y, z")
    x, y, z = (
        number(f"{name} {axis}", one, -most, most, unit)
        for axis, one in zip("xyz", parts, strict=True)
    )
    return x, y, z


def whole(name: str, value: Any, least: int, most: int) -> int:
    """Take a whole number within bounds; errors as of `number`."""
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise InvalidProblem(f"{name} is {quoted(str(value))}; it must be a whole number")
    found = int(value.__index__())
    if not least <= found <= most:
        raise InvalidProblem(f"{name} is {found}; it must be from {least} to {most}")
    return found


def _float(name: str, value: Any) -> float:
    if isinstance(value, str | bytes | bool) or value is None:
        raise InvalidProblem(f"{name} is {quoted(str(value))}; it must be a number")
    try:
        found = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InvalidProblem(f"{name} is {quoted(str(value))}; it must be a number") from None
    if not math.isfinite(found):
        raise InvalidProblem(f"{name} is {found}; it must be finite")
    return found
