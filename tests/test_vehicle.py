"""Vehicles: their rules, their limits, their files, and problems that name one."""

import json
import math
from dataclasses import FrozenInstanceError, replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import peakflight as pf
from peakflight.airframe import Airframe
from peakflight.default_limits import BEHIND, DRAG, MARGIN, default_limits
from peakflight.files import write_json
from peakflight.formats.vehicle_file import FIGURES, as_yaml, read_vehicle
from peakflight.limits import GRAVITY, Limits
from peakflight.vehicle import Vehicle
from peakflight.vehicles import VEHICLES, find_vehicle

STOCK = VEHICLES["crazyflie-2.1"]
RACER = VEHICLES["racing-quad"]
PLUS = VEHICLES["hummingbird"]
WAYPOINTS = [[0, 0, 1], [0.6, 0.5, 1.2], [0.2, 0.9, 1.0], [0.9, 1.3, 1.1], [3.2, 1.2, 1.4]]
REQUIRED = (
    "mass",
    "inertia",
    "rotor_positions",
    "spins",
    "rotor_thrust",
    "torque_per_thrust",
)
each = pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=lambda one: one.name)


def refuses(message, call, *arguments, **options):
    with pytest.raises(pf.InvalidProblem, match=message):
        call(*arguments, **options)


class TestPresets:
    def test_are_the_six(self):
        assert list(VEHICLES) == [
            "crazyflie-2.1",
            "crazyflie-2.1-plus",
            "crazyflie-2.1-upgrade",
            "crazyflie-brushless",
            "racing-quad",
            "hummingbird",
        ]
        assert all(name == vehicle.name for name, vehicle in VEHICLES.items())

    @each
    def test_have_a_source_for_each_figure_and_a_reason_for_each_limit(self, vehicle):
        assert set(vehicle.sources) == set(FIGURES)
        assert set(vehicle.reasons) == set(vehicle.limits.to_dict())
        assert all(len(line) > 5 for line in (*vehicle.sources.values(), *vehicle.reasons.values()))

    @pytest.mark.parametrize(
        ("name", "top"),
        [
            ("crazyflie-2.1", 14.63),
            ("crazyflie-2.1-upgrade", 19.0),
            ("crazyflie-brushless", 18.43),
            ("racing-quad", 3.3 * GRAVITY),
        ],
    )
    def test_top_thrust_accelerations_are_the_published_ones(self, name, top):
        assert VEHICLES[name].top_thrust_acceleration == pytest.approx(top, rel=1e-3)

    def test_spins_and_places_are_those_of_the_sources(self):
        # signs of the mixing matrix of crazyflow: rolling, pitching, yawing
        signs = np.sign(np.linalg.inv(STOCK.mixer))[1:]
        np.testing.assert_array_equal(signs, [[-1, -1, 1, 1], [-1, 1, 1, -1], [-1, 1, -1, 1]])
        # and of rpg_time_optimal's
        signs = np.sign(np.linalg.inv(RACER.mixer))[1:]
        np.testing.assert_array_equal(signs, [[1, -1, -1, 1], [-1, -1, 1, 1], [1, -1, 1, -1]])


