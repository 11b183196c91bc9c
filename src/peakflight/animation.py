"""A flight as one HTML page that moves: no server, no network, no library."""

import json
from importlib.resources import files
from typing import Any

import numpy as np

from peakflight.files import PathLike, write_atomically
from peakflight.flight import Flight
from peakflight.result import Plan

RATE = 100.0
"""Samples a second that the page has; between them it interpolates."""
MOST_SAMPLES = 6000
"""A longer flight has fewer a second: a minute makes a page of a megabyte."""
DIGITS = 5
"""After the point, in SI units: a hundredth of a millimetre."""
LINES = 1000
"""Points of the planned path."""
PLACE = '"FLIGHT"'
"""Where the page takes its data."""


def write_animation(flight: Flight, path: PathLike, *, plan: Plan | None = None) -> None:
    """Write a page that shows a flight: path, attitude, thrusts and error, to play and to turn.

    Parameters
    ----------
    plan
        What was flown: its waypoints are drawn, and the rest of its path after a crash.

    Raises
    ------
    InvalidFile
        If the file cannot be written.
    """
    page = files("peakflight").joinpath("animation.html").read_text(encoding="utf-8")
    data = json.dumps(_data(flight, plan), allow_nan=False, separators=(",", ":"))
    data = data.replace("<", "\\u003c")  # a name cannot end the script
    write_atomically(path, page.replace(PLACE, data, 1))


def _data(flight: Flight, plan: Plan | None) -> dict[str, Any]:
    count = len(flight.times)
    lasts = float(flight.times[-1])
    shown = int(np.clip(lasts * RATE, 1, MOST_SAMPLES)) + 1
    chosen = np.unique(np.linspace(0, count - 1, min(shown, count)).round().astype(int))
    path = flight.planned_position[chosen]
    marks = np.zeros((0, 3))
    if plan is not None:
        trajectory = plan.trajectory
        path = trajectory(np.linspace(trajectory.start_time, trajectory.end_time, LINES))
        marks = plan.problem.waypoints
    crash = flight.crash
    verdict = "flew" if crash is None else f"crashed at {crash.time:.2f} s: {crash.cause}"
    return {
        "title": f"{flight.vehicle.name}, {flight.controller} controller",
        "verdict": verdict,
        "crashed": crash is not None,
        "about": f"plan of {flight.duration:.3f} s, RMS error {100.0 * flight.rms_error:.1f} cm, "
        f"top error {100.0 * flight.top_error:.1f} cm",
        "duration": flight.duration,
        "times": _rounded(flight.times[chosen]),
        "position": _rounded(flight.position[chosen]),
        "velocity": _rounded(flight.velocity[chosen]),
        "attitude": _rounded(flight.attitude[chosen]),
        "thrusts": _rounded(flight.rotor_thrusts[chosen]),
        "planned": _rounded(flight.planned_position[chosen]),
        "path": _rounded(path),
        "waypoints": _rounded(marks),
        "rotors": [list(place) for place in flight.vehicle.rotor_positions],
        "range": list(flight.vehicle.rotor_thrust),
    }


def _rounded(values: np.ndarray) -> list[Any]:
    rounded: list[Any] = (np.round(values, DIGITS) + 0.0).tolist()
    return rounded
