"""The figures show what the plan says, no text is over another, and files are written."""

import importlib
import itertools
import json
import math
import subprocess
import sys

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D
from scipy.interpolate import make_interp_spline

from peakflight import (
    GRAVITY,
    VEHICLES,
    History,
    InvalidFile,
    InvalidProblem,
    Limits,
    MissingExtra,
    Plan,
    Problem,
    Report,
    Status,
    Trajectory,
    planned_states,
)
from peakflight.figures import (
    course_figure,
    derivatives_figure,
    rotors_figure,
    save_figures,
    segment_times_figure,
)
from peakflight.figures.canvas import COLOURS, seconds
from peakflight.figures.view import View
from peakflight.labelling import even_step
from peakflight.palette import FAINT, LIMIT
from peakflight.planner import plan as solve

LIMITS = Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)
ALL_LIMITS = Limits(
    **LIMITS.to_dict(), tilt=0.8, least_thrust_acceleration=4.0, body_rate=4.0,
    angular_acceleration=30.0,
)  # fmt: skip
FIGURES = (course_figure, derivatives_figure, segment_times_figure)
TWISTY = np.array(
    [
        [0.0, 0.0, 1.0],
        [0.6, 0.5, 1.2],
        [0.2, 0.9, 1.0],
        [0.9, 1.3, 1.1],
        [3.2, 1.2, 1.4],
        [4.6, -0.4, 1.2],
        [3.2, -2.0, 1.0],
        [0.4, -2.0, 1.2],
        [-1.2, -0.6, 1.0],
    ]
)  # the public course tight_then_fast
GATES = np.array(
    [
        [-1.1, -1.6, 3.6],
        [9.2, 6.6, 1.0],
        [9.2, -4.0, 1.2],
        [-4.5, -6.0, 3.5],
        [-4.5, -6.0, 0.8],
        [4.75, -0.9, 1.2],
        [-2.8, 6.8, 1.2],
    ]
)
LAPS = np.concatenate(([[-5.0, 4.5, 1.2]], GATES, GATES, GATES[:6]))  # uzh_19wp
RING = np.array([[math.cos(a), math.sin(a), 0.0] for a in np.linspace(0.0, 6.2, 14)])


def walk(count):
    steps = np.random.default_rng(7).normal(size=(count, 3)) * [1.5, 1.5, 0.5]
    return np.cumsum(steps, axis=0)


def spline(waypoints, times):
    """The C4 quintic spline from rest to rest."""
    rest = [(1, np.zeros(3)), (2, np.zeros(3))]
    knots = np.concatenate(([0.0], np.cumsum(times)))
    quintic = make_interp_spline(knots, waypoints, k=5, bc_type=(rest, rest))
    orders = [quintic(knots[:-1], order) / math.factorial(order) for order in range(6)]
    return Trajectory(np.stack(orders, axis=1), times)


def norms(trajectory, count=400):
    """Name of limit to (K, count), from the definition and by other code than the figures'."""
    times = trajectory.breakpoints[:-1, None] + trajectory.segment_times[:, None] * np.linspace(
        1e-9, 1.0 - 1e-9, count
    )
    first, second, third, fourth = (trajectory(times, order) for order in (1, 2, 3, 4))
    thrust = second + np.array([0.0, 0.0, GRAVITY])
    size = np.sqrt((thrust**2).sum(axis=-1))
    return times, {
        "speed": np.sqrt((first**2).sum(axis=-1)),
        "thrust_acceleration": size,
        "jerk": np.sqrt((third**2).sum(axis=-1)),
        "snap": np.sqrt((fourth**2).sum(axis=-1)),
        "tilt": np.arccos(thrust[..., 2] / size),
        "least_thrust_acceleration": size,
        **turning(thrust, third, fourth),
    }


def turning(thrust, jerk, snap):
    """From the formula with powers of the thrust."""
    square, along = (thrust * thrust).sum(axis=-1), (thrust * jerk).sum(axis=-1)
    turn = np.cross(thrust, jerk)
    change = square[..., None] * np.cross(thrust, snap) - 2.0 * along[..., None] * turn
    return {
        "body_rate": np.sqrt((turn**2).sum(axis=-1)) / square,
        "angular_acceleration": np.sqrt((change**2).sum(axis=-1)) / square**2,
    }


def ratios(trajectory, limits):
    """Sampled kappa, in place of certified ones."""
    values = norms(trajectory)[1]
    kappa = {name: values[name].max(axis=1) / limit for name, limit in limits.to_dict().items()}
    if "least_thrust_acceleration" in kappa:
        lowest = values["least_thrust_acceleration"].min(axis=1)
        kappa["least_thrust_acceleration"] = limits.least_thrust_acceleration / lowest
    return kappa


