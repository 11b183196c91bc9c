"""Pictures of a plan: the course, the derivatives against their limits, the segment times.

Matplotlib is imported here and nowhere else in the package.
"""

from importlib.util import find_spec

from peakflight.errors import MissingExtra

if find_spec("matplotlib") is None:
    raise MissingExtra(
        "figures need matplotlib, which is not installed; "
        "install it with: pip install 'peakflight[figures]'"
    )

from peakflight.figures.course import course_figure
from peakflight.figures.derivatives import derivatives_figure
from peakflight.figures.saving import save_figures
from peakflight.figures.segment_times import segment_times_figure

__all__ = [
    "course_figure",
    "derivatives_figure",
    "save_figures",
    "segment_times_figure",
]
