"""Plan files, and other JSON with coefficients and segment times."""

import re

from peakflight.errors import InvalidFile, InvalidProblem
from peakflight.files import PathLike, parse_json
from peakflight.readers.pieces import MOST_POWERS
from peakflight.readers.value import TrajectoryFile
from peakflight.result import Plan
from peakflight.trajectory import Trajectory

_BEGINNING = re.compile(r"\s*[\[{]")


def recognises(text: str) -> bool:
    """Whether the text begins as JSON lists and objects do."""
    return _BEGINNING.match(text) is not None


def read(text: str, path: PathLike, tolerance: float) -> TrajectoryFile:
    """The motion in a plan file; or of `coefficients` (K, N+1, 3 or 4) and `segment_times` (K,).

    Raises
    ------
    InvalidFile
        If it is not JSON, or neither of these.
    InvalidProblem
        If a value is against a rule.
    """
    del tolerance
    root = parse_json(text, path)
    if not isinstance(root, dict) or "coefficients" not in root:
        raise InvalidFile(
            f"{path}: has no coefficients; a trajectory in JSON is a plan file, or has "
            "coefficients and segment_times"
        )
    if "waypoints" in root:
        plan = Plan.from_dict(root)
        _require_low_degree(plan.trajectory, path)
        return TrajectoryFile(
            trajectory=plan.trajectory, yaw=plan.yaw_motion, form="a plan file", plan=plan
        )
    try:
        whole = Trajectory.from_dict(root)
    except InvalidProblem:
        raise
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidFile(f"{path}: a key has a value of the wrong kind ({error})") from None
    _require_low_degree(whole, path)
    if whole.axes not in (3, 4):
        raise InvalidFile(f"{path}: has {whole.axes} axes; it must be x, y, z, or x, y, z, yaw")
    times, start = whole.segment_times, whole.start_time
    turning = whole.coefficients[:, :, 3:]
    return TrajectoryFile(
        trajectory=Trajectory(whole.coefficients[:, :, :3], times, start),
        yaw=Trajectory(turning, times, start) if turning.any() else None,
        form="polynomial coefficients in JSON",
    )


def _require_low_degree(motion: Trajectory, path: PathLike) -> None:
    if motion.degree >= MOST_POWERS:
        raise InvalidFile(
            f"{path}: coefficients have degree {motion.degree}; {MOST_POWERS - 1} is the highest"
        )
