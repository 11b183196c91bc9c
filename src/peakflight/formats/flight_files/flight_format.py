"""What a format of flight file is: how flights become bytes, and what a consumer reads in them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.result import Plan
from peakflight.trajectory import Trajectory

POLYNOMIAL, SET_POINTS = 4, 2
"""Highest derivative that a file fixes: snap by polynomials, acceleration by set-points."""


class Encoded(NamedTuple):
    """A flight file."""

    data: bytes
    notes: tuple[str, ...] = ()
    """For whoever flies it, one line each."""


class Reading(NamedTuple):
    """A flight as the consumer of a file reads it, in its own precision."""

    trajectory: Trajectory
    """In three axes, from the time at which the file begins."""
    yaw: Trajectory | None = None
    """In one axis, rad; None if the file has none."""


class Precision(NamedTuple):
    """By how much at most a file is off the flight that was written to it."""

    position: float
    """m on each axis."""
    time: float = 0.0
    """s by which joints may be earlier or later."""
    relative: float = 0.0
    """Part of the coordinate on each axis, m/m."""
    terms: float = 0.0
    """Part of the sum of the sizes of a polynomial's terms on each axis, m/m: coefficients round
    one by one, however much of them cancels."""


@dataclass(frozen=True, kw_only=True)
class FlightFormat:
    """One format of flight file. Everything that knows formats goes through these fields."""

    filename: str
    """What the file is called unless the user says otherwise."""
    summary: str
    """What the file is, for help texts."""
    consumer: str
    """Who reads it."""
    numbers: str
    """What the consumer's numbers are, in words."""
    rules: str = "none"
    """What the format cannot hold, in words."""
    encode: Callable[[Sequence[Plan], Sequence[str]], Encoded]
    """The file of plans under names; raises InvalidProblem if it cannot hold them."""
    decode: Callable[[bytes], tuple[Reading, ...]]
    """What the consumer reads, in the order of the plans; the inverse of `encode`."""
    precision: Precision
    tolerance: float
    """Part of a limit by which the file may exceed it, for rounding."""
    fixed: int = POLYNOMIAL
    """Highest derivative that the numbers fix."""
    coarse: bool = False
    """Whether rounding leaves jerk and snap of short pieces no meaning."""
    several: bool = False
    """Whether one file holds several drones."""
    needs_vehicle: bool = False
    from_rest: bool = False
    """Whether the vehicle hovers before and after, so that plans begin and end at rest."""
    from_ground: bool = False
    """Whether z is above where the vehicle starts, so that plans do not go below 0."""
    most_pieces: Callable[[Plan], int] | None = None
    """How many pieces of a plan there is room for; None for any number."""

    @property
    def held(self) -> int:
        """Limits on derivatives up to this one are held to the tolerance."""
        return min(self.fixed, SET_POINTS) if self.coarse else self.fixed


def single(
    encode: Callable[[Plan, str], Encoded],
) -> Callable[[Sequence[Plan], Sequence[str]], Encoded]:
    """An encoder of one plan as one of several, which refuses more."""

    def encode_first(plans: Sequence[Plan], names: Sequence[str]) -> Encoded:
        if len(plans) != 1:
            raise InvalidProblem(f"the format holds one drone; {len(plans)} plans are given")
        return encode(plans[0], names[0])

    return encode_first


def as_text(lines: Sequence[str]) -> bytes:
    """Lines as the bytes of a file."""
    return ("\n".join(lines) + "\n").encode()


def start_note(plans: Sequence[Plan], what: str) -> tuple[str, ...]:
    """A note where plans have a start time, which most files have not."""
    first = min(plan.trajectory.start_time for plan in plans)
    if first == 0.0:
        return ()
    return (
        f"the plan starts at {first:g} s; the file has no such time, and its flight starts when "
        f"{what} is told to",
    )


def through_samples(
    times: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    acceleration: np.ndarray | None = None,
) -> Trajectory:
    """The motion through set-points: between two, the polynomial that has both.

    Of degree 5 through position, velocity and acceleration, of degree 3 without the last. A
    set-point that is followed by the end at once is left out: rounding in both would be a motion.

    Parameters
    ----------
    times
        (n,) s, rising.
    position, velocity, acceleration
        (n, D).
    """
    states = [position, velocity] + ([] if acceleration is None else [acceleration])
    if len(times) > 2 and times[-1] - times[-2] < SHORT * (times[-2] - times[-3]):
        keep = np.arange(len(times)) != len(times) - 2
        times, states = times[keep], [state[keep] for state in states]
    h = np.diff(times)[:, None]
    scaled = [state[:-1] * h**order for order, state in enumerate(states)]
    scaled += [state[1:] * h**order for order, state in enumerate(states)]
    degree = 2 * len(states) - 1
    shapes = hermite(len(states))
    coefficients = np.einsum("ij,jkd->kid", shapes, np.stack(scaled))
    powers = h[:, :, None] ** np.arange(degree + 1)[:, None]
    return Trajectory(coefficients / powers, h[:, 0], float(times[0]))


SHORT = 0.5
"""Part of a period: a set-point nearer to the end than this is left out."""


def hermite(orders: int) -> np.ndarray:
    """(2n, 2n) coefficients on [0, 1] from the first n derivatives at 0, then at 1."""
    rows = np.zeros((2 * orders, 2 * orders))
    for power in range(2 * orders):
        monomial = np.polynomial.Polynomial(np.eye(2 * orders)[power])
        for order in range(orders):
            rows[order, power] = monomial(0.0)
            rows[orders + order, power] = monomial(1.0)
            monomial = monomial.deriv()
    return np.linalg.inv(rows)
