"""What a plan looks like in space: ground, path, the accepted one beside it, legs, the vehicle."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import viser

from peakflight.limits import GRAVITY
from peakflight.page import colours, shapes
from peakflight.page.drawing import Drawing, Leg

PATH_WIDTH, GHOST_WIDTH = 5.0, 2.5
"""Pixels."""
CELL_CHOICES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
"""Sizes of a cell of the ground, m."""
CELLS = 24
"""Of them across a course, at most."""
SECTION = 5
"""Cells between stronger lines."""
ASIDE, OUTGROWN = 0.5, 1.5
"""How far a course may move, over its size, and how often it may be as large, on one ground."""
AXES = 0.02
"""Radius of the axes at the origin, which are as long as a cell, over that."""
SEEN = 0.022
"""Size of the vehicle over that of the course, at least, so that it can be seen."""
ARROW = 1.1
"""Length of a rotor's arrow as it hovers, over the vehicle's size."""
MOST_TIMES = 3
"""In one label."""
NEAR = 0.03
"""How far legs in one label may be apart, over the size of the course."""
MOST_LEG_LABELS = 80
"""Legs that are labelled; of more, every so many."""
LABEL = 0.8
"""Size of labels."""


class Scene:
    """The nodes of the scene that a plan says; handles are elsewhere."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._path: viser.LineSegmentsHandle | None = None
        self._ghost: viser.LineSegmentsHandle | None = None
        self._labels: list[viser.LabelHandle] = []
        self._vehicle: Any = None
        self._arrows: viser.ArrowsHandle | None = None
        self._vehicle_key: tuple[Any, ...] = ()
        self._size = 1.0
        self._ground: tuple[np.ndarray, float] | None = None
        server.scene.set_up_direction("+z")
        server.scene.world_axes.visible = False

    def clear(self) -> None:
        """Take away all that a plan says."""
        for node in (self._path, self._ghost, self._vehicle):
            if node is not None:
                node.visible = False
        self.label_legs(None)

    def set_ground(self, waypoints: np.ndarray) -> str | None:
        """Draw the ground at z = 0 below a course; what a cell is, or None if it stays."""
        low, high = waypoints.min(axis=0), waypoints.max(axis=0)
        centre, extent = (low + high) / 2.0, size_of(waypoints)
        if self._ground is not None:
            aside = float(np.linalg.norm(centre[:2] - self._ground[0]))
            grown = extent / self._ground[1]
            if aside < ASIDE * extent and 1.0 / OUTGROWN < grown < OUTGROWN:
                return None
        self._ground = (centre[:2], extent)
        cell = next((size for size in CELL_CHOICES if extent / size <= CELLS), CELL_CHOICES[-1])
        across = 3.0 * extent
        self._server.scene.add_grid(
            "/ground",
            width=across,
            height=across,
            cell_size=cell,
            section_size=SECTION * cell,
            cell_color=(222, 226, 231),
            section_color=(190, 197, 206),
            cell_thickness=1.0,
            section_thickness=1.3,
            plane_opacity=0.0,
            shadow_opacity=0.0,
            position=(*np.round(centre[:2] / (SECTION * cell)) * SECTION * cell, 0.0),
        )
        self._server.scene.add_frame(
            "/axes", axes_length=cell, axes_radius=AXES * cell, origin_radius=AXES * cell
        )
        return f"grid at z = 0: cells of {cell:g} m, strong lines every {SECTION * cell:g} m"

    def draw_path(self, drawing: Drawing, *, fresh: bool = True) -> None:
        """Draw the path of a plan: by speed if it is proven and of the course, else plain."""
        shown = drawing.colours
        if not drawing.plan.report.feasible:
            shown = np.broadcast_to(np.array(colours.REFUSED, dtype=np.uint8), shown.shape)
        elif not fresh:
            shown = np.broadcast_to(np.array(colours.GHOST, dtype=np.uint8), shown.shape)
        self._path = self._lines("/path", self._path, drawing.segments, shown, PATH_WIDTH)

    def draw_ghost(self, drawing: Drawing | None, *, visible: bool) -> None:
        """Draw the accepted path, or take it away."""
        if drawing is None or not visible:
            if self._ghost is not None:
                self._ghost.visible = False
            return
        grey = np.broadcast_to(np.array(colours.GHOST, dtype=np.uint8), drawing.segments.shape)
        self._ghost = self._lines("/accepted", self._ghost, drawing.segments, grey, GHOST_WIDTH)

    def label_legs(self, drawing: Drawing | None) -> None:
        """Write time and nearest limit beside each leg; None takes the labels away."""
        texts, places = [], np.empty((0, 3))
        if drawing is not None:
            times = drawing.plan.waypoint_times
            middles = drawing.plan.trajectory((times[:-1] + times[1:]) / 2.0)
            groups = sorted(set(together(middles, NEAR * size_of(middles))))
            groups = groups[:: -(-len(groups) // MOST_LEG_LABELS)]
            texts = [legs_text([drawing.legs[leg] for leg in group]) for group in groups]
            places = middles[[group[0] for group in groups]]
        for label in self._labels[len(texts) :]:
            label.remove()
        del self._labels[len(texts) :]
        for index, (text, place) in enumerate(zip(texts, places, strict=True)):
            if index < len(self._labels):
                self._labels[index].text, self._labels[index].position = text, place
                continue
            label = self._server.scene.add_label(
                f"/legs/{index}",
                text,
                position=place,
                font_screen_scale=LABEL,
                anchor="center-center",
            )
            self._labels.append(label)

    def set_vehicle(self, drawing: Drawing) -> None:
        """Draw what flies, if it is another one than before."""
        vehicle = drawing.flown
        key = (vehicle.rotor_positions, round(size_of(drawing.plan.problem.waypoints), 1))
        if key == self._vehicle_key:
            self._vehicle.visible = True
            return
        self._vehicle_key = key
        mesh, size = shapes.quadrotor(np.array(vehicle.rotor_positions))
        scale = max(1.0, SEEN * size_of(drawing.plan.problem.waypoints) / size)
        self._size = scale * size
        self._vehicle = self._server.scene.add_frame("/vehicle", show_axes=False)
        self._server.scene.add_mesh_trimesh("/vehicle/body", mesh, scale=scale)
        self._rotors = scale * np.pad(np.array(vehicle.rotor_positions), ((0, 0), (0, 1)))
        self._arrows = self._server.scene.add_arrows(
            "/vehicle/thrusts",
            self._arrow_points(np.full(4, vehicle.mass * GRAVITY / 4.0), drawing),
            colors=colours.THRUST,
            shaft_radius=0.045 * self._size,
            head_radius=0.12 * self._size,
            head_length=0.25 * self._size,
        )

    def move_vehicle(self, drawing: Drawing, seconds: float) -> None:
        """Put the vehicle where it is at a time, s, as it leans there, with its rotors' thrusts."""
        if self._vehicle is None or self._arrows is None:
            return
        position, attitude, thrusts = drawing.at(seconds)
        self._vehicle.position, self._vehicle.wxyz = position, attitude
        self._arrows.points = self._arrow_points(thrusts, drawing)

    def _arrow_points(self, thrusts: np.ndarray, drawing: Drawing) -> np.ndarray:
        """(4, 2, 3) m in the body frame; as long as the thrust is, over that of hovering."""
        vehicle = drawing.flown
        lengths = ARROW * self._size * thrusts / (vehicle.mass * GRAVITY / 4.0)
        ends = self._rotors + np.maximum(lengths, 1e-3)[:, None] * np.array([0.0, 0.0, 1.0])
        return np.stack([self._rotors, ends], axis=1).astype(np.float32)

    def _lines(
        self,
        name: str,
        lines: viser.LineSegmentsHandle | None,
        points: np.ndarray,
        shown: np.ndarray,
        width: float,
    ) -> viser.LineSegmentsHandle:
        """Lines with other points: the same node as long as there are as many."""
        shown = colours.for_lines(shown)
        if lines is None or lines.points.shape != points.shape:
            return self._server.scene.add_line_segments(
                name, points, shown, thickness=width, thickness_units="screen"
            )
        with self._server.atomic():
            lines.points, lines.colors, lines.visible = points, shown, True
        return lines


def size_of(waypoints: np.ndarray) -> float:
    """How large a course is, m: its diagonal, and never nothing."""
    return max(float(np.linalg.norm(np.ptp(waypoints, axis=0))), 0.5)


def together(points: np.ndarray, distance: float) -> list[tuple[int, ...]]:
    """(n,) for each of (n, 3) points all those that share a label with it: as near as this, m."""
    groups: list[list[int]] = []
    of: list[list[int]] = []
    for index, point in enumerate(points):
        firsts = points[[group[0] for group in groups]].reshape(-1, 3)
        near = np.linalg.norm(firsts - point, axis=1) < distance
        if near.any():
            group = groups[int(near.argmax())]
        else:
            group = []
            groups.append(group)
        group.append(index)
        of.append(group)
    return [tuple(group) for group in of]


def legs_text(legs: Sequence[Leg]) -> str:
    """What the label of a leg says, or of several in one place."""
    times = ", ".join(f"{leg.duration:.2f}" for leg in legs[:MOST_TIMES])
    more = ", ..." if len(legs) > MOST_TIMES else ""
    return f"{times}{more} s \u00b7 {legs[0].held[0].label}"