class TestRules:
    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"name": ""}, "vehicle name is ''; it must be text, not empty"),
            ({"name": 3}, "vehicle name is 3; it must be text"),
            ({"name": "a\nb"}, r"vehicle name is 'a\\nb'; it must be up to 80 printable"),
            ({"mass": 0.0}, "vehicle mass is 0; it must be positive"),
            ({"mass": -1}, "vehicle mass is -1; it must be positive"),
            ({"mass": "heavy"}, "vehicle mass is 'heavy'; it must be a number"),
            ({"mass": math.nan}, "vehicle mass is nan; it must be finite"),
            ({"mass": True}, "vehicle mass is 'True'; it must be a number"),
            ({"inertia": (1e-5, 1e-5)}, r"vehicle inertia is '\(1e-05, 1e-05\)'; it must be 3 fin"),
            ({"inertia": (1e-5, 1e-5, -1e-5)}, "vehicle inertia about z is -1e-05; it must be pos"),
            ({"inertia": (1e-5, 1e-5, 3e-5)}, "no body has one moment of inertia larger than"),
            ({"rotor_positions": [[0.1, 0.1]] * 3}, "it must be 4 x 2 finite numbers"),
            ({"rotor_positions": [[0.1, 0.1]] * 4}, r"have their centre at \[0.1, 0.1\] m"),
            (
                {"rotor_positions": [[0.1, 0.1], [-0.1, -0.1], [0.1, 0.1], [-0.1, -0.1]]},
                "give no hold on roll, pitch and yaw",
            ),
            ({"spins": (1, 1, 1, -1)}, r"vehicle spins is \[1, 1, 1, -1\]; two rotors must"),
            ({"spins": (1, 1, -1, -1)}, None),
            ({"rotor_thrust": (0.2, 0.1)}, r"vehicle rotor_thrust is \[0.2, 0.1\] N; it must be"),
            ({"rotor_thrust": (-0.1, 0.1)}, "it must be the least, from 0, and the most"),
            (
                {"rotor_thrust": (0.0, 0.08)},
                "at most 0.08 N, 0.32 N in all; it must be above the weight of 0.3218 N, or the "
                "vehicle cannot hover",
            ),
            ({"rotor_thrust": (0.0, 0.085)}, "less the margin of 25% that is 7.774, which is not"),
            ({"rotor_thrust": (0.07, 0.12)}, "which is not below gravity"),
            ({"torque_per_thrust": 0.0}, "vehicle torque_per_thrust is 0; it must be positive"),
            ({"motor_lag": -0.1}, "vehicle motor_lag is -0.1; it must be from 0"),
            ({"body_rate": (10.0, 0.0)}, "vehicle body_rate is 0; it must be positive"),
            ({"drag": (0.1, -0.1)}, "vehicle drag is -0.1; it must be from 0"),
            (
                {"limits": {"speed": 5}},
                "vehicle limits is {'speed': 5}; it must be a peakflight.Li",
            ),
            ({"sources": {"colour": "red"}}, "vehicle sources has an unknown key 'colour'; known"),
            ({"sources": {"mass": 3}}, "vehicle sources of mass is 3; it must be a line of text"),
            ({"reasons": ["x"]}, "vehicle reasons must be a mapping"),
            ({"reasons": {"speed": "wind"}}, "vehicle reasons has an unknown key 'speed'; known"),
        ],
    )
    def test_name_figure_value_and_rule(self, change, message):
        values = {name: getattr(STOCK, name) for name in ("name", *REQUIRED)} | change
        if message is None:
            # a square whose neighbours turn alike cannot yaw without rolling
            refuses("neighbours in a square must turn opposite ways", Vehicle, **values)
        else:
            refuses(message, Vehicle, **values)

    def test_vehicles_are_frozen_and_of_plain_numbers(self):
        vehicle = replace(RACER, inertia=np.array([1e-3, 1e-3, 2e-3]), spins=[-1.0, 1.0, -1.0, 1.0])
        with pytest.raises(FrozenInstanceError):
            vehicle.mass = 3.0
        assert vehicle.inertia == (1e-3, 1e-3, 2e-3)
        assert vehicle.spins == (-1, 1, -1, 1)
        assert type(vehicle.spins[0]) is int
        assert not vehicle.mixer.flags.writeable


class TestAirframe:
    def test_of_a_square_is_what_it_is(self):
        airframe = STOCK.airframe
        assert (airframe.mass, airframe.inertia) == (STOCK.mass, STOCK.inertia[0])
        assert airframe.lever == pytest.approx(0.03253, rel=1e-12)
        assert VEHICLES["crazyflie-brushless"].airframe.inertia == 28e-6

    def test_of_a_plus_is_the_same_square_turned(self):
        assert PLUS.airframe.lever == pytest.approx(0.17 / math.sqrt(2.0), rel=1e-12)

    def test_of_a_rectangle_holds_for_the_rotor_that_feels_a_torque_most(self):
        wide = replace(RACER, rotor_positions=((0.1, 0.2), (0.1, -0.2), (-0.1, -0.2), (-0.1, 0.2)))
        angles = np.linspace(0.0, 2.0 * math.pi, 3601)
        torques = np.stack((0.0 * angles, np.cos(angles), np.sin(angles), 0.0 * angles))
        most = np.abs(wide.mixer @ torques).max()
        assert most == pytest.approx(math.sqrt(2.0) / (4.0 * wide.airframe.lever), rel=1e-6)


