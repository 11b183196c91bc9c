import io
import json
import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

import peakflight as pf
import peakflight.exporting.writing
import peakflight.planner
from peakflight.cli.application import application
from peakflight.cli.folder import folder_for
from peakflight.cli.options import parse_limits
from peakflight.cli.plan_output import print_plan
from peakflight.cli.progress import Progress
from peakflight.formats import FLIGHT_FORMATS
from peakflight.formats.flight_files import USUAL
from peakflight.limits import PAPER_LIMITS
from peakflight.methods import METHODS
from peakflight.wording import ranges, seconds, written

Run = Callable[..., Result]

WAYPOINTS = [[0, 0, 1], [0.6, 0.5, 1.2], [0.2, 0.9, 1.0], [0.9, 1.3, 1.1], [3.2, 1.2, 1.4]]
PICTURES = {"course.png", "derivatives.png", "segment_times.png"}
DATA = {"plan.json", *(FLIGHT_FORMATS[name].filename for name in USUAL)}
CONTRACT = {
    "status",
    "method",
    "duration",
    "segment_times",
    "degree",
    "coefficients",
    "limits",
    "peaks",
    "waypoints",
    "pieces",
    "iterations",
    "wall_time_s",
    "version",
}
COMPILING = "peakflight: compiling the planner for this machine, once; this takes some seconds\n"
QUICK = ("--no-figures", "--method", "proportional")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current folder but for one course, and an environment that says nothing."""
    for name in ("FORCE_COLOR", "NO_COLOR", "COLUMNS", "PEAKFLIGHT_DEBUG"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)
    write_course(tmp_path / "lap.csv", WAYPOINTS)
    return tmp_path


@pytest.fixture
def run() -> Run:
    def invoke(*arguments: object) -> Result:
        result = CliRunner().invoke(application, [str(argument) for argument in arguments])
        assert result.exception is None or isinstance(result.exception, SystemExit)
        return result

    return invoke


@pytest.fixture
def plan_file(run: Run, folder: Path) -> Path:
    assert run("plan", "lap.csv", "-o", "made", *QUICK).exit_code == 0
    return folder / "made" / "plan.json"


def write_course(path: Path, waypoints: object) -> None:
    path.write_text("x,y,z\n" + "\n".join(",".join(map(str, point)) for point in waypoints))


def shell(*arguments: object, code: str | None = None, **options: object) -> subprocess.Popen[str]:
    """A process of its own; `code` is Python that runs before the command line does."""
    start = ["-m", "peakflight"]
    if code is not None:
        start = ["-c", f"{code}\nfrom peakflight.cli import main; main()"]
    return subprocess.Popen(
        [sys.executable, *start, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        env={**os.environ, "PYTHONIOENCODING": "utf-8"},
        # what is started in the background of a shell ignores Ctrl-C
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509 - no threads
        **options,
    )


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def refused(result: Result, *words: str) -> None:
    """Exit code 2, nothing on stdout, one line on stderr with these words in it."""
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith("peakflight: ")
    for word in words:
        assert word in result.stderr


def edit(path: Path, **values: object) -> dict[str, object]:
    content = {**json.loads(path.read_text()), **values}
    path.write_text(json.dumps(content))
    return content


class TestPlan:
    def test_writes_every_file_and_says_what_came_out(self, run: Run, folder: Path) -> None:
        result = run("plan", "lap.csv", "-o", "out")
        assert result.exit_code == 0
        assert result.stderr.replace(COMPILING, "") == ""
        assert names(folder / "out") == DATA | PICTURES
        plan = pf.Plan.load(folder / "out" / "plan.json")
        assert plan.feasible
        assert plan.problem.limits == PAPER_LIMITS
        for words in (
            "lap: 5 waypoints, 4 legs",
            "limits (the paper's): speed=5,thrust_acceleration=15.5,jerk=62,snap=800",
            f"{plan.duration:.4f} s",
            "solved",
            "certified      yes",
            "planning time",
            f"iterations     {plan.iterations}",
            "wrote to out:",
            *DATA,
            *PICTURES,
        ):
            assert words in result.stdout
        for leg, duration in enumerate(np.diff(plan.waypoint_times)):
            assert any(
                line.split()[:2] == [str(leg), f"{duration:.4f}"]
                for line in result.stdout.splitlines()
            )

    def test_output_is_plain_and_fits_80_columns(self, run: Run) -> None:
        limits = "speed=5,jerk=62,snap=800,tilt=50deg,least_thrust_acceleration=3"
        result = run("plan", "lap.csv", *QUICK, "--limits", limits)
        assert result.exit_code == 0
        assert "\x1b" not in result.stdout
        assert max(map(len, result.stdout.splitlines())) <= 80
        assert not any(line.endswith(" ") for line in result.stdout.splitlines())

    def test_many_legs_are_thinned(self, run: Run) -> None:
        rng = np.random.default_rng(2)
        write_course(Path("long.csv"), np.cumsum(rng.normal(size=(51, 3)), axis=0))
        lines = run("plan", "long.csv", *QUICK).stdout.splitlines()
        start = next(n for n, line in enumerate(lines) if line.startswith("leg "))
        legs = [line.split()[0] for line in lines[start + 2 : start + 23]]
        assert legs == [*map(str, range(10)), "...", *map(str, range(40, 50))]
        assert any("first and last 10 of 50 legs" in line for line in lines)

    def test_legs_of_several_pieces_are_summed(
        self, hand_plan: Callable[..., pf.Plan], capsys: pytest.CaptureFixture[str]
    ) -> None:
        plan = hand_plan(pieces=(1, 3, 2))
        options = {"variant": None, "given_limits": PAPER_LIMITS, "before": (), "after": ()}
        print_plan(plan, course="x", folder=Path("d"), files={}, summaries={}, **options)
        printed = capsys.readouterr().out
        for leg, duration in enumerate(np.diff(plan.waypoint_times)):
            assert f"{leg}      {duration:.4f}" in printed

    def test_json_is_one_object_and_nothing_else(self, run: Run, folder: Path) -> None:
        result = run("plan", "lap.csv", "-o", "out", "--json")
        assert result.exit_code == 0
        assert result.stdout.count("\n") == 1
        printed = json.loads(result.stdout)
        stored = json.loads((folder / "out" / "plan.json").read_text())
        stored.pop("history")
        assert set(printed) >= CONTRACT
        assert {key: printed[key] for key in stored} == stored
        assert printed["course"] == "lap"
        assert {Path(path).name for path in printed["files"].values()} == DATA | PICTURES
        assert all(Path(path).is_file() for path in printed["files"].values())
        assert printed["notes"] == []

    @pytest.mark.parametrize("method", METHODS)
    def test_every_method(self, run: Run, method: str) -> None:
        result = run("plan", "lap.csv", "--no-figures", "--method", method, "--json")
        assert result.exit_code == 0
        assert json.loads(result.stdout)["method"] == method

    def test_variant_paper(self, run: Run, folder: Path) -> None:
        result = run("plan", "lap.csv", "--no-figures", "--variant", "paper")
        assert result.exit_code == 0
        assert "peak, variant paper" in result.stdout
        history = pf.Plan.load(folder / "lap-plan" / "plan.json").history
        assert history is not None
        assert history.kappa is not None

    def test_limits_are_those_given(self, run: Run, folder: Path) -> None:
        result = run(
            "plan", "lap.csv", *QUICK, "--limits", "speed=4, jerk=30", "--limits=tilt=30deg"
        )
        assert result.exit_code == 0
        assert "limits: speed=4,jerk=30,tilt=30deg\n" in result.stdout
        limits = pf.Plan.load(folder / "lap-plan" / "plan.json").problem.limits
        assert limits == pf.Limits(speed=4.0, jerk=30.0, tilt=np.radians(30.0))

    def test_spline_options(self, run: Run) -> None:
        options = ("--minimize", "snap", "--degree", "5", "--continuity", "3")
        printed = json.loads(run("plan", "lap.csv", *QUICK, "--json", *options).stdout)
        assert (printed["degree"], printed["problem"]["continuity"]) == (5, 3)
        assert printed["problem"]["minimize"] == "snap"

    def test_export_chooses_flight_files(self, run: Run, folder: Path) -> None:
        assert run("plan", "lap.csv", *QUICK, "--export", "samples").exit_code == 0
        assert names(folder / "lap-plan") == {"plan.json", "samples.csv"}

    def test_no_crazyflie_file_beyond_degree_7_is_a_note(self, run: Run, folder: Path) -> None:
        result = run("plan", "lap.csv", *QUICK, "--degree", "9")
        assert result.exit_code == 0
        assert "note: no crazyflie.csv: the trajectory has degree 9" in result.stdout
        assert names(folder / "lap-plan") == {"plan.json", "samples.csv"}

    def test_files_of_an_earlier_plan_are_named(self, run: Run, plan_file: Path) -> None:
        result = run("plan", "lap.csv", "-o", plan_file.parent, *QUICK, "--export", "samples")
        assert "note: from an earlier run in this folder: crazyflie.csv" in result.stdout

    def test_yaw_and_unused_times(self, run: Run, folder: Path) -> None:
        Path("t.csv").write_text("t,x,y,z,yaw\n0,0,0,1,0\n1,1,0,1,0.5\n2,2,1,1,1\n")
        result = run("plan", "t.csv", *QUICK)
        assert "note: the times in the course are not used" in result.stdout
        plan = pf.Plan.load(folder / "t-plan" / "plan.json")
        assert plan.problem.yaw is not None
        assert list(plan.problem.yaw) == [0.0, 0.5, 1.0]

    def test_yaw_is_planned_proven_and_in_every_file(self, run: Run, folder: Path) -> None:
        limits = ("--yaw-limits", "rate=2,acceleration=10")
        result = run("plan", "lap.csv", "-o", "out", "--yaw", "velocity", *limits)
        assert result.exit_code == 0
        assert names(folder / "out") == DATA | PICTURES | {"yaw.png"}
        for words in (
            "yaw: velocity; limits: rate=2,acceleration=10",
            "yaw rate                2 rad/s",
            "deg off the direction it follows",
            "note: crazyflie.csv: its yaw is up to",
        ):
            assert words in result.stdout
        plan = pf.Plan.load(folder / "out" / "plan.json")
        assert plan.problem.heading == pf.Heading(policy="velocity", rate=2.0, acceleration=10.0)
        assert plan.report.peaks["yaw_rate"].max() <= 1.0
        header = (folder / "out" / "samples.csv").read_text().split("\n", 1)[0]
        assert header.endswith("yaw [rad],yaw_rate [rad/s],yaw_acceleration [rad/s^2]")
        checked = run("check", "out/plan.json")
        assert checked.exit_code == 0
        assert "yaw acceleration" in checked.stdout
        worst = json.loads(run("check", "out/plan.json", "--json").stdout)["worst"]
        assert worst["yaw_rate"]["limit"] == 2.0

    def test_check_finds_a_yaw_that_was_changed(self, run: Run, folder: Path) -> None:
        assert run("plan", "lap.csv", "-o", "out", *QUICK, "--yaw", "point:1,1,0").exit_code == 0
        path = folder / "out" / "plan.json"
        yaw = json.loads(path.read_text())["yaw"]
        yaw["coefficients"][3][1][0] += 10.0
        edit(path, yaw=yaw)
        result = run("check", path)
        assert result.exit_code == 1
        assert "claims to be feasible, but is not: yaw rate reaches" in result.stderr
        edit(path, yaw=None)
        assert "there is no yaw motion" in run("check", path).stderr

    @pytest.mark.parametrize(
        ("text", "angle"), [("90deg", np.pi / 2), ("-1.5", -1.5), ("-180deg", -np.pi)]
    )
    def test_fixed_yaw(self, text: str, angle: float, run: Run, folder: Path) -> None:
        assert run("plan", "lap.csv", *QUICK, "--yaw", text).exit_code == 0
        plan = pf.Plan.load(folder / "lap-plan" / "plan.json")
        assert plan.yaw(0.1) == pytest.approx(angle)

    def test_yaw_of_the_course_under_limits(self, run: Run, folder: Path) -> None:
        Path("t.csv").write_text("x,y,z,yaw\n0,0,1,0\n1,0,1,3\n2,1,1,0\n")
        for options in (("--yaw", "waypoints"), ("--yaw-limits", "rate=1")):
            result = run("plan", "t.csv", *QUICK, *options)
            assert result.exit_code == 0
            assert "note: slowed down by" in result.stdout
        plan = pf.Plan.load(folder / "t-plan" / "plan.json")
        assert plan.problem.heading.acceleration is None
        again = run("plan", "t-plan/plan.json", "-o", "again", *QUICK, "--yaw", "waypoints")
        assert again.exit_code == 0

    @pytest.mark.parametrize(
        ("options", "words"),
        [
            (("--yaw", "north"), "yaw is 'north'; it must be an angle in rad or such as 90deg"),
            (("--yaw", "point:1,2"), "point:x,y,z with three numbers"),
            (("--yaw", "point:1,2,nan"), "a coordinate of the yaw point = nan; it must be finite"),
            (("--yaw", "inf"), "yaw = inf; it must be finite"),
            (("--yaw", "waypoints"), "the yaw of the course, which has none; give a --yaw"),
            (("--yaw-limits", "rate=1"), "the yaw of the course, which has none; give a --yaw"),
            (
                ("--yaw", "1", "--yaw-limits", "rate=-1"),
                "limit yaw_rate is -1; it must be",
            ),
            (("--yaw", "1", "--yaw-limits", "speed=1"), "unknown limit 'speed'; known are rate"),
            (("--yaw", "1", "--yaw-limits", "rate"), "'rate' is not a limit; write name=value"),
        ],
    )
    def test_bad_yaw_is_one_line(self, options: tuple[str, ...], words: str, run: Run) -> None:
        refused(run("plan", "lap.csv", *QUICK, *options), words)

    def test_near_equal_waypoints_are_merged_with_a_note(self, run: Run, folder: Path) -> None:
        write_course(Path("near.csv"), [*WAYPOINTS, [3.2, 1.2, 1.4005], [5, 1, 1]])
        result = run("plan", "near.csv", *QUICK)
        assert result.exit_code == 0
        assert "note: waypoint 5 (line 7) is 0.5 mm from waypoint 4: merged" in result.stdout
        plan = pf.Plan.load(folder / "near-plan" / "plan.json")
        assert len(plan.problem.waypoints) == 6
        assert "waypoint 5 (line 7) is 0.5 mm from waypoint 4" in plan.message

    def test_near_equal_waypoints_are_refused_with_strict(self, run: Run, folder: Path) -> None:
        write_course(Path("near.csv"), [*WAYPOINTS, [3.2, 1.2, 1.4005], [5, 1, 1]])
        refused(run("plan", "near.csv", "--strict"), "near.csv: waypoint 5 (line 7)", "0.5 mm")
        assert not (folder / "near-plan").exists()

    def test_many_merges_are_thinned(self, run: Run) -> None:
        write_course(Path("near.csv"), [[0, 0, 1]] * 30 + [[1, 1, 1]])
        result = run("plan", "near.csv", *QUICK)
        assert result.stdout.count("note: waypoint") == 10
        assert "note: 19 more like these" in result.stdout

    def test_5000_waypoints(self, run: Run) -> None:
        rng = np.random.default_rng(3)
        write_course(Path("big.csv"), np.cumsum(rng.normal(size=(5000, 3)), axis=0))
        result = run("plan", "big.csv", *QUICK, "--export", "crazyflie")
        assert result.exit_code == 0
        assert "big: 5000 waypoints, 4999 legs" in result.stdout
        assert "note: no crazyflie.csv: the flight has 4999 pieces; there is room" in result.stdout
        assert len(result.stdout.splitlines()) < 60
        assert run("check", "big-plan/plan.json").exit_code == 0

    def test_what_stopped_the_method_early_is_a_note(
        self, run: Run, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        solve = peakflight.planner.plan

        def stop(problem: pf.Problem, **options: object) -> pf.Plan:
            plan = solve(problem, **options)
            return replace(plan, status=pf.Status.ITERATION_LIMIT, message="2000 were not enough")

        monkeypatch.setattr(peakflight.planner, "plan", stop)
        result = run("plan", "lap.csv", *QUICK)
        assert result.exit_code == 0
        assert "status         iteration limit" in result.stdout
        assert "note: 2000 were not enough" in result.stdout

    def test_no_feasible_trajectory(
        self, run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        solve = peakflight.planner.plan

        def fail(problem: pf.Problem, **options: object) -> pf.Plan:
            plan = solve(problem, **options)
            peaks = {name: 1.2 * kappa for name, kappa in plan.report.peaks.items()}
            report = replace(plan.report, feasible=False, peaks=peaks, problems=("too fast",))
            return replace(plan, status=pf.Status.INFEASIBLE, report=report, message="too fast")

        monkeypatch.setattr(peakflight.planner, "plan", fail)
        result = run("plan", "lap.csv", "--method", "proportional")
        assert result.exit_code == 1
        assert (
            result.stderr.replace(COMPILING, "")
            == "peakflight: no feasible trajectory (infeasible)\n"
        )
        for words in ("certified      no", "no feasible trajectory: too fast", "1.2", "exceeded"):
            assert words in result.stdout
        assert names(folder / "lap-plan") == {"plan.json", *PICTURES}
        assert not pf.Plan.load(folder / "lap-plan" / "plan.json").feasible
        result = run("plan", "lap.csv", *QUICK, "--json")
        assert result.exit_code == 1
        assert json.loads(result.stdout)["status"] == "infeasible"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("0,0,1\n1,nan,1\n2,0,1\n", "waypoint 1 (line 2) has y = nan"),
        ("0,0,1\n1,0,1\n2,0,inf\n", "waypoint 2 (line 3) has z = inf"),
        ("0,0,-Infinity\n1,0,1\n", "waypoint 0 (line 1) has z = -inf"),
        ("0,0,1\n", "1 waypoint given"),
        ("x,y,z\n", "no waypoints"),
        ("# a remark\n", "no waypoints"),
        ("0,0\n1,1\n", "line 1 has 2 columns"),
        ("0,0,1\n1,1\n2,2,1\n", "line 2 has 2 columns"),
        ("0,0,1,0,0,0\n1,1,1,0,0,0\n", "line 1 has 6 columns"),
        ("0,0,1\nnorth,0,1\n", "line 2: x is 'north'"),
        ("north,east,up\n", "names no column x"),
        ("", "the file is empty"),
        (" \n\n", "the file is empty"),
        ("0,0,1\n0,0,1\n", "all 2 waypoints lie within 1 mm"),
        ("[[0, 0, 1], [1, 0", "not JSON"),
        ("[[0, 0, 1], [1, 0]]", "[1] has 2 numbers"),
        ("[[0, 0, 1], [1, 0, NaN]]", "NaN"),
        ("[]", "holds no waypoints"),
        ("waypoints: [[0, 0, 1], [1, a, 1]]", "'a'"),
        ("waypoints: [[0, 0, 1], [1, 0", "not YAML"),
        ("0,0,1\n2e7,0,1\n", "within 1e+07 m of zero"),
    ],
)
def test_bad_courses(run: Run, folder: Path, content: str, words: str) -> None:
    Path("bad.csv").write_text(content)
    refused(run("plan", "bad.csv"), "bad.csv", words)
    assert names(folder) == {"lap.csv", "bad.csv"}


def test_courses_that_are_no_files(run: Run, folder: Path) -> None:
    refused(run("plan", "missing.csv"), "missing.csv: no such file")
    refused(run("plan", folder), "is a folder")
    Path("binary.csv").write_bytes(b"\x89PNG\xff\x00")
    refused(run("plan", "binary.csv"), "binary.csv")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("speed=0", "limit speed is 0; it must be positive"),
        ("speed=-1", "limit speed is -1; it must be positive"),
        ("speed=nan", "limit speed is nan"),
        ("speed=inf", "limit speed is inf"),
        ("speed=fast", "limit speed is 'fast'; it must be a number, in m/s"),
        ("speed=1_0", "limit speed is '1_0'"),
        ("speed=5deg", "limit speed is '5deg'"),
        ("thrust_acceleration=9.81", "must be above gravity"),
        ("thrust_acceleration=3", "must be above gravity"),
        ("least_thrust_acceleration=10", "must be below gravity"),
        ("tilt=50", "write 50deg for degrees"),
        ("tilt=90deg", "must be below pi/2"),
        ("tilt=steep", "in rad, or degrees such as 50deg"),
        ("body_rate=400deg", "'400deg'; it must be a number, in rad/s"),
        ("velocity=5", "unknown limit 'velocity'; known are speed,"),
        ("speed=5,speed=6", "limit speed is given twice"),
        ("speed", "'speed' is not a limit"),
        ("speed=", "'speed=' is not a limit"),
        ("=5", "'=5' is not a limit"),
        ("speed=5,", "'' is not a limit"),
        ("", "'' is not a limit"),
        ("speed=" + "9" * 9 + "x" * 900, "xxx'..."),
    ],
)
def test_bad_limits(run: Run, folder: Path, text: str, words: str) -> None:
    for command in (("plan", "lap.csv"), ("check", "plan.json")):
        refused(run(*command, "--limits", text), "'--limits'", words)
    assert names(folder) == {"lap.csv"}


class TestVehicles:
    def test_plan_keeps_the_limits_of_the_vehicle_but_those_given(
        self, run: Run, folder: Path
    ) -> None:
        options = ("--vehicle", "crazyflie-2.1", "--limits", "speed=2,jerk=40")
        result = run("plan", "lap.csv", "--method", "proportional", "-o", "out", *options)
        assert result.exit_code == 0
        assert names(folder / "out") == DATA | PICTURES | {"rotors.png"}
        plan = pf.Plan.load(folder / "out" / "plan.json")
        stock = pf.VEHICLES["crazyflie-2.1"]
        assert plan.problem.limits == replace(stock.limits, speed=2.0, jerk=40.0)
        assert plan.vehicle is not None
        assert plan.vehicle.rotor_thrust == stock.rotor_thrust
        assert "limits (of crazyflie-2.1 but speed, jerk): speed=2,thrust_" in result.stdout
        assert "rotor thrusts and body rates, against time" in result.stdout
        checked = run("check", "out/plan.json")
        assert checked.exit_code == 0
        assert "for crazyflie-2.1" in checked.stdout
        assert json.loads(run("check", "out/plan.json", "--json").stdout)["vehicle"] == stock.name

    def test_rotors_in_place_of_the_limits_that_stand_for_them(
        self, run: Run, folder: Path
    ) -> None:
        options = ("--vehicle", "racing-quad", "--rotors", "--limits", "speed=9")
        result = run("plan", "lap.csv", "-o", "out", *options)
        assert result.exit_code == 0
        plan = pf.Plan.load(folder / "out" / "plan.json")
        quad = pf.VEHICLES["racing-quad"]
        assert plan.problem.limits == replace(quad.on_rotors().limits, speed=9.0)
        assert plan.report.peaks["rotor_thrust"].max() <= 1.0
        assert "rotor thrust " in result.stdout
        assert run("check", "out/plan.json").exit_code == 0
        refused(run("plan", "lap.csv", "--rotors"), "--rotors needs --vehicle")

    def test_check_takes_other_limits_whole(self, run: Run, folder: Path) -> None:
        run("plan", "lap.csv", "--vehicle", "racing-quad", "-o", "out", *QUICK)
        result = run("check", "out/plan.json", "--limits", "speed=90", "--json")
        assert json.loads(result.stdout)["limits"] == {"speed": 90.0}

    def test_a_file_of_ones_own(self, run: Run, folder: Path) -> None:
        printed = run("vehicles", "racing-quad", "--yaml")
        assert printed.exit_code == 0
        (folder / "mine.yaml").write_text(printed.stdout.replace("0.85", "0.95"))
        result = run("plan", "lap.csv", "--vehicle", "mine.yaml", *QUICK, "--json")
        assert result.exit_code == 0
        planned = json.loads(result.stdout)
        assert planned["problem"]["vehicle"]["mass"] == 0.95
        assert planned["limits"]["thrust_acceleration"] == pytest.approx(24.27 * 0.85 / 0.95, 1e-3)

    def test_compare_keeps_the_limits_of_the_vehicle(self, run: Run) -> None:
        options = ("--vehicle", "racing-quad", "--methods", "proportional")
        result = run("compare", "lap.csv", *options)
        assert result.exit_code == 0
        assert "limits (of racing-quad): thrust_acceleration=24.27" in result.stdout
        values = json.loads(run("compare", "lap.csv", *options, "--json").stdout)
        assert values["vehicle"]["name"] == "racing-quad"

    @pytest.mark.parametrize("command", ["plan lap.csv --vehicle", "vehicles"])
    def test_bad_names_list_the_known_ones(self, run: Run, command: str) -> None:
        refused(run(*command.split(), "kite"), "unknown vehicle 'kite'", *pf.VEHICLES, "YAML file")

    @pytest.mark.parametrize(
        ("content", "words"),
        [
            (None, "mine.yaml: no such file"),
            ("mass: [", "mine.yaml: line 2 is not YAML"),
            ("mass: 1", "mine.yaml: vehicle inertia is missing"),
            ("weight: 1", "mine.yaml: vehicle has an unknown key 'weight'; known are name, mass"),
        ],
    )
    def test_bad_files_are_named(
        self, run: Run, folder: Path, content: str | None, words: str
    ) -> None:
        if content is not None:
            (folder / "mine.yaml").write_text(content)
        refused(run("plan", "lap.csv", "--vehicle", "mine.yaml"), words)

    def test_a_vehicle_that_cannot_hover_is_refused(self, run: Run, folder: Path) -> None:
        text = run("vehicles", "racing-quad", "--yaml").stdout.replace("0.85", "4")
        (folder / "mine.yaml").write_text(text)
        refused(run("vehicles", "mine.yaml"), "mine.yaml: vehicle rotor_thrust", "cannot hover")

    def test_the_list_and_one_of_it(self, run: Run) -> None:
        listed = run("vehicles")
        assert listed.exit_code == 0
        assert all(name in listed.stdout for name in pf.VEHICLES)
        one = run("vehicles", "racing-quad")
        assert one.exit_code == 0
        for words in ("0.85 kg", "uzh-rpg/rpg_time_optimal", "25% below the vehicle's own limit"):
            assert words in " ".join(one.stdout.split())
        unknown = run("vehicles", "hummingbird").stdout
        assert "unknown" in unknown
        for text in (listed.stdout, *(one.stdout, unknown)):
            lines = [line for line in text.splitlines() if "--limits" not in line]
            assert max(map(len, lines)) <= 80

    def test_json(self, run: Run) -> None:
        listed = json.loads(run("vehicles", "--json").stdout)["vehicles"]
        assert [one["name"] for one in listed] == list(pf.VEHICLES)
        (one,) = json.loads(run("vehicles", "hummingbird", "--json").stdout)["vehicles"]
        assert one.pop("top_thrust_acceleration") == pytest.approx(33.54, abs=0.01)
        assert pf.Vehicle.from_dict(one) == pf.VEHICLES["hummingbird"]

    @pytest.mark.parametrize(
        ("options", "words"),
        [
            (("--yaml",), "--yaml needs the name of a vehicle"),
            (("hummingbird", "--yaml", "--json"), "--yaml and --json exclude each other"),
        ],
    )
    def test_bad_options(self, run: Run, options: tuple[str, ...], words: str) -> None:
        result = run("vehicles", *options)
        assert result.exit_code == 2
        assert words in result.stderr


def test_limits_given_twice_in_two_options(run: Run) -> None:
    refused(run("plan", "lap.csv", "--limits", "speed=5", "--limits", "speed=4"), "given twice")


def test_limits_round_trip() -> None:
    limits = parse_limits("tilt=50deg, snap = 800,speed=5e0,least_thrust_acceleration=.5")
    assert limits == pf.Limits(
        speed=5.0, snap=800.0, tilt=np.radians(50.0), least_thrust_acceleration=0.5
    )
    assert parse_limits(written(limits)) == limits
    assert parse_limits("tilt=0.5").tilt == 0.5
    turning = parse_limits("body_rate=8,angular_acceleration=80")
    assert turning == pf.Limits(body_rate=8.0, angular_acceleration=80.0)
    assert written(turning) == "body_rate=8,angular_acceleration=80"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--method", "magic"), "'magic' is not one of"),
        (("--variant", "magic"), "'magic' is not one of"),
        (("--variant", "paper", "--method", "proportional"), "--variant is of method peak"),
        (("--time-penalty", "1", "--method", "mellinger"), "--time-penalty is of method bry"),
        (("--time-penalty", "0"), "setting time_penalty is 0.0; it must be from"),
        (("--minimize", "crackle"), "'crackle' is not one of"),
        (("--export", "pdf"), "'pdf' is not one of"),
        (("--degree", "five"), "'five' is not a valid integer"),
        (("--degree", "2"), "degree is 2; it must be 3 to 11"),
        (("--degree", "5", "--continuity", "5"), "continuity is 5; degree 5 allows 0 to 4"),
        (("--continuity", "-1"), "continuity is -1"),
        (("--nonsense",), "no such option '--nonsense'"),
        (("another.csv",), "unexpected extra argument"),
        (("--limits",), "requires an argument"),
    ],
)
def test_bad_options(run: Run, folder: Path, options: tuple[str, ...], words: str) -> None:
    refused(run("plan", "lap.csv", *options), words)
    assert names(folder) == {"lap.csv"}


def test_bad_commands(run: Run) -> None:
    refused(run("fly-away"), "no such command 'fly-away'", "peakflight --help")
    refused(run("plan"), "missing argument 'COURSE'", "peakflight plan --help")
    refused(run("check"), "missing argument 'PLAN'")


def test_bad_input_with_json_is_an_object_too(run: Run) -> None:
    for arguments in (("plan", "missing.csv"), ("plan",), ("check", "lap.csv"), ("fly",)):
        result = run(*arguments, "--json")
        assert result.exit_code == 2
        assert result.stderr == f"peakflight: {json.loads(result.stdout)['error']}\n"


class TestOutputFolder:
    @pytest.mark.parametrize("output", ["lap.csv/below", "lap.csv"])
    def test_is_checked_before_planning(
        self, run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch, output: str
    ) -> None:
        monkeypatch.setattr(peakflight.planner, "plan", lambda *_, **__: pytest.fail("planned"))
        refused(run("plan", "lap.csv", "-o", output), output)
        assert names(folder) == {"lap.csv"}

    def test_name_too_long(self, run: Run, folder: Path) -> None:
        refused(run("plan", "lap.csv", "-o", f"new/{'a' * 300}"), "cannot be written to")
        refused(run("plan", "lap.csv", "-o", ""), "the name is empty")
        assert names(folder) == {"lap.csv"}

    def test_a_folder_where_a_file_should_go(self, run: Run, folder: Path) -> None:
        (folder / "out" / "plan.json").mkdir(parents=True)
        refused(run("plan", "lap.csv", "-o", "out", *QUICK), "out/plan.json")

    def test_is_called_after_the_course(self) -> None:
        assert folder_for("tight_then_fast") == Path("tight_then_fast-plan")
        assert folder_for("../../etc/a b") == Path("etc-a-b-plan")
        assert folder_for("..") == Path("course-plan")
        assert folder_for("Übung 1") == Path("Übung-1-plan")
        assert len(str(folder_for("n" * 500))) < 100

    def test_name_in_the_file_counts(self, run: Run, folder: Path) -> None:
        Path("c.json").write_text(json.dumps({"name": "up/down", "waypoints": WAYPOINTS}))
        assert run("plan", "c.json", *QUICK).exit_code == 0
        assert (folder / "up-down-plan" / "plan.json").is_file()

    def test_an_interrupt_leaves_nothing(
        self, run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def interrupt(*_: object, **__: object) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(peakflight.planner, "plan", interrupt)
        result = run("plan", "lap.csv", "-o", "new/deep")
        assert (result.exit_code, result.stdout) == (130, "")
        assert result.stderr == "peakflight: interrupted\n"
        assert names(folder) == {"lap.csv"}

    def test_an_interrupt_while_drawing_keeps_the_earlier_files(
        self, run: Run, plan_file: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        import peakflight.figures

        def interrupt(*_: object, **__: object) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(peakflight.figures, "save_figures", interrupt)
        before = {path: path.read_bytes() for path in plan_file.parent.iterdir()}
        result = run("plan", "lap.csv", "-o", plan_file.parent, "--limits", "speed=1")
        assert result.exit_code == 130
        assert {path: path.read_bytes() for path in plan_file.parent.iterdir()} == before

    def test_an_error_while_drawing_keeps_the_plan(
        self, run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        import peakflight.figures

        def fail(*_: object, **__: object) -> None:
            raise ZeroDivisionError("in a picture")

        monkeypatch.setattr(peakflight.figures, "save_figures", fail)
        result = run("plan", "lap.csv", "-o", "out", "--method", "proportional")
        assert result.exit_code == 3
        assert names(folder / "out") == DATA

    def test_a_full_disk_is_reported_by_the_final_name(
        self, run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def fail(path: Path, _: bytes) -> None:
            raise pf.InvalidFile(f"{path}: cannot be written (no space left on device)")

        monkeypatch.setattr(peakflight.exporting.writing, "write_atomically", fail)
        result = run("plan", "lap.csv", "-o", "out", *QUICK)
        refused(result, f"{Path('out/samples.csv')}: cannot be written (no space")
        assert names(folder / "out") == {"plan.json"}


class TestCheck:
    def test_proves_a_plan(self, run: Run, plan_file: Path) -> None:
        result = run("check", plan_file)
        assert (result.exit_code, result.stderr) == (0, "")
        for words in (
            "feasible: proven at every instant",
            "thrust acceleration",
            "5 m/s",
            "binds",
            "joints     up to snap",
            "waypoints  missed by",
            "agree with the proof",
        ):
            assert words in result.stdout
        assert "\x1b" not in result.stdout
        assert all(len(line) <= 80 for line in result.stdout.splitlines()[1:])

    def test_json(self, run: Run, plan_file: Path) -> None:
        result = run("check", plan_file, "--json")
        assert (result.exit_code, result.stderr) == (0, "")
        printed = json.loads(result.stdout)
        plan = pf.Plan.load(plan_file)
        assert printed["feasible"] is True
        assert printed["false_claims"] == []
        assert printed["duration"] == plan.duration
        worst = printed["worst"]["speed"]
        assert worst["ratio"] == max(printed["peaks"]["speed"])
        assert worst["reached"] == pytest.approx(5.0 * worst["ratio"])
        assert worst["unit"] == "m/s"
        binding = {k for entry in printed["worst"].values() for k in entry["binds"]}
        assert binding == set(np.flatnonzero(plan.report.segment_peaks >= 0.999))

    def test_other_limits(self, run: Run, plan_file: Path) -> None:
        assert run("check", plan_file, "--limits", "speed=50,tilt=80deg").exit_code == 0
        result = run("check", plan_file, "--limits", "speed=0.1,tilt=80deg")
        assert result.exit_code == 1
        assert result.stderr.startswith(
            f"peakflight: {plan_file}: not feasible within the given limits: speed reaches"
        )
        assert "exceeded" in result.stdout

    def test_a_changed_coefficient(self, run: Run, plan_file: Path) -> None:
        coefficients = json.loads(plan_file.read_text())["coefficients"]
        coefficients[1][3][0] *= 1.0 + 1e-6
        edit(plan_file, coefficients=coefficients)
        result = run("check", plan_file)
        assert result.exit_code == 1
        assert "claims to be feasible, but is not: " in result.stderr
        assert result.stderr.count("\n") == 1

    def test_a_lowered_limit(self, run: Run, plan_file: Path) -> None:
        limits = json.loads(plan_file.read_text())["limits"]
        for name in limits:
            edit(plan_file, limits={**limits, name: limits[name] * 0.95 if name != "snap" else 9.0})
            result = run("check", plan_file, "--json")
            printed = json.loads(result.stdout)
            assert result.exit_code == 1
            assert printed["false_claims"] != []

    def test_lower_peaks(self, run: Run, plan_file: Path) -> None:
        peaks = json.loads(plan_file.read_text())["peaks"]
        peaks["jerk"][2] -= 1e-3
        edit(plan_file, peaks=peaks)
        result = run("check", plan_file)
        assert result.exit_code == 1
        assert "false claim: claims a jerk of" in result.stderr
        assert "in segment 2, proven is" in result.stderr

    @pytest.mark.parametrize(
        ("peaks", "words"),
        [
            ({}, "claims no peaks of speed"),
            ({"speed": [0.5]}, "claims 1 peaks of speed, there are 4"),
            ({"body_rate": [1.0] * 4}, "claims peaks of body_rate, which it does not limit"),
        ],
    )
    def test_other_peaks(
        self, run: Run, plan_file: Path, peaks: dict[str, object], words: str
    ) -> None:
        edit(plan_file, peaks=peaks)
        result = run("check", plan_file, "--json")
        assert result.exit_code == 1
        assert any(words in claim for claim in json.loads(result.stdout)["false_claims"])

    @pytest.mark.parametrize("duration", [1.0, -1, "soon", None, 10**400, [1] * 999])
    def test_another_duration(self, run: Run, plan_file: Path, duration: object) -> None:
        edit(plan_file, duration=duration)
        result = run("check", plan_file)
        assert result.exit_code == 1
        assert "false claim: claims a duration of" in result.stderr
        assert len(result.stderr) < 400

    def test_another_degree(self, run: Run, plan_file: Path) -> None:
        edit(plan_file, degree=7)
        result = run("check", plan_file)
        assert result.exit_code == 2
        assert "degree is 7; the coefficients have 5" in result.stderr

    def test_a_plan_that_claims_too_little(self, run: Run, plan_file: Path) -> None:
        edit(plan_file, feasible=False, status="infeasible")
        result = run("check", plan_file)
        assert result.exit_code == 1
        assert "claims to be not feasible" in result.stderr

    def test_an_honest_infeasible_plan(self, run: Run, plan_file: Path) -> None:
        plan = pf.Plan.load(plan_file)
        problem = replace(plan.problem, limits=pf.Limits(speed=0.5))
        plan = replace(plan, problem=problem, status=pf.Status.INFEASIBLE)
        replace(plan, report=pf.certify_plan(plan)).save(plan_file)
        result = run("check", plan_file)
        assert result.exit_code == 1
        assert f"{plan_file}: not feasible: speed reaches" in result.stderr
        assert "agree with the proof" in result.stdout

    def test_a_file_with_the_contract_keys_alone(self, run: Run, plan_file: Path) -> None:
        values = json.loads(plan_file.read_text())
        plan_file.write_text(json.dumps({key: values[key] for key in CONTRACT}))
        assert run("check", plan_file).exit_code == 0

    @pytest.mark.parametrize(
        ("content", "words"),
        [
            ("", "the file is empty"),
            ("{", "not JSON"),
            ("[]", "must be a JSON object"),
            ("{}", "'status' is missing"),
            ('{"status": NaN}', "NaN is not finite"),
        ],
    )
    def test_files_that_are_no_plans(self, run: Run, content: str, words: str) -> None:
        Path("p.json").write_text(content)
        refused(run("check", "p.json"), "p.json: ", words)

    @pytest.mark.parametrize(
        ("key", "value"),
        [
            ("iterations", "many"),
            ("pieces", ["x"]),
            ("peaks", "high"),
            ("segment_times", [1.0]),
            ("segment_times", [-1.0] * 4),
            ("coefficients", [[[0.0]]]),
            ("status", "excellent"),
            ("limits", {"speed": 0.0}),
            ("limits", {"magic": 1.0}),
            ("waypoints", [[0, 0, 0]]),
        ],
    )
    def test_plans_with_wrong_values(
        self, run: Run, plan_file: Path, key: str, value: object
    ) -> None:
        edit(plan_file, **{key: value})
        refused(run("check", plan_file), str(plan_file))

    def test_no_file(self, run: Run, folder: Path) -> None:
        refused(run("check", "missing.json"), "no such file")
        refused(run("check", folder), "is a folder")


class TestUnexpectedErrors:
    @pytest.fixture(autouse=True)
    def bug(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def fail(*_: object, **__: object) -> None:
            raise ZeroDivisionError("deep\ninside")

        monkeypatch.setattr(peakflight.planner, "plan", fail)

    def test_take_one_line(self, run: Run, folder: Path) -> None:
        result = run("plan", "lap.csv", "--json")
        assert result.exit_code == 3
        assert result.stderr.count("\n") == 1
        assert "unexpected ZeroDivisionError: deep inside" in result.stderr
        assert "report" in result.stderr
        assert "ZeroDivisionError" in json.loads(result.stdout)["error"]
        assert names(folder) == {"lap.csv"}

    def test_show_where_with_debug(self, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
        assert "Traceback" in run("plan", "lap.csv", "--debug").stderr
        monkeypatch.setenv("PEAKFLIGHT_DEBUG", "1")
        result = run("plan", "lap.csv")
        assert result.exit_code == 3
        assert "Traceback" in result.stderr


class TestHelp:
    def test_alone_prints_help(self, run: Run) -> None:
        result = run()
        assert result.exit_code == 0
        assert result.stdout == run("--help").stdout
        for command in application.commands:
            assert f"\n  {command}  " in result.stdout

    @pytest.mark.parametrize("command", sorted(application.commands))
    def test_every_command_has_an_example(self, run: Run, command: str) -> None:
        result = run(command, "--help")
        assert result.exit_code == 0
        assert f"Example:\n    peakflight {command} " in result.stdout
        assert "--json" in result.stdout
        assert max(map(len, result.stdout.splitlines())) <= 80

    def test_version(self, run: Run) -> None:
        assert run("--version").stdout == f"peakflight {pf.__version__}\n"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class TestProgress:
    def test_is_silent_where_nobody_watches(self, capsys: pytest.CaptureFixture[str]) -> None:
        with Progress() as progress:
            progress.stage("planning")
            logging.getLogger("peakflight").warning("compiling, %s", "once")
        assert capsys.readouterr() == ("", "peakflight: compiling, once\n")

    def test_on_a_terminal(self, monkeypatch: pytest.MonkeyPatch) -> None:
        stream = Terminal()
        monkeypatch.setattr(sys, "stderr", stream)
        with Progress() as progress:
            progress.stage("planning")
            time.sleep(0.25)
            logging.getLogger("peakflight").warning("compiling")
            progress.stage("drawing")
        lines = stream.getvalue().replace("\r", "\n").split("\n")
        assert lines.count("peakflight: compiling") == 1
        assert sum(line.startswith("planning (0.") for line in lines) >= 3
        assert any(line.startswith("drawing (0.") for line in lines)
        assert lines[-1] == ""
        assert "\x1b" not in stream.getvalue()
        assert logging.getLogger("peakflight").handlers == []

    def test_long_work_has_a_bar(self, monkeypatch: pytest.MonkeyPatch) -> None:
        stream = Terminal()
        monkeypatch.setattr(sys, "stderr", stream)
        monkeypatch.setattr("peakflight.cli.progress.PATIENCE", 0.1)
        with Progress() as progress:
            progress.stage("planning")
            time.sleep(0.5)
            progress.stage("drawing", 0.25)
        lines = stream.getvalue().split("\r")
        assert lines[1].startswith("planning (0.0 s)")
        unknown = [line for line in lines if line.startswith("[") and "planning" in line]
        assert all(line[:22].count("#") == 1 for line in unknown)
        assert len({line[:22] for line in unknown}) >= 2, "it moves"
        assert any(line.startswith(f"[{'#' * 5}{'.' * 15}] drawing") for line in lines)


def test_ranges() -> None:
    assert ranges([]) == "none"
    assert ranges([0, 1, 2, 3, 7]) == "0-3, 7"
    assert ranges(range(0, 40, 2), most=2) == "0, 2, ... (20 in all)"


def test_seconds() -> None:
    assert seconds(4.71508) == "4.7151"
    assert seconds(1e-6) == "1e-06"
    assert seconds(1.25e12) == "1.25e+12"


class TestProcess:
    def test_exit_codes_and_plain_output(self, folder: Path) -> None:
        process = shell("plan", "lap.csv", "-o", "out", cwd=folder)
        output, errors = process.communicate(timeout=300)
        assert process.returncode == 0
        assert "\x1b" not in output + errors
        assert max(map(len, output.splitlines())) <= 80
        assert names(folder / "out") == DATA | PICTURES
        process = shell("check", "out/plan.json", "--limits", "speed=1", cwd=folder)
        output, errors = process.communicate(timeout=300)
        assert process.returncode == 1
        assert errors.count("\n") == 1
        process = shell("plan", "missing.csv", cwd=folder)
        output, errors = process.communicate(timeout=300)
        assert (process.returncode, output) == (2, "")
        assert errors == "peakflight: missing.csv: no such file\n"

    def test_an_interrupt(self, folder: Path) -> None:
        process = shell("plan", "lap.csv", "-o", "new/out", cwd=folder)
        while not (folder / "new" / "out").exists():
            assert process.poll() is None
            time.sleep(0.002)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=300)
        assert (process.returncode, output) == (130, "")
        assert errors.endswith("peakflight: interrupted\n")
        assert "Traceback" not in errors
        assert names(folder) == {"lap.csv"}

    def test_a_reader_that_stops(self, folder: Path) -> None:
        process = shell("plan", "lap.csv", "-o", "out", *QUICK, cwd=folder)
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        with process.stderr as errors:
            assert errors.read().replace(COMPILING, "") == ""
        assert process.wait(timeout=300) == 141
        assert names(folder / "out") == DATA

    @pytest.mark.parametrize("library", ["click", "rich"])
    def test_a_missing_library(self, folder: Path, library: str) -> None:
        process = shell(
            "plan", "lap.csv", "--json", code=f"import sys; sys.modules['{library}'] = None"
        )
        output, errors = process.communicate(timeout=300)
        assert process.returncode == 2
        assert errors.count("\n") == 1
        assert library in errors
        assert "pip install 'peakflight[cli]'" in errors
        assert "peakflight[cli]" in json.loads(output)["error"]

    def test_without_matplotlib_there_are_no_pictures(self, folder: Path) -> None:
        process = shell(
            "plan",
            "lap.csv",
            "--method",
            "proportional",
            code="import sys; sys.modules['matplotlib'] = None",
            cwd=folder,
        )
        output, errors = process.communicate(timeout=300)
        assert (process.returncode, errors.replace(COMPILING, "")) == (0, "")
        assert "note: no pictures: figures need matplotlib" in output
        assert names(folder / "lap-plan") == DATA
