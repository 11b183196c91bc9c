"""What a flight must be where the file flies a vehicle from the ground and back to it."""

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.formats.flight_files import FlightFormat
from peakflight.result import Plan
from peakflight.trajectory import Trajectory

AT_REST = 1e-3
"""Speed, m/s, and acceleration, m/s^2, that are rest: above rounding, below what is felt."""
ON_GROUND = 1e-3
"""m below the ground that count as on it."""
UNITS = ("m/s", "m/s^2")


def check_whole_flight(name: str, chosen: FlightFormat, which: str, plan: Plan) -> None:
    """Refuse a plan that the vehicle cannot hover before and after, or that goes underground.

    Parameters
    ----------
    name, chosen
        Of the format.
    which
        What messages call the plan.

    Raises
    ------
    InvalidProblem
        If it begins or ends in motion, or goes below z = 0, and the format is not about that.
    """
    flight = plan.trajectory
    ends = (("begins", flight.start_time), ("ends", flight.end_time))
    for end, time in ends if chosen.from_rest else ():
        speed, acceleration = (float(np.linalg.norm(flight(time, order))) for order in (1, 2))
        if not max(speed, acceleration) <= AT_REST:
            raise InvalidProblem(
                f"{which} {end} at {speed:.3g} m/s and {acceleration:.3g} m/s^2; in format {name} "
                "the vehicle hovers before and after; the plan must begin and end at rest"
            )
    if chosen.from_ground:
        height, time = _lowest(flight)
        if not height >= -ON_GROUND:
            raise InvalidProblem(
                f"{which} goes down to z = {height:.3g} m at {time:.3g} s; in format {name} z is "
                "above where the vehicle starts, and must not be below 0"
            )


def _lowest(flight: Trajectory) -> tuple[float, float]:
    """Least z, m, and when it is reached, s: at an end of a piece or where z stands still."""
    found, powers = [], np.arange(flight.degree + 1)
    for index, h in enumerate(flight.segment_times.tolist()):
        z = np.polynomial.Polynomial(flight.coefficients[index, :, 2] * h**powers)
        slope = z.deriv().trim()
        roots = slope.roots() if slope.degree() > 0 else np.empty(0)
        parts = np.concatenate(([0.0, 1.0], np.clip(np.real(roots), 0.0, 1.0)))
        heights = z(parts)
        lowest = int(heights.argmin())
        found.append((float(heights[lowest]), float(flight.breakpoints[index] + parts[lowest] * h)))
    return min(found)
