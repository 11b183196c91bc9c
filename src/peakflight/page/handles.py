"""The waypoints as handles: balls to drag, numbers, rings across the path, arrows at one of them.

A ball that is dragged stays at its height; with Shift it goes straight up and down. The chosen one
has arrows beside it, along the axes.
"""

from collections.abc import Callable
from typing import Any, Literal, TypeAlias

import numpy as np
import viser

from peakflight.page import colours, shapes
from peakflight.page.scene import size_of, together

BALL, BALL_OF_LEG = 0.016, 0.14
"""Radius of a ball over the size of the course, and at most over a typical leg."""
RING = 2.6
"""Radius of a ring over that of a ball."""
MOST_NUMBERS = 60
"""Waypoints that are all numbered; of more, every tenth and the chosen one."""
GIZMO = 90.0
"""Size of the arrows, pixels."""
GRAZING = 0.12
"""Sine of the angle to the ground below which a line of sight says too little about it."""
FAR = 3.0
"""How far a ball may go in one drag, over the size of the course or its distance from the eye."""
Phase: TypeAlias = Literal["start", "update", "end"]
Moved: TypeAlias = Callable[[int, np.ndarray, Phase], None]
"""Told which waypoint goes where, (3,) m."""


class Handles:
    """The nodes of the waypoints. Callbacks come from the server's threads."""

    def __init__(
        self, server: viser.ViserServer, *, moved: Moved, chose: Callable[[int], None]
    ) -> None:
        self._server, self._moved, self._chose = server, moved, chose
        self._balls: Any = None
        self._rings: Any = None
        self._numbers: dict[int, viser.LabelHandle] = {}
        self._gizmo: viser.TransformControlsHandle | None = None
        self._waypoints = np.empty((0, 3))
        self._chosen = 0
        self._radius = 0.0
        self._grabbed: dict[int, np.ndarray] = {}
        self._rings_shown = True

    @property
    def radius(self) -> float:
        """Of a ball, m."""
        return self._radius

    def show(self, waypoints: np.ndarray, chosen: int, *, resize: bool = False) -> None:
        """Draw (n, 3) waypoints, m; `resize` fits the balls to the course anew."""
        same = len(waypoints) == len(self._waypoints) and self._balls is not None
        if resize or not same:
            legs = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
            radius = min(BALL * size_of(waypoints), BALL_OF_LEG * float(np.median(legs)))
            same = same and radius == self._radius
            self._radius = radius
        self._waypoints, self._chosen = waypoints, chosen
        positions = waypoints.astype(np.float32)
        rings = shapes.about(_headings(waypoints)).astype(np.float32)
        if not same:
            self._make(positions, rings)
        with self._server.atomic():
            self._balls.batched_positions = positions
            self._balls.batched_colors = self._ball_colours()
            self._rings.batched_positions = positions
            self._rings.batched_wxyzs = rings
            if self._gizmo is not None:
                self._gizmo.position = waypoints[chosen]
        self._number()

    def show_rings(self, visible: bool) -> None:
        """Whether rings are drawn around the waypoints."""
        self._rings_shown = visible
        if self._rings is not None:
            self._rings.visible = visible

    def _make(self, positions: np.ndarray, rings: np.ndarray) -> None:
        vertices, faces = shapes.ball()
        upright = np.tile(np.array([1.0, 0.0, 0.0, 0.0], dtype=np.float32), (len(positions), 1))
        self._balls = self._server.scene.add_batched_meshes_simple(
            "/waypoints",
            self._radius * vertices,
            faces,
            batched_wxyzs=upright,
            batched_positions=positions,
            batched_colors=self._ball_colours(),
            lod="off",
            cast_shadow=False,
        )
        self._balls.on_click(self._clicked)
        self._balls.on_drag("left")(self._dragged)
        self._balls.on_drag("left", modifier="shift")(self._lifted)
        vertices, faces = shapes.ring()
        self._rings = self._server.scene.add_batched_meshes_simple(
            "/rings",
            RING * self._radius * vertices,
            faces,
            batched_wxyzs=rings,
            batched_positions=positions,
            batched_colors=colours.RING,
            opacity=0.55,
            lod="off",
            side="double",
            cast_shadow=False,
            visible=self._rings_shown,
        )
        if self._gizmo is None:
            self._gizmo = self._server.scene.add_transform_controls(
                "/chosen",
                scale=GIZMO,
                fixed=True,
                line_width=3.0,
                disable_rotations=True,
                depth_test=False,
                position=positions[self._chosen],
            )
            self._gizmo.on_update(self._pulled)

    def _ball_colours(self) -> np.ndarray:
        shown = np.tile(np.array(colours.WAYPOINT, dtype=np.uint8), (len(self._waypoints), 1))
        shown[[0, -1]] = colours.END
        shown[self._chosen] = colours.CHOSEN
        return shown

    def _number(self) -> None:
        count = len(self._waypoints)
        every = 1 if count <= MOST_NUMBERS else 10
        shared = together(self._waypoints, self._radius)
        wanted = {shared[index][0] for index in (*range(0, count, every), self._chosen, count - 1)}
        for index in set(self._numbers) - wanted:
            self._numbers.pop(index).remove()
        lift = np.array([0.0, 0.0, 2.0 * self._radius])
        for index in wanted:
            place, text = self._waypoints[index] + lift, ", ".join(map(str, shared[index]))
            label = self._numbers.get(index)
            if label is None:
                self._numbers[index] = self._server.scene.add_label(
                    f"/numbers/{index}",
                    text,
                    position=place,
                    font_screen_scale=0.85,
                    anchor="bottom-center",
                )
                continue
            if not np.array_equal(label.position, place):
                label.position = place
            if label.text != text:
                label.text = text

    async def _clicked(self, event: Any) -> None:
        if event.instance_index is not None:
            self._chose(int(event.instance_index))

    async def _dragged(self, event: Any) -> None:
        """A drag over the ground, at the height of the waypoint."""
        self._follow(event, _on_level)

    async def _lifted(self, event: Any) -> None:
        """A drag up or down."""
        self._follow(event, _upright)

    def _follow(self, event: Any, place: Callable[..., np.ndarray]) -> None:
        index = event.instance_index
        if index is None or not 0 <= index < len(self._waypoints):
            return
        if event.phase == "start":
            self._grabbed[event.client_id] = self._waypoints[index].copy()
            self._chose(int(index))
        begin = self._grabbed.get(event.client_id)
        if begin is None:
            return
        shift = np.array(event.end_position) - np.array(event.start_position)
        eye = np.array(event.client.camera.position)
        self._moved(int(index), place(begin, shift, eye, size_of(self._waypoints)), event.phase)
        if event.phase == "end":
            self._grabbed.pop(event.client_id, None)

    async def _pulled(self, event: Any) -> None:
        """The arrows are dragged."""
        self._moved(self._chosen, np.array(event.target.position), event.phase)


