"""The commands edit, import and show."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

import peakflight as pf
from peakflight import editing
from peakflight.cli.application import application
from peakflight.formats import write_crazyflie, write_samples
from peakflight.readers import read_trajectory_file

Run = Callable[..., Result]
LIMITS = pf.Limits(speed=3.0, thrust_acceleration=14.0, jerk=50.0, snap=600.0)
GIVEN = "speed=3,thrust_acceleration=14,jerk=50,snap=600"
WAYPOINTS = np.array([[0, 0, 1], [1, 0.5, 1.3], [2, -0.5, 1.0], [3, 0, 1.2]])


@pytest.fixture(scope="module")
def made() -> pf.Plan:
    return pf.plan(WAYPOINTS, limits=LIMITS, method="peak", yaw="velocity")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, made: pf.Plan, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("FORCE_COLOR", "NO_COLOR", "COLUMNS", "PEAKFLIGHT_DEBUG"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)
    made.save("plan.json")
    editing.move(made, [0.0, 3.0, 0.0]).save("other.json")
    write_crazyflie(made, "pieces.csv")
    write_samples(made, "samples.csv")
    return tmp_path


@pytest.fixture
def run() -> Run:
    def invoke(*arguments: object) -> Result:
        result = CliRunner().invoke(application, [str(argument) for argument in arguments])
        assert result.exception is None or isinstance(result.exception, SystemExit)
        return result

    return invoke


def refused(result: Result, *words: str) -> None:
    """Exit code 2, nothing on stdout, one line on stderr with these words in it."""
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1
    for word in words:
        assert word in result.stderr


class TestEdit:
    def test_verbs_go_in_the_order_given(self, run: Run, made: pf.Plan) -> None:
        first = run("edit", "plan.json", "--rotate", "90", "--move", "1,0,0.5", "-o", "a.json")
        second = run("edit", "plan.json", "--move", "1,0,0.5", "--rotate", "90", "-o", "b.json")
        assert first.exit_code == second.exit_code == 0
        turned = made.problem.waypoints[:, [1, 0, 2]] * [-1.0, 1.0, 1.0]
        one, two = (pf.Plan.load(name).problem.waypoints for name in ("a.json", "b.json"))
        np.testing.assert_allclose(one, turned + np.array([1.0, 0.0, 0.5]), atol=1e-12)
        np.testing.assert_allclose(two, turned + np.array([0.0, 1.0, 0.5]), atol=1e-12)
        assert "turned by 90 deg about z; moved by (1, 0, 0.5) m" in first.stdout
        assert "wrote a.json" in first.stdout
        assert run("check", "a.json").exit_code == 0

    def test_a_verb_may_come_twice(self, run: Run, made: pf.Plan) -> None:
        steps = ("--move", "1,0,0", "--reverse", "--slow", "50%", "--move", "-1,0,0", "--reverse")
        result = run("edit", "plan.json", *steps, "--slow", "0.5", "-o", "a.json")
        assert result.exit_code == 0
        plan = pf.Plan.load("a.json")
        np.testing.assert_allclose(plan.problem.waypoints, made.problem.waypoints, atol=1e-12)
        assert plan.duration == pytest.approx(4.0 * made.duration)

    @pytest.mark.parametrize(
        ("angle", "turned"), [("90", 90.0), ("90deg", 90.0), ("1rad", 57.2957795), ("-45", -45.0)]
    )
    def test_angles(self, angle: str, turned: float, run: Run) -> None:
        result = run("edit", "plan.json", "--rotate", angle, "--json")
        assert json.loads(result.stdout)["done"] == [f"turned by {turned:.6g} deg about z"]

    def test_every_verb_is_the_function_of_its_name(self, run: Run, made: pf.Plan) -> None:
        for arguments, plan in (
            (("--slow", "80%"), editing.slow(made, 0.8)),
            (("--duration", "9s"), editing.to_duration(made, 9.0)),
            (("--delay", "1.5"), editing.delay(made, 1.5)),
            (("--mirror", "x"), editing.mirror(made, "x")),
            (("--scale", "0.5"), editing.scale(made, 0.5)),
            (("--scale", "1,0.5,1"), editing.scale(made, [1.0, 0.5, 1.0])),
            (("--reverse",), editing.reverse(made)),
            (("--slow", "0.5", "--retime"), made),
            (("--join", "other.json"), pf.join(made, editing.move(made, [0.0, 3.0, 0.0]))),
        ):
            assert run("edit", "plan.json", *arguments, "-o", "a.json").exit_code == 0, arguments
            loaded = pf.Plan.load("a.json")
            assert loaded.duration == pytest.approx(plan.duration, rel=1e-9)
            np.testing.assert_allclose(
                loaded.trajectory(loaded.duration / 3.0),
                plan.trajectory(plan.duration / 3.0),
                atol=1e-7,
            )

    def test_an_exceeded_limit_is_said_and_kept_on_request(self, run: Run) -> None:
        result = run("edit", "plan.json", "--scale", "2", "-o", "a.json")
        assert result.exit_code == 1
        assert result.stderr.startswith("peakflight: a.json: not feasible: speed reaches")
        assert "exceeded" in result.stdout
        kept = run("edit", "plan.json", "--scale", "2", "--keep-limits", "-o", "a.json")
        assert kept.exit_code == 0
        assert "to what the limits allow" in kept.stdout
        assert run("check", "a.json").exit_code == 0

    def test_limits_can_be_changed(self, run: Run) -> None:
        assert run("edit", "plan.json", "--limits", "speed=1").exit_code == 1
        result = run("edit", "plan.json", "--limits", "speed=1", "--retime", "--json")
        assert result.exit_code == 0
        found = json.loads(result.stdout)
        assert found["limits"] == {"speed": 1.0}
        assert found["duration"] > found["duration_before"]
        assert found["file"] is None

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (("plan.json",), ("say what to do",)),
            (("plan.json", "--slow", "0"), ("the pace is 0 %",)),
            (("plan.json", "--slow", "fast"), ("--slow", "'fast'", "must be a number")),
            (("plan.json", "--duration", "nan"), ("--duration", "must be finite")),
            (("plan.json", "--move", "1,2"), ("--move", "must have 3")),
            (("plan.json", "--move", "1,2,x"), ("--move", "'x'")),
            (("plan.json", "--mirror", "z"), ("--mirror", "x or y")),
            (("plan.json", "--scale", "-1"), ("must be positive",)),
            (("plan.json", "--join", "nowhere.json"), ("nowhere.json: no such file",)),
            (("plan.json", "--join", "pieces.csv"), ("pieces.csv: line 1 is not JSON",)),
            (("pieces.csv", "--reverse"), ("pieces.csv",)),
            (("nowhere.json", "--reverse"), ("no such file",)),
            (("plan.json", "--reverse", "-o", "no/such/folder.json"), ("cannot be written",)),
        ],
    )
    def test_bad_input(self, arguments: tuple[str, ...], words: tuple[str, ...], run: Run) -> None:
        refused(run("edit", *arguments), *words)

    def test_different_limits_do_not_join(self, run: Run, made: pf.Plan) -> None:
        editing.under_limits(made, pf.Limits(speed=9.0)).save("fast.json")
        refused(run("edit", "plan.json", "--join", "fast.json"), "different limits")


class TestImport:
    def test_says_what_it_found(self, run: Run) -> None:
        result = run("import", "pieces.csv", "--limits", GIVEN, "--repair", "--retime", "-o", "out")
        assert result.exit_code == 0
        for words in (
            "polynomial pieces, as Crazyswarm has them",
            f"limits: {GIVEN}",
            "joints",
            "repair",
            "total time",
            "carried; nothing limits it",
            "feasible: proven",
        ):
            assert words in result.stdout
        assert [path.name for path in Path("out").iterdir()] == ["plan.json"]
        assert run("check", "out/plan.json").exit_code == 0

    def test_samples_and_plans_too(self, run: Run, made: pf.Plan) -> None:
        found = json.loads(run("import", "samples.csv", "--limits", GIVEN, "--json").stdout)
        assert found["form"] == "samples"
        assert len(found["fit_errors"]) == 3
        assert found["duration"] == pytest.approx(made.duration)
        result = run("import", "plan.json")
        assert result.exit_code == 0
        assert "(of the file)" in result.stdout
        assert run("import", "plan.json", "--vehicle", "racing-quad").exit_code == 0

    def test_too_fast_is_a_negative_verdict(self, run: Run) -> None:
        result = run("import", "pieces.csv", "--limits", "speed=1", "--repair")
        assert result.exit_code == 1
        assert "not feasible: speed reaches" in result.stderr
        faster = run("import", "pieces.csv", "--limits", "speed=1", "--method", "peak", "--json")
        assert faster.exit_code == 0
        assert json.loads(faster.stdout)["feasible_before"] is False

    def test_rounded_files_are_told_to_be_repaired(self, run: Run, made: pf.Plan) -> None:
        slow = editing.slow(made, 0.9)
        write_crazyflie(slow, "slow.csv")
        header, *rows = Path("slow.csv").read_text().strip().split("\n")
        rows = [",".join(f"{float(field):.6f}" for field in row.split(",")) for row in rows]
        Path("rounded.csv").write_text("\n".join([header, *rows]))
        result = run("import", "rounded.csv", "--limits", GIVEN)
        assert result.exit_code == 1
        assert "jump by" in result.stdout
        assert "come from rounded numbers" in result.stdout
        assert run("import", "rounded.csv", "--limits", GIVEN, "--repair").exit_code == 0

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (("nowhere.csv",), ("no such file",)),
            (("pieces.csv", "--limits", "speed=x"), ("limit speed",)),
            (("pieces.csv", "--tolerance", "0"), ("tolerance is 0 m",)),
            (("pieces.csv", "--yaw-limits", "rate=-1"), ("yaw_rate",)),
            (("pieces.csv", "--method", "magic"), ("magic",)),
            (("course.csv",), ("course.csv: has 3 columns and no header",)),
        ],
    )
    def test_bad_input(self, arguments: tuple[str, ...], words: tuple[str, ...], run: Run) -> None:
        Path("course.csv").write_text("0,0,1\n1,1,1\n")
        refused(run("import", *arguments), *words)


class TestShow:
    def test_kept(self, run: Run) -> None:
        arguments = ("show", "plan.json", "other.json", "--separation", "0.4", "--downwash", "0.8")
        result = run(*arguments)
        assert result.exit_code == 0
        assert "kept: 0.4 m to the side, 0.8 m above and below; proven" in result.stdout
        found = json.loads(run(*arguments, "--json").stdout)
        assert found["kept"] is True
        assert found["distance"] == pytest.approx(3.0, abs=1e-9)
        assert found["pairs"][0]["pair"] == [0, 1]

    def test_not_kept(self, run: Run) -> None:
        result = run("show", "plan.json", "plan.json", "--separation", "0.4", "--stagger", "0.1")
        assert result.exit_code == 1
        assert "not kept" in result.stdout
        assert "plan.json (0) and plan.json (1) come as near as" in result.stderr

    def test_other_files_and_delays(self, run: Run) -> None:
        result = run("show", "pieces.csv", "samples.csv", "other.json", "--delays", "0,9,0")
        assert result.exit_code == 0
        assert "3 drones, 3 pairs" in result.stdout

    def test_how_far_off_samples_the_proof_is(self, run: Run) -> None:
        fit = read_trajectory_file("samples.csv").fit_errors
        assert fit is not None
        arguments = ("show", "samples.csv", "other.json")
        said = " ".join(run(*arguments).stdout.split())
        assert f"off samples by {fit[0]:.1e} m, {fit[1]:.1e} m/s" in said
        assert json.loads(run(*arguments, "--json").stdout)["fit_errors"] == [list(fit), None]
        assert "(samples.csv)" in said
        found = json.loads(run(*arguments, "--json").stdout)
        assert found["bound"] == pytest.approx(found["distance"] - fit[0], abs=1e-6)

    def test_a_separation_is_kept_by_samples_too_or_not_proven(self, run: Run) -> None:
        near = json.loads(run("show", "samples.csv", "other.json", "--json").stdout)
        between = 0.5 * (near["distance"] + near["bound"])
        result = run("show", "samples.csv", "other.json", "--separation", f"{between:.9f}")
        assert result.exit_code == 1
        assert "less what they are off samples" in result.stderr
        assert "samples" not in run("show", "plan.json", "other.json").stdout

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (("plan.json",), ("two plans at least",)),
            (("plan.json", "nowhere.json"), ("no such file",)),
            (("plan.json", "other.json", "--delays", "1"), ("1 delays for 2 plans",)),
            (("plan.json", "other.json", "--delays", "1,x"), ("'x' is not a number",)),
            (("plan.json", "other.json", "--delays", "1,nan"), ("delay 1 is nan s",)),
            (("plan.json", "other.json", "--delays", "1,2", "--stagger", "1"), ("exclude",)),
            (("plan.json", "other.json", "--separation", "-1"), ("separation is -1 m",)),
            (("plan.json", "other.json", "--downwash", "1"), ("without the separation",)),
        ],
    )
    def test_bad_input(self, arguments: tuple[str, ...], words: tuple[str, ...], run: Run) -> None:
        refused(run("show", *arguments), *words)