def make_plan(waypoints, *, pace=1.5, limits=LIMITS, history=None, feasible=True, **changes):
    """A plan flown at about `pace` m/s."""
    waypoints = np.asarray(waypoints, dtype=float)
    times = np.linalg.norm(np.diff(waypoints, axis=0), axis=1) / pace
    trajectory = spline(waypoints, times)
    values = {
        "problem": Problem(waypoints, limits=limits),
        "method": "peak",
        "status": Status.SOLVED if feasible else Status.INFEASIBLE,
        "trajectory": trajectory,
        "report": Report(
            feasible=feasible,
            peaks=ratios(trajectory, limits),
            joint_residual=0.0,
            waypoint_error=0.0,
        ),
        "pieces": (1,) * len(times),
        "iterations": 3,
        "wall_time_s": 0.001,
        "history": None if history is None else History(segment_times=history),
    }
    return Plan(**{**values, **changes})


def with_peaks(plan, **peaks):
    """The plan with kappa as given, the rest at one half."""
    full = {name: np.full(len(plan.trajectory), 0.5) for name in plan.report.peaks} | peaks
    report = Report(feasible=True, peaks=full, joint_residual=0.0, waypoint_error=0.0)
    return Plan(**{**vars(plan), "report": report})


def words(figure):
    return [text.get_text() for text in visible_texts(figure)]


def visible_texts(figure):
    """Every text that is drawn; ticks outside of the view are not."""
    figure.canvas.draw()
    texts = [*figure.texts]
    for axes in figure.axes:
        texts += axes.texts
        if axes.get_legend() is not None:
            texts += [*axes.get_legend().get_texts(), axes.get_legend().get_title()]
        if axes.axison:
            for axis in (axes.xaxis, axes.yaxis):
                low, high = sorted(axis.get_view_interval())
                slack = 1e-9 * (high - low)
                texts += [axis.label, axis.get_offset_text()]
                texts += [
                    tick.label1
                    for tick in axis.get_major_ticks()
                    if low - slack <= tick.get_loc() <= high + slack
                ]
    return [text for text in texts if text.get_visible() and text.get_text().strip()]


def assert_legible(figure):
    """No text is smaller than 8 pt, over another or outside of the figure."""
    texts = visible_texts(figure)
    page = figure.bbox
    boxes = [text.get_window_extent() for text in texts]
    for text, box in zip(texts, boxes, strict=True):
        assert text.get_fontsize() >= 8.0, text
        assert box.x0 >= page.x0 and box.x1 <= page.x1, text
        assert box.y0 >= page.y0 and box.y1 <= page.y1, text
    for (one, a), (other, b) in itertools.combinations(zip(texts, boxes, strict=True), 2):
        across = min(a.x1, b.x1) - max(a.x0, b.x0)
        up = min(a.y1, b.y1) - max(a.y0, b.y0)
        assert min(across, up) <= 2.0, (one, other)  # 2 pixels: what ascenders leave empty


def paths(axes):
    return [item for item in axes.collections if item.get_array() is not None]


def limit_lines(axes):
    """Heights of the dashed lines."""
    return [line.get_ydata()[0] for line in axes.lines if line.is_dashed()]


def marks(axes, marker):
    found = [line for line in axes.lines if line.get_marker() == marker]
    return np.concatenate([line.get_xydata() for line in found])


def borders(axes):
    (lines,) = (item for item in axes.collections if isinstance(item, LineCollection))
    return [segment[0, 0] for segment in lines.get_segments()]


def bars(axes):
    """Colour to the rectangles that have it."""
    return {
        tuple(item.get_facecolor()[0]): [path.vertices[:4] for path in item.get_paths()]
        for item in axes.collections
        if isinstance(item, PolyCollection)
    }


