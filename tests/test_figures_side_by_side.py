"""Figures of several flights: each is there, told apart, legible, at any number of legs."""

import itertools

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from test_figures import LIMITS, TWISTY, assert_legible, limit_lines, make_plan, spline, walk, words

from peakflight.figures import (
    comparison_figures,
    differences_figure,
    in_sequence,
    overlaid_derivatives_figure,
    paths_figure,
    side_by_side,
)
from peakflight.figures.flights import LOOKS, looks
from peakflight.figures.overlaid_derivatives import CUT
from peakflight.methods import METHODS

PACES = dict(zip(METHODS, np.linspace(1.0, 2.0, len(METHODS)), strict=True))


def plans_of(waypoints):
    return {name: make_plan(waypoints, pace=pace, method=name) for name, pace in PACES.items()}


CASES = {
    "one leg": [[0, 0, 1], [1, 2, 2]],
    "twisty": TWISTY,
    "walk of 200": walk(201),
    "vertical": [[2, 3, 0], [2, 3, 3], [2, 3, 10]],
    "far from the origin": TWISTY + np.array([456789.0, 5234567.5, 412.0]),
}


@pytest.mark.parametrize("waypoints", CASES.values(), ids=CASES)
def test_every_figure_of_every_case_is_legible(waypoints):
    figures = comparison_figures(plans_of(waypoints), title="a course")
    assert list(figures) == ["paths", "derivatives", "leg-times"]
    for figure in figures.values():
        assert_legible(figure)
        said = " ".join(words(figure))
        for name in METHODS:
            assert f"{name}, " in said


def test_names_of_users_are_written_as_they_are():
    name = "a_$x^$ & {b}\\" + "long " * 40 + "$"
    for figure in comparison_figures({"peak": make_plan(TWISTY)}, title=name).values():
        assert_legible(figure)
    figure = differences_figure([name], {"peak": [-5.0]}, title=name, axis="percent")
    assert_legible(figure)
    assert name[-20:] in " ".join(words(figure))


def test_a_single_plan_is_drawn():
    for figure in comparison_figures({"peak": make_plan(TWISTY)}, title="alone").values():
        assert_legible(figure)


def test_methods_look_the_same_in_every_figure_and_can_be_told_apart():
    assert [looks(name) for name in METHODS] == list(LOOKS[: len(METHODS)])
    for (one, *dashes), (other, *others) in itertools.combinations(LOOKS, 2):
        lightness = abs(np.dot(np.subtract(to_rgb(one), to_rgb(other)), (0.3, 0.59, 0.11)))
        assert dashes[0] != others[0] or lightness > 0.1
    (flight,) = side_by_side({"as I call it": make_plan(TWISTY, method="mellinger")})
    assert flight[3:] == looks("mellinger")
    assert looks("unknown") in LOOKS


def test_derivatives_are_those_of_each_flight_and_share_the_limits():
    plans = plans_of(TWISTY)
    figure = overlaid_derivatives_figure(side_by_side(plans), LIMITS, title="")
    speed = figure.axes[-1]
    curves = [line for line in speed.lines if len(line.get_xdata()) > 2]
    for curve, plan in zip(curves, plans.values(), strict=True):
        times, values = curve.get_data()
        inside = times < plan.duration * (1.0 - 1e-9)
        expected = np.linalg.norm(plan.trajectory(times[inside], 1), axis=-1)
        np.testing.assert_allclose(values[inside], expected, atol=1e-9)
    assert LIMITS.speed in limit_lines(speed)
    assert speed.get_xlim() == pytest.approx((0.0, max(p.duration for p in plans.values())))


def test_derivatives_far_above_a_limit_are_cut_and_the_figure_says_so():
    plans = {"peak": make_plan(TWISTY), "mellinger": make_plan(TWISTY, pace=12.0)}
    figure = overlaid_derivatives_figure(side_by_side(plans), LIMITS, title="")
    assert_legible(figure)
    snap = figure.axes[0]
    assert snap.get_ylim()[1] == pytest.approx(1.15 * CUT * LIMITS.snap)
    assert "↑" in " ".join(words(figure))


def test_leg_times_stand_side_by_side_and_count_pieces_together():
    plan = make_plan(TWISTY)
    halves = np.repeat(plan.trajectory.segment_times / 2.0, 2)
    points = np.insert(TWISTY, np.arange(1, len(TWISTY)), 0.5 * (TWISTY[1:] + TWISTY[:-1]), axis=0)
    cut = make_plan(TWISTY, trajectory=spline(points, halves), pieces=(2,) * 8, method="joint")
    figure = comparison_figures({"peak": plan, "joint": cut}, title="")["leg-times"]
    heights = [bar.get_height() for bar in figure.axes[0].patches]
    np.testing.assert_allclose(heights, np.tile(plan.trajectory.segment_times, 2))


def test_paths_by_iteration_darken():
    flights = in_sequence({str(i): make_plan(TWISTY, pace=1.0 + i).trajectory for i in range(8)})
    lightness = [np.dot(flight.colour[:3], (0.3, 0.59, 0.11)) for flight in flights]
    assert (np.diff(lightness) < 0.0).all()
    assert_legible(paths_figure(flights, TWISTY, title="by iteration"))
    assert_legible(paths_figure(flights[:1], TWISTY, title="one iteration"))


@pytest.mark.parametrize("count", [1, 4, 300])
def test_differences_of_any_number_of_courses(count):
    names = [f"{'deep/' * (i % 9)}course_{i}" for i in range(count)]
    values = {name: [-10.0 * k - i % 7 for i in range(count)] for k, name in enumerate(METHODS)}
    figure = differences_figure(names, values, title="all", axis="against proportional")
    assert_legible(figure)
    (axes,) = figure.axes
    dots = [line.get_xydata() for line in axes.lines if line.get_linestyle() == "None"]
    for found, expected in zip(dots, values.values(), strict=True):
        np.testing.assert_allclose(found, np.stack((expected, np.arange(count)), axis=1))


def test_differences_without_a_figure_leave_the_place_empty():
    values = {"peak": [None, -5.0], "joint": [None, None]}
    figure = differences_figure(["one", "two"], values, title="", axis="percent")
    assert_legible(figure)
    dots = [line.get_xydata() for line in figure.axes[0].lines if line.get_linestyle() == "None"]
    assert [len(found) for found in dots] == [1, 0]
