import csv
import io
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

import peakflight as pf
import peakflight.compare
from peakflight.bound import Bound
from peakflight.cli.application import application
from peakflight.compare import (
    BASELINE,
    as_csv,
    compare,
    path_length,
    summarise,
    warm_up,
)
from peakflight.methods import METHODS, proportional

Run = Callable[..., Result]

LIMITS = pf.Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)
WAYPOINTS = [[0, 0, 1], [0.6, 0.5, 1.2], [0.2, 0.9, 1.0], [0.9, 1.3, 1.1], [3.2, 1.2, 1.4]]
PROBLEM = pf.Problem(WAYPOINTS, limits=LIMITS)
COMPILING = "peakflight: compiling the planner for this machine, once; this takes some seconds\n"


@pytest.fixture
def broken(monkeypatch: pytest.MonkeyPatch) -> Callable[[Exception], str]:
    """Add a method to the registry that ends in an error."""

    def add(error: Exception) -> str:
        def solve(*_: Any) -> None:
            raise error

        module = SimpleNamespace(
            Settings=proportional.Settings, kernels=proportional.kernels, solve=solve
        )
        monkeypatch.setitem(METHODS, "broken", "fails")
        monkeypatch.setitem(sys.modules, "peakflight.methods.broken", module)
        return "broken"

    return add


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, shift in (("lap", 0.0), ("far", 2.0)):
        points = np.array(WAYPOINTS, dtype=float)
        points[-1, 0] += shift
        lines = [f"{x},{y},{z}" for x, y, z in points]
        (tmp_path / f"{name}.csv").write_text("\n".join(["x,y,z", *lines]))
    return tmp_path


@pytest.fixture
def run(folder: Path) -> Run:
    def invoke(*arguments: object) -> Result:
        result = CliRunner().invoke(application, ["compare", *map(str, arguments)])
        assert result.exception is None or isinstance(result.exception, SystemExit)
        return result

    return invoke


def some_bound(duration: float | None, status: pf.Status = pf.Status.SOLVED) -> Bound:
    """A bound that nobody computed."""
    return Bound(
        status=status,
        duration=duration,
        segment_times=None,
        interval=0.02,
        intervals=100,
        iterations=20,
        wall_time_s=0.5,
        cpu_time_s=0.5,
        trajectory=None,
        peak_ratio=None,
        message="" if duration else "IPOPT ended with Restoration_Failed",
    )