def _on_level(begin: np.ndarray, shift: np.ndarray, eye: np.ndarray, extent: float) -> np.ndarray:
    """Where a line of sight meets the level of where it began.

    Parameters
    ----------
    begin, shift
        (3,) m, where the waypoint was, and by how much the pointer has moved from it in a plane
        across the sight.
    eye
        (3,) m.
    """
    sight = begin + shift - eye
    level = np.array([shift[0], shift[1], 0.0])
    if abs(sight[2]) > GRAZING * float(np.linalg.norm(sight)):
        along = (begin[2] - eye[2]) / sight[2]
        reached = eye + along * sight - begin
        if along > 0.0 and np.linalg.norm(reached) < FAR * max(
            extent, float(np.linalg.norm(begin - eye))
        ):
            level = np.array([reached[0], reached[1], 0.0])
    return begin + level


def _upright(begin: np.ndarray, shift: np.ndarray, eye: np.ndarray, extent: float) -> np.ndarray:
    """Straight above or below where it began; arguments as of `_on_level`."""
    del eye, extent
    return begin + np.array([0.0, 0.0, shift[2]])


def _headings(waypoints: np.ndarray) -> np.ndarray:
    """(n, 3) directions in which a path passes waypoints, by their neighbours."""
    ahead = np.vstack([waypoints[1:], waypoints[-1:]])
    behind = np.vstack([waypoints[:1], waypoints[:-1]])
    directions = ahead - behind
    still = np.linalg.norm(directions, axis=1) < 1e-9
    directions[still] = (1.0, 0.0, 0.0)
    return directions
