"""Vehicles in YAML or JSON: the fields of `peakflight.Vehicle` by name."""

import json
from pathlib import Path
from typing import Any

from peakflight.errors import InvalidFile, InvalidProblem
from peakflight.files import PathLike, parse_json, read_text
from peakflight.formats.courses import json_course, yaml_course
from peakflight.limits import plain_unit
from peakflight.vehicle import Vehicle

FIGURES = {
    "mass": ("kg", ""),
    "inertia": ("kg m^2", "about x, y and z"),
    "rotor_positions": ("m", "x forward and y left of each, from the centre of mass"),
    "spins": ("", "seen from above: 1 counterclockwise, -1 clockwise"),
    "rotor_thrust": ("N", "least and most of one rotor"),
    "torque_per_thrust": ("m", "of a rotor"),
    "motor_lag": ("s", "time constant of thrust; may be left out"),
    "body_rate": ("rad/s", "most across and about the thrust axis; may be left out"),
    "drag": ("kg/s", "force over speed, across and along the thrust axis; may be left out"),
}
"""Name of a figure to its unit and what there is to say of it."""


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


def shown_figure(vehicle: Vehicle, name: str) -> str:
    """One of `FIGURES` of a vehicle with its unit, as it is shown to people."""
    value = getattr(vehicle, name)
    return "unknown" if value is None else f"{_shown(value)} {plain_unit(FIGURES[name][0])}".strip()


def _shown(value: Any) -> str:
    if isinstance(value, tuple):
        return ("; " if isinstance(value[0], tuple) else ", ").join(map(_shown, value))
    return f"{value:.4g}"


def as_yaml(vehicle: Vehicle) -> str:
    """A vehicle as a YAML file, with units, to be changed by hand and read again.

    Limits that follow from the figures are remarks, so that they follow the changed figures too.
    """
    values = vehicle.to_dict()
    lines = [f"name: {json.dumps(vehicle.name)}"]
    for name, (unit, remark) in FIGURES.items():
        if values[name] is not None:
            said = ", ".join(part for part in (unit, remark) if part)
            lines.append(f"{name}: {json.dumps(values[name])}  # {said}")
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