class TestDefaultLimits:
    @each
    def test_keep_the_margin_and_level_flight_holds_height(self, vehicle):
        limits, top = vehicle.limits, vehicle.top_thrust_acceleration
        assert 0.99 * (1.0 - MARGIN) * top < limits.thrust_acceleration <= (1.0 - MARGIN) * top
        if vehicle.name in ("racing-quad", "hummingbird"):
            assert limits.tilt is None
        else:
            lift = limits.thrust_acceleration * math.cos(limits.tilt)
            assert GRAVITY <= lift < 1.01 * GRAVITY
        assert vehicle.has_default_limits()
        if vehicle.body_rate is not None:
            assert limits.body_rate <= (1.0 - MARGIN) * vehicle.body_rate[0]

    @each
    def test_leave_each_rotor_in_its_range_at_any_heading(self, vehicle):
        limits, airframe = vehicle.limits, vehicle.airframe
        least, most = vehicle.rotor_thrust
        torque = airframe.inertia * limits.angular_acceleration
        turning = math.sqrt(2.0) * torque / (4.0 * airframe.lever)
        assert airframe.mass * limits.thrust_acceleration / 4.0 + turning <= most
        assert airframe.mass * limits.least_thrust_acceleration / 4.0 - turning >= least

    def test_a_vehicle_without_lag_may_jerk_as_fast_as_it_turns(self):
        figures = {"rotor_thrust": (0.0, 5.0), "body_rate": None}
        airframe = Airframe(mass=1.0, inertia=5e-3, lever=0.1)
        quick, _ = default_limits(airframe, motor_lag=0.0, **figures)
        slow, reasons = default_limits(airframe, motor_lag=0.5, **figures)
        assert quick.jerk == pytest.approx(quick.body_rate * quick.thrust_acceleration, rel=1e-3)
        change = slow.thrust_acceleration - slow.least_thrust_acceleration
        assert slow.jerk == pytest.approx(change / 0.5, rel=1e-3)
        assert "one motor lag, 0.5 s" in reasons["jerk"]

    def test_turning_waits_for_the_rotors_and_speed_for_the_drag(self):
        figures = {"rotor_thrust": (0.0, 5.0), "body_rate": None}
        airframe = Airframe(mass=1.0, inertia=5e-3, lever=0.1)
        quick, _ = default_limits(airframe, motor_lag=0.0, **figures)
        slow, reasons = default_limits(airframe, motor_lag=0.1, drag=0.5, **figures)
        assert slow.angular_acceleration == pytest.approx(BEHIND / 0.1, rel=1e-3)
        assert slow.angular_acceleration < quick.angular_acceleration
        assert "behind" in reasons["angular_acceleration"]
        assert 0.5 * slow.speed == pytest.approx(DRAG * 4.0 * 5.0, rel=1e-3)
        assert quick.speed is None

    def test_own_limits_and_reasons_take_their_place(self):
        own = replace(RACER, limits=Limits(speed=3.0), reasons={"speed": "the hall is\n short"})
        assert own.limits == Limits(speed=3.0)
        assert own.reasons == {"speed": "the hall is short"}
        assert not own.has_default_limits()

    def test_what_is_set_replaces_its_own_and_loses_its_reason(self):
        changed = STOCK.with_limits(Limits(speed=2.0, jerk=40.0, tilt=STOCK.limits.tilt))
        assert changed.limits == replace(STOCK.limits, speed=2.0, jerk=40.0)
        assert set(STOCK.reasons) - set(changed.reasons) == {"speed", "jerk"}


