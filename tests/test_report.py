"""The report of a plan: one page of HTML, and the command that writes it."""

import dataclasses
import json
import math
import re
import shlex
import sys
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

import peakflight as pf
from peakflight.cli.application import application

pytest.importorskip("plotly")

from peakflight import reporting
from peakflight.reporting import commands, panels, themes
from peakflight.reporting.closeness import closeness
from peakflight.wording import seconds

TILT = math.radians(50)
LIMITS = pf.Limits(speed=3.0, thrust_acceleration=14.0, jerk=50.0, snap=600.0, tilt=TILT)
WAYPOINTS = np.array([[0, 0, 1], [1, 0.5, 1.3], [2, -0.5, 1.0], [3, 0, 1.2]])
HOSTILE = "</script><img src=x onerror=alert(1)> & \"'"


@pytest.fixture(scope="module")
def made() -> pf.Plan:
    return pf.plan(WAYPOINTS, limits=LIMITS, pieces=2, yaw="velocity")


@pytest.fixture(scope="module")
def on_rotors() -> pf.Plan:
    vehicle = pf.find_vehicle("crazyflie-2.1-upgrade").on_rotors()
    limits = pf.Limits(speed=4.0)
    return pf.plan(WAYPOINTS, vehicle=vehicle, limits=limits, yaw="velocity")


@pytest.fixture(scope="module")
def page(made: pf.Plan) -> str:
    return reporting.report_html(made)


def data_of(page: str) -> Any:
    return json.loads(
        re.search(r'<script type="application/json" id="data">(.*?)</script>', page)[1]
    )


def without_plotly(page: str) -> str:
    """The page but for Plotly's own code."""
    parts = re.split(r"<script>", page)
    return min(parts, key=lambda part: "plotly.js v" in part) + parts[-1]


def words(page: str) -> str:
    """What a person reads."""
    body = page[page.index("<body>") : page.index('<script type="application/json"')]
    return " ".join(unescape(re.sub(r"<[^>]*>", " ", body)).split())


def rows_of(page: str, table: str) -> list[list[str]]:
    body = re.search(f'aria-label="{table}".*?<tbody>(.*?)</tbody>', page, re.S)[1]
    return [
        [unescape(re.sub(r"<[^>]*>", "", cell)) for cell in re.findall("<td.*?>(.*?)</td>", row)]
        for row in re.findall("<tr.*?>(.*?)</tr>", body, re.S)
    ]


