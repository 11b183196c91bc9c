import math
import subprocess
import sys
import threading
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import peakflight as pf
from peakflight import bound, multiple_shooting
from peakflight.bound import Settings
from peakflight.limits import keeps, limited_values

pytest.importorskip("casadi")

PAPER = {"speed": 5.0, "thrust_acceleration": 15.5, "jerk": 62.0, "snap": 800.0}
ROOT = Path(__file__).parent.parent
TURN = [[0, 0, 1], [1.0, 0.2, 1.3], [1.4, 1.0, 1.1], [0.3, 1.6, 1.0]]


def course(name: str, **limits: float) -> pf.Problem:
    read = pf.read_course(ROOT / "examples" / "courses" / f"{name}.json")
    return pf.Problem(read.waypoints, limits=pf.Limits(**(limits or PAPER)))


def line(length: float, **limits: float) -> pf.Problem:
    """Rest to rest along x, in one leg."""
    return pf.Problem([[0, 0, 1], [length, 0, 1]], limits=pf.Limits(**limits))


def violations(
    problem: pf.Problem, motion: pf.Trajectory, tolerance: float, count: int = 40
) -> list[str]:
    """Limits that are not kept at samples of a motion."""
    values = limited_values([motion.sample(count, order) for order in range(1, 5)])
    found = []
    for kind in problem.limits.active:
        limit = getattr(problem.limits, kind.name)
        least = kind.name.startswith("least_")
        worst = float(values[kind.name].min() if least else values[kind.name].max())
        if not keeps(kind.name, worst, limit * (1.0 - tolerance if least else 1.0 + tolerance)):
            found.append(f"{kind.name} {worst} against {limit}")
    return found


class TestAgainstWhatIsKnown:
    @pytest.mark.parametrize(
        ("name", "known"),
        [("tight_then_fast", 4.300), ("mfbo_traj_2", 4.184), ("random_10", 5.681)],
    )
    def test_another_implementation(self, name: str, known: float) -> None:
        """Found elsewhere by the same discretisation; they are printed to 1e-3 s."""
        found = pf.discretised_bound(course(name))
        assert found.duration == pytest.approx(known, rel=5e-4)

    @pytest.mark.parametrize(("length", "snap"), [(3.0, 800.0), (0.01, 50.0), (200.0, 10.0)])
    def test_snap_alone(self, length: float, snap: float) -> None:
        """Rest to rest under |s| <= S takes at least (384 d / S)^(1/4).

        Rest at the end makes snap orthogonal to 1, t and t^2, and d the integral of s t^3 / 6. So
        d is at most S times the distance, in the mean, of t^3 / 6 from the parabolas. On [-1, 1]
        t^3 is 1/4 from them, by the Chebyshev polynomial U_3 / 8; so d <= S (T/2)^4 / 24.
        The snap is that polynomial's sign: + - + -, switched at the zeros of U_3.
        """
        least = (384.0 * length / snap) ** 0.25
        found = pf.discretised_bound(line(length, snap=snap))
        assert found.duration is not None
        assert least * (1.0 - 1e-6) <= found.duration <= least * 1.002
        fine = pf.discretised_bound(line(length, snap=snap), settings=Settings(fewest=400))
        assert fine.duration is not None
        assert least * (1.0 - 1e-6) <= fine.duration <= least * 1.00003
        instants = least * (1.0 + np.array([-0.85, -0.5, -0.1, 0.1, 0.5, 0.85])) / 2.0
        signs = np.sign(fine.trajectory(instants, 4)[:, 0])
        assert signs.tolist() == [1, -1, -1, 1, 1, -1]

    def test_jerk_alone(self) -> None:
        """As with snap, one order lower: T^3 = 32 d / J. It starts with jerk, so that is free."""
        least = (32.0 * 2.0 / 30.0) ** (1.0 / 3.0)
        found = pf.discretised_bound(line(2.0, jerk=30.0), settings=Settings(full_rest=False))
        assert found.duration is not None
        assert least <= found.duration <= least * 1.01  # jerk cannot jump between two intervals
        held = pf.discretised_bound(line(2.0, jerk=30.0))
        assert held.duration is not None
        assert found.duration < held.duration

    @pytest.mark.parametrize("length", [6.0, 20.0])
    def test_speed_and_snap(self, length: float) -> None:
        """One can be at speed V in the time (32 V / S)^(1/3), and half as far as at full speed."""
        speed, snap = 4.0, 300.0
        feasible = length / speed + (32.0 * speed / snap) ** (1.0 / 3.0)
        found = pf.discretised_bound(line(length, speed=speed, snap=snap))
        assert found.duration is not None
        assert feasible * 0.999 < found.duration < feasible * 1.0001

    def test_a_finer_grid_comes_closer_from_above(self) -> None:
        problem = pf.Problem(TURN, limits=pf.Limits(**PAPER))
        durations = [
            pf.discretised_bound(problem, settings=Settings(interval=interval)).duration
            for interval in (0.1, 0.05, 0.025, 0.0125)
        ]
        assert durations == sorted(durations, reverse=True)
        assert durations[2] - durations[3] < 1e-3 * durations[3]

    def test_below_every_plan(self) -> None:
        problem = replace(course("mfbo_traj_2"), degree=7, start=None, end=None, continuity=None)
        found = pf.discretised_bound(problem)
        for degree, minimize in ((5, "jerk"), (7, "snap")):
            plan = pf.plan(
                problem.waypoints, limits=problem.limits, degree=degree, minimize=minimize
            )
            assert found.excess(plan.duration) > 5.0


