"""The fastest smooth trajectory through waypoints that provably keeps every limit."""

from peakflight.errors import (
    InvalidFile,
    InvalidProblem,
    MissingExtra,
    PeakflightError,
    Status,
)
from peakflight.limits import GRAVITY, KINDS, Limits
from peakflight.problem import Problem
from peakflight.result import History, Plan, Report
from peakflight.trajectory import Trajectory

__version__ = "0.1.0"

__all__ = [
    "GRAVITY",
    "KINDS",
    "History",
    "InvalidFile",
    "InvalidProblem",
    "Limits",
    "MissingExtra",
    "PeakflightError",
    "Plan",
    "Problem",
    "Report",
    "Status",
    "Trajectory",
    "__version__",
]
