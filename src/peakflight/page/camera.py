"""Where cameras stand: at first, after another course is loaded, and when asked to show it all."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import viser

SIDES = {
    "Fit": np.array([-0.26, -0.75, 0.61]),
    "Top": np.array([0.0, -0.001, 1.0]),
    "Side": np.array([0.0, -1.0, 0.02]),
}
"""From a course to the eye: from behind, a little to the left and well above; from nearly straight
above, with x to the right; and from the side, with x to the right and z up."""
USUAL = "Fit"
FOV = np.radians(50.0)
"""Vertical angle of view, rad: narrower than viser's, so that balls at the edge stay round."""
FILLED = 0.8
"""Part of the view, across and upright, that a course fills; the rest is for labels."""
LEAST = 0.5
"""How near a camera goes to what it shows at most, m."""
NEAR, FAR = 1e-3, 50.0
"""What is drawn at all, over the distance to the course."""
USUAL_ASPECT = 0.7
"""Width over height of a view between both panels, for whoever is not there yet."""
SAME = 1e-3
"""How far a camera may be from where it was put and still count as there, over its distance."""
RECENT = 8
"""How many of the places where a camera was put are remembered."""


def framing(points: np.ndarray, aspect: float, side: str = USUAL) -> tuple[np.ndarray, np.ndarray]:
    """Where a camera stands, and what it looks at, so that it just sees a course.

    Parameters
    ----------
    points
        (n, 3) m, what is to be seen.
    aspect
        Width of the view over its height.
    side
        Of `SIDES`.

    Returns
    -------
    tuple of ndarray
        (3,) m each.

    Notes
    -----
    A point at r to the right of the middle, u above it and d towards the eye is seen from the
    distance D if |r| <= tan(fov / 2) aspect (D - d) and |u| <= tan(fov / 2) (D - d); the nearest
    such D, and the middle that allows it, follow from the extremes of d + r / t and d - r / t.
    Where that would be at a point, it is taken farther.
    """
    towards = SIDES[side] / np.linalg.norm(SIDES[side])
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    up = np.cross(towards, right)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    away = points - middle
    depth = away @ towards
    distance = float(depth.max()) + LEAST
    for axis, stretch in ((right, aspect), (up, 1.0)):
        slope = FILLED * np.tan(FOV / 2.0) * stretch
        high = float((depth + away @ axis / slope).max())
        low = float((depth - away @ axis / slope).max())
        distance = max(distance, (high + low) / 2.0)
        middle = middle + slope * (high - low) / 2.0 * axis
    return middle + distance * towards, middle


@dataclass(frozen=True, eq=False)
class _Framed:
    """How a camera was framed last."""

    aspect: float
    side: str
    places: tuple[np.ndarray, ...]
    """(3,) m, where it has been put of late: what a browser tells may be older than the last."""


class Cameras:
    """The cameras of all clients, and of those to come.

    A camera that nobody has moved since stays framed as its window changes its shape.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._points = np.zeros((1, 3))
        self._framed: dict[int, _Framed] = {}
        server.initial_camera.fov = float(FOV)
        server.on_client_connect(self._came)
        server.on_client_disconnect(self._left)

    def frame(self, points: np.ndarray) -> None:
        """Show everyone (n, 3) points, m."""
        self._points = points
        position, middle = framing(points, USUAL_ASPECT)
        near, far = _drawn(position, middle)
        camera = self._server.initial_camera
        camera.look_at, camera.position = tuple(middle), tuple(position)
        camera.near, camera.far = near, far
        for client in self._server.get_clients().values():
            self._put(client)

    def fit(self, points: np.ndarray, client: viser.ClientHandle, side: str) -> None:
        """Show one client (n, 3) points, m, from one of the `SIDES`."""
        self._points = points
        self._put(client, side)

    def _put(self, client: viser.ClientHandle, side: str = USUAL) -> None:
        camera = client.camera
        aspect = camera.aspect
        position, middle = framing(self._points, aspect, side)
        last = self._framed.get(client.client_id)
        places = (*(last.places if last else ()), position)[-RECENT:]
        self._framed[client.client_id] = _Framed(aspect, side, places)
        near, far = _drawn(position, middle)
        with client.atomic():
            camera.fov, camera.near, camera.far = float(FOV), near, far
            camera.up_direction = (0.0, 0.0, 1.0)
            camera.position = position
            camera.look_at = middle

    async def _came(self, client: viser.ClientHandle) -> None:
        client.camera.on_update(self._updated)
        self._put(client)

    async def _left(self, client: viser.ClientHandle) -> None:
        self._framed.pop(client.client_id, None)

    async def _updated(self, camera: Any) -> None:
        """A camera has moved, or its window has another shape."""
        framed = self._framed.get(camera.client.client_id)
        if framed is None or camera.aspect == framed.aspect:
            return
        reach = SAME * float(np.linalg.norm(camera.position - camera.look_at))
        if any(np.linalg.norm(camera.position - place) < reach for place in framed.places):
            self._put(camera.client, framed.side)


def _drawn(position: np.ndarray, middle: np.ndarray) -> tuple[float, float]:
    """Nearest and farthest that is drawn, m."""
    distance = float(np.linalg.norm(position - middle))
    return NEAR * distance, FAR * distance
