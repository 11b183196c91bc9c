"""Flying the plan that is drawn: where the vehicle is, and the marks in the plots with it."""

import time

from peakflight.page.drawing import Drawing
from peakflight.page.flight_panel import FlightPanel
from peakflight.page.scene import Scene

PLOT_FRAME = 1.0 / 12.0
"""Between positions of the mark in the plots, s."""
PAUSE_AT_END = 0.8
"""Before the flight is played again, s."""


class Playback:
    """A time in the flight, which a person sets or which goes on by itself."""

    def __init__(self, scene: Scene, panel: FlightPanel) -> None:
        self._scene, self._panel = scene, panel
        self._drawing: Drawing | None = None
        self._seconds, self._pace = 0.0, 1.0
        self._looked = self._plotted = 0.0
        self.playing = False

    def show(self, drawing: Drawing) -> None:
        """Fly this from now on, at the same time if it lasts as long."""
        self._drawing = drawing
        self._scene.set_vehicle(drawing)
        self._seconds = min(self._seconds, drawing.plan.duration)
        self._scene.move_vehicle(drawing, self._seconds)
        self._panel.show(drawing)
        self._panel.plot(drawing, self._seconds)

    def clear(self) -> None:
        """There is nothing to fly."""
        self._drawing, self._seconds = None, 0.0

    def play(self, on: bool) -> None:
        """Fly, or stop."""
        drawing = self._drawing
        if drawing is not None and on and self._seconds >= drawing.plan.duration:
            self._seconds = 0.0
        self.playing, self._looked = on, time.perf_counter()
        self._panel.set_playing(on)

    def seek(self, seconds: float) -> None:
        """Look at another time, s."""
        self._seconds = seconds
        if self._drawing is not None:
            self._scene.move_vehicle(self._drawing, seconds)
            self._panel.plot(self._drawing, seconds)

    def set_pace(self, pace: float) -> None:
        """Play faster or slower than it is."""
        self._pace = pace

    def advance(self) -> None:
        """Fly on by what has passed."""
        now = time.perf_counter()
        passed, self._looked = now - self._looked, now
        drawing = self._drawing
        if drawing is None or not self.playing:
            return
        self._seconds += self._pace * passed
        if self._seconds > drawing.plan.duration + PAUSE_AT_END * self._pace:
            self._seconds = 0.0
        seconds = min(self._seconds, drawing.plan.duration)
        self._scene.move_vehicle(drawing, seconds)
        if now - self._plotted > PLOT_FRAME:
            self._plotted = now
            self._panel.set_time(seconds)
            self._panel.plot(drawing, seconds)
