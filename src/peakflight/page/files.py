"""Files that come from a browser and go to it: courses, plans, flight files."""

import json
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from peakflight.course import tidy
from peakflight.errors import InvalidFile, InvalidProblem, PeakflightError
from peakflight.exporting import ExportReport, export
from peakflight.files import json_text
from peakflight.formats import FLIGHT_FORMATS, read_course
from peakflight.page.edited import Edited
from peakflight.result import Plan

LARGEST = 20_000_000
"""Bytes of an upload."""
UPLOAD = "upload"
"""What an upload is called here, whatever its name was elsewhere."""
MOST_WAYPOINTS = 2000
"""What a page can show and plan while one waits."""


def load(
    path: Path, like: Edited | None = None, name: str | None = None
) -> tuple[Edited, tuple[str, ...]]:
    """What a file asks for: of a course, flown and planned as `like`; of a plan, as it says.

    `name` is what its owner calls it, if that is not its path.

    Raises
    ------
    PeakflightError
        If it is neither, with the same words as `peakflight plan` and `check`.
    """
    if path.is_file() and path.stat().st_size > LARGEST:
        raise InvalidFile(f"{path}: has {path.stat().st_size / 1e6:.0f} MB; the page takes 20")
    notes: tuple[str, ...] = ()
    if _is_plan(path):
        within = path.parent.name if name is None and path.stem == "plan" else path.stem
        edited = Edited.of_plan(Plan.load(path), within)
    else:
        course = read_course(path)
        try:
            course, notes = tidy(course)
        except InvalidProblem as error:
            raise InvalidFile(f"{path}: {error}") from None
        edited = Edited.of_course(course)
        if like is not None:
            edited = _like(edited, like)
    if name is not None:
        edited = replace(edited, name=Path(name).stem or edited.name)
    if len(edited.waypoints) > MOST_WAYPOINTS:
        raise InvalidFile(
            f"{path}: has {len(edited.waypoints)} waypoints; the page takes {MOST_WAYPOINTS} "
            "(peakflight plan takes more)"
        )
    return edited, notes


def load_upload(name: str, content: bytes, like: Edited) -> tuple[Edited, tuple[str, ...]]:
    """The same of what was uploaded; messages call it as its owner does."""
    called = name.replace("\\", "/").rpartition("/")[2] or UPLOAD
    with _folder() as folder:
        path = Path(folder) / UPLOAD
        path.write_bytes(content)
        try:
            return load(path, like, called)
        except PeakflightError as error:
            raise InvalidFile(str(error).replace(str(path), called)) from None


def course_csv(edited: Edited) -> bytes:
    """The course as a CSV that `read_course` reads back without loss."""
    angles = edited.angles
    lines = ["x,y,z" if angles is None else "x,y,z,yaw"]
    for index, waypoint in enumerate(edited.waypoints.tolist()):
        values = waypoint if angles is None else [*waypoint, float(angles[index])]
        lines.append(",".join(repr(value) for value in values))
    return ("\n".join(lines) + "\n").encode()


def plan_json(plan: Plan) -> bytes:
    """The plan file."""
    return json_text(plan.to_dict()).encode()


def report(plan: Plan, name: str) -> bytes:
    """The report of a plan, as `peakflight report` writes it."""
    from peakflight.reporting import report_html

    return report_html(plan, title=name).encode()


def flight_file(plan: Plan, to: str) -> tuple[str, bytes, ExportReport]:
    """Name and content of a flight file, and what was proven about it.

    Raises
    ------
    PeakflightError
        As `peakflight.export`.
    """
    with _folder() as folder:
        path = Path(folder) / FLIGHT_FORMATS[to].filename
        report = export(plan, to=to, path=path)
        return path.name, path.read_bytes(), report


_folder: Callable[[], tempfile.TemporaryDirectory[str]] = lambda: tempfile.TemporaryDirectory(  # noqa: E731
    prefix="peakflight-page-"
)


def _is_plan(path: Path) -> bool:
    """Whether a file is JSON with coefficients; anything else is read as a course."""
    try:
        value = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(value, dict) and "coefficients" in value


def _like(edited: Edited, like: Edited) -> Edited:
    """A course, flown and planned as another was; its own yaw goes before."""
    yaw = edited.problem.yaw
    if yaw is None and like.angles is None:
        yaw = like.problem.yaw
    problem = like.problem.__class__(
        edited.waypoints,
        limits=like.problem.limits,
        vehicle=like.vehicle,
        minimize=like.problem.minimize,
        yaw=yaw,
    )
    return replace(like, problem=problem, name=edited.name)