CASES = {
    "twisty": lambda: make_plan(TWISTY, history=np.geomspace(2.0, 1.0, 80).reshape(10, 8)),
    "laps": lambda: make_plan(LAPS, history=np.geomspace(1.0, 50.0, 200).reshape(10, 20)),
    "walk of 100": lambda: make_plan(walk(100)),
    "one leg": lambda: make_plan([[0, 0, 1], [1, 2, 2]]),
    "planar": lambda: make_plan(3.0 * RING),
    "straight": lambda: make_plan([[0, 0, 1], [3, 0, 1], [9, 0, 1]]),
    "vertical": lambda: make_plan([[2, 3, 0], [2, 3, 3], [2, 3, 10]]),
    "there and back": lambda: make_plan([[0, 0, 1], [3, 1, 1], [0, 0, 1]]),
    "centimetres": lambda: make_plan(0.01 * RING + [0, 0, 0.3], pace=0.01),
    "kilometres": lambda: make_plan(2e4 * RING + 100.0 * walk(14), pace=100.0),
    "far from the origin": lambda: make_plan(5.0 * RING + [456789.0, 5234567.5, 412.0]),
    "infeasible": lambda: make_plan(8.0 * walk(8), pace=60.0, feasible=False),
    "lost history": lambda: make_plan(TWISTY, history=np.full((5, 8), np.nan)),
    "loose limits": lambda: make_plan(TWISTY, limits=Limits(speed=500.0, snap=1e6)),
    "all limits": lambda: make_plan(
        TWISTY,
        limits=ALL_LIMITS,
    ),
}


@pytest.fixture(scope="module", params=CASES)
def case(request):
    return CASES[request.param]()


@pytest.mark.parametrize("draw", FIGURES)
def test_every_text_of_every_case_is_legible(case, draw):
    assert_legible(draw(case))


@pytest.mark.parametrize("draw", FIGURES)
def test_a_thousand_legs_are_drawn(draw):
    history = np.random.default_rng(1).uniform(0.5, 1.0, (200, 1000))
    for plan in (make_plan(walk(1001)), make_plan(walk(1001), history=history)):
        assert_legible(draw(plan))


@pytest.mark.parametrize("draw", FIGURES)
def test_headline_tells_time_method_and_proof(draw):
    plan = make_plan(TWISTY)
    assert draw(plan).get_suptitle() == f"{plan.duration:.3f} s by method peak, certified"
    plan = make_plan(TWISTY, feasible=False)
    assert draw(plan).get_suptitle().endswith("not certified (infeasible)")


def test_course_path_is_the_trajectory_coloured_by_speed():
    plan = make_plan(TWISTY)
    above, side, bar = course_figure(plan).axes
    (path,) = paths(above)
    lines = np.array(path.get_segments())
    np.testing.assert_allclose(lines[1:, 0], lines[:-1, 1], atol=1e-9)  # without gaps
    per_leg = len(lines) // 8
    np.testing.assert_allclose(lines[::per_leg, 0], TWISTY[:-1, :2], atol=1e-9)
    np.testing.assert_allclose(lines[-1, 1], TWISTY[-1, :2], atol=1e-9)
    ends = plan.trajectory.breakpoints[:-1, None] + plan.segment_times[:, None] * np.linspace(
        0.0, 1.0, per_leg + 1
    )
    speed = np.linalg.norm(plan.trajectory(ends, 1), axis=-1)
    middle = 0.5 * (speed[:, 1:] + speed[:, :-1]).ravel()
    np.testing.assert_allclose(path.get_array(), middle, atol=1e-6)
    assert sorted(paths(side)[0].get_array()) == pytest.approx(sorted(middle), abs=1e-6)
    assert paths(side)[0].norm.vmax == path.norm.vmax == pytest.approx(middle.max())
    assert (above.get_xlabel(), above.get_ylabel()) == ("x (m)", "y (m)")
    assert bar.get_ylabel() == "speed (m/s)"


def test_course_from_above_has_one_scale_and_shows_all(case):
    above = course_figure(case).axes[0]
    origin, right, up = above.transData.transform([[0, 0], [1, 0], [0, 1]])
    assert right[0] - origin[0] == pytest.approx(up[1] - origin[1], rel=1e-6)
    (low_x, high_x), (low_y, high_y) = above.get_xlim(), above.get_ylim()
    x, y = case.trajectory.sample(50)[..., :2].reshape(-1, 2).T
    assert low_x < x.min() and x.max() < high_x
    assert low_y < y.min() and y.max() < high_y


def test_course_marks_start_end_and_every_waypoint():
    above = course_figure(make_plan(TWISTY)).axes[0]
    np.testing.assert_array_equal(marks(above, "^"), TWISTY[:1, :2])
    np.testing.assert_array_equal(marks(above, "s"), TWISTY[-1:, :2])
    np.testing.assert_array_equal(marks(above, "o"), TWISTY[1:-1, :2])
    labels = [text.get_text() for text in above.texts]
    assert sorted(labels) == ["0 start", "1", "2", "3", "4", "5", "6", "7", "8 end"]


