"""What a flight must be where the file flies a vehicle from the ground and back to it."""

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.exporting.lifting import lowest
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
    check_above_ground(name, chosen, which, flight)


def check_above_ground(name: str, chosen: FlightFormat, which: str, flight: Trajectory) -> None:
    """Refuse a flight that goes below z = 0, where that is below where the vehicle starts.

    Raises
    ------
    InvalidProblem
        If it does.
    """
    if not chosen.from_ground:
        return
    height, time = lowest(flight)
    if not height >= -ON_GROUND:
        raise InvalidProblem(
            f"{which} goes down to z = {height:.3g} m at {time:.3g} s; in format {name} z is above "
            "where the vehicle starts, and must not be below 0; move it up, with --lift auto or by "
            "as many m as you say (peakflight export; in Python lift=...)"
        )