class TestPage:
    def test_says_time_proof_and_gain(self, made: pf.Plan, page: str) -> None:
        said = words(page)
        guess = pf.plan(WAYPOINTS, limits=LIMITS, yaw="velocity", method="proportional")
        gain = 100.0 * (1.0 - made.duration / guess.duration)
        assert f"{seconds(made.duration)} s Certified Every limit is kept" in said
        assert "NOT certified" not in said
        assert (
            f"shorter by {gain:.1f} % than the proportional guess, {seconds(guess.duration)} s"
            in said
        )
        assert "settings pieces = 2" in said
        assert f"Planned by peakflight {pf.__version__}" in said

    def test_is_complete_by_itself(self, page: str) -> None:
        own = without_plotly(page)
        assert "plotly.js v" in page
        assert "plotly.js v" not in own
        assert set(re.findall(r'(?:src|href)="(?!#)([^"]*)"', own)) == set()
        assert "url(" not in own
        assert "@import" not in own
        policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]
        assert "default-src 'none'" in policy
        assert "http" not in policy

    def test_the_same_plan_gives_the_same_page(self, made: pf.Plan, page: str) -> None:
        assert reporting.report_html(pf.Plan.from_dict(made.to_dict())) == page

    def test_legs(self, made: pf.Plan, page: str) -> None:
        rows = rows_of(page, "Legs")
        times = np.diff(made.waypoint_times)
        assert [row[2] for row in rows] == [seconds(time) for time in times]
        kappa = np.array(list(made.report.peaks.values())).reshape(-1, 3, 2).max(axis=2)
        names = [pf.limits.LABELS.get(name, name.replace("_", " ")) for name in made.report.peaks]
        assert [row[5] for row in rows] == [names[index] for index in kappa.argmax(axis=0)]
        t = np.linspace(0.0, made.duration, 200_001)
        speed = np.linalg.norm(made.trajectory(t, derivative=1), axis=1)
        assert sum(float(row[3]) for row in rows) == pytest.approx(np.trapezoid(speed, t), abs=2e-3)

    def test_limits(self, made: pf.Plan, page: str) -> None:
        rows = {row[0]: row for row in rows_of(page, "Limits")}
        assert len(rows) == len(made.report.peaks)
        assert rows["tilt"][1] == "50°"
        for name, limit in (("speed", 3.0), ("jerk", 50.0)):
            worst = made.report.peaks[name].max()
            assert float(rows[name][2]) == pytest.approx(limit * worst, rel=1e-5)
            assert rows[name][5] == ("binds" if worst >= 0.999 else "")

    def test_plots_are_plots_to_plotly(self, page: str) -> None:
        from plotly import graph_objects

        data = data_of(page)
        assert set(data["plots"]) == {"path", "above", "limits-plot", "legs-plot", "yaw-plot"}
        for theme in data["themes"].values():
            assert set(theme) == set(data["themes"]["light"])
            for plot in data["plots"].values():
                graph_objects.Figure(
                    data=themed(plot["data"], theme), layout=themed(plot["layout"], theme)
                )

    def test_curves_are_those_of_the_plan(self, made: pf.Plan, page: str) -> None:
        plots = data_of(page)["plots"]
        path = plots["path"]["data"][0]
        middle = len(path["x"]) // 2
        time = path["customdata"][middle][0]
        at = made.trajectory(time)
        assert [path[axis][middle] for axis in "xyz"] == pytest.approx(at, abs=1e-5)
        assert max(path["line"]["color"]) == pytest.approx(
            3.0 * made.report.peaks["speed"].max(), rel=1e-3
        )
        drawn = {one["name"]: one for one in plots["limits-plot"]["data"]}
        jerk = np.linalg.norm(made.trajectory(drawn["jerk"]["x"], derivative=3), axis=1)
        assert np.median(np.abs(jerk - drawn["jerk"]["y"])) < 1e-3  # at joints it may jump
        assert len(drawn["tilt"]["x"]) == len(drawn["tilt"]["y"])

    def test_rotors_are_within_what_is_proven(self, on_rotors: pf.Plan) -> None:
        """At joints too, where the pieces of flight and yaw must belong together."""
        assert on_rotors.feasible
        limits = on_rotors.problem.limits
        thrust = panels.limit_panels(on_rotors).panels[-1]
        values = np.array([curve.values for curve in thrust.curves])
        assert thrust.label == "rotor thrust"
        assert values.shape[0] == 4
        assert (
            values.max()
            <= limits.rotor_thrust * on_rotors.report.peaks["rotor_thrust"].max() + 1e-9
        )
        assert values.min() >= limits.least_rotor_thrust - 1e-9
        turning = panels.yaw_panels(on_rotors).panels[-1]
        worst = on_rotors.report.peaks["angular_acceleration_z"].max()
        assert np.abs(turning.curves[0].values).max() <= 20.0 * worst * (1.0 + 1e-6)

    def test_vehicle_with_sources(self, on_rotors: pf.Plan) -> None:
        said = words(reporting.report_html(on_rotors))
        for source in on_rotors.vehicle.sources.values():
            assert source in said
        assert "what the vehicle itself can do, without a margin" in said

    def test_every_colour_is_one(self, on_rotors: pf.Plan) -> None:
        text = json.dumps(data_of(reporting.report_html(on_rotors))["plots"])
        used = set(re.findall(r'"@([a-z0-9-]+)"', text))
        assert used <= set(themes.THEMES["light"])
        assert {"ink", "limit", "speeds", "rotor-3"} <= used

    def test_without_yaw_vehicle_or_guess(self) -> None:
        plan = pf.plan(WAYPOINTS, limits=LIMITS, method="proportional")
        page = reporting.report_html(plan)
        assert "shorter by" not in page
        assert 'id="yaw"' not in page
        assert 'id="vehicle"' not in page

    @pytest.mark.parametrize("limits", [
        {"body_rate": 6.0, "least_thrust_acceleration": 4.0},
        {"angular_acceleration": 90.0},
        {"rotor_thrust": 0.15, "least_rotor_thrust": 0.02},
    ])  # fmt: skip
    def test_every_kind_of_limit_is_drawn(self, limits: dict[str, float]) -> None:
        airframe = pf.find_vehicle("crazyflie-2.1-upgrade").airframe
        kept = pf.Limits(speed=2.0, airframe=airframe, **limits)
        page = reporting.report_html(pf.plan(WAYPOINTS, limits=kept, method="peak"))
        drawn = data_of(page)["plots"]["limits-plot"]["layout"]
        bounds = [shape["y0"] for shape in drawn["shapes"] if shape["xref"] == "paper"]
        texts = " ".join(one["text"] for one in drawn["annotations"])
        for name, value in limits.items():
            assert value in bounds or f"{value:.5g}" in texts, name


