"""Flights: what comes out, what disturbs them, how they end, files and the command."""

import json
import math
import re
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import peakflight as pf
from peakflight.animation import write_animation
from peakflight.cli.application import application
from peakflight.flight import CONTROLLERS, GeometricSettings, RotorSpeeds, firmware_settings
from peakflight.flight.flight import COLUMNS

UPGRADE = "crazyflie-2.1-upgrade"
RACER = "racing-quad"


def path(*points, seconds=1.5, start_time=0.0):
    """Rest to rest through points, a degree-5 piece each."""
    points = np.array(points, dtype=float)
    rows = np.zeros((len(points) - 1, 6, 3))
    rows[:, 0] = points[:-1]
    for power, factor in ((3, 10.0), (4, -15.0), (5, 6.0)):
        rows[:, power] = factor * np.diff(points, axis=0) / seconds**power
    return pf.Trajectory(rows, np.full(len(rows), seconds), start_time)


def hover(at=(0.0, 0.0, 1.0), seconds=2.0):
    return pf.Trajectory(np.array(at, dtype=float)[None, None, :], np.array([seconds]))


GENTLE = path((0, 0, 1), (1.0, 0.4, 1.3), (0.2, 0.8, 1.0))


def same(one, other):
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in COLUMNS)


@pytest.mark.parametrize("name", pf.VEHICLES)
def test_the_ideal_tracker_hovers_and_stays(name):
    flight = pf.fly(hover(), vehicle=name)
    assert flight.flew
    assert flight.top_error < 1e-9
    weight = 9.81 * flight.vehicle.mass
    np.testing.assert_allclose(flight.rotor_thrusts.sum(axis=1), weight, rtol=1e-9)


GENTLE_ERRORS = {"geometric": 0.01, "firmware": 0.12}
"""m; the firmware believes in a wrong mass, which costs a Crazyflie 5 to 10 cm of height."""


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("name", pf.VEHICLES)
def test_both_controllers_fly_a_gentle_plan(name, controller):
    flight = pf.fly(GENTLE, vehicle=name, controller=controller)
    assert flight.within(GENTLE_ERRORS[controller]), flight.rms_error
    assert flight.duration == GENTLE.duration
    assert flight.times[-1] == pytest.approx(GENTLE.duration + 1.0, abs=2e-3)
    np.testing.assert_allclose(flight.planned_position[-1], GENTLE(3.0), atol=1e-12)


def test_the_firmware_hovers_where_its_wrong_mass_holds_it():
    settings = firmware_settings(pf.VEHICLES[UPGRADE])
    flight = pf.fly(hover(seconds=8.0), vehicle=UPGRADE, controller="firmware")
    vehicle = flight.vehicle
    scale = settings.mass_thrust * 4.0 * vehicle.rotor_thrust[1] / 65535.0
    missing = vehicle.mass * 9.81 / scale - settings.mass * 9.81
    height = flight.planned_position[-1, 2] - flight.position[-1, 2]
    integral = 0.05 * np.clip(-np.cumsum(flight.position[::5, 2] - 1.0)[-1] / 100.0, -0.4, 0.4)
    assert 1.25 * height + integral == pytest.approx(missing, rel=0.02)


def test_errors_are_those_of_the_samples_while_the_plan_lasts():
    flight = pf.fly(GENTLE, vehicle=UPGRADE, controller="firmware")
    on_plan = flight.times <= flight.duration
    off = np.linalg.norm((flight.position - flight.planned_position)[on_plan], axis=1)
    assert flight.rms_error == pytest.approx(math.sqrt((off**2).mean()))
    assert flight.top_error == off.max()
    assert not on_plan.all()


def test_a_plan_that_starts_moving_is_flown_from_its_state_and_has_no_hovering():
    moving = GENTLE.split(0.6)[1].split(2.2)[0]
    flight = pf.fly(moving, vehicle=RACER)
    np.testing.assert_array_equal(flight.velocity[0], moving(0.6, 1))
    assert np.linalg.norm(flight.velocity[0]) > 0.5
    assert flight.times[0] == 0.0
    assert flight.times[-1] == pytest.approx(moving.duration, abs=2e-3)
    assert flight.rms_error < 1e-3


