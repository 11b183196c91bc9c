"""Where a camera stands from which all of a course is seen."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("viser")

from peakflight.page.camera import FILLED, FOV, LEAST, SIDES, USUAL, framing

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
    eye, middle = framing(points, aspect, side)
    if count > 1 and np.linalg.norm(eye - middle) > LEAST:
        assert most == pytest.approx(FILLED, abs=1e-9)


def test_a_course_fills_the_view_from_edge_to_edge() -> None:
    across, upright = seen(BOX, 0.5)
    assert (across.min(), across.max()) == pytest.approx((-FILLED, FILLED))
    across, upright = seen(BOX, 2.0)
    assert (upright.min(), upright.max()) == pytest.approx((-FILLED, FILLED))
