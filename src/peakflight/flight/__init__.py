"""Flying a plan in simulation: a rigid body with rotors that lag, under a controller."""

from peakflight.flight.conditions import Conditions
from peakflight.flight.controllers import FirmwareSettings, GeometricSettings, firmware_settings
from peakflight.flight.flight import Crash, Flight
from peakflight.flight.motion_capture import FlightAnalysis, analyse
from peakflight.flight.rotors import ROTOR_SPEEDS, RotorSpeeds
from peakflight.flight.simulate import CONTROLLERS, FlySettings, fly
from peakflight.flight.spread import Spread, SpreadResult, fly_spread

__all__ = [
    "CONTROLLERS",
    "ROTOR_SPEEDS",
    "Conditions",
    "Crash",
    "FirmwareSettings",
    "Flight",
    "FlightAnalysis",
    "FlySettings",
    "GeometricSettings",
    "RotorSpeeds",
    "Spread",
    "SpreadResult",
    "analyse",
    "firmware_settings",
    "fly",
    "fly_spread",
]
