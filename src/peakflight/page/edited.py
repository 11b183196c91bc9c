"""What is being edited: a course, what flies it, and how it is planned. Every edit is a new value.

Each edit gives a `Problem` that is valid, or raises `InvalidProblem` and leaves all as it was.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from peakflight.course import Course
from peakflight.errors import InvalidProblem
from peakflight.limits import BOUNDING, KINDS, PAPER_LIMITS, ROTORS, Limits
from peakflight.methods import DEFAULT_METHOD, METHODS, find
from peakflight.problem import Problem
from peakflight.result import Plan
from peakflight.vehicle import Vehicle
from peakflight.vehicles import find_vehicle
from peakflight.yaw import Heading

Pieces: TypeAlias = int | Literal["auto"]
COSTS = ("jerk", "snap", "acceleration")
"""Derivatives that a spline can minimize, and effort weigh."""
END_STEP = 1.0
"""How far a waypoint that is added at the end lies beyond the last one, m."""


@dataclass(frozen=True, eq=False)
class Edited:
    """A problem, and how it is planned."""

    problem: Problem
    method: str = DEFAULT_METHOD
    pieces: Pieces = "auto"
    """Polynomials in each leg, of method joint."""
    effort: float = 0.0
    """Weight of smoothness, of method joint."""
    name: str = "course"
    """What files are called."""
    others: Mapping[str, Any] = field(default_factory=dict)
    """Further settings of the method, from a plan file."""

    @classmethod
    def of_course(
        cls, course: Course, *, vehicle: Vehicle | None = None, limits: Limits | None = None
    ) -> Self:
        """Begin with a course; the paper's limits unless there are others."""
        if vehicle is None and limits is None:
            limits = PAPER_LIMITS
        problem = Problem(course.waypoints, vehicle=vehicle, limits=limits, yaw=course.yaw)  # type: ignore[arg-type]
        return cls(problem, name=course.name or "course")

    @classmethod
    def of_plan(cls, plan: Plan, name: str) -> Self:
        """Begin with what a plan answers, by the method that made it."""
        method = plan.method if plan.method in METHODS else DEFAULT_METHOD
        problem = plan.problem
        if problem.is_at_rest and not problem.derivatives:  # what the method had filled in
            problem = replace(problem, degree=None, continuity=None, start=None, end=None)
        settings: Any = find(method).Settings
        known = set(settings.__dataclass_fields__) - {"initial"}
        others = {key: value for key, value in plan.settings.items() if key in known}
        pieces, effort = others.pop("pieces", "auto"), others.pop("effort", 0.0)
        return cls(problem, method, pieces, effort, name, others)

    @property
    def waypoints(self) -> np.ndarray:
        """(n, 3) m."""
        return self.problem.waypoints

    @property
    def vehicle(self) -> Vehicle | None:
        """What flies, if anything is named."""
        vehicle = self.problem.vehicle
        return vehicle if isinstance(vehicle, Vehicle) else None

    @property
    def angles(self) -> np.ndarray | None:
        """(n,) rad, yaw at each waypoint; None unless it is asked for there."""
        yaw = self.problem.yaw
        if isinstance(yaw, Heading):
            return None if yaw.angles is None else np.array(yaw.angles)
        return None if yaw is None else np.asarray(yaw)

    @property
    def options(self) -> dict[str, Any]:
        """What the method is told beside the problem."""
        if self.method != "joint":
            return dict(self.others)
        effort = {"effort": self.effort} if self.effort else {}
        return {**self.others, "pieces": self.pieces, **effort}

    def is_other_than(self, before: Self) -> bool:
        """Whether this is another course, and not an edit of one: few waypoints are the same."""
        known = set(map(tuple, before.waypoints.tolist()))
        same = sum(waypoint in known for waypoint in map(tuple, self.waypoints.tolist()))
        return 2 * same < max(len(self.waypoints), len(before.waypoints))

    def move(self, index: int, position: ArrayLike) -> Self:
        """Put a waypoint elsewhere, (3,) m."""
        waypoints = self.waypoints.copy()
        waypoints[self._checked(index)] = position
        return self._with(waypoints=waypoints)

    def insert(self, index: int, position: ArrayLike) -> Self:
        """Put a new waypoint, (3,) m, in the course so that it has this index."""
        count = len(self.waypoints)
        if not 0 <= index <= count:
            raise InvalidProblem(f"there is no place {index} among {count} waypoints")
        waypoints = np.insert(self.waypoints, index, np.asarray(position, dtype=float), axis=0)
        angles = self.angles
        if angles is not None:
            angles = np.insert(angles, index, angles[min(index, count - 1)])
        return self._rearranged(waypoints, angles, [*range(index), None, *range(index, count)])

    def append(self) -> Self:
        """Add a waypoint beyond the last one, in the direction of the last leg."""
        last, before = self.waypoints[-1], self.waypoints[-2]
        step = last - before
        return self.insert(len(self.waypoints), last + step * (END_STEP / np.linalg.norm(step)))

    def delete(self, index: int) -> Self:
        """Take a waypoint out."""
        index, count = self._checked(index), len(self.waypoints)
        if count == 2:
            raise InvalidProblem("a course needs two waypoints; these stay")
        return self._taken([i for i in range(count) if i != index])

    def reorder(self, index: int, to: int) -> Self:
        """Pass a waypoint at another place in the order."""
        order = list(range(len(self.waypoints)))
        order.insert(self._checked(to), order.pop(self._checked(index)))
        return self._taken(order)

    def turn(self, index: int, angle: float) -> Self:
        """Ask for a yaw at a waypoint, rad; where none is asked for yet, the others get 0."""
        angles = self.angles
        angles = np.zeros(len(self.waypoints)) if angles is None else angles.copy()
        angles[self._checked(index)] = angle
        return self._with(yaw=self._yaw_with(angles))

    def head(self, yaw: Heading | np.ndarray | None) -> Self:
        """Ask for another yaw along the whole flight; None for nothing."""
        return self._with(yaw=yaw)

    def head_by(self, policy: str, angle: float, point: tuple[float, ...]) -> Self:
        """Ask for a yaw by a policy of `Heading`, "waypoints", or "" for nothing.

        Parameters
        ----------
        angle, point
            rad, of policy "fixed", and (3,) m, of policy "point"; others do without.
        """
        if not policy:
            return self.head(None)
        if policy == "waypoints":
            angles = self.angles
            return self.head(np.zeros(len(self.waypoints)) if angles is None else angles)
        if policy == "fixed":
            return self.head(Heading(policy=policy, angle=angle))
        if policy == "point":
            x, y, z = point
            return self.head(Heading(policy=policy, point=(x, y, z)))
        return self.head(Heading(policy=policy))

    def fly_named(self, name: str | None) -> Self:
        """Let a preset fly, the user's own if that is its name, or nothing in particular."""
        if name is None:
            return self.fly(None)
        own = self.vehicle
        return self.fly(own if own is not None and own.name == name else find_vehicle(name))

    def fly(self, vehicle: Vehicle | None) -> Self:
        """Let something else fly, within its own limits; None keeps the limits that need none.

        Where none of those bounds the flight, the paper's are added.
        """
        if vehicle is not None:
            return replace(self, problem=replace(self.problem, vehicle=vehicle, limits=None))  # type: ignore[arg-type]
        limits = self.problem.limits.to_dict()
        kept = {name: value for name, value in limits.items() if name not in (*ROTORS, "airframe")}
        if not set(kept) & set(BOUNDING):  # nothing is left that bounds the flight
            kept = PAPER_LIMITS.to_dict() | kept
        return replace(self, problem=replace(self.problem, vehicle=None, limits=Limits(**kept)))

    def limit(self, changes: Mapping[str, float | None]) -> Self:
        """Set limits by name, in SI units; None takes one away."""
        values = {kind.name: getattr(self.problem.limits, kind.name) for kind in KINDS} | dict(
            changes
        )
        airframe = self.problem.airframe
        if any(values[name] is not None for name in ROTORS):
            if airframe is None:
                raise InvalidProblem("rotor thrusts are those of a vehicle; choose one first")
            limits = Limits(**values, airframe=airframe)
        else:
            limits = Limits(**values)
        vehicle = self.vehicle
        if vehicle is not None:
            vehicle = replace(vehicle, limits=limits, reasons={})
        return self._with(limits=limits, vehicle=vehicle)

    def plan_by(
        self,
        *,
        method: str | None = None,
        pieces: Pieces | None = None,
        effort: float | None = None,
        minimize: str | None = None,
    ) -> Self:
        """Plan in another way; what is None stays. Degree and continuity go back to the method."""
        edited = self
        if minimize is not None or (method is not None and method != self.method):
            cost = self.problem.minimize if minimize is None else minimize
            edited = edited._with(minimize=cost, degree=None, continuity=None)
        if edited.method != method and method is not None:
            edited = replace(edited, others={})
        return replace(
            edited,
            method=self.method if method is None else method,
            pieces=self.pieces if pieces is None else pieces,
            effort=self.effort if effort is None else effort,
        )

    def as_course(self) -> Course:
        """The course alone."""
        return Course(self.waypoints, yaw=self.angles, name=self.name)

    def _checked(self, index: int) -> int:
        if not 0 <= index < len(self.waypoints):
            raise InvalidProblem(f"there is no waypoint {index}; there are {len(self.waypoints)}")
        return int(index)

    def _with(self, **changes: Any) -> Self:
        return replace(self, problem=replace(self.problem, **changes))

    def _yaw_with(self, angles: np.ndarray | None) -> Heading | np.ndarray | None:
        """The yaw that is asked for, at other angles where it is about waypoints."""
        yaw = self.problem.yaw
        if angles is None:
            return yaw  # type: ignore[return-value]
        if isinstance(yaw, Heading) and yaw.angles is not None:
            return replace(yaw, angles=tuple(angles.tolist()))
        return angles

    def _taken(self, order: list[int]) -> Self:
        angles = self.angles
        return self._rearranged(
            self.waypoints[order], None if angles is None else angles[order], order
        )

    def _rearranged(
        self, waypoints: np.ndarray, angles: np.ndarray | None, order: list[Any]
    ) -> Self:
        """Other waypoints; what is fixed at inner ones goes with them while they are inner."""
        last = len(order) - 1
        derivatives = {
            place: self.problem.derivatives[old]
            for place, old in enumerate(order)
            if old in self.problem.derivatives and 0 < place < last
        }
        return self._with(waypoints=waypoints, derivatives=derivatives, yaw=self._yaw_with(angles))
