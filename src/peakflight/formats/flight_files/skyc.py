"""Drone shows of Skybrush: a zip with `show.json`, a trajectory of Bézier curves for each drone.

The Skybrush server turns the numbers into whole milliseconds and, by cutting off, whole
millimetres (or a multiple of them, where the show is wide) before drones get them. Curves here are
already rounded to these, and written so that what the server cuts off is nothing.
"""

import io
import json
import math
import zipfile
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from peakflight.errors import InvalidFile, InvalidProblem
from peakflight.formats.flight_files.flight_format import (
    Encoded,
    FlightFormat,
    Precision,
    Reading,
    start_note,
)
from peakflight.formats.flight_files.rounded import (
    DEGREE,
    LONGEST,
    MILLI,
    Curves,
    control_points,
    cut,
    motion,
    rounded,
)
from peakflight.heading import heading
from peakflight.result import Plan

SHOW = "show.json"
VERSION = 1
ABOVE = 1e-7
"""m by which coordinates are written farther from zero, so that cutting off rounds to them."""
REACH, WIDEST = 32768, 127
"""Whole numbers that two bytes hold, and the largest multiple of a millimetre that they stand
for."""
BLOCK, START, PIECE = 65535, 9, 45
"""Bytes that the trajectory of a drone may have, and those of its start and of a piece."""
CREATED = (1980, 1, 1, 0, 0, 0)
"""Time of the entries of the zip: the same show is the same bytes."""


def encode(plans: Sequence[Plan], names: Sequence[str]) -> Encoded:
    """The show of several plans; the first one starts with it, others wait for theirs.

    Raises
    ------
    InvalidProblem
        If a plan has a degree above 7, too many pieces, or is too far out.
    """
    drones, notes = [], []
    first = min(plan.trajectory.start_time for plan in plans)
    for plan, name in zip(plans, names, strict=True):
        curves, unit = _curves(plan, name)
        points = _written(curves.points, unit)
        delay = round((plan.trajectory.start_time - first) * 1e3)
        drones.append(
            {
                "type": "generic",
                "settings": {
                    "name": name,
                    "home": points[0][0],
                    "landAt": points[-1][-1],
                    "trajectory": {
                        "version": VERSION,
                        "points": _keypoints(curves.milliseconds, points, delay),
                        "takeoffTime": 0.0,
                    },
                },
            }
        )
        if heading(plan).coefficients.any():
            notes.append(f"{name}: its yaw is not in the show")
    show = {
        "version": VERSION,
        "settings": {},
        "environment": {"type": "indoor"},
        "swarm": {"drones": drones},
        "media": {},
        "meta": {"title": ", ".join(names)},
    }
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        entry = zipfile.ZipInfo(SHOW, CREATED)
        entry.compress_type = zipfile.ZIP_DEFLATED
        archive.writestr(entry, json.dumps(show, allow_nan=False))
    return Encoded(stream.getvalue(), (*notes, *start_note(plans, "the show")))


def decode(data: bytes) -> tuple[Reading, ...]:
    """What drones get of a show through the server's arithmetic.

    Raises
    ------
    InvalidFile
        If it is not a show.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            show = json.loads(archive.read(SHOW))
        return tuple(
            _reading(drone["settings"]["trajectory"]["points"]) for drone in show["swarm"]["drones"]
        )
    except (zipfile.BadZipFile, KeyError, IndexError, TypeError, ValueError) as error:
        raise InvalidFile(f"the file is not a show of Skybrush ({error})") from None


def keeps(milliseconds: int) -> bool:
    """Whether the server's seconds become as many milliseconds again."""
    return math.floor(round(milliseconds / 1000.0, 3) * 1000) == milliseconds


def _curves(plan: Plan, name: str) -> tuple[Curves, float]:
    """The rounded curves of a plan, and what a whole number stands for, m."""
    trajectory = cut(plan.trajectory)
    size = START + PIECE * len(trajectory)
    if size > BLOCK:
        raise InvalidProblem(
            f"{name}: {len(trajectory)} pieces take {size} bytes; the trajectory of a drone has "
            f"{BLOCK} at most"
        )
    points = control_points(trajectory)
    scale = _scale(float(np.abs(points).max()) + ABOVE)
    if scale > WIDEST:
        raise InvalidProblem(
            f"{name}: reaches {np.abs(points).max():.0f} m with a control point; the format holds "
            f"{REACH * WIDEST * MILLI:.0f} m"
        )
    unit = scale * MILLI
    curves = rounded(points, trajectory.segment_times, np.full(3, unit), fits=keeps)
    return curves, unit


def _scale(farthest: float) -> int:
    """Millimetres that a whole number stands for in a show with coordinates up to this, m."""
    return math.ceil((math.ceil(farthest * 1000) + 1) / REACH)


def _written(points: np.ndarray, unit: float) -> list[list[list[float]]]:
    """Coordinates in m that cutting off takes back to the (K, 8, 3) whole numbers."""
    digits = 9
    values: list[list[list[float]]] = (
        np.round(points * unit + ABOVE * np.sign(points), digits) + 0.0
    ).tolist()
    return values


def _keypoints(
    milliseconds: np.ndarray, points: list[list[list[float]]], delay: int
) -> list[list[Any]]:
    """[time, point, control points before it], the first without any, after ms of waiting."""
    ends = (delay + np.cumsum(milliseconds)) / 1000.0
    waits = [*range(0, delay, LONGEST), delay]
    keypoints: list[list[Any]] = [[wait / 1000.0, points[0][0], []] for wait in waits]
    for end, curve in zip(ends.tolist(), points, strict=True):
        inner = [] if all(point == curve[0] for point in curve) else curve[1:-1]
        keypoints.append([end, curve[-1], inner])
    return keypoints


def _reading(keypoints: list[list[Any]]) -> Reading:
    flat = [
        coordinate for _, point, via in keypoints for one in (point, *via) for coordinate in one
    ]
    scale = _scale(max(abs(float(coordinate)) for coordinate in flat))
    milliseconds, pieces = [], []
    for (before, start, _), (after, end, via) in pairwise(keypoints):
        milliseconds.append(math.floor(round(after - before, 3) * 1000))
        curve = [start, *via, end] if via else [start] * DEGREE + [end]
        if len(curve) != DEGREE + 1:
            raise ValueError(f"a curve of degree {len(curve) - 1}; degree 7 is read")
        pieces.append([[int(x * (1000 / scale)) for x in point] for point in curve])
    curves = Curves(np.array(milliseconds), np.array(pieces))
    waiting = int(np.ptp(curves.points, axis=1).any(axis=1).argmax())
    delay = float(curves.milliseconds[:waiting].sum() * MILLI)
    flight = Curves(curves.milliseconds[waiting:], curves.points[waiting:])
    return Reading(motion(flight, np.full(3, scale * MILLI)).shift(delay))


FORMAT = FlightFormat(
    filename="show.skyc",
    summary="a drone show of Skybrush",
    consumer="Skybrush Live and server; its viewer shows degree 3 at most",
    numbers="whole mm and ms (multiples of a mm beyond 32 m)",
    rules="degree 7; 4161 m; 1456 pieces a drone; no yaw",
    encode=encode,
    decode=decode,
    precision=Precision(position=MILLI, time=2 * MILLI, relative=1e-4),
    tolerance=1e-2,
    coarse=True,
    several=True,
    from_rest=True,
)
