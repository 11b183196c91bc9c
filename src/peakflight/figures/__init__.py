"""Pictures of a plan, and of several side by side: paths, what is limited, segment times.

Matplotlib is imported here and nowhere else in the package.
"""

from importlib.util import find_spec

from peakflight.errors import MissingExtra

if find_spec("matplotlib") is None:
    raise MissingExtra(
        "figures need matplotlib, which is not installed; "
        "install it with: pip install 'peakflight[figures]'"
    )

from peakflight.figures.comparison import comparison_figures
from peakflight.figures.course import course_figure
from peakflight.figures.derivatives import derivatives_figure
from peakflight.figures.differences import differences_figure
from peakflight.figures.flights import Flight, in_sequence, side_by_side
from peakflight.figures.flown import FlownPlan, flown_figures
from peakflight.figures.leg_times import leg_times_figure
from peakflight.figures.motion_capture import motion_capture_figures
from peakflight.figures.overlaid_derivatives import overlaid_derivatives_figure
from peakflight.figures.paths import paths_figure
from peakflight.figures.rotors import rotors_figure
from peakflight.figures.saving import save_figures, write_figure
from peakflight.figures.segment_times import segment_times_figure
from peakflight.figures.yaw import yaw_figure

__all__ = [
    "Flight",
    "FlownPlan",
    "comparison_figures",
    "course_figure",
    "derivatives_figure",
    "differences_figure",
    "flown_figures",
    "in_sequence",
    "leg_times_figure",
    "motion_capture_figures",
    "overlaid_derivatives_figure",
    "paths_figure",
    "rotors_figure",
    "save_figures",
    "segment_times_figure",
    "side_by_side",
    "write_figure",
    "yaw_figure",
]
