"""Vehicles in YAML or JSON: the fields of `peakflight.Vehicle` by name."""

import json
from pathlib import Path
from typing import Any

from peakflight.errors import InvalidFile, InvalidProblem
from peakflight.files import PathLike, parse_json, read_text
from peakflight.formats import json_course, yaml_course
from peakflight.vehicle import Vehicle

UNITS = {
    "mass": "kg",
    "inertia": "about x, y, z, kg m^2",
    "rotor_positions": "x forward and y left of each, m, from the centre of mass",
    "spins": "seen from above: 1 counterclockwise, -1 clockwise",
    "rotor_thrust": "least and most of one rotor, N",
    "torque_per_thrust": "of a rotor, m",
    "motor_lag": "time constant of thrust, s; may be left out",
    "body_rate": "most across and about the thrust axis, rad/s; may be left out",
    "drag": "over speed, across and along the thrust axis, kg/s; may be left out",
}
"""Name of a figure to what it is and its unit."""


def read_vehicle(path: PathLike) -> Vehicle:
    """Read a vehicle; what is in the file, not its name, says whether it is YAML or JSON.

    A vehicle that has no name in the file is called as the file is.

    Raises
    ------
    InvalidFile
        If it cannot be read or holds no vehicle; the message names file, key, value and rule.
    MissingExtra
        If it is YAML and PyYAML is not installed.
    """
    path = Path(path)
    text = read_text(path)
    is_json = json_course.recognises(text)
    values = parse_json(text, path) if is_json else yaml_course.parse(text, path)
    if not isinstance(values, dict):
        raise InvalidFile(f"{path}: a vehicle must be a mapping of its figures by name")
    try:
        return Vehicle.from_dict({"name": path.stem, **values})
    except InvalidProblem as error:
        raise InvalidFile(f"{path}: {error}") from None


def as_yaml(vehicle: Vehicle) -> str:
    """A vehicle as a YAML file, with units, to be changed by hand and read again.

    Limits that follow from the figures are remarks, so that they follow the changed figures too.
    """
    values = vehicle.to_dict()
    lines = [f"name: {json.dumps(vehicle.name)}"]
    for name, unit in UNITS.items():
        if values[name] is not None:
            lines.append(f"{name}: {json.dumps(values[name])}  # {unit}")
    mark = ""
    if vehicle.has_default_limits():
        mark = "# "
        lines.append("# Limits follow from the figures, as below, unless they are given here.")
    for name in ("limits", "reasons"):
        lines += _block(name, values[name], mark)
    return "\n".join([*lines, *_block("sources", values["sources"]), ""])


def _block(name: str, values: dict[str, Any], mark: str = "") -> list[str]:
    if not values:
        return []
    rows = (f"{mark}  {key}: {json.dumps(value)}" for key, value in values.items())
    return [f"{mark}{name}:", *rows]
