"""Where a camera stands from which all of a course is seen."""

import asyncio
from collections.abc import Callable
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("viser")

from peakflight.page.camera import FILLED, FOV, LEAST, SIDES, USUAL, Cameras, framing

BOX = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def seen(points: np.ndarray, aspect: float, side: str = USUAL) -> tuple[np.ndarray, np.ndarray]:
    """(n,) across and upright, from -1 to 1 in the view, of points in front of the camera."""
    eye, middle = framing(points, aspect, side)
    ahead = (middle - eye) / np.linalg.norm(middle - eye)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    away = points - eye
    depth = away @ ahead
    assert np.all(depth > 0.0)
    slope = np.tan(FOV / 2.0)
    return away @ right / depth / slope / aspect, away @ np.cross(right, ahead) / depth / slope


@given(
    seed=st.integers(0, 10_000),
    count=st.integers(1, 60),
    aspect=st.floats(0.3, 3.0),
    size=st.floats(1.0, 4.0).map(lambda power: 10.0**power),
    side=st.sampled_from(sorted(SIDES)),
)
def test_all_is_seen_and_no_nearer_would_do(
    seed: int, count: int, aspect: float, size: float, side: str
) -> None:
    rng = np.random.default_rng(seed)
    points = size * (rng.normal(size=(count, 3)) * rng.uniform(0.0, 1.0, 3) + rng.normal(size=3))
    across, upright = seen(points, aspect, side)
    most = np.abs([across, upright]).max()
    assert most <= FILLED + 1e-9
    eye, _ = framing(points, aspect, side)
    towards = SIDES[side] / np.linalg.norm(SIDES[side])
    nearest = ((eye - points) @ towards).min()
    assert nearest >= LEAST * (1.0 - 1e-9)
    if nearest > LEAST * (1.0 + 1e-9):
        assert most == pytest.approx(FILLED, abs=1e-9)


def test_a_tower_below_the_camera_is_seen_from_above_it() -> None:
    tower = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, 100.0]])
    across, upright = seen(tower, 1.0, "Top")
    assert np.abs([across, upright]).max() <= FILLED + 1e-9


def test_a_course_fills_the_view_from_edge_to_edge() -> None:
    across, upright = seen(BOX, 0.5)
    assert (across.min(), across.max()) == pytest.approx((-FILLED, FILLED))
    across, upright = seen(BOX, 2.0)
    assert (upright.min(), upright.max()) == pytest.approx((-FILLED, FILLED))


class Late:
    """A client whose browser tells the shape of its window before it has moved its camera."""

    def __init__(self, aspect: float) -> None:
        self.client_id, self.atomic = 7, nullcontext
        self.camera = SimpleNamespace(aspect=aspect, client=self, on_update=self._keep)

    def _keep(self, callback: Callable[[Any], Any]) -> None:
        self._callback = callback

    def tell(self, aspect: float, position: np.ndarray) -> None:
        self.camera.aspect, self.camera.position = aspect, position
        asyncio.run(self._callback(self.camera))


def test_a_camera_that_is_behind_stays_framed_and_one_that_was_moved_stays_where_it_is() -> None:
    server = SimpleNamespace(initial_camera=SimpleNamespace(), get_clients=dict)
    server.on_client_connect = lambda callback: setattr(server, "came", callback)
    server.on_client_disconnect = lambda callback: None
    cameras = Cameras(server)
    cameras.frame(BOX)
    late = Late(2.0)
    asyncio.run(server.came(late))
    first = late.camera.position
    late.tell(1.0, first)
    second = late.camera.position
    assert second == pytest.approx(framing(BOX, 1.0)[0])
    late.tell(0.5, first)  # not yet moved to the second
    assert late.camera.position == pytest.approx(framing(BOX, 0.5)[0])
    late.tell(0.7, second)
    assert late.camera.position == pytest.approx(framing(BOX, 0.7)[0])
    elsewhere = second + 3.0
    late.tell(2.0, elsewhere)
    assert np.array_equal(late.camera.position, elsewhere)
