"""Tuning: limits of points, the border of what flies, and the search as a whole."""

import json
import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import peakflight as pf
from peakflight.flight.simulate import FlySettings
from peakflight.limits import GRAVITY, Limits

pytest.importorskip("cmaes")

from peakflight.tuning.search import FIRST_SCALE
from peakflight.tuning.space import COORDINATES, FAMILIES, HIGH, LOW, limits_at
from peakflight.tuning.trial import Candidate, Trying

WAYPOINTS = [[0, 0, 1], [0.6, 0.5, 1.2], [0.2, 0.9, 1.0], [1.4, 1.3, 1.1]]
UPGRADE = pf.find_vehicle("crazyflie-2.1-upgrade")
ORIGIN = tuple([0.0] * len(COORDINATES))
QUICK = pf.TuneSettings(
    scan=2, families=1, generations=1, population=4, finalists=4, final_doubts=2, doubts=()
)


def trying(error=0.15, **changes):
    work = Trying(
        problem=pf.Problem(WAYPOINTS, vehicle=UPGRADE),
        vehicle=UPGRADE,
        controller="firmware",
        fly_settings=FlySettings(),
        conditions=(pf.Conditions(),),
        error=error,
        precision=0.02,
        within=None,
    )
    return replace(work, **changes)


class TestLimitsOfPoints:
    def test_scale_as_time_does(self):
        slow, fast = (limits_at(UPGRADE, np.zeros(len(LOW)), scale) for scale in (0.5, 1.0))
        for name, power in (("speed", 1), ("body_rate", 1), ("jerk", 3), ("snap", 4)):
            assert getattr(fast, name) == pytest.approx(2**power * getattr(slow, name), rel=1e-4)
        assert fast.angular_acceleration == pytest.approx(4 * slow.angular_acceleration, rel=1e-4)
        assert math.tan(fast.tilt) == pytest.approx(4 * math.tan(slow.tilt), rel=1e-4)

        def sideways(limits):
            return math.sqrt(limits.thrust_acceleration**2 - GRAVITY**2)

        assert sideways(fast) == pytest.approx(4 * sideways(slow), rel=1e-3)

    @pytest.mark.parametrize("name", pf.VEHICLES)
    @pytest.mark.parametrize("corner", [LOW, HIGH])
    @pytest.mark.parametrize("scale", [0.15, 4.0])
    def test_are_limits_everywhere_and_never_above_the_rotors(self, name, corner, scale):
        vehicle = pf.find_vehicle(name)
        limits = limits_at(vehicle, corner, scale)
        assert limits.thrust_acceleration <= vehicle.top_thrust_acceleration * (1 + 1e-4)
        assert limits.least_thrust_acceleration < GRAVITY

    def test_are_not_looser_than_what_is_given(self):
        cap = Limits(speed=1.0, tilt=0.3, least_thrust_acceleration=9.0, rotor_thrust=None)
        limits = limits_at(UPGRADE, HIGH, 4.0, cap)
        assert (limits.speed, limits.tilt, limits.least_thrust_acceleration) == (1.0, 0.3, 9.0)


@pytest.fixture(scope="module")
def trials():
    work = trying()
    candidate = Candidate(0, ORIGIN, FIRST_SCALE)
    return work.value(candidate, work.perform(candidate))


