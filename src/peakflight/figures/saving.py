"""Figures as files."""

from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from peakflight.errors import InvalidFile
from peakflight.figures.course import course_figure
from peakflight.figures.derivatives import derivatives_figure
from peakflight.figures.rotors import rotors_figure
from peakflight.figures.segment_times import segment_times_figure
from peakflight.figures.yaw import yaw_figure
from peakflight.files import PathLike, prepare_folder, write_atomically
from peakflight.result import Plan

FORMATS = ("png", "pdf", "svg")
"""Kinds of picture file that can be written."""
FIGURES = {
    "course": course_figure,
    "derivatives": derivatives_figure,
    "segment_times": segment_times_figure,
}
"""Name of file to what draws it."""
YAW_FIGURES = {"yaw": yaw_figure}
"""As `FIGURES`, for plans that have a yaw motion."""
VEHICLE_FIGURES = {"rotors": rotors_figure}
"""As `FIGURES`, for plans that have a vehicle."""


def save_figures(plan: Plan, folder: PathLike, *, format: str = "png") -> list[Path]:
    """Draw every figure of a plan into a folder, which is created if need be.

    Parameters
    ----------
    plan
        What to draw, feasible or not.
    folder
        Gets `course`, `derivatives` and `segment_times`, with a yaw motion `yaw`, and with a
        vehicle `rotors`;
        nothing is left half written.
    format
        "png", "pdf" or "svg".

    Returns
    -------
    The files, in that order.

    Raises
    ------
    InvalidFile
        If the format is unknown or the folder cannot be written to.
    """
    if format not in FORMATS:
        raise InvalidFile(f"{folder}: format {format!r} is unknown; known are {', '.join(FORMATS)}")
    target = prepare_folder(folder)
    paths = []
    wanted = dict(FIGURES)
    if plan.yaw_motion is not None:
        wanted |= YAW_FIGURES
    if plan.vehicle is not None:
        wanted |= VEHICLE_FIGURES
    for name, draw in wanted.items():
        paths.append(target / f"{name}.{format}")
        write_figure(draw(plan), paths[-1])
    return paths


def write_figure(figure: Figure, path: PathLike) -> bytes:
    """Write a figure to a file of the kind that the name ends in; hand back what is in it.

    Raises
    ------
    InvalidFile
        If the file cannot be written.
    """
    stream = BytesIO()
    figure.savefig(stream, format=Path(path).suffix.removeprefix("."))
    write_atomically(path, stream.getvalue())
    return stream.getvalue()