@pytest.mark.parametrize("waypoints", [TWISTY, walk(20), walk(60), 3.0 * RING])
def test_course_labels_are_nearest_to_their_own_waypoints_or_tied_to_them(waypoints):
    figure = course_figure(make_plan(waypoints))
    figure.canvas.draw()
    above = figure.axes[0]
    places = above.transData.transform(waypoints[:, :2])
    (leaders,) = (item for item in above.collections if item.get_array() is None)
    tied = [line[0] for line in leaders.get_segments()]
    labels = [text for text in above.texts if text.get_text().isdigit()]
    assert len(labels) >= 0.7 * min(len(waypoints), 15)
    for text in labels:
        box, index = text.get_window_extent(), int(text.get_text())
        gaps = np.maximum([[box.x0, box.y0] - places, places - [box.x1, box.y1]], 0.0).max(axis=0)
        nearest = int(np.hypot(*gaps.T).argmin())
        assert nearest == index or any(np.allclose(waypoints[index, :2], end) for end in tied)
    assert len(tied) < len(labels)


def test_course_labels_a_repeated_place_once():
    above, side, _ = course_figure(make_plan(LAPS)).axes
    labels = [text.get_text() for text in above.texts]
    assert "1, 8, 15" in labels
    assert "2, 9, 16" in labels
    assert "0 start" in labels
    assert "6, 13, 20 end" in labels
    assert "4, 5, 11, 12, 18, …" in labels  # one above the other: one place from above,
    assert "4, 11, 18" in [text.get_text() for text in side.texts]  # two from the side
    assert len(labels) == 7


def test_course_that_ends_where_it_starts_says_both():
    above = course_figure(make_plan([[0, 0, 1], [3, 1, 1], [0, 0, 1]])).axes[0]
    assert sorted(text.get_text() for text in above.texts) == ["0 start, 2 end", "1"]


def test_course_with_many_waypoints_is_labelled_thinly():
    above = course_figure(make_plan(walk(100))).axes[0]
    labels = [text.get_text() for text in above.texts]
    assert {"0 start", "99 end"} <= set(labels)
    assert 8 <= len(labels) <= 22
    assert all(int(label) % 5 == 0 for label in labels if label.isdigit())
    assert len(marks(above, "o")) == 98


def test_view_is_a_parallel_projection_that_fits_the_paper():
    points = walk(30)
    view = View.of(points, np.array([200.0, 150.0]))
    placed = view(points)
    assert (placed > 0.0).all() and (placed < [200.0, 150.0]).all()
    shift = np.array([0.3, -0.2, 0.5])
    moved = view(points + shift) - placed
    np.testing.assert_allclose(moved, np.broadcast_to(moved[0], moved.shape), atol=1e-9)
    x, y, z = (view(point) - view(np.zeros(3)) for point in np.eye(3))
    assert z[0] == pytest.approx(0.0, abs=1e-9)  # up stays up
    assert x @ x + y @ y + z @ z / view.stretch**2 == pytest.approx(2.0 * view.scale**2)
    assert (view.on_floor(points)[:, 2] < points[:, 2].min()).all()


def test_view_stretches_heights_of_flat_courses_only_and_says_so():
    paper = np.array([200.0, 150.0])
    corners = np.array([[0.0, 0.0, 0.0], [10.0, 8.0, 1.0]])
    assert View.of(corners, paper).stretch == 3
    assert View.of(corners * [1, 1, 1e-3], paper).stretch == 5
    assert View.of(corners * [1, 1, 0], paper).stretch == 1
    assert View.of(corners * [1, 1, 9], paper).stretch == 1
    assert "z (m), drawn 3\u00d7" in words(course_figure(make_plan(TWISTY)))
    assert "z (m)" in words(course_figure(make_plan(walk(8) * [0.2, 0.2, 3.0])))


def test_view_from_side_casts_its_shadow_under_the_path():
    side = course_figure(make_plan(TWISTY)).axes[1]
    shadow = next(line for line in side.lines if line.get_linestyle() == "-").get_xydata()
    lines = np.array(paths(side)[0].get_segments())
    starts = {round(x, 6): y for x, y in lines[:, 0]}
    for x, y in shadow[:-1]:
        assert y < starts[round(x, 6)]


