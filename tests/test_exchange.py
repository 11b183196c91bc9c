"""Pieces where they help most: merging of neighbours, and exchange between legs."""

from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import peakflight as pf
from peakflight import Limits, Trajectory
from peakflight.limits import PAPER_LIMITS
from peakflight.methods import interior_run, joint
from peakflight.methods.exchange import TRIES, exchanged
from peakflight.methods.merging import changes, merge, merged

COURSES = Path(__file__).parent.parent / "examples" / "courses"
LIMITS = Limits(speed=1.0)
ALLOWED = 1e-3
"""Relative: what separates two solutions of one problem."""


def random_course(seed: int, legs: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform([-4.0, -4.0, 0.5], [4.0, 4.0, 3.0], size=(legs + 1, 3))


# ---- merging --------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [3, 5, 7, 9])
def test_what_was_cut_is_merged_to_what_it_was(degree: int) -> None:
    """A polynomial is given by what is kept of it at both ends."""
    rng = np.random.default_rng(degree)
    whole = Trajectory(rng.normal(size=(3, degree + 1, 3)), [0.7, 1.9, 1.1], 2.0)
    parts = np.array([1, 3, 2])
    cut = whole.subdivide(parts)
    again, pieces = merged(cut, parts, 3)
    np.testing.assert_array_equal(pieces, [1, 1, 1])
    np.testing.assert_allclose(again.segment_times, whole.segment_times)
    np.testing.assert_allclose(again.coefficients, whole.coefficients, rtol=1e-6, atol=1e-7)
    assert again.start_time == 2.0
    np.testing.assert_array_equal(merged(cut, parts, 1)[1], [1, 1, 1])  # one a leg stays


def test_changes_are_those_of_sampling() -> None:
    motion = pf.minimum_effort_spline(random_course(3, 4), [0.5, 1.5, 0.8, 1.0], minimize="snap")
    found = changes(motion, np.array([3, 1]))
    assert np.isinf(found[2])  # across a waypoint
    for first in range(2):
        one, _ = merge(motion, np.array([3, 1]), first)
        t = np.linspace(motion.breakpoints[first], motion.breakpoints[first + 2], 200_001)
        integral = np.trapezoid(((one(t, 3) - motion(t, 3)) ** 2).sum(axis=1), t)
        assert found[first] == pytest.approx(integral, rel=0.03)  # of 33 points


def test_the_pair_that_changes_least_is_merged_first() -> None:
    rng = np.random.default_rng(4)
    rough = rng.normal(size=(2, 8, 3))
    motion = Trajectory(rough, [1.0, 1.0]).join(Trajectory(rough[:1], [2.0]).subdivide(2))
    for order in (2, 0):  # the one that was cut last or first
        pieces = np.array([2, 2])
        again, left = merged(motion if order == 2 else motion.reverse(), pieces, 3)
        np.testing.assert_array_equal(left, [2, 1] if order == 2 else [1, 2])
        assert len(again) == 3


# ---- exchange -------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Toy:
    """Legs whose idle time falls with the square of their pieces; the objective is its sum."""

    trajectory: Trajectory
    pieces: np.ndarray
    idle: np.ndarray

    @property
    def objective(self) -> float:
        return 10.0 + float((self.idle / self.pieces**2).sum())


def straight(idle: np.ndarray, pieces: np.ndarray) -> Trajectory:
    """Along x at speeds that leave so much of each leg idle, at most 1 s, under `LIMITS`."""
    left = idle / pieces**2
    coefficients = np.zeros((len(idle), 8, 3))
    coefficients[:, 1, 0] = 1.0 - left
    return Trajectory(coefficients, np.ones(len(idle))).subdivide(pieces)


@pytest.mark.parametrize("seed", range(6))
def test_pieces_go_where_they_are_worth_most(seed: int) -> None:
    rng = np.random.default_rng(seed)
    legs, most = 4, 9
    idle = rng.uniform(0.05, 0.9, size=legs)
    ways = [np.array(way) for way in product(range(1, most), repeat=legs) if sum(way) == most]
    best = min(10.0 + float((idle / way**2).sum()) for way in ways)
    start = ways[int(rng.integers(len(ways)))]
    seen = []

    def solve(trajectory: Trajectory, pieces: np.ndarray) -> Toy:
        assert len(trajectory) == pieces.sum()
        seen.append(int(pieces.sum()))
        return Toy(straight(idle, pieces), pieces, idle)

    first = solve(straight(idle, start), start)
    found = exchanged(first, LIMITS, most, 50, solve)
    assert found.pieces.sum() == most
    assert found.objective == pytest.approx(best, rel=1e-4)  # of which a round must be worth half
    assert set(seen) <= {most, most + 1}
    none = exchanged(first, LIMITS, most, 0, solve)
    assert none is first


def test_pieces_that_are_not_there_yet_are_cut_first() -> None:
    idle = np.array([0.9, 0.1, 0.4])

    def solve(_: Trajectory, pieces: np.ndarray) -> Toy:
        return Toy(straight(idle, pieces), pieces, idle)

    ones = np.ones(3, dtype=np.int64)
    found = exchanged(Toy(straight(idle, ones), ones, idle), LIMITS, 6, 50, solve)
    np.testing.assert_array_equal(found.pieces, [3, 1, 2])


def test_without_time_a_solution_stays() -> None:
    idle, pieces = np.array([0.5, 0.5]), np.array([2, 2])
    calls = []

    def late(_: Trajectory, pieces: np.ndarray) -> Toy | None:
        calls.append(1)
        return Toy(straight(idle, pieces), pieces, idle) if len(calls) < 4 else None

    first = Toy(straight(idle, pieces), pieces, idle)
    assert exchanged(first, LIMITS, 4, 50, late) is first
    assert len(calls) == len(first.trajectory)  # one round of cuts


@pytest.mark.parametrize("worse", [1.0, 1.5])
def test_without_gain_a_solution_stays_and_nothing_more_is_tried(worse: float) -> None:
    idle, pieces = np.array([0.5, 0.5]), np.array([2, 2])
    calls = []

    def no_better(_: Trajectory, pieces: np.ndarray) -> Toy:
        calls.append(1)
        return Toy(straight(idle, pieces), pieces, worse * idle * pieces**2 / 4)

    first = Toy(straight(idle, pieces), pieces, idle)
    assert exchanged(first, LIMITS, 4, 50, no_better) is first
    assert len(calls) <= 2 * TRIES


# ---- in method joint ------------------------------------------------------------------------


def test_exchanges_make_plans_of_few_pieces_faster() -> None:
    """On courses that nothing was tuned on; under the default limits of a Crazyflie."""
    gains = []
    for seed in range(4):
        problem = pf.Problem(random_course(seed, 10), vehicle="crazyflie-2.1")
        plain, better = (
            pf.plan(problem, max_pieces=15, exchanges=exchanges) for exchanges in (0, 10)
        )
        assert plain.feasible
        assert better.feasible
        assert sum(better.pieces) <= 15
        assert better.duration <= plain.duration * (1.0 + ALLOWED)
        assert better.iterations > plain.iterations
        gains.append(1.0 - better.duration / plain.duration)
    assert np.mean(gains) > 1e-3


class Ticking:
    """A clock that is a second later whenever it is looked at."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def perf_counter(self) -> float:
        self.seconds += 1.0
        return self.seconds


def test_a_time_limit_ends_exchanges(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = pf.Problem(random_course(0, 10), vehicle="crazyflie-2.1")
    before = pf.plan(problem, max_pieces=15, exchanges=0)
    whole = pf.plan(problem, max_pieces=15)
    clock = Ticking()
    for module in (joint, interior_run):
        monkeypatch.setattr(module, "time", clock)
    short = pf.plan(problem, max_pieces=15, time_limit=400.0)
    assert short.feasible
    assert short.status is pf.Status.TIME_LIMIT
    assert before.iterations < short.iterations < whole.iterations
    assert whole.duration <= short.duration <= before.duration
    assert clock.seconds < 420.0


def test_under_limits_on_rotors_pieces_are_not_exchanged() -> None:
    """What samples say is faster is not always so with what lies between them, and the yaw."""
    problem = pf.Problem(
        random_course(0, 6), vehicle=pf.find_vehicle("crazyflie-2.1-plus").on_rotors()
    )
    made = [pf.plan(problem, max_pieces=8, exchanges=count) for count in (0, 10)]
    assert made[0].iterations == made[1].iterations
    assert made[0].duration == made[1].duration


def test_room_for_one_a_leg_and_more_than_pays_are_not_searched() -> None:
    problem = pf.Problem(random_course(1, 6), vehicle="crazyflie-2.1")
    for most in (6, 60):
        made = [pf.plan(problem, max_pieces=most, exchanges=count) for count in (0, 10)]
        assert made[0].iterations == made[1].iterations
        np.testing.assert_array_equal(
            made[0].trajectory.coefficients, made[1].trajectory.coefficients
        )


def test_bad_exchanges_are_refused() -> None:
    for bad, words in ((-1, "must be from 0"), (2.5, "must be a whole number")):
        with pytest.raises(pf.InvalidProblem, match=f"setting exchanges is {bad}; it {words}"):
            joint.Settings(exchanges=bad)


def test_a_history_holds_runs_of_the_same_pieces_alone() -> None:
    course = pf.read_course(COURSES / "uzh_19wp.json")
    plan = pf.plan(course.waypoints, limits=PAPER_LIMITS, max_pieces=31)
    assert plan.history is not None
    firsts = np.cumsum(plan.pieces) - plan.pieces
    legs = np.add.reduceat(plan.history.segment_times, firsts, axis=1)
    assert np.abs(legs / np.diff(plan.waypoint_times) - 1.0).max() < 0.2