class TestBorder:
    def test_is_between_a_flight_that_is_tracked_and_one_that_is_not(self, trials):
        good = [one.scale for one in trials if one.flew and one.rms_error <= 0.15]
        bad = [one.scale for one in trials if not (one.flew and one.rms_error <= 0.15)]
        assert max(good) < min(bad) <= 1.021 * max(good)

    def test_is_what_flying_says(self, trials):
        best = max((one for one in trials if one.flew), key=lambda one: one.scale)
        limits = limits_at(UPGRADE, np.zeros(len(LOW)), best.scale)
        plan = pf.plan(WAYPOINTS, vehicle=UPGRADE, limits=limits, method=FAMILIES[0].method)
        flight = pf.fly(plan, controller="firmware")
        assert plan.duration == best.duration
        assert flight.rms_error == pytest.approx(best.rms_error, rel=1e-9)

    def test_comes_earlier_for_a_smaller_error(self, trials):
        candidate = Candidate(0, ORIGIN, FIRST_SCALE)
        work = trying(error=0.08)
        strict = work.value(candidate, work.perform(candidate))
        slow = [one.duration for one in strict if one.flew and one.rms_error <= 0.08]
        fast = [one.duration for one in trials if one.flew and one.rms_error <= 0.15]
        assert not slow or min(slow) > min(fast)

    def test_a_vehicle_too_weak_for_the_error_has_none(self):
        work = trying(error=1e-4)
        candidate = Candidate(0, ORIGIN, FIRST_SCALE)
        assert all(one.rms_error > 1e-4 for one in work.value(candidate, work.perform(candidate)))


@pytest.fixture(scope="module")
def result():
    return pf.tune(WAYPOINTS, vehicle=UPGRADE, settings=QUICK, workers=1, budget=None)


class TestTune:
    def test_finds_a_certified_plan_that_is_tracked(self, result):
        assert result.complete
        assert result.plan.feasible
        flight = pf.fly(result.plan, controller="firmware")
        assert flight.within(0.15)
        assert flight.rms_error == pytest.approx(result.rms_error, rel=1e-9)
        assert result.rms_error <= result.worst_error

    def test_beats_the_default_limits(self, result):
        assert result.plan.duration < 0.95 * pf.plan(WAYPOINTS, vehicle=UPGRADE).duration

    def test_says_how_to_make_the_plan_again(self, result):
        again = pf.plan(WAYPOINTS, vehicle=UPGRADE, limits=result.limits, **result.options)
        assert again.duration == result.plan.duration

    def test_front_bargains(self, result):
        durations = [point.duration for point in result.front]
        errors = [point.rms_error for point in result.front]
        assert durations == sorted(durations)
        assert errors == sorted(errors, reverse=True)
        json.dumps(result.to_dict(), allow_nan=False)

    def test_does_not_depend_on_who_works(self, result):
        with ThreadPoolExecutor(3) as executor:
            other = pf.tune(
                WAYPOINTS, vehicle=UPGRADE, settings=QUICK, executor=executor, budget=None
            )
        assert other.plan.trajectory.coefficients.tobytes() == (
            result.plan.trajectory.coefficients.tobytes()
        )
        assert [point.to_dict() for point in other.front] == [
            point.to_dict() for point in result.front
        ]

    def test_robust_is_slower_and_has_been_flown(self, result):
        robust = pf.tune(
            WAYPOINTS, vehicle=UPGRADE, settings=QUICK, workers=1, budget=None, robust=4
        )
        assert robust.plan.duration >= result.plan.duration
        spread = pf.Spread().draw(pf.Conditions(), 4, QUICK.seed)
        for one in spread:
            assert pf.fly(robust.plan, controller="firmware", conditions=one).within(0.15)

    def test_ends_when_the_budget_is_spent(self):
        seen = []
        result = pf.tune(
            WAYPOINTS,
            vehicle=UPGRADE,
            workers=1,
            budget=1.0,
            settings=replace(QUICK, generations=1000),
            on_trials=lambda plans, part, best: seen.append((plans, part, best)),
        )
        assert not result.complete
        assert seen[-1][0] == result.plans > 0
        assert 0.0 < seen[-1][1] < 1.0

    @pytest.mark.parametrize(
        ("changes", "says"),
        [
            ({"vehicle": None}, "no vehicle to fly"),
            ({"error": -1.0}, "error is -1"),
            ({"robust": -1}, "robust is -1"),
            ({"controller": "hands"}, "unknown controller 'hands'"),
            ({"minimize": "snap"}, "minimize is what the tuner chooses"),
            ({"wings": 2}, "unknown option 'wings'"),
        ],
    )
    def test_refuses(self, changes, says):
        with pytest.raises(pf.InvalidProblem, match=says):
            pf.tune(WAYPOINTS, **{"vehicle": UPGRADE, "workers": 1, **changes})