class TestFiles:
    @each
    def test_through_dictionaries_json_and_yaml(self, vehicle, tmp_path):
        assert Vehicle.from_dict(json.loads(json.dumps(vehicle.to_dict()))) == vehicle
        write_json(tmp_path / "one.json", vehicle.to_dict())
        assert read_vehicle(tmp_path / "one.json") == vehicle
        (tmp_path / "one.yaml").write_text(as_yaml(vehicle))
        assert find_vehicle(tmp_path / "one.yaml") == vehicle
        assert find_vehicle(str(tmp_path / "one.yaml")) == vehicle

    def test_own_limits_through_yaml(self, tmp_path):
        own = replace(RACER, limits=Limits(speed=3.0), reasons={"speed": "the hall"})
        (tmp_path / "own.yml").write_text(as_yaml(own))
        assert read_vehicle(tmp_path / "own.yml") == own

    def test_any_yaml_reader_reads_the_same(self):
        values = yaml.safe_load(as_yaml(PLUS))
        assert Vehicle.from_dict(values) == PLUS

    def test_a_file_needs_no_more_than_the_figures(self, tmp_path):
        lines = [f"{name}: {json.dumps(RACER.to_dict()[name])}" for name in REQUIRED]
        (tmp_path / "mine.yaml").write_text("\n".join(lines))
        mine = read_vehicle(tmp_path / "mine.yaml")
        assert mine.name == "mine"
        assert mine.body_rate is None
        assert (mine.motor_lag, mine.drag) == (0.0, (0.0, 0.0))

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("- 1\n", "mine.yaml: a vehicle must be a mapping of its figures by name"),
            ("mass: 1\n", "mine.yaml: vehicle inertia is missing"),
            ("mass: 1\nwings: 2\n", "mine.yaml: vehicle has an unknown key 'wings'; known are na"),
            ("mass: [\n", "mine.yaml: line 2 is not YAML"),
            ("name: 2.1\n", "mine.yaml: vehicle mass is missing"),
            ("{", "mine.yaml: "),
            ("", "mine.yaml: the file is empty"),
        ],
    )
    def test_what_is_wrong_is_named(self, text, message, tmp_path):
        (tmp_path / "mine.yaml").write_text(text)
        with pytest.raises(pf.InvalidFile, match=message):
            read_vehicle(tmp_path / "mine.yaml")

    @pytest.mark.parametrize(
        ("key", "value", "message"),
        [
            ("mass", "0", "vehicle mass is 0; it must be positive"),
            ("name", "2.1", "vehicle name is 2.1; it must be text"),
            ("limits", "[1]", "vehicle limits must be a mapping"),
            ("limits", "{sped: 3}", "unknown limit 'sped'; known are speed"),
            ("limits", "{speed: fast}", "limit speed is 'fast'; it must be a number"),
            ("spins", "[left, right, left, right]", "vehicle spins is"),
            ("rotor_thrust", "[0, 1]", "4 N in all; it must be above the weight of 8.338 N"),
        ],
    )
    def test_a_wrong_value_is_named(self, key, value, message, tmp_path):
        values = {name: json.dumps(RACER.to_dict()[name]) for name in ("name", *REQUIRED)}
        values[key] = value
        path = tmp_path / "mine.yaml"
        path.write_text("\n".join(f"{name}: {text}" for name, text in values.items()))
        with pytest.raises(pf.InvalidFile, match=r"mine\.yaml: ") as caught:
            read_vehicle(path)
        assert message in str(caught.value)

    @pytest.mark.parametrize("name", ["hovercraft", "Crazyflie-2.1", "", 3, None])
    def test_unknown_names_list_those_that_are_known(self, name):
        refuses(
            "unknown vehicle .* known are crazyflie-2.1, .* hummingbird, or", find_vehicle, name
        )

    def test_missing_files_are_named(self):
        with pytest.raises(pf.InvalidFile, match=r"mine\.yaml: no such file"):
            find_vehicle("mine.yaml")
        with pytest.raises(pf.InvalidFile, match="no such file"):
            find_vehicle(Path("folder") / "mine")