class TestMotion:
    @pytest.mark.parametrize(
        "more",
        [
            {},
            {"tilt": 0.6},
            {"least_thrust_acceleration": 9.0},
            {"tilt": 0.8, "least_thrust_acceleration": 4.0},
        ],
    )
    def test_keeps_every_limit(self, more: dict[str, float]) -> None:
        problem = pf.Problem(TURN, limits=pf.Limits(**PAPER, **more))
        found = pf.discretised_bound(problem)
        assert found.success
        assert violations(problem, found.trajectory, found.peak_ratio - 1.0 + 1e-9) == []
        assert found.peak_ratio <= 1.0 + bound.OVERSHOOT
        free = pf.discretised_bound(pf.Problem(TURN, limits=pf.Limits(**PAPER)))
        assert found.duration >= free.duration * (1.0 - bound.OVERSHOOT)
        if more:  # it makes a difference
            assert violations(problem, free.trajectory, 1e-2) != []

    def test_passes_the_waypoints_smoothly(self) -> None:
        problem = course("random_10")
        found = pf.discretised_bound(problem)
        motion = found.trajectory
        times = np.concatenate(([0.0], np.cumsum(found.segment_times)))
        assert found.duration == pytest.approx(times[-1], rel=1e-12)
        assert np.abs(motion(times) - problem.waypoints).max() < 1e-8
        ends = motion.sample(2, 0).shape
        assert ends[0] == found.intervals
        for order in range(4):
            samples = motion.sample(2, order)
            jump = np.abs(samples[1:, 0] - samples[:-1, 1]).max()
            assert jump < 1e-7 * max(np.abs(samples).max(), 1.0)
        for order in (1, 2, 3):
            assert np.abs(motion(times[[0, -1]], order)).max() < 1e-9
        assert found.interval == pytest.approx(0.025, rel=0.25)

    def test_moving_ends_and_inner_states(self) -> None:
        problem = pf.Problem(
            TURN,
            limits=pf.Limits(**PAPER),
            start={"velocity": [1.0, 0.0, 0.2], "acceleration": [0.5, 0.0, 0.0]},
            derivatives={2: {"velocity": [math.nan, 1.5, 0.0]}},
        )
        found = pf.discretised_bound(problem)
        assert found.success
        times = np.concatenate(([0.0], np.cumsum(found.segment_times)))
        motion = found.trajectory
        assert motion(0.0, 1) == pytest.approx([1.0, 0.0, 0.2], abs=1e-9)
        assert motion(0.0, 2) == pytest.approx([0.5, 0.0, 0.0], abs=1e-9)
        assert motion(times[2], 1)[1:] == pytest.approx([1.5, 0.0], abs=1e-7)
        assert np.abs(motion(times[-1], 3)).max() < 1e-6
        assert 1.0 <= found.peak_ratio <= 1.001
        assert violations(problem, motion, 1e-3) == []

    def test_jerk_at_rest_is_zero_or_free(self) -> None:
        problem = line(2.0, **PAPER)
        full = pf.discretised_bound(problem)
        posed = pf.discretised_bound(problem, settings=Settings(full_rest=False))
        assert np.abs(full.trajectory(0.0, 3)).max() < 1e-9
        assert np.linalg.norm(posed.trajectory(0.0, 3)) > 50.0
        assert posed.duration < full.duration
        given = replace(problem, start={"jerk": [math.nan] * 3}, end={"jerk": [math.nan] * 3})
        asked = pf.discretised_bound(given)
        assert asked.duration == pytest.approx(posed.duration, rel=1e-6)

    def test_from_another_start(self) -> None:
        problem = pf.Problem(TURN, limits=pf.Limits(**PAPER))
        start = pf.plan(problem, method="proportional")
        one = pf.discretised_bound(problem)
        other = pf.discretised_bound(problem, start=start)
        assert other.intervals > one.intervals
        assert other.duration == pytest.approx(one.duration, rel=1e-3)

    def test_turned_and_moved(self) -> None:
        angle = 0.7
        turn = np.array(
            [
                [math.cos(angle), -math.sin(angle), 0.0],
                [math.sin(angle), math.cos(angle), 0.0],
                [0.0, 0.0, 1.0],
            ]
        )
        limits = pf.Limits(**PAPER)
        one = pf.discretised_bound(pf.Problem(TURN, limits=limits))
        moved = np.array(TURN) @ turn.T + [1e4, -3e3, 50.0]
        other = pf.discretised_bound(pf.Problem(moved, limits=limits))
        assert other.duration == pytest.approx(one.duration, rel=1e-4)

    def test_a_course_of_100_legs(self) -> None:
        found = pf.discretised_bound(course("random_100"))
        assert found.success
        assert found.duration < 61.0
        assert found.cpu_time_s < 120.0