def test_derivatives_are_the_norms_and_limits_are_where_they_belong():
    plan = make_plan(TWISTY, limits=ALL_LIMITS)
    panels = derivatives_figure(plan).axes[::-1]
    names = list(ALL_LIMITS.to_dict())
    heights = [5.0, 15.5, 62.0, 800.0, math.degrees(0.8), 4.0, 4.0, 30.0]
    labels = [
        "speed\n(m/s)",
        "thrust\nacceleration\n(m/s²)",
        "jerk\n(m/s³)",
        "snap\n(m/s⁴)",
        "tilt\n(°)",
        "least thrust\nacceleration\n(m/s²)",
        "body rate\n(rad/s)",
        "angular\nacceleration\n(rad/s²)",
    ]
    assert [panel.get_ylabel() for panel in panels] == labels
    for panel, name, height in zip(panels, names, heights, strict=True):
        x, y = panel.lines[0].get_data()
        count = len(x) // len(plan.trajectory)
        times, values = norms(plan.trajectory, count)
        np.testing.assert_allclose(x, times.ravel(), atol=1e-6)
        wanted = np.degrees(values[name]) if name == "tilt" else values[name]
        np.testing.assert_allclose(y, wanted.ravel(), rtol=1e-5, atol=1e-4)
        assert limit_lines(panel) == [pytest.approx(height)]
        assert panel.get_ylim()[0] == 0.0
        assert panel.get_ylim()[1] > y.max()
    assert panels[-1].get_xlabel() == "time (s)"


def test_derivatives_in_free_fall_are_drawn():
    falling = Trajectory([[[0, 0, 9], [1, 0, 0], [0, 0, -GRAVITY / 2]]], [1.0])
    limits = Limits(speed=20.0, body_rate=4.0, angular_acceleration=30.0)
    points = [[0, 0, 9], [1, 0, 9 - GRAVITY / 2]]
    plan = make_plan(points, limits=limits, feasible=False, trajectory=falling)
    for panel in derivatives_figure(plan).axes:
        assert np.isfinite(panel.get_ylim()).all()


def test_derivatives_without_a_limit_are_drawn_without_a_line():
    figure = derivatives_figure(make_plan(TWISTY, limits=Limits(jerk=62.0)))
    assert [limit_lines(panel) for panel in figure.axes[::-1]] == [[], [], [62.0], []]


def test_derivatives_of_a_loose_limit_are_drawn_to_their_own_scale():
    plan = make_plan(TWISTY, limits=Limits(speed=500.0))
    figure = derivatives_figure(plan)
    speed = figure.axes[-1]
    peak = norms(plan.trajectory)[1]["speed"].max()
    assert peak < speed.get_ylim()[1] < 1.3 * peak
    assert "500 m/s ↑" in words(figure)


def test_derivatives_mark_peaks_at_and_above_the_limit():
    kappa = np.array([0.5, 0.9995, 0.998, 1.0, 1.2, 0.1, 0.2, 0.9991])
    plan = with_peaks(make_plan(TWISTY), jerk=kappa)
    panels = derivatives_figure(plan).axes[::-1]
    jerk = panels[2]
    curve = jerk.lines[0].get_xydata().reshape(8, -1, 2)
    top = np.array([piece[piece[:, 1].argmax()] for piece in curve])
    np.testing.assert_array_equal(marks(jerk, "o"), top[[1, 3, 7]])
    np.testing.assert_array_equal(marks(jerk, "x"), top[[4]])
    assert len(marks(panels[0], "o")) == len(marks(panels[0], "x")) == 0


def test_derivatives_mark_least_thrust_at_its_lowest():
    plan = make_plan(TWISTY, limits=Limits(speed=5.0, least_thrust_acceleration=4.0))
    plan = with_peaks(plan, least_thrust_acceleration=np.array([1.0] + 7 * [0.5]))
    panel = derivatives_figure(plan).axes[0]
    first = panel.lines[0].get_xydata().reshape(8, -1, 2)[0]
    np.testing.assert_array_equal(marks(panel, "o"), [first[first[:, 1].argmin()]])


def test_derivatives_show_legs_not_pieces():
    plan = make_plan(TWISTY, problem=Problem(TWISTY[::2], limits=LIMITS), pieces=(2, 2, 2, 2))
    figure = derivatives_figure(plan)
    for panel in figure.axes:
        np.testing.assert_allclose(borders(panel), plan.trajectory.breakpoints[2:-1:2])
    numbers = {text.get_text(): text.get_position()[0] for text in figure.axes[-1].texts}
    for leg in range(4):
        start, end = plan.waypoint_times[leg : leg + 2]
        assert start < numbers[str(leg)] < end
    assert "4" not in numbers


