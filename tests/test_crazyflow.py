"""Flights in crazyflow: what is refused, and, where it is installed, that it agrees with ours."""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from click.testing import CliRunner

import peakflight as pf
from peakflight.cli.application import application
from peakflight.flight import crazyflow

WAYPOINTS = [[0, 0, 1], [0.6, 0.5, 1.2], [0.2, 0.9, 1.0], [0.9, 1.3, 1.1], [3.2, 1.2, 1.4]]
UPGRADE = pf.find_vehicle("crazyflie-2.1-upgrade")
HARD = pf.Limits(thrust_acceleration=18.9, jerk=400.0, snap=9000.0)
"""Of plans that no Crazyflie follows."""
installed = pytest.mark.skipif(find_spec("crazyflow") is None, reason="needs the extra crazyflow")


def test_refuses_vehicles_that_it_has_not():
    plan = pf.plan(WAYPOINTS, vehicle="racing-quad", method="peak")
    with pytest.raises(pf.InvalidProblem, match="crazyflow has no vehicle 'racing-quad'; it flies"):
        pf.fly_crazyflow([plan])


def test_refuses_a_vehicle_that_only_has_the_name():
    heavy = pf.Vehicle.from_dict({**UPGRADE.to_dict(), "mass": 0.05, "limits": None})
    with pytest.raises(pf.InvalidProblem, match="crazyflow has another vehicle"):
        crazyflow.drone_of(heavy)
    assert crazyflow.drone_of(UPGRADE.with_limits(pf.Limits(speed=1.0))) == "cf2x_T350"


def test_says_which_extra_is_missing(monkeypatch):
    monkeypatch.setattr(crazyflow, "find_spec", lambda name: None)
    plan = pf.plan(WAYPOINTS, vehicle=UPGRADE, method="peak")
    with pytest.raises(pf.MissingExtra, match=r"pip install 'peakflight\[crazyflow\]'"):
        pf.fly_crazyflow([plan])


@pytest.mark.parametrize("option", [["--wind", "1,0,0"], ["--spread", "5"], ["--seed", "1"]])
def test_options_of_our_own_simulator_are_refused(option, tmp_path):
    path = tmp_path / "plan.json"
    pf.plan(WAYPOINTS, vehicle=UPGRADE, method="peak").save(path)
    done = CliRunner().invoke(application, ["fly", str(path), "--simulator", "crazyflow", *option])
    assert done.exit_code == 2
    assert f"{option[0]} is of our own simulator" in done.output


@pytest.fixture(scope="module")
def pairs():
    """Plans of two vehicles, with their flights here and there."""
    vehicles = [UPGRADE, pf.find_vehicle("crazyflie-brushless")]
    vehicles += [replace(vehicle, limits=HARD, reasons={}) for vehicle in vehicles]
    plans = [pf.plan(WAYPOINTS, vehicle=vehicle, pieces=1) for vehicle in vehicles]
    there = pf.fly_crazyflow(plans)
    return [
        (pf.fly(plan, controller="firmware"), flight)
        for plan, flight in zip(plans, there, strict=True)
    ]


@installed
class TestFlights:
    def test_verdicts_are_those_of_our_simulator(self, pairs):
        assert [here.flew for here, _ in pairs] == [there.flew for _, there in pairs]
        assert {there.flew for _, there in pairs} == {True, False}

    def test_flights_that_succeed_are_nearly_the_same(self, pairs):
        for here, there in pairs:
            if there.flew:
                assert np.array_equal(here.times, there.times)
                # two models of one vehicle, integrated by different rules
                assert np.abs(here.position - there.position).max() < 0.05
                assert there.rms_error == pytest.approx(here.rms_error, abs=0.01)

    def test_begin_as_planned_and_stay_in_the_range_of_the_rotors(self, pairs):
        for _, there in pairs:
            least, most = there.vehicle.rotor_thrust
            assert np.abs(there.position[0] - there.planned_position[0]).max() < 1e-5
            assert there.rotor_thrusts.min() > 0.99 * least
            assert there.rotor_thrusts.max() < 1.01 * most
            assert 0.0 <= there.saturation_share <= 1.0

    def test_crashes_have_a_cause_and_end_the_flight(self, pairs):
        for _, there in pairs:
            if not there.flew:
                assert there.crash.time == there.times[-1] < there.duration + 1.0
                assert there.controller == "crazyflow"

    def test_the_command(self, tmp_path):
        path = tmp_path / "plan.json"
        pf.plan(WAYPOINTS, vehicle=UPGRADE, method="peak").save(path)
        done = CliRunner().invoke(
            application, ["fly", str(path), "--simulator", "crazyflow", "--error", "0.2"]
        )
        assert done.exit_code == 0, done.output
        assert "under the crazyflow controller" in done.output
