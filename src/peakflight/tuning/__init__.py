"""Tuning: the fastest plan that a vehicle still tracks, found by flying in simulation."""

from peakflight.tuning.result import Point, TuneResult
from peakflight.tuning.settings import TuneSettings
from peakflight.tuning.tuner import tune

__all__ = ["Point", "TuneResult", "TuneSettings", "tune"]
