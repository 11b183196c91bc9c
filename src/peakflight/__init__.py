"""The fastest smooth trajectory through waypoints that provably keeps every limit.

Importing the package is quick: what needs compiled kernels is imported when it is first used.
"""

from typing import TYPE_CHECKING, Any

from peakflight.airframe import Airframe
from peakflight.course import Course, tidy
from peakflight.errors import (
    ExecutorFailed,
    InvalidFile,
    InvalidProblem,
    MissingExtra,
    PeakflightError,
    Status,
)
from peakflight.formats import read_course
from peakflight.limits import GRAVITY, KINDS, Limits
from peakflight.problem import Problem
from peakflight.readers import TrajectoryFile, read_trajectory, read_trajectory_file
from peakflight.result import History, Plan, Report
from peakflight.trajectory import Trajectory
from peakflight.vehicle import Vehicle
from peakflight.vehicles import VEHICLES, find_vehicle
from peakflight.version import __version__
from peakflight.yaw import Heading

if TYPE_CHECKING:
    from peakflight.batch import BatchResult, FlightResult, fly_many, plan_many
    from peakflight.bound import discretised_bound
    from peakflight.certificate import certify, certify_plan, stretch_to_limits
    from peakflight.exporting import ExportReport, export
    from peakflight.flatness import FlatStates, flat_states, planned_states, states_along
    from peakflight.flight import (
        Conditions,
        Crash,
        Flight,
        FlightAnalysis,
        FlySettings,
        Spread,
        SpreadResult,
        analyse,
        fly,
        fly_spread,
    )
    from peakflight.flight.crazyflow import fly_crazyflow
    from peakflight.importing import Imported, import_trajectory
    from peakflight.joining import join
    from peakflight.planner import plan, replan
    from peakflight.reporting import report_html, write_report
    from peakflight.separation import ClosestApproach, closest_approach
    from peakflight.spline import minimum_effort_spline
    from peakflight.tuning import TuneResult, TuneSettings, tune

__all__ = [
    "GRAVITY",
    "KINDS",
    "VEHICLES",
    "Airframe",
    "BatchResult",
    "ClosestApproach",
    "Conditions",
    "Course",
    "Crash",
    "ExecutorFailed",
    "ExportReport",
    "FlatStates",
    "Flight",
    "FlightAnalysis",
    "FlightResult",
    "FlySettings",
    "Heading",
    "History",
    "Imported",
    "InvalidFile",
    "InvalidProblem",
    "Limits",
    "MissingExtra",
    "PeakflightError",
    "Plan",
    "Problem",
    "Report",
    "Spread",
    "SpreadResult",
    "Status",
    "Trajectory",
    "TrajectoryFile",
    "TuneResult",
    "TuneSettings",
    "Vehicle",
    "__version__",
    "analyse",
    "certify",
    "certify_plan",
    "closest_approach",
    "discretised_bound",
    "export",
    "find_vehicle",
    "flat_states",
    "fly",
    "fly_crazyflow",
    "fly_many",
    "fly_spread",
    "import_trajectory",
    "join",
    "minimum_effort_spline",
    "plan",
    "plan_many",
    "planned_states",
    "read_course",
    "read_trajectory",
    "read_trajectory_file",
    "replan",
    "report_html",
    "states_along",
    "stretch_to_limits",
    "tidy",
    "tune",
    "write_report",
]

_LAZY = {
    "BatchResult": "peakflight.batch",
    "ClosestApproach": "peakflight.separation",
    "Conditions": "peakflight.flight",
    "Crash": "peakflight.flight",
    "ExportReport": "peakflight.exporting",
    "FlatStates": "peakflight.flatness",
    "Flight": "peakflight.flight",
    "FlightAnalysis": "peakflight.flight",
    "FlightResult": "peakflight.batch",
    "FlySettings": "peakflight.flight",
    "Imported": "peakflight.importing",
    "Spread": "peakflight.flight",
    "SpreadResult": "peakflight.flight",
    "analyse": "peakflight.flight",
    "TuneResult": "peakflight.tuning",
    "TuneSettings": "peakflight.tuning",
    "certify": "peakflight.certificate",
    "certify_plan": "peakflight.certificate",
    "closest_approach": "peakflight.separation",
    "discretised_bound": "peakflight.bound",
    "export": "peakflight.exporting",
    "flat_states": "peakflight.flatness",
    "fly": "peakflight.flight",
    "fly_crazyflow": "peakflight.flight.crazyflow",
    "fly_many": "peakflight.batch",
    "fly_spread": "peakflight.flight",
    "import_trajectory": "peakflight.importing",
    "join": "peakflight.joining",
    "minimum_effort_spline": "peakflight.spline",
    "plan": "peakflight.planner",
    "plan_many": "peakflight.batch",
    "planned_states": "peakflight.flatness",
    "replan": "peakflight.planner",
    "report_html": "peakflight.reporting",
    "states_along": "peakflight.flatness",
    "stretch_to_limits": "peakflight.certificate",
    "tune": "peakflight.tuning",
    "write_report": "peakflight.reporting",
}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(_LAZY[name]), name)
    globals()[name] = value
    return value
