"""What comes out: the certified report of a trajectory, and the plan around it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from keyword import iskeyword
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from peakflight.errors import InvalidFile, InvalidProblem, Status, quoted
from peakflight.files import PathLike, read_json, write_json
from peakflight.problem import Problem, as_float_array
from peakflight.trajectory import Trajectory
from peakflight.vehicle import Vehicle

BINDING = 1.0 - 1e-3
"""A limit binds a segment whose certified peak comes this close to it."""
JOINT_TOLERANCE = 1e-8
"""Largest jump at a joint, relative to the derivative's size around it, that counts as smooth."""
WAYPOINT_TOLERANCE = 1e-9
"""Largest miss of a waypoint that counts as passed, relative to the size of the course (and m)."""

PLAIN = (str, int, float, bool, type(None))
"""Types of settings that a plan file has: what a method takes beside, only Python can say."""


def allowed_miss(waypoints: np.ndarray) -> float:
    """Distance in m by which waypoints (n, axes) in m may be missed and still count as passed."""
    return WAYPOINT_TOLERANCE * (1.0 + float(np.abs(waypoints).max()))


@dataclass(frozen=True, eq=False, kw_only=True)
class Report:
    """What has been proven about a trajectory, from its coefficients alone."""

    feasible: bool
    """Every certified peak is within its limit, every joint smooth, every waypoint passed."""
    peaks: dict[str, np.ndarray]
    """Name of limit to (K,): certified upper bounds of kappa, peak over limit (Eq. kapp_i)."""
    joint_residual: float
    """Largest jump of a derivative at a joint, relative to its size around the joint."""
    waypoint_error: float
    """Largest distance by which a waypoint is missed, m."""
    state_error: float = 0.0
    """Largest difference from a derivative that is fixed at a waypoint, relative to its size."""
    problems: tuple[str, ...] = ()
    """What is wrong, in words, one line each; empty if feasible."""

    def __post_init__(self) -> None:
        peaks = {name: as_float_array(name, kappa, (None,)) for name, kappa in self.peaks.items()}
        object.__setattr__(self, "peaks", peaks)
        object.__setattr__(self, "problems", tuple(self.problems))

    @property
    def worst(self) -> float:
        """The largest peak ratio of all."""
        return max(float(kappa.max()) for kappa in self.peaks.values())

    @property
    def binding(self) -> tuple[str, ...]:
        """(K,) name of the limit that each segment comes closest to."""
        names = tuple(self.peaks)
        closest = np.argmax([self.peaks[name] for name in names], axis=0)
        return tuple(names[index] for index in closest)

    @property
    def segment_peaks(self) -> np.ndarray:
        """(K,) largest kappa of each segment."""
        return np.max(list(self.peaks.values()), axis=0)

    def binding_segments(self, name: str) -> list[int]:
        """Segments that a limit binds: kappa within 0.1 % of 1."""
        return [int(k) for k in np.flatnonzero(self.peaks[name] >= BINDING)]

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names, from which `from_dict` makes the same report."""
        return {
            "feasible": self.feasible,
            "peaks": {name: kappa.tolist() for name, kappa in self.peaks.items()},
            "joint_residual": self.joint_residual,
            "waypoint_error": self.waypoint_error,
            "state_error": self.state_error,
            "problems": list(self.problems),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """A report from what `to_dict` gave."""
        return cls(**values)


@dataclass(frozen=True, eq=False, kw_only=True)
class History:
    """The road to a plan, one row an iteration, for figures and study."""

    segment_times: np.ndarray
    """(I, K) s."""
    kappa: np.ndarray | None = None
    """(I, K, len(KINDS)) peak ratios, where the method has them; NaN for a limit that is not
    set."""

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "segment_times", as_float_array("history", self.segment_times, (None, None))
        )
        if self.kappa is not None:
            kappa = as_float_array("kappa", self.kappa, (*self.segment_times.shape, None))
            object.__setattr__(self, "kappa", kappa)

    def __len__(self) -> int:
        return len(self.segment_times)


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """A problem, the trajectory that answers it, and the proof that it keeps the limits."""

    problem: Problem
    method: str
    """Name of the method that made it."""
    status: Status
    trajectory: Trajectory
    """Feasible exactly if `report.feasible`; otherwise the best there was."""
    report: Report
    pieces: tuple[int, ...]
    """(legs,) polynomial pieces in each leg; their sum is the number of segments K."""
    iterations: int
    """Iterations of the method."""
    wall_time_s: float
    """Time that planning took, s."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the method that are not its defaults, as far as they are numbers and names; for
    a plan that it began from, that it was one."""
    message: str = ""
    """What the user should know: why there is no solution, what was merged, ..."""
    history: History | None = field(default=None, repr=False)
    yaw_motion: Trajectory | None = field(default=None, repr=False)
    """Yaw against time in one axis, rad, on knots of its own; None if none is asked for."""
    yaw_deviation: float = 0.0
    """Largest difference from a direction that the yaw follows, rad."""
    version: str = ""
    """Version of peakflight that made it."""
    memory: Any = field(default=None, repr=False)
    """What its method keeps to plan a similar problem faster; not written to files."""

    @property
    def vehicle(self) -> Vehicle | None:
        """What flies it, if the problem says so."""
        vehicle = self.problem.vehicle
        return vehicle if isinstance(vehicle, Vehicle) else None

    @property
    def feasible(self) -> bool:
        """Whether every limit is proven to hold."""
        return self.report.feasible

    @property
    def duration(self) -> float:
        """Total time, s."""
        return self.trajectory.duration

    @property
    def segment_times(self) -> np.ndarray:
        """(K,) s, duration of each polynomial piece."""
        return self.trajectory.segment_times

    @property
    def waypoint_times(self) -> np.ndarray:
        """(legs+1,) s, when each waypoint is passed."""
        return self.trajectory.breakpoints[np.concatenate(([0], np.cumsum(self.pieces)))]

    def yaw(self, t: ArrayLike, derivative: int = 0) -> np.ndarray:
        """Yaw at (...,) s, (...,) rad, unwrapped, or a derivative of it; zero without a motion.

        Raises
        ------
        ValueError
            If a time is outside the plan, or the order is negative.
        """
        if self.yaw_motion is None:
            return np.zeros_like(self.trajectory(t)[..., 0])
        return self.yaw_motion(t, derivative)[..., 0]

    def to_dict(self) -> dict[str, Any]:
        """The plan file: the keys of the public contract, then what a lossless copy needs."""
        values = {
            "status": str(self.status),
            "method": self.method,
            "duration": self.duration,
            "segment_times": self.segment_times.tolist(),
            "degree": self.trajectory.degree,
            "coefficients": self.trajectory.coefficients.tolist(),
            "limits": self.problem.limits.to_dict(),
            "peaks": {name: kappa.tolist() for name, kappa in self.report.peaks.items()},
            "waypoints": self.problem.waypoints.tolist(),
            "pieces": list(self.pieces),
            "iterations": self.iterations,
            "wall_time_s": self.wall_time_s,
            "version": self.version,
            "settings": dict(self.settings),
            "start_time": self.trajectory.start_time,
            "message": self.message,
            "feasible": self.report.feasible,
            "joint_residual": self.report.joint_residual,
            "waypoint_error": self.report.waypoint_error,
            "state_error": self.report.state_error,
            "problems": list(self.report.problems),
        }
        problem = self.problem.to_dict()
        values["problem"] = {
            key: value for key, value in problem.items() if key not in ("waypoints", "limits")
        }
        if self.yaw_motion is not None:
            values["yaw"] = {**self.yaw_motion.to_dict(), "deviation": self.yaw_deviation}
        if self.history is not None:
            kappa = self.history.kappa
            values["history"] = {
                "segment_times": self.history.segment_times.tolist(),
                "kappa": None if kappa is None else np.where(np.isnan(kappa), None, kappa).tolist(),  # type: ignore[call-overload]
            }
        return values

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """A plan from what `to_dict` gave.

        Raises
        ------
        InvalidProblem
            If a key is missing or its value is against a rule.
        """
        if not isinstance(values, Mapping):
            raise InvalidProblem("a plan must be a JSON object")
        missing = [key for key in _REQUIRED if key not in values]
        if missing:
            raise InvalidProblem(f"key {missing[0]!r} is missing")
        try:
            return cls._from_checked(values)
        except InvalidProblem:
            raise
        except (TypeError, ValueError, AttributeError, KeyError, OverflowError) as error:
            raise InvalidProblem(f"a key has a value of the wrong kind ({error})") from None

    @classmethod
    def _from_checked(cls, values: Mapping[str, Any]) -> Self:
        problem = Problem.from_dict(
            {
                "degree": values["degree"],
                **values.get("problem", {}),
                "waypoints": values["waypoints"],
                "limits": values["limits"],
            }
        )
        trajectory = Trajectory.from_dict(dict(values))
        if values["degree"] != trajectory.degree:
            raise InvalidProblem(
                f"degree is {values['degree']!r}; the coefficients have {trajectory.degree}"
            )
        pieces = tuple(int(count) for count in values["pieces"])
        if sum(pieces) != len(trajectory) or len(pieces) != len(problem.waypoints) - 1:
            raise InvalidProblem(
                f"pieces add up to {sum(pieces)} in {len(pieces)} legs; there are "
                f"{len(trajectory)} segments and {len(problem.waypoints)} waypoints"
            )
        if min(pieces) < 1:
            raise InvalidProblem(f"leg {pieces.index(min(pieces))} has no piece")
        if trajectory.axes != problem.waypoints.shape[1]:
            raise InvalidProblem(
                f"coefficients have {trajectory.axes} axes, waypoints {problem.waypoints.shape[1]}"
            )
        if values["status"] not in set(Status):
            raise InvalidProblem(f"status {values['status']!r} is unknown")
        report = Report(
            feasible=bool(values.get("feasible", False)),
            peaks=dict(values["peaks"]),
            joint_residual=float(values.get("joint_residual", np.nan)),
            waypoint_error=float(values.get("waypoint_error", np.nan)),
            state_error=float(values.get("state_error", np.nan)),
            problems=tuple(values.get("problems", ())),
        )
        history = values.get("history")
        yaw = values.get("yaw")
        motion = None if yaw is None else Trajectory.from_dict(dict(yaw))
        if motion is not None and motion.axes != 1:
            raise InvalidProblem(f"yaw has {motion.axes} axes; it must have 1")
        return cls(
            problem=problem,
            method=str(values["method"]),
            status=Status(values["status"]),
            trajectory=trajectory,
            report=report,
            pieces=pieces,
            iterations=int(values["iterations"]),
            wall_time_s=float(values["wall_time_s"]),
            settings=_checked_settings(values.get("settings", {})),
            message=str(values.get("message", "")),
            history=None if history is None else History(**history),
            yaw_motion=motion,
            yaw_deviation=0.0 if yaw is None else float(yaw.get("deviation", 0.0)),
            version=str(values["version"]),
        )

    def save(self, path: PathLike) -> None:
        """Write the plan file; nothing is left half written.

        Raises
        ------
        InvalidFile
            If the file cannot be written.
        """
        write_json(path, self.to_dict())

    @classmethod
    def load(cls, path: PathLike) -> Self:
        """Read a plan file. What it claims is not proof: `peakflight.certify` proves it again.

        Raises
        ------
        InvalidFile
            If it cannot be read or is not a plan; the message names the key and the rule.
        """
        return cls.load_with_claims(path)[0]

    @classmethod
    def load_with_claims(cls, path: PathLike) -> tuple[Self, Any]:
        """The same, and all that the file says."""
        values = read_json(path, "a plan file")
        try:
            return cls.from_dict(values), values
        except (ValueError, OverflowError) as error:
            raise InvalidFile(f"{Path(path)}: {error}") from None


def _checked_settings(values: Any) -> dict[str, Any]:
    """Settings of a method, whichever that is, from a plan file."""
    if not isinstance(values, Mapping):
        raise InvalidProblem("settings must be a JSON object")
    for name, value in values.items():
        if not (isinstance(name, str) and name.isidentifier()) or iskeyword(name):
            raise InvalidProblem(
                f"there is a setting {quoted(str(name))}; no method has one of that name"
            )
        if type(value) not in PLAIN or (isinstance(value, float) and not np.isfinite(value)):
            raise InvalidProblem(
                f"setting {name} is {quoted(str(value))}; it must be a finite number, a text, "
                "true, false or null"
            )
    return dict(values)


_REQUIRED = (
    "status",
    "method",
    "segment_times",
    "degree",
    "coefficients",
    "limits",
    "peaks",
    "waypoints",
    "pieces",
    "iterations",
    "wall_time_s",
    "version",
)