class TestProof:
    def test_is_made_again(self, made: pf.Plan) -> None:
        tighter = dataclasses.replace(LIMITS, speed=2.0)
        lying = dataclasses.replace(made, problem=dataclasses.replace(made.problem, limits=tighter))
        assert lying.feasible
        said = words(reporting.report_html(lying))
        assert "NOT certified" in said
        assert "speed reaches 1." in said
        assert "claims to be feasible, proven is the opposite" in said
        assert "Every limit is kept" not in said

    def test_a_missed_waypoint_and_a_jump_are_seen(self, made: pf.Plan) -> None:
        moved = WAYPOINTS + np.array([[0], [1e-3], [0], [0]]) * [0, 0, 1]
        problem = dataclasses.replace(made.problem, waypoints=moved)
        page = reporting.report_html(dataclasses.replace(made, problem=problem))
        assert [row[-1] for row in rows_of(page, "Waypoints")][1] == "1.0e-03"
        assert "waypoint 1 is missed by 0.001 m" in words(page)
        coefficients = made.trajectory.coefficients.copy()
        coefficients[2, 1, 0] += 0.25
        broken = pf.Trajectory(coefficients, made.segment_times)
        page = reporting.report_html(dataclasses.replace(made, trajectory=broken))
        joints = {row[0]: row for row in rows_of(page, "Joints")}
        assert float(joints["velocity"][1].split()[0]) >= 0.25
        assert "NOT certified" in words(page)

    def test_each_kind_of_bound_has_its_own_closeness(
        self, made: pf.Plan, on_rotors: pf.Plan
    ) -> None:
        plain = closeness(made.problem)
        assert [line.split(": ")[0] for line in plain] == [
            "speed, thrust acceleration, jerk, snap", "tilt", "yaw rate, yaw acceleration",
        ]  # fmt: skip
        assert plain[1] == "tilt: to 10⁻¹⁰ of the square of its tangent"
        turned = words(reporting.report_html(on_rotors))
        assert (
            "rotor thrust, least rotor thrust, body rate about z, angular acceleration about z: "
            "together with the yaw, to 10⁻⁶ of the limit or the value, whichever is larger; 10⁻⁴ "
            "where rounding is in the way" in turned
        )
        assert "of its square" not in turned
        airframe = dataclasses.replace(
            on_rotors.problem.airframe,
            yaw_inertia=None,
            torque_per_thrust=None,
            inertia_difference=0.0,
        )
        limits = pf.Limits(airframe=airframe, rotor_thrust=0.15, least_rotor_thrust=0.02)
        alone = dataclasses.replace(made.problem, limits=limits, yaw=None)
        said = "rotor thrust, least rotor thrust: to 10⁻¹⁰ of the limit or the value, whichever "
        assert closeness(alone)[-1] == said + "is larger; 10⁻⁷ where rounding is in the way"
        limits = pf.Limits(speed=3.0, body_rate=3.0)
        assert closeness(dataclasses.replace(made.problem, limits=limits, yaw=None)) == [
            "speed: to 10⁻¹⁰ of the square",
            "body rate: to 10⁻¹⁰ of the square, and what rounding can amount to",
        ]

    def test_proof_page_and_check_allow_the_same_miss(
        self, made: pf.Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        moved = WAYPOINTS + np.array([[0], [1e-3], [0], [0]]) * [0, 0, 1]
        problem = dataclasses.replace(made.problem, waypoints=moved)
        monkeypatch.setattr(pf.result, "WAYPOINT_TOLERANCE", 2.6e-4)
        plan = dataclasses.replace(made, problem=problem)
        said = words(reporting.report_html(plan))
        assert "NOT certified" not in said
        assert "1.0e-03 m at most, 1.0e-03 m is allowed" in said
        plan.save(tmp_path / "plan.json")
        checked = CliRunner().invoke(application, ["check", str(tmp_path / "plan.json")])
        assert "(1.0e-03 m allowed)" in checked.stdout

    def test_a_false_claim_is_told(self, made: pf.Plan) -> None:
        claims = made.to_dict() | {"duration": 1.0}
        said = words(reporting.report_html(made, claims=claims))
        assert "the file claims a duration of 1.0 s" in said
        assert "Certified Every limit" in said


def test_texts_of_users_mean_nothing_to_a_browser(made: pf.Plan) -> None:
    vehicle = dataclasses.replace(
        pf.find_vehicle("crazyflie-2.1"), name=HOSTILE, sources={"mass": HOSTILE}
    )
    plan = pf.plan(WAYPOINTS, vehicle=vehicle, method="peak")
    plan = dataclasses.replace(plan, message=HOSTILE, version=HOSTILE, settings={HOSTILE: HOSTILE})
    page = reporting.report_html(plan, title=HOSTILE, file=HOSTILE)
    assert "<img" not in without_plotly(page)
    assert page.count("<script") - page.count("</script>") == 0
    assert words(page).count(HOSTILE) >= 5
    assert reporting.report_html(plan).count("</script>") == page.count("</script>")
    broken = dataclasses.replace(plan, method=HOSTILE)
    assert "<img" not in without_plotly(reporting.report_html(broken))


def test_what_is_no_text_is_replaced(made: pf.Plan, tmp_path: Path) -> None:
    odd = "half \ud800 of one"
    plan = dataclasses.replace(made, message=odd, version=odd, settings={"variant": odd})
    path = tmp_path / "page.html"
    reporting.write_report(plan, path, title=odd, file="plan-\udcff.json")
    said = words(path.read_text(encoding="utf-8"))
    assert said.count("half ? of one") == 4


CASES: dict[str, dict[str, Any]] = {
    "joint": {"limits": LIMITS, "pieces": 2, "effort": 1e-6},
    "peak": {"limits": LIMITS, "method": "peak", "minimize": "snap"},
    "bry": {"limits": pf.Limits(speed=3.0, jerk=100 / 3), "method": "bry", "time_penalty": 50.0},
    "vehicle": {"vehicle": "crazyflie-2.1", "limits": pf.Limits(speed=1.7), "method": "peak"},
    "rotors": {
        "vehicle": pf.VEHICLES["racing-quad"].on_rotors(),
        "limits": pf.Limits(speed=6.0),
        "yaw": pf.Heading(policy="point", point=(1.0, -2.0, 0.0), rate=2.5, acceleration=None),
    },
    "yaw": {
        "limits": LIMITS,
        "yaw": pf.Heading(policy="fixed", angle=-0.3, about="body", rate=2.0),
    },
    "yaw at waypoints": {"limits": LIMITS, "method": "peak", "yaw": [0.0, 0.5, 1.0, 0.0]},
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_the_commands_make_the_same_plan(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    first = pf.plan(WAYPOINTS, **CASES[name])
    first.save("a plan.json")
    plan = pf.Plan.load("a plan.json")
    command = commands.plan_command(plan, "a plan.json")
    assert command is not None
    words = shlex.split(command)
    assert words[0] == "peakflight"
    result = CliRunner().invoke(application, [*words[1:], "--no-figures", "--export", "json"])
    assert result.exit_code == 0, result.output
    found: dict[str, Any] = {}
    exec(commands.plan_in_python(plan, "a plan.json"), found)
    for again in (pf.Plan.load("again/plan.json"), found["again"]):
        assert again.method == plan.method
        assert again.settings == plan.settings
        assert again.problem.limits == plan.problem.limits
        np.testing.assert_array_equal(again.trajectory.coefficients, plan.trajectory.coefficients)
        np.testing.assert_array_equal(again.yaw([0.1, 0.5]), plan.yaw([0.1, 0.5]))


@pytest.mark.parametrize("options", [
    {"start": {"velocity": [1.0, 0.0, 0.0]}},
    {"derivatives": {1: {"velocity": [1.0, 0.0, 0.0]}}},
    {"minimize": {"jerk": 1.0, "snap": 0.1}},
    {"vehicle": dataclasses.replace(pf.VEHICLES["crazyflie-2.1"], mass=0.03)},
    {"limits": pf.Limits(speed=2.0, airframe=pf.VEHICLES["crazyflie-2.1"].airframe)},
])  # fmt: skip
def test_no_command_is_better_than_a_wrong_one(options: dict[str, Any]) -> None:
    plan = pf.plan(WAYPOINTS, **{"limits": pf.Limits(speed=2.0), "method": "peak", **options})
    assert commands.plan_command(plan, "plan.json") is None
    assert commands.plan_in_python(plan, "plan.json") is not None


@pytest.mark.parametrize("settings", [
    {"pieces=1)\nimport os\nprint(os.name": 1},
    {"no_such_setting": 1},
    {"pieces": [1, 2]},
    {"pieces": "many"},
    {"effort": type("Odd", (float,), {"__repr__": lambda self: "print(1)"})(1.0)},
])  # fmt: skip
def test_only_settings_of_the_method_are_typed_again(
    made: pf.Plan, settings: dict[str, Any]
) -> None:
    plan = dataclasses.replace(made, settings=settings)
    assert commands.plan_in_python(plan, "plan.json") is None
    assert commands.plan_command(plan, "plan.json") is None
    assert "pf.plan(" not in words(reporting.report_html(plan))


def test_what_only_python_can_say(made: pf.Plan) -> None:
    plan = dataclasses.replace(made, settings={"time_limit": None, "effort": True})
    assert commands.plan_command(plan, "plan.json") is None
    assert "time_limit=None, effort=True)" in commands.plan_in_python(plan, "plan.json")


def test_a_plan_that_began_from_another_says_so(made: pf.Plan, tmp_path: Path) -> None:
    pf.replan(made, waypoints=WAYPOINTS + 0.01).save(tmp_path / "plan.json")
    plan = pf.Plan.load(tmp_path / "plan.json")
    assert plan.settings == {"pieces": 2, "initial": "a plan"}
    said = words(reporting.report_html(plan))
    assert "pieces = 2, initial = a plan" in said
    assert "Plan it again" not in said
    assert "Prove it again" in said


def test_numbers_of_numpy_are_typed_again_as_numbers() -> None:
    options = {"pieces": np.int64(2), "effort": np.float64(1e-6)}
    plan = pf.plan(WAYPOINTS, limits=LIMITS, **options)
    assert {name: type(value) for name, value in plan.settings.items()} == {
        "pieces": int, "effort": float,
    }  # fmt: skip
    assert "pieces=2, effort=1e-06)" in commands.plan_in_python(plan, "plan.json")
    assert "--pieces 2 --effort 1e-06" in commands.plan_command(plan, "plan.json")


def test_a_plan_that_no_method_made(hand_plan: Callable[..., pf.Plan]) -> None:
    plan = hand_plan(start_time=1.7e9)
    page = reporting.report_html(plan)
    assert commands.plan_command(plan, "plan.json") is None
    assert commands.plan_in_python(plan, "plan.json") is None
    assert "peakflight check plan.json" in page
    times = data_of(page)["plots"]["limits-plot"]["data"][0]["x"]
    assert times[-1] - times[0] == pytest.approx(plan.duration, abs=1e-5)
    assert len(set(times)) > 700  # four pieces of 200, which share their ends


def test_without_plotly_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "plotly", None)
    monkeypatch.delitem(sys.modules, "peakflight.reporting")
    with pytest.raises(pf.MissingExtra, match=re.escape("pip install 'peakflight[page]'")):
        import peakflight.reporting  # noqa: F401


@pytest.fixture
def run(tmp_path: Path, made: pf.Plan, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    monkeypatch.chdir(tmp_path)
    made.save("plan.json")

    def invoke(*arguments: object) -> Result:
        result = CliRunner().invoke(application, ["report", *map(str, arguments)])
        assert result.exception is None or isinstance(result.exception, SystemExit)
        return result

    return invoke


class TestCommand:
    def test_writes_the_page(self, run: Callable[..., Result], made: pf.Plan, page: str) -> None:
        result = run("plan.json", "-o", "page.html", "--title", "Flight plan")
        assert result.exit_code == 0
        assert result.stderr == ""
        assert "certified" in result.stdout
        assert Path("page.html").read_text() == page
        assert sorted(path.name for path in Path().iterdir()) == ["page.html", "plan.json"]

    @pytest.mark.parametrize("spoil", [
        lambda values: values["coefficients"][1][5].__setitem__(0, 1e200),
        lambda values: values["coefficients"][1][5].__setitem__(0, 1e307),
        lambda values: values.update(start_time=1e9),
        lambda values: values.pop("yaw"),
        lambda values: values.update(peaks={}),
    ])  # fmt: skip
    def test_a_plan_that_is_far_from_a_flight_has_a_page(
        self, run: Callable[..., Result], on_rotors: pf.Plan, spoil: Callable[[Any], Any]
    ) -> None:
        values = on_rotors.to_dict()
        spoil(values)
        Path("odd.json").write_text(json.dumps(values))
        result = run("odd.json")
        assert result.exit_code == 1, result.stderr
        assert result.stderr.count("\n") == 1
        assert data_of(Path("report.html").read_text())["plots"]

    def test_texts_and_names_that_are_no_utf_8(
        self, run: Callable[..., Result], made: pf.Plan
    ) -> None:
        values = made.to_dict() | {"message": "\ud800"}
        Path("plan-\udcff.json").write_text(json.dumps(values))
        result = run("plan-\udcff.json", "--json")
        assert result.exit_code == 0, result.stderr
        assert json.loads(result.stdout)["report"] == "report.html"
        assert "<h1>plan-?</h1>" in Path("report.html").read_text(encoding="utf-8")

    def test_says_where_as_json(self, run: Callable[..., Result], tmp_path: Path) -> None:
        said = json.loads(run(tmp_path / "plan.json", "--json").stdout)
        assert Path(said["report"]) == tmp_path / "report.html"
        assert f"<h1>{tmp_path.name}</h1>" in Path(said["report"]).read_text()
        assert said["feasible"] is True

    def test_an_unproven_plan_has_a_page_and_exit_code_1(
        self, run: Callable[..., Result], made: pf.Plan
    ) -> None:
        values = made.to_dict()
        values["limits"]["speed"] = 2.0
        Path("fast.json").write_text(json.dumps(values))
        result = run("fast.json")
        assert result.exit_code == 1
        assert "NOT certified" in result.stdout
        assert "not feasible: speed reaches" in result.stderr
        assert "NOT certified" in Path("report.html").read_text()
        values = made.to_dict() | {"duration": 1.0}
        Path("wrong.json").write_text(json.dumps(values))
        result = run("wrong.json")
        assert result.exit_code == 1
        assert "false claim: claims a duration of 1.0 s" in result.stderr

    @pytest.mark.parametrize(
        "content", ["", "[1, 2]", "{}", '{"status": "solved"}', "x,y,z\n0,0,1\n"]
    )
    def test_refuses_what_is_no_plan(self, run: Callable[..., Result], content: str) -> None:
        Path("no.json").write_text(content)
        Path("report.html").write_text("as before")
        result = run("no.json")
        assert result.exit_code == 2
        assert result.stdout == ""
        assert result.stderr.count("\n") == 1
        assert "no.json" in result.stderr
        assert Path("report.html").read_text() == "as before"

    def test_refuses_where_it_cannot_write(self, run: Callable[..., Result]) -> None:
        for place in ("missing/page.html", "."):
            result = run("plan.json", "-o", place)
            assert result.exit_code == 2
            assert result.stderr.count("\n") == 1
        assert [path.name for path in Path().iterdir()] == ["plan.json"]

    def test_does_not_write_over_the_plan(self, run: Callable[..., Result]) -> None:
        before = Path("plan.json").read_bytes()
        Path("link.json").symlink_to("plan.json")
        Path("report.html").hardlink_to("plan.json")
        for arguments in (["-o", "plan.json"], ["-o", "./link.json"], []):
            result = run("plan.json", *arguments)
            assert result.exit_code == 2
            assert "is the plan itself; name another file with -o" in result.stderr
            assert result.stderr.count("\n") == 1
        assert Path("plan.json").read_bytes() == before
        result = run("plan.json", "-o", "n" * 300)
        assert result.exit_code == 2
        assert "cannot be written" in result.stderr


def themed(value: Any, theme: dict[str, Any]) -> Any:
    """As the page puts colours in."""
    if isinstance(value, str):
        return theme[value[1:]] if value.startswith("@") else value
    if isinstance(value, list):
        return [themed(one, theme) for one in value]
    if isinstance(value, dict):
        return {key: themed(one, theme) for key, one in value.items()}
    return value