class TestProblems:
    def test_take_a_name_a_vehicle_or_a_file(self, tmp_path):
        (tmp_path / "own.yaml").write_text(as_yaml(RACER))
        for given in ("racing-quad", RACER, tmp_path / "own.yaml", str(tmp_path / "own.yaml")):
            problem = pf.Problem(WAYPOINTS, vehicle=given)
            assert problem.vehicle == RACER
            assert problem.limits == RACER.limits

    def test_limits_beside_a_vehicle_replace_what_is_set(self):
        problem = pf.Problem(WAYPOINTS, vehicle=STOCK, limits=Limits(speed=2.0, jerk=30.0))
        assert problem.limits == replace(STOCK.limits, speed=2.0, jerk=30.0)
        assert problem.vehicle.limits == problem.limits
        assert replace(problem, degree=9).limits == problem.limits
        assert replace(problem, degree=9).vehicle == problem.vehicle

    def test_need_limits_or_a_vehicle(self):
        refuses(r"limits is missing; .* or vehicle=", pf.Problem, WAYPOINTS)
        refuses("unknown vehicle 'kite'", pf.Problem, WAYPOINTS, vehicle="kite")

    def test_through_json_and_from_files_without_a_vehicle(self):
        problem = pf.Problem(WAYPOINTS, vehicle=STOCK, limits=Limits(speed=2.0))
        again = pf.Problem.from_dict(json.loads(json.dumps(problem.to_dict())))
        assert again.limits == problem.limits
        assert replace(again.vehicle, reasons=problem.vehicle.reasons) == problem.vehicle
        old = pf.Problem(WAYPOINTS, limits=Limits(speed=2.0)).to_dict()
        assert old.pop("vehicle") is None
        assert pf.Problem.from_dict(old).vehicle is None

    def test_a_limit_taken_out_of_a_file_stays_out(self):
        values = pf.Problem(WAYPOINTS, vehicle=STOCK).to_dict()
        del values["limits"]["jerk"]
        assert pf.Problem.from_dict(values).limits.jerk is None


@pytest.mark.kernels
class TestPlans:
    @each
    def test_keep_the_limits_of_each_preset_and_remember_it(self, vehicle, tmp_path):
        plan = pf.plan(WAYPOINTS, vehicle=vehicle.name, method="proportional")
        assert plan.feasible
        assert plan.vehicle == vehicle
        plan.save(tmp_path / "plan.json")
        assert pf.Plan.load(tmp_path / "plan.json").vehicle.name == vehicle.name

    def test_a_vehicle_beside_a_problem_is_refused(self):
        problem = pf.Problem(WAYPOINTS, limits=Limits(speed=2.0))
        refuses(
            "vehicle given beside a Problem, which has its own", pf.plan, problem, vehicle=STOCK
        )

    def test_planning_again_changes_limits_one_by_one_and_vehicles_whole(self):
        first = pf.plan(WAYPOINTS, vehicle=STOCK, limits=Limits(speed=2.0), method="proportional")
        slower = pf.replan(first, limits=Limits(jerk=20.0))
        assert slower.problem.limits == replace(STOCK.limits, speed=2.0, jerk=20.0)
        other = pf.replan(first, vehicle="racing-quad")
        assert other.problem.limits == RACER.limits

    @pytest.mark.parametrize("vehicle", [RACER, STOCK], ids=lambda one: one.name)
    def test_default_limits_keep_rotors_in_range_without_turning_about_the_axis(self, vehicle):
        # what `default_limits` promises: without drag, and a yaw that undoes what tilting twists
        plan = pf.plan(WAYPOINTS, vehicle=vehicle, method="peak")
        still = replace(vehicle, drag=(0.0, 0.0))
        times = np.linspace(0.0, plan.duration, 20_001)
        at_zero = pf.states_along(plan.trajectory, times, still)
        rate, acceleration = -at_zero.body_rate[:, 2], -at_zero.angular_acceleration[:, 2]
        steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(times)
        yaw = np.concatenate(([0.0], np.cumsum(steps)))
        states = pf.states_along(plan.trajectory, times, still, yaw=(yaw, rate, acceleration))
        np.testing.assert_allclose(states.body_rate[:, 2], 0.0, atol=1e-12)
        least, most = vehicle.rotor_thrust
        assert plan.feasible
        assert least <= states.rotor_thrust.min()
        assert states.rotor_thrust.max() <= most
