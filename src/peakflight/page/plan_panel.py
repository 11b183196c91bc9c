"""The panel of the plan: header, undo, the chosen waypoint, limits, method, legs, files."""

import math
from functools import partial
from typing import Any, Protocol

import numpy as np
import viser

from peakflight.formats import FLIGHT_FORMATS
from peakflight.methods import METHODS
from peakflight.page.callbacks import alone, with_client, with_value
from peakflight.page.drawing import Drawing
from peakflight.page.edited import COSTS, Edited, Pieces
from peakflight.page.header import Summary, course_line, header, legs_table, message
from peakflight.page.limits_panel import LimitsPanel
from peakflight.vehicles import VEHICLES
from peakflight.yaw import Heading

WIDTH = 360
"""Pixels."""
NO_VEHICLE = "none, limits alone"
PIECES: dict[str, Pieces] = {"where it pays": "auto", "1": 1, "2": 2, "3": 3, "4": 4, "6": 6}
YAWS = {
    "not asked for": "",
    "an angle": "fixed",
    "along the flight": "velocity",
    "towards a point": "point",
    "at each waypoint": "waypoints",
    "free": "free",
}
"""What is shown, and the policy of a `Heading`."""
MOST_EFFORT = 0.01


class Actions(Protocol):
    """What a person can do; called from the server's threads."""

    def undo(self) -> None: ...  # noqa: D102
    def redo(self) -> None: ...  # noqa: D102
    def accept(self) -> None: ...  # noqa: D102
    def cancel(self) -> None: ...  # noqa: D102
    def choose(self, index: int) -> None: ...  # noqa: D102
    def place(self, position: tuple[float, float, float]) -> None: ...  # noqa: D102
    def turn(self, degrees: float) -> None: ...  # noqa: D102
    def insert_after(self) -> None: ...  # noqa: D102
    def append(self) -> None: ...  # noqa: D102
    def delete(self) -> None: ...  # noqa: D102
    def shift(self, by: int) -> None: ...  # noqa: D102
    def add_by_click(self, on: bool) -> None: ...  # noqa: D102
    def fly(self, name: str | None) -> None: ...  # noqa: D102
    def rotors_alone(self) -> None: ...  # noqa: D102
    def limit(self, name: str, value: float | None, moving: bool) -> None: ...  # noqa: D102
    def plan_by(self, **changes: Any) -> None: ...  # noqa: D102
    def head(self, policy: str, degrees: float, point: tuple[float, ...]) -> None: ...  # noqa: D102
    def load(self, name: str, content: bytes, client: Any) -> None: ...  # noqa: D102
    def save(self, what: str, client: Any) -> None: ...  # noqa: D102


