"""The reconstructed course is what its page says, and the search that found it is repeatable."""

import re
from pathlib import Path

import numpy as np
import pytest

import peakflight as pf
from benchmarks import algorithm_1, evolution, reconstruction
from peakflight.methods.algorithm1 import Algorithm1Settings

COURSES = Path(__file__).parent.parent / "examples" / "courses"
ROW = re.compile(r"\| (min \w+, degree 5) \| (\w+) \| ([\d.]+) \| ([\d.]+) \|")


@pytest.fixture(scope="module")
def waypoints() -> np.ndarray:
    return pf.read_course(COURSES / "paper_like.csv").waypoints


def test_the_page_says_what_the_methods_find(waypoints: np.ndarray) -> None:
    said = {
        (cost, method): (printed, here)
        for cost, method, printed, here in ROW.findall((COURSES / "README.md").read_text())
    }
    assert len(said) == 6
    found = zip(reconstruction.PRINTED, reconstruction.plans(waypoints), strict=True)
    for (task, printed), plans in found:
        for method, time, plan in zip(reconstruction.METHODS, printed, plans, strict=True):
            assert plan.status is pf.Status.SOLVED
            assert plan.feasible
            assert said[task.name, method] == (f"{time:.1f}", f"{plan.duration:.2f}")


def test_the_course_keeps_to_the_room_and_the_spacing(waypoints: np.ndarray) -> None:
    assert (waypoints >= reconstruction.ROOM[0]).all()
    assert (waypoints <= reconstruction.ROOM[1]).all()
    legs = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    assert legs.min() > reconstruction.SPACING - 1e-3  # the search may trade a millimetre


def test_algorithm_1_meets_its_rule_at_the_stated_rates(waypoints: np.ndarray) -> None:
    problem = reconstruction.JERK_5.problem(waypoints)
    run = algorithm_1.attempt(problem, Algorithm1Settings())
    assert run.met


def test_a_search_is_the_same_again() -> None:
    first, second = (reconstruction.search(3, 60) for _ in range(2))
    assert np.array_equal(first, second)
    assert np.array_equal(first, first.round(reconstruction.DECIMALS))


def test_the_evolution_finds_the_minimum_of_a_long_valley() -> None:
    rng = np.random.default_rng(0)
    axes, _ = np.linalg.qr(rng.normal(size=(6, 6)))
    scales = np.logspace(0.0, 3.0, 6)
    goal = rng.normal(size=6)
    point, value = evolution.minimise(
        lambda x: float((scales * (axes @ (x - goal)) ** 2).sum()),
        np.zeros(6), spread=0.5, evaluations=4000, rng=rng,
    )  # fmt: skip
    assert value < 1e-10  # it falls by orders of magnitude once the valley's shape is known
    assert np.abs(point - goal).max() < 1e-5