def test_derivatives_thin_out_borders_and_numbers_of_many_legs():
    top = derivatives_figure(make_plan(walk(301))).axes[-1]
    assert 30 <= len(borders(top)) <= 60
    assert 10 <= sum(text.get_text().isdigit() for text in top.texts) <= 40


def test_segment_times_follow_the_history():
    history = np.random.default_rng(3).uniform(0.5, 2.0, (7, 8))
    legs, total = segment_times_figure(make_plan(TWISTY, history=history)).axes
    np.testing.assert_array_equal([line.get_ydata() for line in legs.lines], history.T)
    np.testing.assert_array_equal(legs.lines[0].get_xdata(), range(7))
    np.testing.assert_allclose(total.lines[0].get_ydata(), history.sum(axis=1))
    assert (legs.get_xlabel(), legs.get_ylabel()) == ("iteration", "leg time (s)")
    assert total.get_ylabel() == "total (s)"
    names = [text.get_text() for text in legs.get_legend().get_texts()]
    assert names == [str(leg) for leg in range(8)]
    markers = {line.get_marker() for line in legs.lines}
    assert len(markers) == 8  # told apart without colour


def test_segment_times_compare_the_total_with_the_plan():
    plan = make_plan(TWISTY, history=np.full((3, 8), 2.0))
    total = segment_times_figure(plan).axes[1]
    assert limit_lines(total) == [pytest.approx(plan.duration)]
    assert f"plan {seconds(plan.duration)}" in [text.get_text() for text in total.texts]


def test_segment_times_add_up_the_pieces_of_a_leg():
    history = np.random.default_rng(3).uniform(0.5, 2.0, (7, 8))
    problem = Problem(TWISTY[[0, 3, 4, 8]], limits=LIMITS)
    plan = make_plan(TWISTY, history=history, problem=problem, pieces=(3, 1, 4))
    legs = segment_times_figure(plan).axes[0]
    sums = [history[:, :3].sum(axis=1), history[:, 3], history[:, 4:].sum(axis=1)]
    np.testing.assert_allclose([line.get_ydata() for line in legs.lines], sums)
    by_leg = History(segment_times=np.array(sums).T)
    legs = segment_times_figure(Plan(**{**vars(plan), "history": by_leg})).axes[0]
    np.testing.assert_allclose([line.get_ydata() for line in legs.lines], sums)


@pytest.mark.parametrize(("spread", "scale"), [(29.0, "linear"), (31.0, "log")])
def test_segment_times_are_logarithmic_if_spread_far(spread, scale):
    history = np.geomspace(0.1, 0.1 * spread, 24).reshape(3, 8)
    assert segment_times_figure(make_plan(TWISTY, history=history)).axes[0].get_yscale() == scale


def test_segment_times_of_many_legs_have_a_colour_scale():
    history = np.random.default_rng(3).uniform(0.5, 2.0, (7, 20))
    legs, _, bar = sorted(
        segment_times_figure(make_plan(LAPS, history=history)).axes,
        key=lambda axes: (axes.get_ylabel() == "leg", axes.get_ylabel() == "total (s)"),
    )
    (lines,) = legs.collections
    np.testing.assert_array_equal([line[:, 1] for line in lines.get_segments()], history.T)
    np.testing.assert_array_equal(lines.get_array(), range(20))
    assert legs.get_legend() is None
    assert bar.get_ylabel() == "leg"


def test_segment_times_leave_out_iterations_that_went_astray():
    history = np.ones((4, 8))
    history[1, 3], history[2, 0] = np.nan, -1.0
    legs = segment_times_figure(make_plan(TWISTY, history=history)).axes[0]
    np.testing.assert_array_equal(legs.lines[0].get_xdata(), [0, 3])


@pytest.mark.parametrize(
    "history", [None, np.ones((1, 8)), np.full((9, 8), np.nan), np.ones((9, 5))]
)
def test_segment_times_without_a_history_are_bars(history):
    plan = make_plan(TWISTY, history=history)
    axes = segment_times_figure(plan).axes[0]
    boxes = sorted((box for group in bars(axes).values() for box in group), key=lambda b: b[0, 0])
    heights = [np.ptp(box[:, 1]) for box in boxes]
    np.testing.assert_allclose(heights, plan.segment_times)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("leg", "leg time (s)")


