"""The files that courses come in and that vehicles fly."""

from peakflight.formats.courses import COURSE_READERS, LARGEST_FILE, Reader, read_course
from peakflight.formats.flight_files import (
    FLIGHT_FORMATS,
    FlightFormat,
    find_format,
    write_crazyflie,
    write_samples,
)

__all__ = [
    "COURSE_READERS",
    "FLIGHT_FORMATS",
    "LARGEST_FILE",
    "FlightFormat",
    "Reader",
    "find_format",
    "read_course",
    "write_crazyflie",
    "write_samples",
]
