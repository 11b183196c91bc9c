"""From certified plans to flight files that are certified again, as their consumers read them."""

from peakflight.exporting.report import Differences, ExportedFlight, ExportReport
from peakflight.exporting.writing import export

__all__ = ["Differences", "ExportReport", "ExportedFlight", "export"]
