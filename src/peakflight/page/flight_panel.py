"""The panel of the flight: the scale of speed, playback, and plots against the limits."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import viser

from peakflight.page import colours
from peakflight.page.callbacks import alone, with_client, with_value
from peakflight.page.camera import SIDES, USUAL
from peakflight.page.drawing import Curve, Drawing
from peakflight.page.header import speed_legend

WIDTH = 320
"""Pixels."""
PLOT_HEIGHT = 108
HEADROOM = 1.12
"""Top of a plot over the highest that it shows."""
SPEEDS = {
    "\u00bc \u00d7": 0.25,
    "\u00bd \u00d7": 0.5,
    "1 \u00d7": 1.0,
    "2 \u00d7": 2.0,
    "4 \u00d7": 4.0,
}
"""Of playback."""
SLIDER_STEP = 0.01
"""s."""


class FlightPanel:
    """Widgets of playback and plots."""

    def __init__(
        self,
        server: viser.ViserServer,
        *,
        played: Callable[[bool], None],
        sought: Callable[[float], None],
        paced: Callable[[float], None],
        viewed: Callable[[str, bool], None],
        fitted: Callable[[str, viser.ClientHandle], None],
    ) -> None:
        self._server = server
        self._plots: dict[str, Any] = {}
        self._top = 0.0
        self._drawn: tuple[Curve, ...] = ()
        panel = server.gui.add_panel()
        self._tab = panel.add_tab("Flight", viser.Icon.PLANE_DEPARTURE)
        with self._tab:
            self._legend = server.gui.add_html("")
            self._play = server.gui.add_button(
                "Play", icon=viser.Icon.PLAYER_PLAY, hint="Fly the plan, or stop. Key: space."
            )
            self._slider = server.gui.add_slider(
                "Time (s)", 0.0, 1.0, SLIDER_STEP, 0.0, hint="Where the vehicle is drawn."
            )
            self._pace = server.gui.add_dropdown(
                "Pace",
                tuple(SPEEDS),
                initial_value="1 \u00d7",
                hint="How fast the flight is played.",
            )
            view = server.gui.add_button_group(
                "View", tuple(SIDES), hint="Show all of the course, to you alone. Key: F fits."
            )
            with server.gui.add_folder("Show", expand_by_default=False):
                for name, label, on, hint in VIEWS:
                    box = server.gui.add_checkbox(label, on, hint=hint)
                    box.on_update(with_value(partial(viewed, name)))
        panel.dock_left()
        panel.set_width(WIDTH)
        self.playing = False
        self._play.on_click(alone(lambda: played(not self.playing)))
        self._slider.on_update(with_value(sought))
        self._pace.on_update(with_value(lambda value: paced(SPEEDS[value])))
        view.on_click(with_client(lambda client: fitted(view.value, client)))
        command = server.gui.add_command("Play or stop", hotkey="space")
        command.on_trigger(alone(lambda: played(not self.playing)))
        command = server.gui.add_command("Fit view", hotkey="F")
        command.on_trigger(with_client(partial(fitted, USUAL)))

    def set_playing(self, playing: bool) -> None:
        """Say whether it plays."""
        self.playing = playing
        self._play.label = "Stop" if playing else "Play"
        self._play.icon = viser.Icon.PLAYER_PAUSE if playing else viser.Icon.PLAYER_PLAY

    def show(self, drawing: Drawing) -> None:
        """Draw the curves of a plan."""
        if abs(drawing.top_speed - self._top) > 1e-9:
            self._top = drawing.top_speed
            self._legend.content = speed_legend(self._top)
        end = max(round(drawing.plan.duration, 2), 2.0 * SLIDER_STEP)
        if self._slider.max != end:
            self._slider.max = end
        self._drawn = drawing.curves
        wanted = {curve.name for curve in self._drawn}
        for name in set(self._plots) - wanted:
            self._plots.pop(name).remove()

    def plot(self, drawing: Drawing, seconds: float) -> None:
        """Draw the plots, with the mark of a time, s."""
        times = drawing.curve_times
        for curve in drawing.curves:
            data, top = _data(times, curve, seconds)
            scales = {
                "x": {"time": False, "range": (0.0, float(times[-1]))},
                "y": {"range": (0.0, top)},
            }
            plot = self._plots.get(curve.name)
            if plot is None or len(plot.data) != len(data):
                if plot is not None:
                    plot.remove()
                with self._tab:
                    self._plots[curve.name] = self._add(curve, data, scales)
                continue
            plot.data = data
            if plot.scales != scales:
                plot.scales = scales

    def set_time(self, seconds: float) -> None:
        """Move the slider."""
        self._slider.value = min(max(round(seconds, 2), 0.0), self._slider.max)

    def _add(self, curve: Curve, data: tuple[np.ndarray, ...], scales: Any) -> Any:
        several = len(curve.values) > 1
        series: list[Any] = [{}]
        for index in range(len(curve.values)):
            stroke = colours.OTHERS[index] if several else colours.CURVE
            series.append(
                {"stroke": stroke, "width": 1.2 if several else 1.8, "points": {"show": False}}
            )
        line = {"stroke": colours.BAD, "width": 1.2, "dash": (6, 4), "points": {"show": False}}
        series += [line] * len(curve.limits)
        series.append(
            {"stroke": colours.INK, "width": 1.2, "points": {"show": False}, "spanGaps": False}
        )
        axis = {
            "font": "11px sans-serif",
            "stroke": colours.QUIET,
            "size": 30,
            "grid": {"stroke": "#edf0f3", "width": 1},
            "ticks": {"show": False},
        }
        return self._server.gui.add_uplot(
            data,
            tuple(series),
            title=curve.title,
            scales=scales,
            axes=(axis | {"size": 22}, axis | {"size": 44}),
            legend={"show": False},
            height=PLOT_HEIGHT,
            padding=(2, 10, 0, 0),
            order=BELOW + ORDER.get(curve.name, len(ORDER)),
        )


VIEWS = (
    ("legs", "Leg times and limits", False, "Write time and nearest limit beside each leg."),
    ("accepted", "Accepted plan, in grey", True, "The plan that you accepted, to compare with."),
    ("rings", "Rings", True, "Rings at the waypoints, facing the way that they are passed."),
)
"""What can be shown: name, label, whether it is at first, hint."""
BELOW = 1e9
"""Place of the first plot: after all that viser has counted, over all pages of a process."""
ORDER = {"speed": 1, "thrust_acceleration": 2, "jerk": 3, "snap": 4}


def _data(times: np.ndarray, curve: Curve, seconds: float) -> tuple[tuple[np.ndarray, ...], float]:
    """Times, values, limits and mark as columns, and the top of the plot."""
    top = HEADROOM * max(*(float(one.max()) for one in curve.values), *curve.limits, 1e-9)
    lines = tuple(np.full(len(times), limit) for limit in curve.limits)
    mark = np.full(len(times), np.nan)
    at = min(int(np.searchsorted(times, seconds)), len(times) - 2)
    mark[at : at + 2] = (0.0, top)
    return (times, *curve.values, *lines, mark), top
