"""How near drones that fly together come to each other, proven.

Air pushed down by rotors reaches further than they do to the side, so that distances may be taken
in an ellipsoid's norm: with a separation s kept to the side and d above and below, of a difference
(x, y, z) it is sqrt(x^2 + y^2 + (z s / d)^2), and drones are far enough apart exactly if it is at
least s.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from peakflight.course import FARTHEST
from peakflight.errors import InvalidProblem
from peakflight.kernels import bernstein, separation
from peakflight.kernels.jit import fresh
from peakflight.problem import as_float_array
from peakflight.result import Plan
from peakflight.trajectory import Trajectory, reach

TOLERANCE = 5e-7
"""How near a proven bound comes to the distance that was found, m; rounding may take as much."""
LARGEST_DELAY = 1e7
"""Delays, s: four months."""
LEAST_KEPT, MOST_KEPT = 1e-6, 1e6
"""Separations, m: below, rounding decides; beyond, drones are not near each other."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ClosestApproach:
    """How near drones come to each other, pair by pair."""

    pair: tuple[int, int]
    """Numbers of the two that come nearest."""
    time: float
    """When they do, s."""
    distance: float
    """How near they come, m, in the norm of the separation."""
    bound: float
    """What no distance of any pair ever falls below, proven, m; within 1e-6 m of `distance`, less
    what drones may be off."""
    positions: np.ndarray
    """(2, 3) m, where the two are then."""
    separation: float | None
    """What should be kept to the side, m; None if nothing was asked."""
    downwash: float | None
    """What should be kept above and below, m."""
    pairs: np.ndarray
    """(P, 2) numbers of the two of every pair."""
    times: np.ndarray
    """(P,) s, when each pair comes nearest."""
    distances: np.ndarray
    """(P,) m, how near."""
    bounds: np.ndarray
    """(P,) m, what the distance of each pair is proven never to fall below."""

    @property
    def is_kept(self) -> bool | None:
        """Whether the separation is proven to be kept throughout; None if none was asked for."""
        return None if self.separation is None else bool(self.bound >= self.separation)


def closest_approach(
    plans: Sequence[Plan | Trajectory],
    *,
    separation: float | None = None,
    downwash: float | None = None,
    delays: ArrayLike | None = None,
    off: ArrayLike | None = None,
) -> ClosestApproach:
    """How near drones come to each other, with a proven lower bound.

    Each flies from its start time, plus its delay; before it waits at its first point, afterwards
    at its last.

    Parameters
    ----------
    plans
        (n,) plans or trajectories in three axes, two at least.
    separation
        m, to be kept to the side; None asks for nothing, and distances are then ordinary ones.
    downwash
        m, to be kept above and below; as `separation` if it is left out.
    delays
        (n,) s; none by default.
    off
        (n,) m, how far from its trajectory each may be: of samples, how near polynomials come to
        them. Bounds are lower by what the two of a pair may be off together. None by default.

    Raises
    ------
    InvalidProblem
        If there are fewer than two, or a value is against its rule.
    """
    flights = [plan.trajectory if isinstance(plan, Plan) else plan for plan in plans]
    scale = _scale(separation, downwash)
    late = _delays(delays, len(flights))
    astray = _off(off, len(flights))
    if len(flights) < 2:
        raise InvalidProblem(f"{len(flights)} plans given; a distance needs two at least")
    for index, flight in enumerate(flights):
        if flight.axes != 3:
            raise InvalidProblem(f"plan {index} has {flight.axes} axes; it must have three")
        far = ~(reach(flight) <= FARTHEST)
        if far.any():
            raise InvalidProblem(
                f"piece {int(far.argmax())} of plan {index} is not within {FARTHEST:g} m of zero"
            )
    zero, begins = _begins(flights, late)
    last = float(max(b + flight.duration for b, flight in zip(begins, flights, strict=True)))
    pieces = max(len(flight) for flight in flights) + 2
    degree = max(flight.degree for flight in flights)
    coefficients = np.zeros((len(flights), pieces, degree + 1, 3))
    breakpoints = np.full((len(flights), pieces + 1), last)
    counts = np.empty(len(flights), dtype=np.int64)
    for index, flight in enumerate(flights):
        count = counts[index] = len(flight) + 2
        coefficients[index, 0, 0] = flight.coefficients[0, 0]
        coefficients[index, 1 : count - 1, : flight.degree + 1] = flight.coefficients
        coefficients[index, count - 1, 0] = flight.at(len(flight) - 1, flight.segment_times[-1])
        breakpoints[index, 0] = 0.0
        borders = begins[index] + np.concatenate(([0.0], np.cumsum(flight.segment_times)))
        breakpoints[index, 1:count] = np.minimum(borders, last)
    found, bounds = _nearest(coefficients, breakpoints, counts, scale)
    pairs = np.column_stack(np.triu_indices(len(flights), 1))
    bounds = np.maximum(bounds - scale.max() * astray[pairs].sum(axis=1), 0.0)
    worst = int(found[:, 1].argmin())
    first, second = (int(number) for number in pairs[worst])
    when = zero + float(found[worst, 0])
    return ClosestApproach(
        pair=(first, second),
        time=when,
        distance=float(found[worst, 1]),
        bound=float(bounds.min()),
        positions=_read_only(
            np.array(
                [_position(flights[k], float(found[worst, 0]) - begins[k]) for k in (first, second)]
            )
        ),
        separation=separation,
        downwash=separation if downwash is None else downwash,
        pairs=_read_only(pairs),
        times=_read_only(zero + found[:, 0]),
        distances=_read_only(found[:, 1].copy()),
        bounds=_read_only(bounds),
    )