class TestFailures:
    problem = pf.Problem(TURN, limits=pf.Limits(**PAPER))

    def test_a_start_that_breaks_a_limit(self) -> None:
        problem = replace(self.problem, start={"velocity": [9.0, 0.0, 0.0]})
        found = pf.discretised_bound(problem)
        assert found.status is pf.Status.INFEASIBLE
        assert not found.success
        assert (found.duration, found.segment_times, found.trajectory) == (None, None, None)
        assert found.excess(3.0) is None
        assert "Infeasible_Problem_Detected" in found.message
        assert found.to_dict()["duration"] is None

    @pytest.mark.parametrize(
        ("settings", "status"),
        [
            (Settings(iterations=2), pf.Status.ITERATION_LIMIT),
            (Settings(time_limit=1e-3), pf.Status.TIME_LIMIT),
        ],
    )
    def test_stopped_early(self, settings: Settings, status: pf.Status) -> None:
        found = pf.discretised_bound(self.problem, settings=settings)
        assert (found.status, found.duration) == (status, None)

    def test_a_limit_that_cannot_be_expressed(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delitem(multiple_shooting.EXPRESSIONS, "jerk")
        with pytest.raises(pf.InvalidProblem, match="the bound cannot hold a limit on jerk"):
            pf.discretised_bound(self.problem)

    def test_a_start_of_other_waypoints(self) -> None:
        start = pf.plan([[0, 0, 0], [1, 0, 0]], limits=self.problem.limits)
        with pytest.raises(pf.InvalidProblem, match="other waypoints"):
            pf.discretised_bound(self.problem, start=start)

    @pytest.mark.parametrize("name", ["interval", "points", "tolerance", "time_limit", "most"])
    def test_bad_settings(self, name: str) -> None:
        for value in (0, -1, math.nan, math.inf):
            with pytest.raises(pf.InvalidProblem, match=f"setting {name} is"):
                Settings(**{name: value})

    def test_a_motion_that_exceeds_limits_between_points(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(bound, "OVERSHOOT", 1e-12)
        found = pf.discretised_bound(
            replace(self.problem, start={"velocity": [0.1, 0.0, 0.0]}), settings=Settings(points=1)
        )
        assert (found.status, found.duration) == (pf.Status.NUMERICAL, None)
        assert "between the points" in found.message

    def test_too_many_intervals_are_made_longer(self) -> None:
        found = pf.discretised_bound(self.problem, settings=Settings(fewest=8, most_in_leg=5))
        assert found.intervals == 15
        assert found.success
        assert "as shorter ones would be too many" in found.message

    def test_iterations_are_counted_and_errors_come_through(self) -> None:
        seen: list[int] = []
        found = pf.discretised_bound(self.problem, on_iteration=seen.append)
        assert seen == list(range(found.iterations + 1))

        def interrupt(iteration: int) -> None:
            if iteration == 3:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            pf.discretised_bound(self.problem, on_iteration=interrupt)

    def test_in_another_thread(self) -> None:
        found: list[bound.Bound] = []
        thread = threading.Thread(target=lambda: found.append(pf.discretised_bound(self.problem)))
        thread.start()
        thread.join()
        assert found[0].success

    def test_without_casadi(self, monkeypatch: pytest.MonkeyPatch) -> None:
        find: Callable[[str], object] = bound.find_spec
        monkeypatch.setattr(
            bound, "find_spec", lambda name: None if name == "casadi" else find(name)
        )
        with pytest.raises(pf.MissingExtra, match=r"peakflight\[bound\]"):
            pf.discretised_bound(self.problem)


def test_casadi_is_imported_late() -> None:
    code = "import sys, peakflight.bound; sys.exit('casadi' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_core_may_not_import_it() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    core = next(c for c in contracts["contracts"] if c["name"].startswith("The planning core"))
    assert {"casadi", "peakflight.bound", "peakflight.multiple_shooting"} <= set(
        core["forbidden_modules"]
    )
    assert {"peakflight.planner", "peakflight.methods"} <= set(core["source_modules"])