def test_a_plan_brings_its_vehicle_and_its_yaw(hand_plan):
    plan = hand_plan(yaw=[0.0, 0.5, 1.0, 1.5], seconds=(2.0, 3.0))
    with pytest.raises(pf.InvalidProblem, match="no vehicle"):
        pf.fly(plan)
    flight = pf.fly(plan, vehicle=RACER, settings=pf.FlySettings(ground=None))
    w, x, y, z = flight.attitude[-1]
    assert math.atan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z)) == pytest.approx(1.5, abs=0.05)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_same_seed_gives_the_same_flight_to_the_last_bit(controller):
    world = {"gust": 0.5, "position_noise": 0.003, "body_rate_noise": 0.05, "velocity_noise": 0.01}
    worlds = [pf.Conditions(**world, seed=seed) for seed in (7, 7, 8)]
    one, again, other = (
        pf.fly(GENTLE, vehicle=UPGRADE, controller=controller, conditions=each) for each in worlds
    )
    assert same(one, again)
    assert not same(one, other)


def test_wind_pushes_a_hovering_vehicle_as_far_as_the_gain_of_position_lets_it():
    vehicle, wind = pf.VEHICLES[UPGRADE], 1.0
    flight = pf.fly(
        hover(seconds=6.0), vehicle=vehicle, conditions=pf.Conditions(wind=(wind, 0.0, 0.0))
    )
    gain = GeometricSettings().gains(vehicle)[0, 0]
    off = vehicle.drag[0] * wind / (vehicle.mass * gain)
    assert off > 0.01
    np.testing.assert_allclose(flight.position[-1], [off, 0.0, 1.0], atol=0.02 * off)
    still = pf.fly(hover(), vehicle=RACER, conditions=pf.Conditions(wind=(5.0, 0.0, 0.0)))
    assert still.top_error < 1e-9  # this vehicle has no drag for wind to act on


def test_gusts_have_the_deviation_and_the_memory_they_are_given():
    """With a drag so large that the air carries it along, a vehicle measures the wind."""
    world = pf.Conditions(gust=0.2, gust_time=0.5, drag=(40.0, 40.0), seed=3)
    settings = pf.FlySettings(
        ground=None, lost_distance=1e3, parts=4, geometric=GeometricSettings(fastest=2.0)
    )
    velocity = pf.fly(
        hover(seconds=300.0), vehicle=RACER, conditions=world, settings=settings
    ).velocity[:, :2]
    settled = velocity[5000:]
    # 300 s are 600 times the memory: deviations within 1 / sqrt(600 * 2) or 3 %, three of those
    np.testing.assert_allclose(settled.std(axis=0), 0.2, rtol=0.15)
    later = settled[250:]
    kept = (later * settled[:-250]).mean() / (settled**2).mean()
    assert kept == pytest.approx(math.exp(-1.0), abs=0.12)


def test_what_is_late_or_weak_or_heavy_flies_worse():
    usual = pf.fly(GENTLE, vehicle=UPGRADE).rms_error
    for name, value in {"latency": 0.03, "mass_scale": 1.1, "thrust_scale": 0.9}.items():
        assert (
            pf.fly(GENTLE, vehicle=UPGRADE, conditions=pf.Conditions(**{name: value})).rms_error
            > usual
        )


@pytest.mark.parametrize(
    ("cause", "height", "world"),
    [
        ("hit the ground", 0.5, {"thrust_scale": 0.4}),
        ("left the path by more than 1 m", 3.0, {"thrust_scale": 0.4}),
        ("attitude lost", 5.0, {"latency": 0.3, "attitude_noise": 0.05}),
    ],
)
def test_a_crash_says_why_and_when(cause, height, world):
    points = [(0, 0, height), (2.0, 0.0, height), (0.0, 0.5, height)]
    flight = pf.fly(
        path(*points, seconds=1.0), vehicle="crazyflie-2.1-plus", conditions=pf.Conditions(**world)
    )
    assert not flight.flew
    assert flight.crash.cause == cause
    assert flight.crash.time == flight.times[-1]
    assert not flight.within(100.0)


def test_the_ground_lies_below_a_plan_that_goes_below_it():
    low = path((0, 0, 0.3), (1.0, 0, -0.3), (0, 0, 0.3))
    assert pf.fly(low, vehicle=RACER).flew
    near = path((0, 0, 0.04), (1.0, 0, 0.3), (0, 0, 0.04))
    assert pf.fly(near, vehicle=RACER).flew
    sunk = pf.fly(near, vehicle=RACER, conditions=pf.Conditions(thrust_scale=0.6))
    assert sunk.crash.cause == "hit the ground"
    assert -0.1 < sunk.position[-1, 2] < -0.01
    heavy = pf.Conditions(thrust_scale=0.4)
    settings = pf.FlySettings(ground=-0.5)
    flight = pf.fly(low, vehicle=RACER, conditions=heavy, settings=settings)
    assert flight.crash.cause == "hit the ground"
    assert flight.position[-1, 2] < -0.5 <= flight.position[-2, 2]