class PlanPanel:
    """Widgets of everything that is asked for."""

    def __init__(self, server: viser.ViserServer, actions: Actions) -> None:
        self._do = actions
        gui = server.gui
        gui.set_panel_label("peakflight")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)
        self._header = gui.add_html("")
        steps = gui.add_button_group(
            "Edits", ("Undo", "Redo"), hint="Take the last edit back, or bring it again."
        )
        steps.on_click(
            with_value(lambda word: actions.undo() if word == "Undo" else actions.redo())
        )
        self._accept = gui.add_button(
            "Accept this plan",
            color="teal",
            icon=viser.Icon.CHECK,
            hint="Keep it, in grey, to compare what you change next with it.",
        )
        self._accept.on_click(alone(actions.accept))
        self._cancel = gui.add_button(
            "Stop planning",
            icon=viser.Icon.X,
            color="red",
            visible=False,
            hint="Stop the solve at hand; what is drawn stays.",
        )
        self._cancel.on_click(alone(actions.cancel))
        tabs = gui.add_tab_group()
        with tabs.add_tab("Course"):
            self._course_tab(gui)
        with tabs.add_tab("Limits"):
            self._limits_tab(server)
        with tabs.add_tab("Method"):
            self._method_tab(gui)
        with tabs.add_tab("Legs"):
            gui.add_markdown(
                "The limits that each leg reaches, and for which part of its time. Raise the first "
                "one to fly faster."
            )
            self._legs = gui.add_html("")
        with tabs.add_tab("Files"):
            self._files_tab(gui)
        for label, key, modifier, deed in (
            ("Undo", "Z", "cmd/ctrl", actions.undo),
            ("Redo", "Y", "cmd/ctrl", actions.redo),
        ):
            gui.add_command(label, hotkey=key, modifier=modifier).on_trigger(alone(deed))

    def _course_tab(self, gui: Any) -> None:
        do = self._do
        self._count = gui.add_html("")
        self._index = gui.add_number(
            "Waypoint", 0, min=0, max=1, step=1, hint="The chosen one; or click a ball."
        )
        self._index.on_update(with_value(lambda index: do.choose(int(index))))
        self._position = gui.add_vector3(
            "x, y, z (m)", (0.0, 0.0, 0.0), step=0.01, hint="Where it is; z is up."
        )
        self._position.on_update(with_value(do.place))
        self._yaw = gui.add_number(
            "Yaw (°)", 0.0, step=1.0, hint="Where the nose points there; turns yaw at waypoints on."
        )
        self._yaw.on_update(with_value(lambda degrees: do.turn(float(degrees))))
        adds = gui.add_button_group(
            "Add",
            ("After it", "At the end"),
            hint="A waypoint in the middle of the next leg, or beyond the last one.",
        )
        adds.on_click(
            with_value(lambda word: do.insert_after() if word == "After it" else do.append())
        )
        order = gui.add_button_group(
            "Order", ("Earlier", "Later"), hint="Pass it one place earlier or later."
        )
        order.on_click(with_value(lambda word: do.shift(-1 if word == "Earlier" else 1)))
        gui.add_button(
            "Delete it", icon=viser.Icon.TRASH, color="gray", hint="Take the chosen waypoint out."
        ).on_click(alone(do.delete))
        click = gui.add_checkbox(
            "Add by clicking",
            False,
            hint="A click on the path adds a waypoint to that leg; elsewhere, at the end of the "
            "course, at the height of its last waypoint. Ctrl-click does so at any time.",
        )
        click.on_update(with_value(do.add_by_click))
        self._ground = gui.add_markdown("")

    def _limits_tab(self, server: viser.ViserServer) -> None:
        gui, do = server.gui, self._do
        self._vehicle = gui.add_dropdown(
            "Vehicle",
            (NO_VEHICLE, *VEHICLES),
            initial_value=NO_VEHICLE,
            hint="What flies. It brings limits that it can keep, which you can change below.",
        )
        self._vehicle.on_update(
            with_value(lambda name: do.fly(None if name == NO_VEHICLE else name))
        )
        self._rotors = gui.add_button(
            "Limit its rotors themselves",
            visible=False,
            hint="Rotor thrusts and body rate in place of the limits that stand for them: faster, "
            "with nothing left for control.",
        )
        self._rotors.on_click(alone(do.rotors_alone))
        self._limits = LimitsPanel(server, do.limit)

    def _method_tab(self, gui: Any) -> None:
        do = self._do
        self._method = gui.add_dropdown(
            "Method",
            tuple(METHODS),
            initial_value="joint",
            hint="; ".join(f"{name}: {what}" for name, what in METHODS.items()),
        )
        self._method.on_update(with_value(lambda name: do.plan_by(method=name)))
        self._pieces = gui.add_dropdown(
            "Pieces a leg",
            tuple(PIECES),
            initial_value="where it pays",
            hint="Polynomials in each leg, of method joint: more fly faster and make larger files.",
        )
        self._pieces.on_update(with_value(lambda word: do.plan_by(pieces=PIECES[word])))
        self._cost = gui.add_dropdown(
            "Cost",
            COSTS,
            initial_value="jerk",
            hint="What splines keep small, and what smoothness weighs.",
        )
        self._cost.on_update(with_value(lambda word: do.plan_by(minimize=word)))
        self._effort = gui.add_number(
            "Smoothness",
            0.0,
            min=0.0,
            step=0.0001,
            hint="Weight of the cost beside the time, of method joint: 0 is the fastest.",
        )
        self._effort.on_update(with_value(lambda weight: do.plan_by(effort=float(weight))))
        self._policy = gui.add_dropdown(
            "Yaw",
            tuple(YAWS),
            initial_value="not asked for",
            hint="Where the nose points during the flight.",
        )
        self._angle = gui.add_number("Angle (°)", 0.0, step=1.0, visible=False, hint="Of the nose.")
        self._point = gui.add_vector3(
            "Point (m)", (0.0, 0.0, 0.0), step=0.1, visible=False, hint="What the nose looks at."
        )
        for widget in (self._policy, self._angle, self._point):
            widget.on_update(with_value(lambda _: self._head()))

    def _head(self) -> None:
        self._do.head(YAWS[self._policy.value], float(self._angle.value), self._point.value)

    def _files_tab(self, gui: Any) -> None:
        do = self._do
        self._message = gui.add_html("")
        upload = gui.add_upload_button(
            "Load a course or plan",
            icon=viser.Icon.UPLOAD,
            hint="A course as CSV (x,y,z a line), YAML or JSON, or a plan.json.",
        )
        upload.on_upload(
            with_client(lambda client: do.load(upload.value.name, upload.value.content, client))
        )
        for label, what, hint in SAVES:
            gui.add_button(label, icon=viser.Icon.DOWNLOAD, hint=hint).on_click(
                with_client(partial(do.save, what))
            )
        names = tuple(FLIGHT_FORMATS)
        self._format = gui.add_dropdown(
            "Flight file", names, initial_value="crazyswarm", hint="What is to fly it, or read it."
        )
        self._about = gui.add_markdown("")
        self._format.on_update(with_value(self._explain))
        self._explain(self._format.value)
        gui.add_button(
            "Export the flight file",
            icon=viser.Icon.FILE_EXPORT,
            hint="Written, read back as its consumer reads it, and proven again.",
        ).on_click(with_client(lambda client: do.save(f"export:{self._format.value}", client)))

    def _explain(self, name: str) -> None:
        self._about.content = FLIGHT_FORMATS[name].summary

    def say(self, text: str, *, good: bool) -> None:
        """Show what became of a file."""
        self._message.content = message(text, good=good)

    def show_ground(self, text: str) -> None:
        """Say what the grid is."""
        self._ground.content = text

    def show_header(self, summary: Summary) -> None:
        """Show total time and what is proven."""
        self._header.content = header(summary)
        self._cancel.visible = summary.busy is not None
        plan = summary.plan
        self._accept.disabled = plan is None or not plan.report.feasible or not summary.fresh

    def show_legs(self, drawing: Drawing) -> None:
        """Show the table of legs."""
        self._legs.content = legs_table(drawing.legs)

    def show_chosen(self, edited: Edited, chosen: int) -> None:
        """Show the chosen waypoint."""
        last = len(edited.waypoints) - 1
        self._index.max = last
        self._index.value = chosen
        self._position.value = tuple(round(float(x), 4) for x in edited.waypoints[chosen])
        angles = edited.angles
        self._yaw.value = 0.0 if angles is None else round(math.degrees(angles[chosen]), 3)

    def show_edited(self, edited: Edited, chosen: int) -> None:
        """Set every widget to what is edited."""
        self.show_chosen(edited, chosen)
        count, length = len(edited.waypoints), float(edited.problem.leg_lengths.sum())
        self._count.content = course_line(edited.name, count, length)
        vehicle = edited.vehicle
        name = NO_VEHICLE if vehicle is None else vehicle.name
        if name not in self._vehicle.options:
            self._vehicle.options = (*self._vehicle.options, name)
        self._vehicle.value = name
        self._rotors.visible = vehicle is not None
        self._limits.show(edited)
        self._method.value = edited.method
        joint = edited.method == "joint"
        self._pieces.disabled = self._effort.disabled = not joint
        self._pieces.value = next(
            (word for word, pieces in PIECES.items() if pieces == edited.pieces), "where it pays"
        )
        cost = edited.problem.minimize
        if isinstance(cost, str) and cost in COSTS:
            self._cost.value = cost
        self._effort.value = edited.effort
        self._show_yaw(edited)

    def _show_yaw(self, edited: Edited) -> None:
        yaw = edited.problem.yaw
        policy = "" if yaw is None else yaw.policy if isinstance(yaw, Heading) else "waypoints"
        self._policy.value = next(word for word, known in YAWS.items() if known == policy)
        if isinstance(yaw, Heading) and yaw.angle is not None:
            self._angle.value = round(math.degrees(yaw.angle), 3)
        if isinstance(yaw, Heading) and yaw.point is not None:
            self._point.value = np.array(yaw.point)
        self._angle.visible, self._point.visible = policy == "fixed", policy == "point"


SAVES = (
    (
        "Save the course (CSV)",
        "course",
        "The waypoints: x, y, z in m, and yaw in rad if asked for.",
    ),
    (
        "Download a report (HTML)",
        "report",
        "One page that opens anywhere: plots to turn, tables, the proof. As peakflight report.",
    ),
    ("Save the plan (plan.json)", "plan", "Everything, with the proof; peakflight check reads it."),
)
"""Label, what is saved, hint."""
