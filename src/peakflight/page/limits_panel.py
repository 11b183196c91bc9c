"""The limits as sliders, each with a box that sets or lifts it."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import viser

from peakflight.limits import GRAVITY, KINDS, ROTORS, LimitKind, Limits
from peakflight.page.callbacks import with_value
from peakflight.page.edited import Edited


@dataclass(frozen=True)
class Range:
    """What a slider offers, in the unit that is shown."""

    low: float
    high: float
    step: float
    usual: float
    """Where it begins if the limit was not set."""
    hint: str


RANGES = {
    "speed": Range(0.2, 25.0, 0.01, 5.0, "Fastest that the drone may go."),
    "thrust_acceleration": Range(
        10.0, 50.0, 0.01, 15.5, "Thrust over mass: 9.81 hovers, more is what is left to turn with."
    ),
    "jerk": Range(5.0, 300.0, 1.0, 62.0, "How fast acceleration may change: soft or snappy."),
    "snap": Range(50.0, 4000.0, 10.0, 800.0, "How fast jerk may change: what motors must follow."),
    "tilt": Range(5.0, 85.0, 1.0, 50.0, "Largest angle of the thrust from the vertical."),
    "least_thrust_acceleration": Range(
        0.1, 9.7, 0.01, 2.0, "Smallest thrust over mass: keeps rotors from stopping."
    ),
    "body_rate": Range(0.5, 35.0, 0.01, 8.0, "How fast the thrust direction may turn."),
    "angular_acceleration": Range(
        5.0, 400.0, 1.0, 100.0, "How fast that turning may change: what motor lag allows."
    ),
    "rotor_thrust": Range(0.0, 1.0, 0.0001, 0.1, "Most thrust of one rotor of the vehicle."),
    "least_rotor_thrust": Range(0.0, 1.0, 0.0001, 0.01, "Least thrust of one rotor."),
}
"""By name of limit; rotors' ranges follow from the vehicle."""
WIDEN = 2.0
"""How far the range of a slider is taken beyond a value that it does not hold."""


class LimitsPanel:
    """Boxes and sliders of all kinds of limit."""

    def __init__(
        self, server: viser.ViserServer, changed: Callable[[str, float | None, bool], None]
    ) -> None:
        """`changed` is told name, value in SI units or None, and whether a slider is moving."""
        self._changed = changed
        self._edited: Edited | None = None
        self._boxes: dict[str, Any] = {}
        self._sliders: dict[str, Any] = {}
        for kind in KINDS:
            given = RANGES[kind.name]
            bound = "at least" if kind.is_least else "at most"
            self._boxes[kind.name] = server.gui.add_checkbox(
                f"{kind.label[0].upper()}{kind.label[1:]}",
                False,
                hint=f"{given.hint} Untick to lift.",
            )
            self._sliders[kind.name] = server.gui.add_slider(
                f"{bound} ({kind.shown_unit})",
                given.low,
                given.high,
                given.step,
                given.usual,
                hint=given.hint,
                visible=False,
            )
            self._boxes[kind.name].on_update(with_value(partial(self._ticked, kind)))
            self._sliders[kind.name].on_update(with_value(partial(self._slid, kind)))

    def show(self, edited: Edited) -> None:
        """Set boxes and sliders to the limits of what is edited."""
        self._edited = edited
        for kind in KINDS:
            value = getattr(edited.problem.limits, kind.name)
            box, slider = self._boxes[kind.name], self._sliders[kind.name]
            box.value = value is not None
            box.visible = kind.name not in ROTORS or edited.vehicle is not None
            slider.visible = value is not None
            if value is None:
                continue
            shown = float(kind.shown(value))
            low, high, step = self._range(kind, edited, shown)
            slider.min, slider.max, slider.step = low, high, step
            slider.value = shown

    def _range(self, kind: LimitKind, edited: Edited, value: float) -> tuple[float, float, float]:
        given = RANGES[kind.name]
        low, high, step = given.low, given.high, given.step
        if kind.name in ROTORS and edited.vehicle is not None:
            hover = edited.vehicle.mass * GRAVITY / 4.0
            step = _round_step(hover / 200.0)
            if kind.name == "rotor_thrust":
                low, high = hover + step, 4.0 * hover
            else:
                low, high = 0.0, hover - step
        if value > high:
            high = _bound(kind, WIDEN * value)
        return min(low, value), high, step

    def _ticked(self, kind: LimitKind, on: bool) -> None:
        if self._edited is not None:
            self._changed(kind.name, self._usual(kind) if on else None, False)

    def _usual(self, kind: LimitKind) -> float:
        """Where a limit begins that was not set: as the vehicle has it by default, or as usual."""
        vehicle = None if self._edited is None else self._edited.vehicle
        if vehicle is not None and kind.name in ROTORS:
            own: Limits = vehicle.on_rotors().limits
            return float(getattr(own, kind.name))
        return _si(kind, RANGES[kind.name].usual)

    def _slid(self, kind: LimitKind, value: float) -> None:
        self._changed(kind.name, _si(kind, value), True)


def _si(kind: LimitKind, value: float) -> float:
    """A value that is shown, in the unit of the kind."""
    return math.radians(value) if kind.unit == "rad" else value


def _bound(kind: LimitKind, value: float) -> float:
    """The same, within what the kind can be at all."""
    if kind.name == "least_thrust_acceleration":
        return min(value, RANGES[kind.name].high)
    return value


def _round_step(step: float) -> float:
    """The next power of ten below."""
    return 10.0 ** math.floor(math.log10(step))
