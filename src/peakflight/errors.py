"""The exceptions that peakflight raises and the status with which every solve ends."""

from enum import StrEnum


class PeakflightError(Exception):
    """Base of every error that peakflight raises on purpose."""


class InvalidProblem(PeakflightError, ValueError):
    """What was asked makes no sense; the message names index, value and rule."""


class InvalidFile(PeakflightError, ValueError):
    """A file cannot be read or written; the message names file, line or key, and rule."""


class MissingExtra(PeakflightError, ImportError):
    """An optional library is not installed; the message names the extra that brings it."""


class ExecutorFailed(PeakflightError, RuntimeError):
    """What should have run a batch is broken; what it had found is in the batch's store."""


LONGEST_QUOTE = 40
"""Characters of a wrong value that a message shows."""


def quoted(text: str) -> str:
    """Text from a user as a message shows it: in quotes, on one line, and not too long."""
    return repr(text) if len(text) <= LONGEST_QUOTE else f"{text[:LONGEST_QUOTE]!r}..."


class Status(StrEnum):
    """How a solve ended. A plan is feasible exactly when its report says so, whatever the status.

    Each member is its own text, so that it can be printed and stored as it is.
    """

    SOLVED = "solved"
    """The method's own stopping rule was met and the certificate holds."""
    INFEASIBLE = "infeasible"
    """No trajectory within the limits was found."""
    ITERATION_LIMIT = "iteration limit"
    """Stopped early; the plan is certified, but a longer run could be faster."""
    TIME_LIMIT = "time limit"
    """Out of time; the plan is the best certified one so far."""
    NO_PROGRESS = "no progress"
    """The method stalled before its stopping rule; the plan is certified."""
    NUMERICAL = "numerical"
    """Rounding made the problem unsolvable as posed."""