def test_rotors_lag_as_the_settings_say():
    lagging = pf.FlySettings(rotors="lag")
    one, other = (pf.fly(GENTLE, vehicle=UPGRADE, settings=s) for s in (pf.FlySettings(), lagging))
    assert not same(one, other)
    assert same(
        pf.fly(GENTLE, vehicle=RACER), pf.fly(GENTLE, vehicle=RACER, settings=lagging)
    )  # nothing is identified of this one
    slow = RotorSpeeds(rise=(5.0, 0.0), fall=(5.0, 0.0), linear=0.0)
    assert pf.fly(GENTLE, vehicle=RACER, settings=pf.FlySettings(rotors=slow)).top_error > 2.0 * (
        pf.fly(GENTLE, vehicle=RACER).top_error
    )


@pytest.mark.parametrize("name", ["flight.json", "flight.npz"])
@pytest.mark.parametrize("thrust", [1.0, 0.4])
def test_a_flight_is_stored_without_loss(tmp_path, name, thrust):
    world = pf.Conditions(
        thrust_scale=thrust, wind=(1.0, 2.0, 3.0), drag=(0.01, 0.02), gust=0.1, seed=2**62
    )
    flight = pf.fly(GENTLE, vehicle=UPGRADE, controller="firmware", conditions=world)
    flight.save(tmp_path / name)
    again = pf.Flight.load(tmp_path / name)
    assert same(flight, again)
    for field in ("duration", "saturation_share", "crash", "controller", "conditions", "vehicle"):
        assert getattr(again, field) == getattr(flight, field)


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"position": None}, "position"),
        ({"times": []}, "at least one sample"),
        ({"attitude": [[1, 0, 0]]}, "attitude has shape"),
        ({"crash": {"cause": "x"}}, "crash must be null"),
        ({"saturation_share": 2.0}, "saturation_share is 2"),
        ({"conditions": {"mass": 1}}, "unknown key 'mass'"),
    ],
)
def test_a_flight_file_that_is_wrong_says_what(tmp_path, change, rule):
    values = pf.fly(hover(seconds=0.1), vehicle=RACER).to_dict()
    values.update(change)
    values = {name: value for name, value in values.items() if value is not None or name == "crash"}
    file = tmp_path / "flight.json"
    file.write_text(json.dumps(values))
    with pytest.raises(pf.InvalidFile, match=rule) as caught:
        pf.Flight.load(file)
    assert str(file) in str(caught.value)


def test_an_array_file_that_is_none_says_so(tmp_path):
    file = tmp_path / "flight.npz"
    with pytest.raises(pf.InvalidFile, match="no such file"):
        pf.Flight.load(file)
    file.write_text("not a zip")
    with pytest.raises(pf.InvalidFile, match="NumPy"):
        pf.Flight.load(file)
    np.savez(file, times=np.zeros(3))
    with pytest.raises(pf.InvalidFile, match="about is missing"):
        pf.Flight.load(file)


@pytest.mark.parametrize(
    ("values", "rule"),
    [
        ({"mass_scale": 0.0}, "mass_scale is 0; it must be from 0.1 to 10"),
        ({"latency": -0.1}, "latency is -0.1"),
        ({"latency": "soon"}, "latency is 'soon'"),
        ({"wind": (1, 2)}, "wind is .* three numbers"),
        ({"wind": (1, 2, math.nan)}, "wind z is nan"),
        ({"drag": 0.1}, "drag is"),
        ({"seed": 0.5}, "seed is '0.5'; it must be a whole number"),
        ({"seed": -1}, "seed is -1"),
        ({"gust_time": 0.0}, "gust_time is 0"),
    ],
)
def test_conditions_that_make_no_sense_are_refused(values, rule):
    with pytest.raises(pf.InvalidProblem, match=rule):
        pf.Conditions(**values)


@pytest.mark.parametrize(
    ("values", "rule"),
    [
        ({"control_rate": 0.0}, "control_rate"),
        ({"parts": 0}, "parts is 0"),
        ({"lost_angle": 4.0}, "lost_angle"),
        ({"rotors": "slow"}, "rotors is 'slow'"),
        ({"ground": math.inf}, "ground"),
    ],
)
def test_settings_that_make_no_sense_are_refused(values, rule):
    with pytest.raises(pf.InvalidProblem, match=rule):
        pf.FlySettings(**values)