def test_segment_times_bars_tell_which_limit_binds():
    plan = make_plan(TWISTY)
    speed = np.array([1.0, 1.0, 0.9, 0.2, 0.2, 0.2, 0.2, 0.9995])
    jerk = np.array([0.1, 0.1, 1.0, 0.2, 0.2, 0.2, 0.2, 0.9999])
    axes = segment_times_figure(with_peaks(plan, speed=speed, jerk=jerk)).axes[0]
    legs = {
        colour: sorted(round(box[:, 0].mean()) for box in boxes)
        for colour, boxes in bars(axes).items()
    }
    legend = axes.get_legend()
    colours = {
        text.get_text(): tuple(patch.get_facecolor())
        for text, patch in zip(legend.get_texts(), legend.get_patches(), strict=True)
    }
    assert legs[colours["speed"]] == [0, 1]
    assert legs[colours["jerk"]] == [2, 7]
    assert legs[colours["no limit binds"]] == [3, 4, 5, 6]
    assert colours["no limit binds"] == to_rgba(FAINT)
    assert len({patch.get_hatch() for patch in legend.get_patches()[:2]}) == 2


def test_segment_times_bars_pile_up_the_pieces_of_a_leg():
    problem = Problem(TWISTY[[0, 3, 4, 8]], limits=LIMITS)
    plan = make_plan(TWISTY, problem=problem, pieces=(3, 1, 4))
    axes = segment_times_figure(plan).axes[0]
    boxes = [box for group in bars(axes).values() for box in group]
    assert len(boxes) == 8
    for leg, duration in enumerate(np.diff(plan.waypoint_times)):
        pile = [box for box in boxes if round(box[:, 0].mean()) == leg]
        assert max(box[:, 1].max() for box in pile) == pytest.approx(duration)
        assert sum(np.ptp(box[:, 1]) for box in pile) == pytest.approx(duration)


def test_a_plan_without_proven_peaks_can_be_drawn():
    report = Report(feasible=False, peaks={}, joint_residual=0.0, waypoint_error=0.0)
    plan = make_plan(TWISTY, report=report)
    assert len(bars(segment_times_figure(plan).axes[0])) == 1
    assert all(len(marks(panel, "o")) == 0 for panel in derivatives_figure(plan).axes[1:])


def test_colours_darken_evenly():
    weights = [0.2126, 0.7152, 0.0722]
    grey = COLOURS(np.linspace(0.0, 1.0, 50))[:, :3] @ weights
    assert (np.diff(grey) < 0.0).all()
    assert grey[0] < 0.8 and grey[-1] < 0.1


@pytest.mark.parametrize(
    ("count", "most", "step"),
    [(1, 25, 1), (25, 25, 1), (26, 25, 2), (51, 25, 5), (126, 25, 10), (1001, 25, 50), (0, 9, 1)],
)
def test_even_steps(count, most, step):
    assert even_step(count, most) == step


@pytest.mark.parametrize(
    ("duration", "text"),
    [(4.71481, "4.715 s"), (56.2267, "56.23 s"), (1234.5, "1234 s"), (0.0512345, "0.05123 s")],
)
def test_seconds_have_four_figures(duration, text):
    assert seconds(duration) == text


def test_save_writes_three_pictures_and_nothing_else(tmp_path):
    folder = tmp_path / "new" / "pictures"
    for _ in range(2):  # the second time over the first
        written = save_figures(make_plan(TWISTY), folder)
        names = ["course.png", "derivatives.png", "segment_times.png"]
        assert written == [folder / name for name in names]
        assert sorted(path.name for path in folder.iterdir()) == names
        for path in written:
            assert path.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


@pytest.mark.kernels
def test_a_plan_with_a_vehicle_has_a_picture_of_its_rotors(tmp_path):
    vehicle = VEHICLES["crazyflie-2.1"]
    plan = make_plan(TWISTY, problem=Problem(TWISTY, vehicle=vehicle))
    written = save_figures(plan, tmp_path)
    assert [path.name for path in written][-1] == "rotors.png"
    panels = rotors_figure(plan).axes[::-1]  # made from below
    thrusts = [line for line in panels[0].lines if len(line.get_xdata()) > 2]
    times = thrusts[0].get_xdata()
    states = planned_states(plan, times)
    for rotor, line in enumerate(thrusts):
        np.testing.assert_array_equal(line.get_ydata(), states.rotor_thrust[:, rotor])
    dashed = [line.get_ydata()[0] for line in panels[0].lines if len(line.get_xdata()) == 2]
    np.testing.assert_allclose(dashed, vehicle.rotor_thrust[::-1], rtol=1e-3)
    names = [text.get_text() for text in panels[0].get_legend().get_texts()]
    assert names == ["rotor 1", "rotor 2", "rotor 3", "rotor 4"]
    for panel, rate in zip(panels[1:], vehicle.body_rate, strict=True):
        assert any(text.get_text().startswith(f"{rate:.4g} rad/s") for text in panel.texts)


