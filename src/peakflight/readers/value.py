"""What a trajectory file holds, once it is read."""

from dataclasses import dataclass

from peakflight.course import FARTHEST
from peakflight.errors import InvalidProblem
from peakflight.result import Plan
from peakflight.trajectory import Trajectory, reach


@dataclass(frozen=True, eq=False, kw_only=True)
class TrajectoryFile:
    """A motion from a file, and how it was read.

    Raises
    ------
    InvalidProblem
        If it leaves the range of coordinates that can be planned in.
    """

    trajectory: Trajectory
    """In three axes."""
    yaw: Trajectory | None = None
    """In one axis, rad, from the start to the end of the trajectory; None if the file has none, or
    one that is zero throughout."""
    form: str
    """Of which form the file is, in words."""
    plan: Plan | None = None
    """The whole plan, if it is a plan file."""
    fit_errors: tuple[float, ...] | None = None
    """Largest distance of the trajectory from samples in position, velocity and acceleration, as
    far as the file has them, m, m/s, m/s^2; None if the file holds polynomials."""
    samples: int = 0
    """How many there are in the file."""
    notes: tuple[str, ...] = ()
    """What the user should know about how it was read, one line each."""

    def __post_init__(self) -> None:
        if self.trajectory.axes != 3:
            raise InvalidProblem(
                f"the trajectory has {self.trajectory.axes} axes; it must have x, y and z"
            )
        for motion, what in ((self.trajectory, "position"), (self.yaw, "yaw")):
            if motion is None:
                continue
            far = ~(reach(motion) <= FARTHEST)
            if far.any():
                raise InvalidProblem(
                    f"the {what} of piece {int(far.argmax())} is not within {FARTHEST:g} of zero"
                )