def test_what_cannot_be_flown_is_refused():
    with pytest.raises(pf.InvalidProblem, match="unknown controller 'pid'; known are geometric"):
        pf.fly(GENTLE, vehicle=RACER, controller="pid")
    with pytest.raises(pf.InvalidProblem, match="unknown vehicle"):
        pf.fly(GENTLE, vehicle="kite")
    with pytest.raises(pf.InvalidProblem, match="2 axes"):
        pf.fly(pf.Trajectory(np.zeros((1, 2, 2)), np.ones(1)), vehicle=RACER)
    with pytest.raises(pf.InvalidProblem, match="ndarray cannot be flown"):
        pf.fly(np.zeros(3), vehicle=RACER)
    with pytest.raises(pf.InvalidProblem, match="lasts 1e\\+06 s"):
        pf.fly(hover(seconds=1e6), vehicle=RACER)


def test_without_a_spread_all_vehicles_fly_alike():
    none = pf.Spread(mass=0, thrust=0, inertia=0, motor_lag=0, latency=0)
    result = pf.fly_spread(GENTLE, vehicle=UPGRADE, flights=4, spread=none, error=0.05)
    nominal = pf.fly(GENTLE, vehicle=UPGRADE)
    assert [one.rms_error for one in result.flights] == [nominal.rms_error] * 4
    assert result.share == 1.0
    # Wilson's interval for 4 of 4 at 95 %: 1 / (1 + z^2 / 4)
    assert result.interval == pytest.approx((1.0 / (1.0 + 1.959964**2 / 4.0), 1.0))


def test_a_spread_is_the_same_wherever_it_runs_and_grows_by_its_end():
    seen = []
    asked = {"vehicle": UPGRADE, "controller": "firmware", "error": 0.1}
    few = pf.fly_spread(GENTLE, **asked, flights=6, on_flight=seen.append)
    with ThreadPoolExecutor(1) as executor:
        more = pf.fly_spread(GENTLE, **asked, flights=9, executor=executor)
    assert few.flights == more.flights[:6]
    assert seen == [1, 2, 3, 4, 5, 6]
    other = pf.fly_spread(GENTLE, **asked, flights=6, conditions=pf.Conditions(seed=1))
    assert other.flights != few.flights
    assert sum(few.crashes.values()) + len(few.rms_errors) == 6
    worst = few.worst(6)
    assert {one.conditions for one in worst} == {one.conditions for one in few.flights}
    assert worst[0].crash or worst[0].rms_error == max(few.rms_errors)
    json.dumps(few.to_dict(), allow_nan=False)


def test_draws_have_the_deviations_of_the_spread():
    spread = pf.Spread(mass=0.03, thrust=0.05, inertia=0.1, motor_lag=0.2, latency=0.004)
    base = pf.Conditions(latency=0.01, mass_scale=1.2)
    drawn = spread.draw(base, 4000, seed=5)
    for name in ("mass", "thrust", "inertia", "motor_lag"):
        logs = np.log([getattr(one, f"{name}_scale") for one in drawn])
        # 4000 draws: 1 / sqrt(8000) or 1.1 % of the deviation, four of those
        assert logs.std() == pytest.approx(getattr(spread, name), rel=0.045)
    assert np.median([one.mass_scale for one in drawn]) == pytest.approx(1.2, rel=0.003)
    late = np.array([one.latency for one in drawn]) - 0.01
    assert late.min() >= 0.0
    assert late.mean() == pytest.approx(0.004 * math.sqrt(2.0 / math.pi), rel=0.05)


@pytest.mark.parametrize("values", [{"flights": 0}, {"flights": 2.5}, {"error": 0.0}])
def test_a_spread_that_makes_no_sense_is_refused(values):
    with pytest.raises(pf.InvalidProblem, match=next(iter(values))):
        pf.fly_spread(GENTLE, vehicle=UPGRADE, **values)


def page_data(text):
    found = re.search(r"^const F = (.*);$", text, re.MULTILINE)
    return json.loads(found[1])


def test_the_page_asks_the_network_for_nothing_and_has_the_flight(tmp_path, hand_plan):
    vehicle = pf.Vehicle.from_dict({**pf.VEHICLES[RACER].to_dict(), "name": "</script><b>http"})
    plan = hand_plan(seconds=(2.0, 3.0))
    flight = pf.fly(plan, vehicle=vehicle, settings=pf.FlySettings(ground=None))
    write_animation(flight, tmp_path / "flight.html", plan=plan)
    text = (tmp_path / "flight.html").read_text()
    assert text.count("</script>") == 1  # a name does not end the script
    data = page_data(text)
    for word in (
        "http:",
        "https:",
        "//cdn",
        "<link",
        "src=",
        "@import",
        "fetch(",
        "XMLHttp",
        "url(",
    ):
        assert word not in text
    assert data["title"].startswith("</script><b>http")
    shown = np.searchsorted(flight.times, np.array(data["times"]) - 1e-4)
    np.testing.assert_allclose(data["position"], flight.position[shown], atol=1e-5)
    np.testing.assert_allclose(data["attitude"], flight.attitude[shown], atol=1e-5)
    np.testing.assert_allclose(data["waypoints"], plan.problem.waypoints, atol=1e-5)
    assert data["times"][-1] == pytest.approx(flight.times[-1])


