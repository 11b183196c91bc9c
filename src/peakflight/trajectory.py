"""A piecewise polynomial in time, as a closed value type."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb, perm
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from peakflight.errors import InvalidProblem
from peakflight.problem import as_float_array

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

TIME_TOLERANCE = 1e-9
"""How far outside its interval a trajectory may be asked for, relative to its duration."""

SHORTEST, LONGEST = 1e-9, 1e9
"""Durations of a piece, s: beyond, its powers run out of digits."""
LATEST = 1e10
"""Start times, s: a Unix time is well within."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """K polynomials of degree N in D axes, one after the other.

    Piece k runs for `segment_times[k]` seconds; `coefficients[k, j]` multiplies the j-th power of
    the time since the piece began. Every method returns a new trajectory.

    Raises
    ------
    InvalidProblem
        If shapes do not fit, a time is out of range, or a number is not finite.
    """

    coefficients: np.ndarray
    """(K, N+1, D), ascending powers of piece-local time: metres, metres per second, ..."""
    segment_times: np.ndarray
    """(K,) s."""
    start_time: float = 0.0
    """When the first piece begins, s."""

    def __post_init__(self) -> None:
        coefficients = as_float_array("coefficients", self.coefficients, (None, None, None))
        segment_times = as_float_array("segment_times", self.segment_times, (None,))
        if min(coefficients.shape) == 0 or len(segment_times) != len(coefficients):
            raise InvalidProblem(
                f"coefficients have shape {coefficients.shape} and segment_times "
                f"{segment_times.shape}; they must be (K, N+1, D) and (K,) with K, D at least 1"
            )
        bad = ~((segment_times >= SHORTEST) & (segment_times <= LONGEST))
        if bad.any():
            piece = int(bad.argmax())
            raise InvalidProblem(
                f"segment {piece} lasts {segment_times[piece]} s; it must be positive, from "
                f"{SHORTEST:g} to {LONGEST:g} s"
            )
        if not np.isfinite(coefficients).all():
            piece = int(np.argwhere(~np.isfinite(coefficients))[0, 0])
            raise InvalidProblem(f"segment {piece} has a coefficient that is not finite")
        object.__setattr__(self, "coefficients", coefficients)
        object.__setattr__(self, "segment_times", segment_times)
        object.__setattr__(self, "start_time", float(self.start_time))
        if not abs(self.start_time) <= LATEST:
            raise InvalidProblem(
                f"start_time is {self.start_time}; it must be finite, within {LATEST:g} s of zero"
            )

    def __len__(self) -> int:
        """Number of pieces, K."""
        return len(self.segment_times)

    @property
    def degree(self) -> int:
        """Degree N of the polynomials."""
        return self.coefficients.shape[1] - 1

    @property
    def axes(self) -> int:
        """Number of axes, D."""
        return self.coefficients.shape[2]

    @cached_property
    def breakpoints(self) -> np.ndarray:
        """(K+1,) s, when pieces begin and end."""
        times = self.start_time + np.concatenate(([0.0], np.cumsum(self.segment_times)))
        times.setflags(write=False)
        return times

    @cached_property
    def duration(self) -> float:
        """Total time, s."""
        return float(self.segment_times.sum())

    @property
    def end_time(self) -> float:
        """When the last piece ends, s."""
        return float(self.breakpoints[-1])

    def __call__(self, t: ArrayLike, derivative: int = 0) -> np.ndarray:
        """Position, or a derivative of it, at one time or many.

        Parameters
        ----------
        t
            (...,) s, within the trajectory. At a joint the later piece counts.
        derivative
            0 position, 1 velocity, 2 acceleration, 3 jerk, 4 snap, ...

        Returns
        -------
        (..., D) m, m/s, ...

        Raises
        ------
        ValueError
            If a time is not a number within the trajectory, or the order is negative.
        """
        times = np.asarray(t, dtype=float)
        slack = TIME_TOLERANCE * (self.duration + abs(self.start_time))
        inside = (times >= self.start_time - slack) & (times <= self.end_time + slack)
        if not inside.all():
            raise ValueError(
                f"time {times[~inside].flat[0]} s is outside the trajectory, which runs from "
                f"{self.start_time:g} to {self.end_time:g} s"
            )
        piece = np.searchsorted(self.breakpoints[1:-1], times, side="right")
        local = np.clip(times - self.breakpoints[piece], 0.0, self.segment_times[piece])
        return self.at(piece, local, derivative)

    def at(self, piece: ArrayLike, local: ArrayLike, derivative: int = 0) -> np.ndarray:
        """As a call, at (...,) s since the beginning of (...,) pieces."""
        if derivative < 0:
            raise ValueError(f"derivative is {derivative}; it must be 0 or more")
        piece, local = np.broadcast_arrays(piece, np.asarray(local, dtype=float))
        value = np.zeros((*piece.shape, self.axes))
        for power in range(self.degree, derivative - 1, -1):
            value *= local[..., None]
            value += perm(power, derivative) * self.coefficients[piece, power]
        return value

    def sample(self, count: int, derivative: int = 0) -> np.ndarray:
        """(K, count, D): values at `count` even points of each piece, both ends included."""
        pieces = np.arange(len(self))[:, None]
        return self.at(
            pieces, self.segment_times[:, None] * np.linspace(0.0, 1.0, count), derivative
        )

    def derivative(self, order: int = 1) -> Self:
        """The trajectory of a derivative; its degree is lower by `order`, but not below 0."""
        if order < 0:
            raise ValueError(f"order is {order}; it must be 0 or more")
        powers = range(order, self.degree + 1)
        if not powers:
            return self._with(np.zeros_like(self.coefficients[:, :1]))
        factors = np.array([float(perm(power, order)) for power in powers])
        return self._with(self.coefficients[:, order:] * factors[:, None])

    def piece(self, index: int) -> Self:
        """One piece as a trajectory, at its own time."""
        if not -len(self) <= index < len(self):
            raise IndexError(f"piece {index}: there are {len(self)}")
        index %= len(self)
        return type(self)(
            self.coefficients[index : index + 1],
            self.segment_times[index : index + 1],
            float(self.breakpoints[index]),
        )

    def pieces(self) -> list[Self]:
        """Every piece as a trajectory, each at its own time."""
        return [self.piece(index) for index in range(len(self))]

    def split(self, t: float) -> tuple[Self, Self]:
        """The parts before and after time t, which lies strictly inside."""
        if not self.start_time < t < self.end_time:
            raise ValueError(
                f"cannot split at {t} s; inside is {self.start_time:g} to {self.end_time:g} s"
            )
        index = int(np.searchsorted(self.breakpoints[1:-1], t, side="right"))
        local = float(t - self.breakpoints[index])
        if local <= 0.0:
            return self._cut(0, index), self._cut(index, len(self))
        left = self._cut(0, index + 1)
        times = np.append(self.segment_times[:index], local)
        left = type(self)(left.coefficients, times, self.start_time)
        coefficients = self.coefficients[index:].copy()
        coefficients[:1] = _shift_origin(coefficients[:1], np.array([local]))
        times = self.segment_times[index:].copy()
        times[0] -= local
        return left, type(self)(coefficients, times, float(t))

    def subdivide(self, parts: ArrayLike) -> Self:
        """The same motion, piece k cut into `parts[k]` pieces of equal duration.

        Parameters
        ----------
        parts
            Whole numbers from 1: (K,), or one for all.
        """
        counts = np.broadcast_to(np.asarray(parts), len(self))
        if not (np.issubdtype(counts.dtype, np.integer) and (counts >= 1).all()):
            raise ValueError("parts must be whole numbers from 1")
        parent = np.repeat(np.arange(len(self)), counts)
        first = np.cumsum(counts) - counts
        times = (self.segment_times / counts)[parent]
        offset = (np.arange(len(parent)) - first[parent]) * times
        coefficients = _shift_origin(self.coefficients[parent], offset)
        return type(self)(coefficients, times, self.start_time)

    def cut(self, times: ArrayLike) -> Self:
        """The same motion, with joints at (n,) more times as well, which lie strictly inside."""
        more = np.asarray(times, dtype=float)
        if not ((more > self.start_time) & (more < self.end_time)).all():
            raise ValueError(f"cannot cut outside of {self.start_time:g} to {self.end_time:g} s")
        begins = np.union1d(self.breakpoints[:-1], more)
        parent = np.searchsorted(self.breakpoints[1:-1], begins, side="right")
        ends = np.append(begins[1:], self.end_time)
        whole = np.diff(parent, prepend=-1, append=len(self))  # pieces that stay keep their time
        stays = (whole[:-1] > 0) & (whole[1:] > 0)
        durations = np.where(stays, self.segment_times[parent], ends - begins)
        coefficients = _shift_origin(
            self.coefficients[parent], begins - self.breakpoints[:-1][parent]
        )
        return type(self)(coefficients, durations, self.start_time)

    def join(self, other: Self) -> Self:
        """Append `other`, moved in time to follow at once.

        Nothing is smoothed: the motion jumps where the two do not meet.
        """
        if other.axes != self.axes:
            raise ValueError(f"cannot join {self.axes} axes and {other.axes}")
        degree = max(self.degree, other.degree)
        return type(self)(
            np.concatenate((self.elevate(degree).coefficients, other.elevate(degree).coefficients)),
            np.concatenate((self.segment_times, other.segment_times)),
            self.start_time,
        )

    def shift(self, seconds: float) -> Self:
        """The same motion, later by `seconds`."""
        return type(self)(self.coefficients, self.segment_times, self.start_time + seconds)

    def translate(self, offset: ArrayLike) -> Self:
        """The same motion, moved in space by `offset`, (D,) m."""
        moved = self.coefficients.copy()
        moved[:, 0] += as_float_array("offset", offset, (self.axes,))
        return self._with(moved)

    def reverse(self) -> Self:
        """The same path flown backwards, in the same interval of time."""
        signs = (-1.0) ** np.arange(self.degree + 1)
        flipped = _shift_origin(self.coefficients, self.segment_times) * signs[:, None]
        return type(self)(flipped[::-1], self.segment_times[::-1], self.start_time)

    def stretch(self, factor: float) -> Self:
        """The same path flown slower by `factor` (faster below 1), from the same start time."""
        if not (math.isfinite(factor) and factor > 0.0):
            raise ValueError(f"factor is {factor}; it must be positive and finite")
        powers = float(factor) ** -np.arange(self.degree + 1.0)
        return type(self)(
            self.coefficients * powers[:, None], self.segment_times * factor, self.start_time
        )

    def elevate(self, degree: int) -> Self:
        """The same motion written at a higher degree."""
        if degree < self.degree:
            raise ValueError(f"cannot lower the degree from {self.degree} to {degree}")
        missing = degree - self.degree
        return self._with(np.pad(self.coefficients, ((0, 0), (0, missing), (0, 0))))

    def to_ppoly(self) -> "PPoly":
        """The same function as a `scipy.interpolate.PPoly`."""
        from scipy.interpolate import PPoly

        return PPoly(self.coefficients.transpose(1, 0, 2)[::-1], self.breakpoints)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and lists, from which `from_dict` makes the same trajectory."""
        return {
            "coefficients": self.coefficients.tolist(),
            "segment_times": self.segment_times.tolist(),
            "start_time": self.start_time,
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """A trajectory from what `to_dict` gave."""
        for name in ("coefficients", "segment_times"):
            if name not in values:
                raise InvalidProblem(f"{name} is missing")
        return cls(values["coefficients"], values["segment_times"], values.get("start_time", 0.0))

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Several trajectories, each following at once on the one before."""
        whole = parts[0]
        for part in parts[1:]:
            whole = whole.join(part)
        return whole

    def _with(self, coefficients: np.ndarray) -> Self:
        return type(self)(coefficients, self.segment_times, self.start_time)

    def _cut(self, first: int, last: int) -> Self:
        return type(self)(
            self.coefficients[first:last],
            self.segment_times[first:last],
            float(self.breakpoints[first]),
        )


def reach(motion: Trajectory) -> np.ndarray:
    """(K,) a bound of the size of a motion on each piece; infinite where it has none."""
    with np.errstate(over="ignore", invalid="ignore"):
        powers = motion.segment_times[:, None] ** np.arange(motion.degree + 1)
        sizes = (np.abs(motion.coefficients) * powers[:, :, None]).sum(axis=1).max(axis=1)
    result: np.ndarray = np.where(np.isnan(sizes), np.inf, sizes)
    return result


def _shift_origin(coefficients: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Coefficients (K, N+1, D) of the same polynomials around other origins (K,) (Taylor shift)."""
    powers = range(coefficients.shape[1])
    ways = np.array([[float(comb(j, i)) for j in powers] for i in powers])
    exponents = np.array([[max(j - i, 0) for j in powers] for i in powers])
    return (ways * offset[:, None, None] ** exponents) @ coefficients
