"""The page: what is edited, what is planned, and what of it is shown. All of it on one thread."""

import math
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from peakflight.errors import PeakflightError
from peakflight.page import files
from peakflight.page.asking import Planner, Shown
from peakflight.page.camera import Cameras
from peakflight.page.drawing import Drawing
from peakflight.page.edited import Edited
from peakflight.page.flight_panel import FlightPanel
from peakflight.page.handles import Handles, Phase
from peakflight.page.header import EARLIER, Summary, badge
from peakflight.page.history import History
from peakflight.page.placing import Place, place_after, place_in_sight
from peakflight.page.plan_panel import PlanPanel
from peakflight.page.playback import Playback
from peakflight.page.saving import Saving
from peakflight.page.scene import Scene
from peakflight.page.thread import PageThread
from peakflight.result import Plan

FRAME = 1.0 / 30.0
"""Between positions of the vehicle, s."""
BUSY_AFTER = 0.4
"""How long planning goes on before the page says so, s."""
SLIDING = "limit"
"""What gestures of sliders begin with: they end when the slider has rested."""


class Page:
    """One course for everyone who looks at it."""

    def __init__(self, server: viser.ViserServer, edited: Edited) -> None:
        self._server = server
        self._history = History(edited)
        self._chosen = 0
        self._drawing: Drawing | None = None
        self._answered: Edited | None = None
        self._is_grey = False
        self._shown: Shown | None = None
        self._accepted: Drawing | None = None
        self._error = self._refused = self._notice = ""
        self._views = {"legs": False, "accepted": True, "rings": True}
        self._adds_by_click = False
        self.thread = PageThread(self._failed)
        self.planner = Planner(self._planned, self._noticed)
        self._scene, self._cameras = Scene(server), Cameras(server)
        self._handles = Handles(server, moved=self.move, chose=self.choose)
        self._panel = PlanPanel(server, self)
        self._flight = FlightPanel(
            server,
            played=self.play,
            sought=self.seek,
            paced=self.set_pace,
            viewed=self.view,
            fitted=self.fit,
        )
        self._playback = Playback(self._scene, self._flight)
        server.scene.on_click()(self._clicked(always=False))
        server.scene.on_click(modifier="cmd/ctrl")(self._clicked(always=True))
        self._closed = threading.Event()
        self._clock = threading.Thread(target=self._tick, name="peakflight clock", daemon=True)
        self._post(self._begin)
        self._clock.start()

    @property
    def edited(self) -> Edited:
        """What is being edited."""
        return self._history.present

    @property
    def drawn(self) -> Plan | None:
        """The plan that is drawn."""
        return None if self._drawing is None else self._drawing.plan

    @property
    def summary(self) -> Summary:
        """What the header says."""
        shown, accepted = self._shown, self._accepted
        busy, pending = self.planner.busy, not self.planner.idle
        return Summary(
            plan=self.drawn,
            fresh=self._drawing is not None and self._answered is self.edited,
            follows=self._history.gesture != "" and pending,
            pending=pending,
            whole=shown is not None and shown.whole,
            error=self._error,
            refused=self._refused,
            busy=busy if busy is not None and busy > BUSY_AFTER else None,
            notice=self._notice,
            guess=None if shown is None else shown.guess,
            accepted=None if accepted is None else accepted.plan.duration,
            seconds=0.0 if shown is None else shown.seconds,
        )

    def close(self) -> None:
        """End threads and processes."""
        self._closed.set()
        self._clock.join()
        self.planner.close()
        self.thread.close()

    # What a person can do: called from any thread, done on the page's own.

    def undo(self) -> None:
        """Take the last edit back."""
        self._post(lambda: self._go(self._history.undo()))

    def redo(self) -> None:
        """Bring an edit again."""
        self._post(lambda: self._go(self._history.redo()))

    def accept(self) -> None:
        """Keep the plan that is drawn, to compare with."""
        self._post(self._accept)

    def cancel(self) -> None:
        """Stop planning."""
        self.planner.cancel()
        self._post(self._show_header)

    def choose(self, index: int) -> None:
        """Choose a waypoint."""
        self._post(lambda: self._choose(index))

    def move(self, index: int, position: np.ndarray, phase: Phase) -> None:
        """Drag a waypoint."""
        if phase == "end":
            self._post(lambda: self._end_move(index, position))
        else:
            key = ("move", index) if phase == "update" else None
            self._post(
                lambda: self._edit(
                    lambda now: now.move(index, position), f"move {index}", rests=False
                ),
                key,
            )

    def place(self, position: tuple[float, float, float]) -> None:
        """Put the chosen waypoint somewhere."""
        self._post(lambda: self._edit(lambda now: now.move(self._chosen, position)))

    def turn(self, degrees: float) -> None:
        """Ask for a yaw at the chosen waypoint."""
        self._post(lambda: self._edit(lambda now: now.turn(self._chosen, math.radians(degrees))))

    def insert_after(self) -> None:
        """Add a waypoint after the chosen one."""
        self._post(self._insert_after)

    def append(self) -> None:
        """Add a waypoint at the end."""
        self._post(lambda: self._edit(lambda now: now.append(), choose=-1))

    def delete(self) -> None:
        """Take the chosen waypoint out."""
        self._post(lambda: self._edit(lambda now: now.delete(self._chosen)))

    def shift(self, by: int) -> None:
        """Pass the chosen waypoint earlier or later."""
        self._post(lambda: self._shift(by))

    def add_by_click(self, on: bool) -> None:
        """Whether a click adds a waypoint."""
        self._adds_by_click = on

    def fly(self, name: str | None) -> None:
        """Let another vehicle fly."""
        self._post(lambda: self._edit(lambda now: now.fly_named(name)))

    def rotors_alone(self) -> None:
        """Limit the vehicle's rotors themselves."""
        self._post(
            lambda: self._edit(
                lambda now: now if now.vehicle is None else now.fly(now.vehicle.on_rotors())
            )
        )

    def limit(self, name: str, value: float | None, moving: bool) -> None:
        """Set a limit, in SI units, or lift it."""
        gesture = f"{SLIDING} {name}" if moving else ""
        self._post(
            lambda: self._edit(lambda now: now.limit({name: value}), gesture, rests=not moving),
            key=gesture or None,
        )

    def plan_by(self, **changes: Any) -> None:
        """Plan in another way."""
        self._post(lambda: self._edit(lambda now: now.plan_by(**changes)))

    def head(self, policy: str, degrees: float, point: tuple[float, ...]) -> None:
        """Ask for another yaw."""
        self._post(
            lambda: self._edit(lambda now: now.head_by(policy, math.radians(degrees), point))
        )

    def play(self, on: bool) -> None:
        """Fly, or stop."""
        self._post(lambda: self._playback.play(on))

    def seek(self, seconds: float) -> None:
        """Look at another time, s."""
        self._post(lambda: self._playback.seek(seconds), key="seek")

    def set_pace(self, pace: float) -> None:
        """Play faster or slower than it is."""
        self._post(lambda: self._playback.set_pace(pace))

    def fit(self, side: str, client: viser.ClientHandle) -> None:
        """Show all of the course to whoever asks, from a side."""
        self._post(lambda: self._cameras.fit(self._extent(), client, side))

    def view(self, name: str, on: bool) -> None:
        """Show something, or not."""
        self._post(lambda: self._view(name, on))

    def load(self, name: str, content: bytes, client: Any) -> None:
        """Edit what was uploaded."""
        self._post(lambda: self._load(name, content, client))

    def save(self, what: str, client: Any) -> None:
        """Send a file to whoever asked for it."""
        self._post(lambda: self._save(what, client))

    def say(self, text: str, *, good: bool, client: Any = None) -> None:
        """Show what became of a file, to everyone, and to whoever asked as a notification."""
        self._post(lambda: self._panel.say(text, good=good))
        if client is not None and not good:
            client.add_notification("Refused", text, color="red", auto_close_seconds=12.0)

    # What is done, on the page's own thread.

    def _post(self, deed: Callable[[], None], key: object = None) -> None:
        self.thread.post(deed, key)

    def _begin(self) -> None:
        """Show a course that was not there before, to everyone, and have it planned."""
        edited = self.edited
        self._chosen = min(1, len(edited.waypoints) - 1)
        self._error = self._refused = ""
        self._drawing = self._answered = self._shown = self._accepted = None
        self._scene.clear()
        self._playback.clear()
        self._lay_ground()
        self._cameras.frame(edited.waypoints)
        self._handles.show(edited.waypoints, self._chosen, resize=True)
        self._panel.show_edited(edited, self._chosen)
        self._show_header()
        self.planner.ask(edited)

    def _lay_ground(self) -> None:
        """Draw the ground for the course as it is, if what is there does not suit it."""
        text = self._scene.set_ground(self.edited.waypoints)
        if text is not None:
            self._panel.show_ground(text)

    def _extent(self) -> np.ndarray:
        """(n, 3) m, all that there is to look at."""
        waypoints = self.edited.waypoints
        return waypoints if self._drawing is None else np.vstack([waypoints, self._drawing.path])

    def _edit(
        self,
        change: Callable[[Edited], Edited],
        gesture: str = "",
        *,
        rests: bool = True,
        choose: int | None = None,
    ) -> None:
        """Go on to a changed course, or say why not."""
        try:
            edited = change(self.edited)
        except PeakflightError as error:
            self._refused = str(error)
            self._handles.show(self.edited.waypoints, self._chosen)
            self._panel.show_edited(self.edited, self._chosen)
            self._show_header()
            return
        if edited is self.edited:
            return
        if choose is not None:
            self._chosen = choose % len(edited.waypoints)
        self._go(self._history.do(edited, gesture), rests=rests)

    def _go(self, history: History, *, rests: bool = True) -> None:
        """Show another state, and have it planned."""
        if history.present is self.edited:
            self._history = history
            return
        before, edited = self.edited, history.present
        self._history = history
        self._error = self._refused = ""
        if edited.is_other_than(before):
            self._begin()
            return
        self.planner.ask(edited, rests=rests)
        self._chosen = min(self._chosen, len(edited.waypoints) - 1)
        self._handles.show(edited.waypoints, self._chosen)
        if rests:
            self._lay_ground()
            self._panel.show_edited(edited, self._chosen)
        else:
            self._panel.show_chosen(edited, self._chosen)
        self._show_header()

    def _end_move(self, index: int, position: np.ndarray) -> None:
        """A waypoint is let go."""
        self._edit(lambda now: now.move(index, position), f"move {index}", rests=False)
        self._history = self._history.rest()
        self.planner.rest()
        self._lay_ground()
        self._panel.show_edited(self.edited, self._chosen)
        self._handles.show(self.edited.waypoints, self._chosen, resize=True)

    def _choose(self, index: int) -> None:
        if 0 <= index < len(self.edited.waypoints) and index != self._chosen:
            self._chosen = index
            self._handles.show(self.edited.waypoints, index)
            self._panel.show_chosen(self.edited, index)

    def _insert_after(self) -> None:
        """Add a waypoint in the middle of the next leg."""
        if self._chosen == len(self.edited.waypoints) - 1:
            self._edit(lambda now: now.append(), choose=-1)
        else:
            self._add(place_after(self.edited, self._drawing, self._chosen))

    def _add(self, place: Place) -> None:
        self._edit(lambda now: now.insert(*place), choose=place.to)

    def _shift(self, by: int) -> None:
        to = self._chosen + by
        if 0 <= to < len(self.edited.waypoints):
            self._edit(lambda now: now.reorder(self._chosen, to), choose=to)

    def _clicked(self, *, always: bool) -> Callable[[Any], Any]:
        async def callback(event: Any) -> None:
            if always or self._adds_by_click:
                origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
                self._post(
                    lambda: self._add(place_in_sight(self.edited, self._drawing, origin, direction))
                )

        return callback

    def _accept(self) -> None:
        if self._drawing is None or not self._drawing.plan.report.feasible:
            return
        self._accepted = self._drawing
        self._scene.draw_ghost(self._accepted, visible=self._views["accepted"])
        self._show_header()

    def _view(self, name: str, on: bool) -> None:
        self._views[name] = on
        if name == "rings":
            self._handles.show_rings(on)
        elif name == "accepted":
            self._scene.draw_ghost(self._accepted, visible=on)
        else:
            self._scene.label_legs(self._drawing if on else None)

    def _load(self, name: str, content: bytes, client: Any) -> None:
        try:
            edited, notes = files.load_upload(name, content, self.edited)
        except PeakflightError as error:
            self.say(str(error), good=False, client=client)
            return
        except Exception as error:  # whoever uploads must see it, too
            self.say(f"{name}: {_bug(error)}", good=False, client=client)
            raise
        self._history = self._history.do(edited)
        self._begin()
        count = len(edited.waypoints)
        self.say("; ".join((f"{name}: {count} waypoints", *notes)), good=True)

    def _save(self, what: str, client: Any) -> None:
        plan = self.drawn if self.summary.fresh else None
        Saving(self.say, what, plan, self.edited, client).start()

    # What the planner and the clock bring.

    def _planned(self, shown: Shown) -> None:
        self._post(lambda: self._draw(shown), key="draw")

    def _noticed(self, text: str) -> None:
        self._notice = text
        self._post(self._show_header, key="header")

    def _draw(self, shown: Shown) -> None:
        """Show a plan, if it is about what is edited or on the way there."""
        of_present = shown.edited is self.edited
        if not of_present and (shown.whole or shown.edited.is_other_than(self.edited)):
            return  # of a course that has gone on since
        self._notice = ""
        if shown.whole and self._history.gesture.startswith(SLIDING):
            self._history = self._history.rest()
        guess = shown.guess
        if guess is None and self._shown is not None and not shown.whole:
            guess = self._shown.guess
        self._shown = Shown(**{**shown.__dict__, "guess": guess})
        if shown.plan is None or shown.states is None:
            self._error = shown.error
            self._show_header()
            return
        self._error = ""
        self._drawing = drawing = Drawing(shown.plan, shown.states)
        self._answered, self._is_grey = shown.edited, False
        self._scene.draw_path(drawing)
        self._show_header()
        self._server.flush()
        self._playback.show(drawing)
        if shown.whole:
            self._panel.show_legs(drawing)
        if self._views["legs"]:
            self._scene.label_legs(drawing)

    def _show_header(self) -> None:
        """Say what is proven; the path is grey where it does not answer what is edited."""
        summary = self.summary
        self._panel.show_header(summary)
        is_grey = badge(summary)[0] == EARLIER
        if self._drawing is not None and is_grey is not self._is_grey:
            self._is_grey = is_grey
            self._scene.draw_path(self._drawing, fresh=not is_grey)

    def _tick(self) -> None:
        """Wake the page while there is something that moves."""
        said = pended = False
        while not self._closed.wait(FRAME):
            if self._playback.playing and self._server.get_clients():
                self._post(self._playback.advance, key="advance")
            busy, pending = self.planner.busy, not self.planner.idle
            is_long = busy is not None and busy > BUSY_AFTER
            if is_long or said or pending is not pended:
                self._post(self._show_header, key="header")
            said, pended = is_long, pending

    def _failed(self, error: Exception) -> None:
        self._error = _bug(error)
        self._show_header()


def _bug(error: Exception) -> str:
    return f"unexpected {type(error).__name__}: {error}; this is a bug in the page"