@pytest.fixture
def plan_file(tmp_path, hand_plan):
    """A gentle plan without a vehicle, from 2 m up."""
    plan = hand_plan(seconds=(3.0, 4.0))
    lowest = plan.trajectory.sample(50)[..., 2].min()
    raised = plan.trajectory.translate([0.0, 0.0, 1.0 - lowest]).to_dict()
    values = plan.to_dict()
    values["coefficients"] = raised["coefficients"]
    values["waypoints"] = (plan.problem.waypoints + np.array([0.0, 0.0, 1.0 - lowest])).tolist()
    file = tmp_path / "plan.json"
    file.write_text(json.dumps(values))
    return file


def command(capsys, *arguments):
    code = application.run(["fly", *map(str, arguments)])
    out, err = capsys.readouterr()
    return code, out, err


def test_the_command_flies_and_writes_all_files(capsys, tmp_path, plan_file):
    folder = tmp_path / "flown"
    code, out, _ = command(
        capsys, plan_file, "--vehicle", RACER, "-o", folder, "--spread", "5", "--json"
    )
    values = json.loads(out)
    assert code == 0
    assert values["flew"] is True
    assert values["spread"]["flights"] == 5
    assert sorted(values["files"]) == sorted(p.name for p in folder.iterdir())
    flight = pf.Flight.load(folder / "flight.npz")
    assert flight.rms_error == values["rms_error"]
    table = np.genfromtxt(folder / "flight.csv", delimiter=",", skip_header=1)
    np.testing.assert_allclose(table[:, 0], flight.times, rtol=1e-8)
    np.testing.assert_allclose(table[:, 1:4], flight.position, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(table[:, -1], flight.errors, rtol=1e-7, atol=1e-12)
    for name in ("flight_path.png", "flight_error.png", "spread.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")


def test_the_command_says_how_it_ended(capsys, plan_file):
    code, out, _ = command(
        capsys, plan_file, "--vehicle", RACER, "--wind", "1,0,0", "--gust", "0.1"
    )
    assert code == 0
    assert "RMS error" in out
    assert "wind [1.0, 0.0, 0.0], gust 0.1, seed 0" in " ".join(out.split())
    code, _, err = command(capsys, plan_file, "--vehicle", RACER, "--error", "1e-9")
    assert code == 1
    assert "is above 1e-09 m" in err
    code, _, err = command(capsys, plan_file, "--vehicle", RACER, "--thrust-scale", "0.3")
    assert code == 1
    assert "crashed after" in err


@pytest.mark.parametrize(
    ("arguments", "rule"),
    [
        ([], "names no vehicle to fly it; give --vehicle NAME"),
        (["--vehicle", "kite"], "unknown vehicle 'kite'"),
        (["--vehicle", RACER, "--wind", "1,2"], "three numbers"),
        (["--vehicle", RACER, "--wind", "1,x,2"], "--wind is '1,x,2'"),
        (["--vehicle", RACER, "--latency", "9"], "latency is 9"),
        (["--vehicle", RACER, "--error", "0"], "must be positive"),
        (["--vehicle", RACER, "--error", "nan"], "must be positive"),
        (["--vehicle", RACER, "--spread", "0"], "flights is 0"),
        (["--vehicle", RACER, "--controller", "pid"], "pid"),
    ],
)
def test_the_command_refuses_what_makes_no_sense_in_one_line(
    capsys, tmp_path, plan_file, arguments, rule
):
    folder = tmp_path / "flown"
    code, out, err = command(capsys, plan_file, *arguments, "-o", folder)
    assert code == 2
    assert rule in err
    assert len(err.strip().splitlines()) == 1
    assert out == ""
    assert not folder.exists()


def test_the_command_refuses_a_file_that_is_no_plan(capsys, tmp_path):
    file = tmp_path / "plan.json"
    file.write_text("{}")
    code, _, err = command(capsys, file, "--vehicle", RACER)
    assert code == 2
    assert str(file) in err