def test_rotors_are_drawn_within_what_is_proven():
    """At joints too, where pieces of the flight and of its yaw must belong together."""
    vehicle = VEHICLES["crazyflie-2.1-upgrade"].on_rotors()
    made = solve(TWISTY, vehicle=vehicle, limits=Limits(speed=4.0), yaw="velocity")
    assert made.feasible
    panels = rotors_figure(made).axes[::-1]
    thrusts = [line.get_ydata() for line in panels[0].lines if len(line.get_xdata()) > 2]
    assert len(thrusts) == 4
    assert np.max(thrusts) <= 0.18 + 1e-9


@pytest.mark.kernels
@pytest.mark.parametrize("vehicle", ["racing-quad", "hummingbird"])
def test_rotors_out_of_range_and_unknown_rates_can_be_drawn(vehicle):
    plan = make_plan(TWISTY, pace=8.0, problem=Problem(TWISTY, vehicle=vehicle))
    panels = rotors_figure(plan).axes[::-1]  # made from below
    thrusts = [line.get_ydata() for line in panels[0].lines]
    lowest, highest = panels[0].get_ylim()
    assert lowest <= min(values.min() for values in map(np.asarray, thrusts))
    assert highest > max(values.max() for values in map(np.asarray, thrusts))
    rates_are_drawn = any(len(line.get_xdata()) == 2 for line in panels[1].lines)
    assert rates_are_drawn == (vehicle == "racing-quad")


def test_rotors_of_a_plan_without_a_vehicle_are_refused():
    with pytest.raises(InvalidProblem, match="the plan has no vehicle"):
        rotors_figure(make_plan(TWISTY))


@pytest.mark.parametrize(("kind", "start"), [("pdf", b"%PDF-"), ("svg", b"<?xml")])
def test_save_writes_other_formats(tmp_path, kind, start):
    written = save_figures(make_plan(TWISTY), tmp_path, format=kind)
    assert [path.name for path in written] == [
        f"{name}.{kind}" for name in ("course", "derivatives", "segment_times")
    ]
    assert all(path.read_bytes().startswith(start) for path in written)


def test_save_refuses_an_unknown_format(tmp_path):
    with pytest.raises(InvalidFile, match="format 'gif' is unknown; known are png, pdf, svg"):
        save_figures(make_plan(TWISTY), tmp_path, format="gif")
    assert not list(tmp_path.iterdir())


def test_save_refuses_a_folder_that_is_a_file(tmp_path):
    (tmp_path / "taken").write_text("mine")
    for folder in (tmp_path / "taken", tmp_path / "taken" / "below"):
        with pytest.raises(InvalidFile, match="taken"):
            save_figures(make_plan(TWISTY), folder)
    assert (tmp_path / "taken").read_text() == "mine"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs a folder closed to root")
def test_save_refuses_a_folder_that_cannot_be_written_to():
    with pytest.raises(InvalidFile, match="/proc/self: cannot be written to"):
        save_figures(make_plan(TWISTY), "/proc/self")


def test_save_refuses_a_picture_whose_name_is_a_folder(tmp_path):
    (tmp_path / "derivatives.png").mkdir()
    with pytest.raises(InvalidFile, match=r"derivatives\.png: is a folder"):
        save_figures(make_plan(TWISTY), tmp_path)


def test_drawing_leaves_matplotlib_as_it_was(tmp_path):
    before = dict(matplotlib.rcParams)
    save_figures(make_plan(LAPS), tmp_path)
    assert dict(matplotlib.rcParams) == before


def test_matplotlib_is_imported_by_figures_only_and_pyplot_never():
    code = """
import json, sys, peakflight
core = "matplotlib" in sys.modules
import peakflight.figures
print(json.dumps([core, "matplotlib.figure" in sys.modules, "matplotlib.pyplot" in sys.modules]))
"""
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout
    assert json.loads(output) == [False, True, False]


def test_without_matplotlib_the_error_names_the_extra(monkeypatch):
    for name in [name for name in sys.modules if name.startswith("peakflight.figures")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtra, match=r"pip install 'peakflight\[figures\]'"):
        importlib.import_module("peakflight.figures")


def test_limits_are_drawn_in_their_own_colour_and_dashed():
    speed = derivatives_figure(make_plan(TWISTY)).axes[-1]
    (line,) = (line for line in speed.lines if isinstance(line, Line2D) and line.is_dashed())
    assert line.get_color() == LIMIT
