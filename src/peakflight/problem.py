"""What is asked: waypoints, limits, and the class of spline that answers."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from peakflight.airframe import Airframe
from peakflight.errors import InvalidProblem
from peakflight.limits import BOUNDING, LimitKind, Limits
from peakflight.vehicle import Vehicle
from peakflight.vehicles import VehicleLike, find_vehicle
from peakflight.yaw import Heading, HeadingLike, as_heading

DERIVATIVE_NAMES = ("position", "velocity", "acceleration", "jerk", "snap", "crackle", "pop")
"""Names of the derivatives of position, by order."""
DEGREES = range(3, 12)
"""Degrees of polynomial that are supported."""
AXES = "xyz"

StateLike: TypeAlias = Mapping[str | int, ArrayLike] | ArrayLike
"""Derivatives at a waypoint: by name or order, or an array (n, D) from velocity on. NaN is free."""


class SplineClass(NamedTuple):
    """The polynomials that sub-problem 1 chooses from, and the cost by which it chooses."""

    degree: int
    """Degree N of each polynomial."""
    weights: tuple[float, ...]
    """Weights c_0..c_N on the squared derivatives (Eq. minfuncP)."""
    continuity: int
    """Highest derivative that is continuous at the waypoints."""

    @property
    def end_orders(self) -> int:
        """Derivatives 1..n that a vehicle at rest has at zero: those that end data can hold."""
        return (self.degree - 1) // 2

    @property
    def cost_order(self) -> int:
        """The highest derivative that the cost weighs."""
        return max(order for order, weight in enumerate(self.weights) if weight > 0.0)

    @property
    def is_homogeneous(self) -> bool:
        """Whether the cost weighs one derivative only, so that no time scale is built in."""
        return sum(weight > 0.0 for weight in self.weights) == 1

    @property
    def is_classical(self) -> bool:
        """Whether the optimum is the C^(2r-2) spline of degree 2r-1 for a cost on the r-th."""
        r = self.cost_order
        return (
            self.is_homogeneous
            and self.degree == 2 * r - 1
            and r - 1 <= self.continuity <= 2 * r - 2
        )

    @classmethod
    def of(
        cls,
        minimize: str | Mapping[str | int, float] | Sequence[float] = "jerk",
        degree: int | None = None,
        continuity: int | None = None,
        *,
        inner: bool = False,
    ) -> Self:
        """Fill in what is not given and check that the three go together.

        Parameters
        ----------
        minimize
            "acceleration", "jerk" or "snap"; weights by name or order, as {"jerk": 1, 4: 0.01};
            or the sequence c_0..c_N of Eq. minfuncP.
        degree
            3 to 11. By default 2r-1 for a cost on the r-th derivative: 5 for jerk, 7 for snap.
        continuity
            By default what the optimum itself has, 2r-2, where the degree allows it; else
            degree - 2 (C3 for minimum snap at degree 5, as in the paper).
        inner
            Derivatives are fixed at inner waypoints. The optimum then has r-1 there, which is the
            default, as far as the degree allows it.
        """
        weights = _weights(minimize)
        order = max(weights)
        if degree is None:
            degree = max(2 * order - 1, DEGREES[0])
        degree = _integer("degree", degree)
        if degree not in DEGREES:
            raise InvalidProblem(f"degree is {degree}; it must be {DEGREES[0]} to {DEGREES[-1]}")
        if order > degree:
            raise InvalidProblem(
                f"minimize weighs derivative {order}, which is zero at degree {degree}"
            )
        if continuity is None:
            natural = order - 1 if inner else 2 * order - 2
            continuity = min(natural, degree - 2) if degree < 2 * order - 1 else natural
        continuity = _integer("continuity", continuity)
        if not 0 <= continuity < degree:
            raise InvalidProblem(
                f"continuity is {continuity}; degree {degree} allows 0 to {degree - 1}"
            )
        return cls(degree, tuple(weights.get(s, 0.0) for s in range(degree + 1)), continuity)


@dataclass(frozen=True, eq=False)
class Problem:
    """Waypoints to pass in order, limits to keep, and the class of spline that does it.

    Raises
    ------
    InvalidProblem
        If a value is missing, not finite, of the wrong shape or against a rule; the message
        names the index, the value and the rule.
    """

    waypoints: np.ndarray
    """(K+1, 3) m, z up; two at least, no two in a row alike."""
    limits: Limits = field(default=None, kw_only=True)  # type: ignore[assignment]
    """What to keep; beside a vehicle only what shall differ from its own, and then the whole."""
    vehicle: VehicleLike | None = field(default=None, kw_only=True)
    """What flies: a `Vehicle`, the name of one (`peakflight.VEHICLES`) or the path of its file;
    then the `Vehicle`, with the limits of this problem."""
    minimize: str | Mapping[str | int, float] | Sequence[float] = field(
        default="jerk", kw_only=True
    )
    """The cost of sub-problem 1; see `SplineClass.of`."""
    degree: int | None = field(default=None, kw_only=True)
    """Degree of the polynomials; None leaves it to the method (`spline_class` for splines)."""
    continuity: int | None = field(default=None, kw_only=True)
    """Highest continuous derivative; None leaves it to the method."""
    start: StateLike | None = field(default=None, kw_only=True)
    """Derivatives at the first waypoint; None is rest. Orders left out are zero, NaN is free."""
    end: StateLike | None = field(default=None, kw_only=True)
    """Derivatives at the last waypoint; as for `start`."""
    derivatives: Mapping[int, StateLike] = field(default_factory=dict, kw_only=True)
    """Derivatives at inner waypoints, by index; whatever is left out is free."""
    yaw: np.ndarray | HeadingLike | None = field(default=None, kw_only=True)
    """(K+1,) rad, at each waypoint, however fast the nose must turn for it; or a `Heading`, or what
    is short for one: an angle in rad, "velocity", {"point": [x, y, z]}. Then an array or a
    `Heading`."""

    def __post_init__(self) -> None:
        waypoints = _waypoints(self.waypoints)
        legs, axes = len(waypoints) - 1, waypoints.shape[1]
        object.__setattr__(self, "waypoints", waypoints)
        if self.limits is None and self.vehicle is None:
            raise InvalidProblem(
                "limits is missing; give limits=peakflight.Limits(speed=..., ...) or vehicle=..."
            )
        if not isinstance(self.limits, Limits | None):
            raise InvalidProblem(f"limits is {self.limits!r}; it must be a peakflight.Limits")
        if self.vehicle is not None:
            vehicle = find_vehicle(self.vehicle)
            if self.limits is not None:
                vehicle = vehicle.with_limits(self.limits)
            object.__setattr__(self, "vehicle", vehicle)
            object.__setattr__(self, "limits", vehicle.limits)
            airframe = vehicle.limits.airframe
            if airframe is not None and not airframe.is_near(vehicle.airframe):
                raise InvalidProblem(
                    f"limits are about {airframe}; vehicle {vehicle.name} has {vehicle.airframe}"
                )
        if all(getattr(self.limits, name) is None for name in BOUNDING):
            raise InvalidProblem(
                f"none of the limits {', '.join(BOUNDING)} is set; set at least one, or nothing "
                "bounds how fast the flight can be"
            )
        if isinstance(self.minimize, Mapping):
            object.__setattr__(self, "minimize", dict(self.minimize))
        elif not isinstance(self.minimize, str):
            object.__setattr__(self, "minimize", tuple(self.minimize))
        spline_class = self.spline_class
        if self.yaw is not None:
            object.__setattr__(self, "yaw", _yaw(self.yaw, legs + 1))
            if self.limits.on_rotors and not self.limits.can_steer:
                raise InvalidProblem(
                    "a yaw beside limits on rotors needs yaw_inertia and torque_per_thrust of the "
                    "airframe"
                )
        rest = spline_class.end_orders
        for name in ("start", "end"):
            state = fixed_state(name, getattr(self, name), axes, spline_class.degree, zeros=rest)
            object.__setattr__(self, name, state)
        inner: dict[int, StateLike] = {}
        for index, given in self.derivatives.items():
            if not 0 < index < legs:
                raise InvalidProblem(
                    f"derivatives are given at waypoint {index}; inner waypoints are 1 to "
                    f"{legs - 1} (use start and end for the others)"
                )
            what = f"waypoint {index}"
            inner[int(index)] = fixed_state(what, given, axes, spline_class.degree, zeros=0)
        object.__setattr__(self, "derivatives", inner)

    @cached_property
    def spline_class(self) -> SplineClass:
        """Degree, weights and continuity of the spline of least effort, filled in."""
        return SplineClass.of(
            self.minimize, self.degree, self.continuity, inner=bool(self.derivatives)
        )

    @property
    def fixed(self) -> dict[int, np.ndarray]:
        """Every fixed derivative: waypoint index to (n, 3) from velocity on, NaN where free."""
        return {0: self.start, **self.derivatives, len(self.waypoints) - 1: self.end}  # type: ignore[dict-item]

    @cached_property
    def is_scalable(self) -> bool:
        """Whether slowing down keeps the path: one-derivative cost, no fixed motion but rest."""
        return self.spline_class.is_homogeneous and self.is_at_rest

    @cached_property
    def is_at_rest(self) -> bool:
        """Whether every derivative that is fixed is zero."""
        return not any((np.abs(state) > 0.0).any() for state in self.fixed.values())

    @cached_property
    def heading(self) -> Heading | None:
        """What is asked of the yaw; of an array, to pass it without limits. None for nothing.

        Where rotor thrust is limited, a nose about which nothing is said is free, and limits that
        are not said to be about the yaw are about the body.
        """
        rotors = self.limits.on_rotors and self.limits.can_steer
        if self.yaw is None:
            return Heading(policy="free", rate=None, acceleration=None) if rotors else None
        if isinstance(self.yaw, Heading):
            return replace(self.yaw, about="body") if rotors and not self.yaw.about else self.yaw
        angles = tuple(np.asarray(self.yaw).tolist())
        about = "body" if rotors else None
        return Heading(policy="waypoints", angles=angles, rate=None, acceleration=None, about=about)

    @cached_property
    def allowed(self) -> dict[LimitKind, float]:
        """Every kind that is limited, of the flight and of its yaw, with the limit in its unit."""
        flight = {kind: getattr(self.limits, kind.name) for kind in self.limits.active}
        return flight if self.heading is None else flight | self.heading.limits

    @cached_property
    def airframe(self) -> Airframe | None:
        """What is known of what flies: of the limits on rotors, or else of the vehicle."""
        if self.limits.airframe is not None or self.vehicle is None:
            return self.limits.airframe
        return self.vehicle.airframe  # type: ignore[union-attr]

    @property
    def leg_lengths(self) -> np.ndarray:
        """(K,) m, straight distance between the waypoints of each leg."""
        legs = self.waypoints[1:] - self.waypoints[:-1]
        return np.sqrt((legs * legs).sum(axis=1))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names, from which `from_dict` makes the same problem."""
        minimize = self.minimize
        if isinstance(minimize, Mapping):
            minimize = {str(key): float(value) for key, value in minimize.items()}
        elif not isinstance(minimize, str):
            minimize = [float(weight) for weight in minimize]
        inner = {str(index): _numbers(state) for index, state in self.derivatives.items()}
        return {
            "waypoints": self.waypoints.tolist(),
            "limits": self.limits.to_dict(),
            "vehicle": _vehicle_to_dict(self.vehicle),
            "minimize": minimize,
            "degree": self.degree,
            "continuity": self.continuity,
            "start": _numbers(self.start),
            "end": _numbers(self.end),
            "derivatives": inner,
            "yaw": self.yaw.to_dict() if isinstance(self.yaw, Heading) else _listed(self.yaw),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """A problem from what `to_dict` gave."""
        values = dict(values)
        for name in ("waypoints", "limits"):
            if name not in values:
                raise InvalidProblem(f"{name} is missing")
        if values.get("vehicle") is not None:
            figures = dict(values["vehicle"])
            values["vehicle"] = Vehicle.from_dict({**figures, "limits": values["limits"]})
        values["limits"] = Limits.from_dict(values["limits"])
        inner = values.get("derivatives") or {}
        values["derivatives"] = {int(index): state for index, state in inner.items()}
        unknown = set(values) - set(cls.__dataclass_fields__)
        if unknown:
            raise InvalidProblem(f"unknown entry {min(unknown)!r} in the problem")
        return cls(values.pop("waypoints"), **values)


def derivative_name(order: int) -> str:
    """What a derivative of position is called."""
    return DERIVATIVE_NAMES[order] if order < len(DERIVATIVE_NAMES) else f"derivative {order}"


def as_float_array(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> np.ndarray:
    """A read-only float copy of `values`, checked against `shape` (None: any length)."""
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InvalidProblem(
            f"{name} must be numbers in an array, all rows of one length"
        ) from None
    if array.shape != shape:
        fits = len(array.shape) == len(shape)
        for wanted, found in zip(shape, array.shape, strict=False):
            fits = fits and (wanted is None or wanted == found)
        if not fits:
            rule = ", ".join("n" if n is None else str(n) for n in shape)
            raise InvalidProblem(f"{name} has shape {array.shape}; it must be ({rule})")
    array.setflags(write=False)
    return array


def _waypoints(values: ArrayLike) -> np.ndarray:
    waypoints = as_float_array("waypoints", values, (None, 3))
    if len(waypoints) < 2:
        raise InvalidProblem(
            f"{len(waypoints)} waypoint{'' if len(waypoints) == 1 else 's'} given; "
            "a trajectory needs at least two"
        )
    finite = np.isfinite(waypoints)
    if not finite.all():
        row, column = np.argwhere(~finite)[0]
        raise InvalidProblem(
            f"waypoint {row} has {AXES[column]} = {waypoints[row, column]}; it must be finite"
        )
    same = (waypoints[1:] == waypoints[:-1]).all(axis=1)
    if same.any():
        row = int(same.argmax())
        raise InvalidProblem(
            f"waypoint {row + 1} repeats waypoint {row} "
            f"({', '.join(f'{value:g}' for value in waypoints[row])}); merge them first "
            "(peakflight.tidy does)"
        )
    return waypoints


def _yaw(asked: Any, count: int) -> np.ndarray | Heading:
    heading = as_heading(asked)
    if heading is not None:
        if heading.angles is not None:
            as_float_array("yaw", heading.angles, (count,))
        return heading
    yaw = as_float_array("yaw", asked, (count,))
    if not np.isfinite(yaw).all():
        row = int((~np.isfinite(yaw)).argmax())
        raise InvalidProblem(f"waypoint {row} has yaw = {yaw[row]}; it must be finite")
    return yaw


def fixed_state(
    name: str, state: StateLike | None, axes: int, degree: int, *, zeros: int
) -> np.ndarray:
    """Fixed derivatives (n, axes) from velocity on, NaN where free.

    Orders that are not given are zero up to `zeros`, and free beyond.
    """
    rows = {} if state is None else _rows(name, state, axes)
    count = max([zeros, *rows])
    if count >= degree:
        raise InvalidProblem(
            f"{name} fixes derivative {count}; degree {degree} allows up to {degree - 1}"
        )
    full = np.full((count, axes), math.nan)
    full[:zeros] = 0.0
    for order, row in rows.items():
        full[order - 1] = row
    if np.isinf(full).any():
        raise InvalidProblem(f"{name} has an infinite derivative")
    full.setflags(write=False)
    return full


def _rows(name: str, state: StateLike, axes: int) -> dict[int, np.ndarray]:
    """Order to (axes,) of the derivatives that are given, by name, by order or row by row."""
    if isinstance(state, Mapping):
        return {
            order: as_float_array(f"{name} derivative {order}", row, (axes,))
            for order, row in ((_order(name, key), row) for key, row in state.items())
        }
    rows: Any = state
    if not (isinstance(state, np.ndarray) and state.dtype == np.float64):
        try:
            numbers = [[_number(x) for x in row] for row in state]  # type: ignore[union-attr]
            rows = numbers or np.empty((0, axes))
        except TypeError:
            raise InvalidProblem(
                f"{name} is {state!r}; it must be rows of {axes} numbers"
            ) from None
    return dict(enumerate(as_float_array(name, rows, (None, axes)), start=1))


def _order(name: str, key: str | int) -> int:
    order = DERIVATIVE_NAMES.index(key) if key in DERIVATIVE_NAMES else key
    try:
        order = int(order)
    except ValueError:
        order = 0
    if order < 1:
        known = ", ".join(DERIVATIVE_NAMES[1:])
        raise InvalidProblem(f"{name} names derivative {key!r}; known are {known}, or 1, 2, ...")
    return order


def _number(value: Any) -> Any:
    """JSON has no NaN: null stands for a derivative that is free."""
    return math.nan if value is None else value


def _numbers(state: Any) -> list[list[float | None]]:
    return [[None if math.isnan(x) else x for x in row] for row in state.tolist()]


def _listed(array: Any) -> list[Any] | None:
    return None if array is None else array.tolist()


def _vehicle_to_dict(vehicle: VehicleLike | None) -> dict[str, Any] | None:
    """A vehicle without its limits, which stand beside it, and the reasons for them."""
    if not isinstance(vehicle, Vehicle):
        return None
    beside = ("limits", "reasons")
    return {name: value for name, value in vehicle.to_dict().items() if name not in beside}


def _weights(minimize: str | Mapping[str | int, float] | Sequence[float]) -> dict[int, float]:
    """Positive weights by order of derivative."""
    if isinstance(minimize, str):
        minimize = {minimize: 1.0}
    elif not isinstance(minimize, Mapping):
        minimize = dict(enumerate(minimize))
    weights = {}
    for key, value in minimize.items():
        order = DERIVATIVE_NAMES.index(key) if key in DERIVATIVE_NAMES else key
        if isinstance(order, str) and order.isdigit():
            order = int(order)
        if not isinstance(order, int | np.integer) or order < 0:
            known = ", ".join(DERIVATIVE_NAMES[1:5])
            raise InvalidProblem(f"minimize names {key!r}; known are {known}, or an order")
        try:
            weight = float(value)
        except (TypeError, ValueError):
            weight = math.nan
        if not (math.isfinite(weight) and weight >= 0.0):
            raise InvalidProblem(f"minimize weighs {key!r} by {value!r}; it must be 0 or more")
        if weight > 0.0:
            weights[int(order)] = weight
    if not weights or max(weights) == 0:
        raise InvalidProblem("minimize weighs no derivative; weigh at least one, such as jerk")
    return weights


def _integer(name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise InvalidProblem(f"{name} is {value!r}; it must be a whole number")
    return int(value)
