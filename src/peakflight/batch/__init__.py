"""Many plans or flights at once, on processes of this machine or on a cluster."""

from peakflight.batch.flying import FlightResult, FlightSummary, fly_many
from peakflight.batch.planning import BatchResult, plan_many
from peakflight.batch.processes import Processes
from peakflight.batch.run import Done, Failure, Work, run

__all__ = [
    "BatchResult",
    "Done",
    "Failure",
    "FlightResult",
    "FlightSummary",
    "Processes",
    "Work",
    "fly_many",
    "plan_many",
    "run",
]
