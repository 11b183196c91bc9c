"""Numbers as users write them, in files and on the command line."""

import math


def as_number(text: str) -> float:
    """The number that a text holds; unlike Python's own, without underscores.

    Raises
    ------
    ValueError
        If it holds none.
    """
    if "_" in text:
        raise ValueError(f"{text!r} has an underscore")
    return float(text)


def is_number(text: str) -> bool:
    """Whether a text holds a number, be it NaN or infinity."""
    try:
        as_number(text)
    except ValueError:
        return False
    return True


def is_finite_number(text: str) -> bool:
    """Whether a text holds a number that is neither NaN nor infinity."""
    return is_number(text) and math.isfinite(as_number(text))
