"""How the tuner searches."""

from dataclasses import dataclass, fields

from peakflight.errors import InvalidProblem
from peakflight.flight.conditions import Conditions
from peakflight.flight.numbers import number, whole


@dataclass(frozen=True, kw_only=True)
class TuneSettings:
    """How widely and how long the tuner searches, and what a flight has to stand.

    Raises
    ------
    InvalidProblem
        If a value is out of its range; the message names the field.
    """

    scan: int = 16
    """Proportions of limits to begin with, in each family of plans."""
    families: int = 2
    """Families that go on after the scan: those with the fastest flights."""
    generations: int = 32
    """Of the evolution strategy in each of these."""
    population: int = 10
    """Proportions of limits in each generation."""
    sigma: float = 0.3
    """Step of the first generation, in logarithms of limits."""
    precision: float = 0.02
    """Relative step of the scale at which its border counts as found."""
    error_margin: float = 0.05
    """Part of the error that is kept free: another simulator, or the vehicle, is not alike."""
    doubts: tuple[Conditions, ...] = (
        Conditions(thrust_scale=0.97, motor_lag_scale=1.1),
        Conditions(thrust_scale=1.03, inertia_scale=1.05),
    )
    """What each plan is flown in, too, and has to stand: a vehicle that is only nearly what its
    figures say. Without them the search ends on plans that fly by luck."""
    finalists: int = 20
    """Fastest plans that are looked at closely at the end."""
    final_doubts: int = 12
    """Vehicles that differ a little, which these have to stand."""
    final_spread: float = 0.02
    """Standard deviation of their mass, thrust and inertia, relative; twice that of the lag. At
    half of it a plan was chosen that another simulator flew with twice the error."""
    seed: int = 0

    def __post_init__(self) -> None:
        for name, least, most in (
            ("scan", 1, 4096),
            ("families", 1, 64),
            ("generations", 0, 10_000),
            ("population", 4, 1000),
            ("finalists", 1, 1000),
            ("final_doubts", 0, 1000),
            ("seed", 0, 2**31 - 1),
        ):
            object.__setattr__(self, name, whole(f"tune {name}", getattr(self, name), least, most))
        for name, low, high in (
            ("sigma", 0.01, 2.0),
            ("precision", 1e-4, 0.1),
            ("error_margin", 0.0, 0.9),
            ("final_spread", 0.0, 0.3),
        ):
            value = number(f"tune {name}", getattr(self, name), low, high)
            object.__setattr__(self, name, value)
        if not all(isinstance(one, Conditions) for one in self.doubts):
            raise InvalidProblem("tune doubts must be peakflight.Conditions")

    def to_dict(self) -> dict[str, object]:
        """Plain numbers, lists and names."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return {**values, "doubts": [one.to_dict() for one in self.doubts]}