class TestCompare:
    def test_every_method_of_the_registry(self) -> None:
        comparison = compare(PROBLEM, name="lap")
        assert [row.method for row in comparison.rows] == list(METHODS)
        for row in comparison.rows:
            plan = pf.plan(PROBLEM, method=row.method)
            assert row.certified
            assert row.status == str(plan.status)
            assert row.duration == pytest.approx(plan.duration, rel=1e-9)
            assert row.iterations == plan.iterations
            assert row.pieces == len(plan.trajectory)
            assert row.cpu_time_s > 0.0
            assert row.above_bound is None

    def test_figures_against_dense_samples(self) -> None:
        comparison = compare(PROBLEM)
        slow = comparison.rows[list(METHODS).index(BASELINE)]
        for row in comparison.rows:
            motion = row.plan.trajectory
            instants = np.linspace(0.0, motion.duration, 200_001)
            speeds = np.linalg.norm(motion(instants, 1), axis=1)
            points = motion(instants)
            length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
            assert row.path_length == pytest.approx(length, rel=1e-7)
            assert row.top_speed == pytest.approx(speeds.max(), rel=1e-7)
            assert row.mean_speed == pytest.approx(length / motion.duration, rel=1e-7)
            change = 100.0 * (row.duration - slow.duration) / slow.duration
            assert row.against_proportional == pytest.approx(change, abs=1e-9)
            binding = {n for n in LIMITS.to_dict() if row.plan.report.binding_segments(n)}
            assert set(row.binding) == binding

    def test_the_baseline_need_not_be_shown(self) -> None:
        comparison = compare(PROBLEM, methods=["peak"])
        assert [row.method for row in comparison.rows] == ["peak"]
        assert comparison.proportional == pytest.approx(
            pf.plan(PROBLEM, method="proportional").duration
        )
        assert comparison.rows[0].against_proportional < -1.0
        assert comparison.fastest == comparison.rows[0]

    def test_settings_reach_the_method(self) -> None:
        from peakflight.methods.peak import Settings

        one = compare(PROBLEM, methods=["peak"], settings={"peak": Settings(variant="paper")})
        plan = pf.plan(PROBLEM, method="peak", settings=Settings(variant="paper"))
        assert one.rows[0].duration == plan.duration

    def test_a_moving_start_beyond_the_limits_is_a_row(self) -> None:
        problem = replace(PROBLEM, start={"velocity": [9.0, 0.0, 0.0]})
        comparison = compare(problem, methods=["proportional", "peak"])
        for row in comparison.rows:
            assert (row.certified, row.status) == (False, "infeasible")
            assert (row.duration, row.path_length, row.pieces) == (None, None, None)
            assert "waypoint 0" in row.message
        assert comparison.proportional is None
        assert comparison.fastest is None
        assert len(comparison.notes) == 2

    @pytest.mark.parametrize(
        ("error", "status", "words"),
        [
            (pf.InvalidProblem("no inner states"), "refused", "no inner states"),
            (ZeroDivisionError("deep"), "failed", "unexpected ZeroDivisionError: deep"),
        ],
    )
    def test_an_error_is_a_row(
        self, broken: Callable[[Exception], str], error: Exception, status: str, words: str
    ) -> None:
        comparison = compare(PROBLEM, methods=["peak", broken(error)])
        good, bad = comparison.rows
        assert good.certified
        assert (bad.status, bad.certified, bad.duration) == (status, False, None)
        assert words in bad.message
        assert any(words in note for note in comparison.notes)

    def test_ctrl_c_is_no_row(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def interrupt(*_: object, **__: object) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(peakflight.compare, "plan", interrupt)
        with pytest.raises(KeyboardInterrupt):
            compare(PROBLEM)

    @pytest.mark.parametrize(
        ("methods", "words"),
        [
            (["magic"], "unknown method 'magic'; known are proportional"),
            (["peak", "peak"], "method 'peak' is named twice"),
            ([], "no method is named"),
        ],
    )
    def test_bad_methods(self, methods: list[str], words: str) -> None:
        with pytest.raises(pf.InvalidProblem, match=words):
            compare(PROBLEM, methods=methods)
        with pytest.raises(pf.InvalidProblem, match=words):
            warm_up(PROBLEM, methods)

    def test_stages_are_told(self) -> None:
        told: list[str] = []
        compare(PROBLEM, methods=["peak"], on_stage=told.append)
        assert told == ["peak", "proportional"]

    def test_warm_up_takes_any_problem(self) -> None:
        inner = replace(PROBLEM, derivatives={1: {"velocity": [1.0, 0.5, 0.0]}}, continuity=2)
        for problem in (PROBLEM, inner, replace(PROBLEM, yaw=np.zeros(5))):
            warm_up(problem)


class TestWithTheBound:
    @pytest.fixture(autouse=True)
    def casadi(self) -> None:
        pytest.importorskip("casadi")

    def test_every_method_is_above_it(self) -> None:
        told: list[str] = []
        comparison = compare(PROBLEM, bound=True, on_stage=told.append)
        assert comparison.bound.success
        for row in comparison.rows:
            assert row.above_bound == pytest.approx(
                100.0 * (row.duration / comparison.bound.duration - 1.0)
            )
            assert row.above_bound > 0.0
        assert "bound, iteration 3" in told
        assert any("without jerk; proportional, mellinger" in note for note in comparison.notes)
        values = json.loads(json.dumps(comparison.to_dict(), allow_nan=False))
        assert values["bound"]["duration"] == comparison.bound.duration

    def test_a_plan_without_jerk_at_its_ends_needs_no_note(self) -> None:
        problem = pf.Problem(WAYPOINTS, limits=LIMITS, minimize="snap")
        comparison = compare(problem, bound=True)
        assert comparison.notes == ()

    def test_a_failed_bound_gives_no_figures(self, monkeypatch: pytest.MonkeyPatch) -> None:
        failed = some_bound(None, pf.Status.NO_PROGRESS)
        monkeypatch.setattr(peakflight.compare, "discretised_bound", lambda *_, **__: failed)
        comparison = compare(PROBLEM, bound=True)
        assert all(row.above_bound is None for row in comparison.rows)
        assert comparison.notes == ("no bound (no progress): IPOPT ended with Restoration_Failed",)

    def test_on_the_command_line(self, run: Run, folder: Path) -> None:
        result = run("lap.csv", "far.csv", "--bound", "-o", "out")
        assert result.exit_code == 0
        assert "…" not in result.stdout
        assert max(map(len, result.stdout.splitlines())) <= 80
        assert "bound: " in result.stdout
        assert "not certified to be the fastest" in " ".join(result.stdout.split())
        assert "vs bound" in result.stdout
        values = json.loads((folder / "out" / "compare.json").read_text())
        durations = [one["bound"]["duration"] for one in values["courses"] for _ in METHODS]
        rows = list(csv.DictReader(io.StringIO((folder / "out" / "compare.csv").read_text())))
        assert [float(row["bound [s]"]) for row in rows] == durations
        assert all(float(row["above bound [%]"]) > 0.0 for row in rows)

    def test_without_casadi(self, run: Run, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
        import peakflight.bound

        monkeypatch.setattr(peakflight.bound, "find_spec", lambda _: None)
        result = run("lap.csv", "--bound", "-o", "out")
        assert (result.exit_code, result.stdout) == (2, "")
        assert result.stderr.count("\n") == 1
        assert "pip install 'peakflight[bound]'" in result.stderr
        assert not (folder / "out").exists()


def test_path_length_of_what_is_known() -> None:
    """A straight line, and a quarter of a parabola y = x^2 from 0 to 1, by its closed form."""
    line = pf.Trajectory([[[0, 0, 0], [3, 0, 4]]] * 3, [1.0, 2.0, 0.5])
    assert path_length(line) == pytest.approx(5.0 * 3.5, rel=1e-14)
    parabola = pf.Trajectory([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], [1.0])
    known = np.sqrt(5.0) / 2.0 + np.arcsinh(2.0) / 4.0
    assert path_length(parabola) == pytest.approx(known, rel=1e-12)
    many = pf.Trajectory(np.tile([[0.0, 0, 0], [1, 0, 0]], (4500, 1, 1)), np.full(4500, 0.1))
    assert path_length(many) == pytest.approx(450.0, rel=1e-12)


class TestSummary:
    def comparisons(self) -> list[peakflight.compare.Comparison]:
        problems = [PROBLEM]
        for end in (4.0, 8.0):
            points = np.array(WAYPOINTS, dtype=float)
            points[-1, 0] = end
            problems.append(pf.Problem(points, limits=LIMITS))
        return [compare(problem, name=f"course {n}") for n, problem in enumerate(problems)]

    def test_medians_failures_and_who_is_fastest(self) -> None:
        comparisons = self.comparisons()
        first = comparisons[0]
        at = list(METHODS).index("peak")
        lost = replace(first.rows[at], certified=False, duration=None, against_proportional=None)
        rows = (*first.rows[:at], lost, *first.rows[at + 1 :])
        comparisons[0] = replace(first, rows=rows)
        summaries = {one.method: one for one in summarise(comparisons)}
        assert list(summaries) == list(METHODS)
        base, peak = summaries["proportional"], summaries["peak"]
        assert (base.courses, base.failures) == (3, 0)
        assert base.duration == sorted(one.rows[0].duration for one in comparisons)[1]
        assert base.against_proportional == 0.0
        assert (peak.courses, peak.failures) == (3, 1)
        assert peak.duration == np.mean([one.rows[at].duration for one in comparisons[1:]])
        assert peak.above_bound is None
        assert sum(one.fastest for one in summaries.values()) == 3

    def test_a_method_that_always_fails(self, broken: Callable[[Exception], str]) -> None:
        name = broken(ValueError("never"))
        summary = summarise([compare(PROBLEM, methods=[name])] * 2)[0]
        assert (summary.failures, summary.duration, summary.iterations) == (2, None, None)
        assert summary.to_dict()["cpu_time_s"] is None

    def test_csv_has_a_line_for_each(self) -> None:
        comparisons = self.comparisons()
        rows = list(csv.DictReader(io.StringIO(as_csv(comparisons))))
        assert len(rows) == 3 * len(METHODS)
        for one, row in zip([(c, r) for c in comparisons for r in c.rows], rows, strict=True):
            assert row["course"] == one[0].name
            assert row["method"] == one[1].method
            assert float(row["duration [s]"]) == one[1].duration
            assert row["above bound [%]"] == ""
            assert row["binding limits"].split() == list(one[1].binding)


class TestCommand:
    def test_one_course(self, run: Run, folder: Path) -> None:
        result = run("lap.csv")
        assert result.exit_code == 0
        assert result.stderr.replace(COMPILING, "") == ""
        lines = result.stdout.splitlines()
        assert lines[0] == "limits (the paper's): speed=5,thrust_acceleration=15.5,jerk=62,snap=800"
        assert "lap: 5 waypoints, 4 legs" in lines
        for method in METHODS:
            assert sum(line.startswith(f"{method} ") for line in lines) == 2
        assert max(map(len, lines)) <= 80
        assert "\x1b" not in result.stdout
        assert "…" not in result.stdout
        assert "Medians" not in result.stdout
        assert "vs bound" not in result.stdout
        assert {path.name for path in folder.iterdir()} == {"lap.csv", "far.csv"}

    def test_several_courses(self, run: Run, folder: Path) -> None:
        result = run("lap.csv", "far.csv", "--methods", "peak, proportional", "-o", "new/out")
        assert result.exit_code == 0
        assert "Medians over 2 courses" in result.stdout
        assert "…" not in result.stdout
        assert max(map(len, result.stdout.splitlines())) <= 80
        pictures = {
            f"{course}-{kind}.png"
            for course in ("lap", "far")
            for kind in ("paths", "derivatives", "leg-times")
        }
        assert {path.name for path in (folder / "new" / "out").iterdir()} == {
            "compare.csv",
            "compare.json",
            "compare.png",
            *pictures,
        }
        for name in (*pictures, "compare.png"):
            assert (folder / "new" / "out" / name).read_bytes().startswith(b"\x89PNG")
        values = json.loads((folder / "new" / "out" / "compare.json").read_text())
        assert values["methods"] == ["peak", "proportional"]
        assert [one["course"] for one in values["courses"]] == ["lap", "far"]
        assert [one["method"] for one in values["summary"]] == ["peak", "proportional"]

    def test_json_is_one_object(self, run: Run) -> None:
        result = run("lap.csv", "--json", "--limits", "speed=3,tilt=40deg", "--minimize", "snap")
        assert result.exit_code == 0
        assert result.stdout.count("\n") == 1
        values = json.loads(result.stdout)
        assert values["limits"] == {"speed": 3.0, "tilt": pytest.approx(np.radians(40.0))}
        assert (values["minimize"], values["degree"]) == ("snap", None)
        (course,) = values["courses"]
        assert (course["course"], course["file"], course["legs"]) == ("lap", "lap.csv", 4)
        assert [row["method"] for row in course["rows"]] == list(METHODS)
        assert course["bound"] is None
        assert values["files"] == {}
        assert set(course["rows"][0]) == {
            "method", "status", "certified", "duration", "against_proportional", "above_bound",
            "top_speed", "mean_speed", "path_length", "binding", "pieces", "iterations",
            "cpu_time_s", "message",
        }  # fmt: skip

    def test_the_same_name_twice(self, run: Run, folder: Path) -> None:
        (folder / "other").mkdir()
        (folder / "other" / "lap.csv").write_text((folder / "far.csv").read_text())
        values = json.loads(run("lap.csv", "other/lap.csv", "--json").stdout)
        assert [one["course"] for one in values["courses"]] == ["lap.csv", "other/lap.csv"]

        done = run("lap.csv", "other/lap.csv", "--methods", "proportional", "-o", "out", "--json")
        names = {Path(path).name for path in json.loads(done.stdout)["files"].values()}
        assert {"lap.csv-paths.png", "other-lap.csv-paths.png", "compare.png"} < names
        assert names == {path.name for path in (folder / "out").iterdir()}

    def test_names_that_become_one_do_not_share_a_file(self, run: Run, folder: Path) -> None:
        courses = ("a b.csv", "a-b.csv", "A-b.csv", "a-b-2.csv")
        for name in courses:
            (folder / name).write_text((folder / "lap.csv").read_text())
        run(*courses, "--methods", "proportional", "-o", "out")
        names = {path.name for path in (folder / "out").iterdir()}
        stems = ("a-b", "a-b-2", "A-b-3", "a-b-2-2")
        assert {f"{stem}-paths.png" for stem in stems} < names

    def test_without_figures(self, run: Run, folder: Path) -> None:
        result = run("lap.csv", "--methods", "proportional", "--no-figures", "-o", "out")
        assert result.exit_code == 0
        assert {path.name for path in (folder / "out").iterdir()} == {"compare.csv", "compare.json"}

    def test_without_matplotlib(
        self, run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        for name in [name for name in sys.modules if name.startswith("peakflight.figures")]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.setitem(sys.modules, "matplotlib", None)
        result = run("lap.csv", "--methods", "proportional", "-o", "out")
        assert result.exit_code == 0
        assert "note: no pictures: figures need matplotlib" in result.stdout
        assert {path.name for path in (folder / "out").iterdir()} == {"compare.csv", "compare.json"}

    def test_a_course_without_a_plan_has_no_pictures(
        self, run: Run, folder: Path, broken: Callable[[Exception], str]
    ) -> None:
        broken(ZeroDivisionError("deep inside"))
        result = run("lap.csv", "--methods", "broken", "-o", "out")
        assert result.exit_code == 1
        assert "note: no pictures of lap: no method has a certified plan" in result.stdout
        assert {path.name for path in (folder / "out").iterdir()} == {"compare.csv", "compare.json"}

    def test_notes_on_courses(self, run: Run, folder: Path) -> None:
        text = "t,x,y,z\n0,0,0,1\n1,1,0,1\n2,1,0,1.0004\n3,2,0,1\n"
        (folder / "near.csv").write_text(text)
        result = run("near.csv")
        assert "note: waypoint 2 (line 4) is 0.4 mm from waypoint 1: merged" in result.stdout
        assert "note: the times in the course are not used" in result.stdout
        result = run("near.csv", "--strict")
        assert (result.exit_code, result.stdout) == (2, "")
        assert "near.csv: waypoint 2 (line 4)" in result.stderr

    def test_a_method_that_fails_is_a_row(
        self, run: Run, broken: Callable[[Exception], str]
    ) -> None:
        broken(ZeroDivisionError("deep inside"))
        result = run("lap.csv", "--methods", "broken,peak")
        assert result.exit_code == 0
        assert "failed" in result.stdout
        said = " ".join(result.stdout.split())
        assert "note: broken: failed: unexpected ZeroDivisionError: deep inside" in said
        assert "Traceback" not in result.output
        result = run("lap.csv", "--methods", "broken", "--json")
        assert result.exit_code == 1
        assert result.stderr.endswith("peakflight: no feasible trajectory for lap\n")
        (row,) = json.loads(result.stdout)["courses"][0]["rows"]
        assert (row["status"], row["duration"]) == ("failed", None)

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            ((), "missing argument 'COURSE...'"),
            (("missing.csv",), "missing.csv: no such file"),
            (("lap.csv", "missing.csv"), "missing.csv: no such file"),
            (("lap.csv", "--methods", "magic"), "unknown method 'magic'; known are"),
            (("lap.csv", "--methods", "peak,"), "unknown method ''"),
            (("lap.csv", "--methods", "peak,peak"), "'peak' is named twice"),
            (("lap.csv", "--limits", "speed=-1"), "limit speed is -1"),
            (("lap.csv", "--limits", "tilt=40deg"), "none of the limits"),
            (("lap.csv", "--degree", "2"), "degree is 2; it must be 3 to 11"),
            (("lap.csv", "--minimize", "crackle"), "'crackle' is not one of"),
            (("lap.csv", "-o", "far.csv"), "far.csv: is a file"),
            (("bad.csv",), "bad.csv: waypoint 1 (line 2) has y = nan"),
        ],
    )
    def test_bad_input(
        self, run: Run, folder: Path, arguments: tuple[str, ...], words: str
    ) -> None:
        (folder / "bad.csv").write_text("0,0,1\n1,nan,1\n2,0,1\n")
        result = run(*arguments)
        assert (result.exit_code, result.stdout) == (2, "")
        assert result.stderr.count("\n") == 1
        assert result.stderr.startswith("peakflight: ")
        assert words in result.stderr
        assert {path.name for path in folder.iterdir()} == {"lap.csv", "far.csv", "bad.csv"}

    def test_an_interrupt_leaves_nothing(
        self, run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def interrupt(*_: object, **__: object) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(peakflight.compare, "compare", interrupt)
        result = run("lap.csv", "-o", "out")
        assert (result.exit_code, result.stdout) == (130, "")
        assert not (folder / "out").exists()