def _nearest(
    coefficients: np.ndarray, breakpoints: np.ndarray, counts: np.ndarray, scale: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(P, 2) time and distance, and (P,) bound of every pair, as `kernels.separation.nearest`."""
    count = len(counts) * (len(counts) - 1) // 2
    found, bounds = np.empty((count, 2)), np.empty(count)
    convert, product = bernstein.bernstein_tables(coefficients.shape[2] - 1)
    separation.nearest(
        fresh(coefficients), fresh(breakpoints), counts, scale, TOLERANCE, convert, product,
        found, bounds,
    )  # fmt: skip
    return found, bounds


def _scale(separation: float | None, downwash: float | None) -> np.ndarray:
    """(3,) factors of the axes in the norm."""
    for name, value in (("separation", separation), ("downwash", downwash)):
        if value is not None and not LEAST_KEPT <= value <= MOST_KEPT:
            raise InvalidProblem(
                f"{name} is {value:g} m; it must be positive, from {LEAST_KEPT:g} to "
                f"{MOST_KEPT:g} m"
            )
    if separation is None and downwash is not None:
        raise InvalidProblem("downwash is given without the separation to the side")
    ratio = 1.0 if separation is None or downwash is None else separation / downwash
    return np.array([1.0, 1.0, ratio])


def _delays(delays: ArrayLike | None, count: int) -> np.ndarray:
    late = as_float_array("delays", np.zeros(count) if delays is None else delays, (count,))
    if not (np.abs(late) <= LARGEST_DELAY).all():
        index = int((~(np.abs(late) <= LARGEST_DELAY)).argmax())
        raise InvalidProblem(
            f"delay {index} is {late[index]} s; it must be finite, within {LARGEST_DELAY:g} s"
        )
    return late


def _off(off: ArrayLike | None, count: int) -> np.ndarray:
    astray = as_float_array("off", np.zeros(count) if off is None else off, (count,))
    if not ((astray >= 0.0) & (astray <= FARTHEST)).all():
        index = int((~((astray >= 0.0) & (astray <= FARTHEST))).argmax())
        raise InvalidProblem(
            f"plan {index} is off by {astray[index]} m; it must be from 0 to {FARTHEST:g} m"
        )
    return astray


def _begins(flights: Sequence[Trajectory], late: np.ndarray) -> tuple[float, np.ndarray]:
    """When the first of them starts, s, and (n,) s how much later each does.

    Rounded once, after the subtraction: sums of delays and Unix times have 2e-7 s between them.
    """
    starts = [
        Fraction(flight.start_time) + Fraction(float(delay))
        for flight, delay in zip(flights, late, strict=True)
    ]
    first = min(starts)
    return float(first), np.array([float(start - first) for start in starts])


def _position(flight: Trajectory, time: float) -> np.ndarray:
    """(3,) m, at s since the start; also before and after the flight."""
    flight = flight.shift(-flight.start_time)
    return flight(min(max(time, 0.0), flight.end_time))


def _read_only(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array
