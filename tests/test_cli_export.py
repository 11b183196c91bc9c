"""`peakflight export`, and `--export` of `peakflight plan`."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import peakflight as pf
from peakflight.cli.application import application
from peakflight.formats import FLIGHT_FORMATS

Run = Callable[..., Result]
WAYPOINTS = [[0.0, 0.0, 1.0], [0.8, 0.4, 1.2], [1.2, 1.0, 0.9]]


@pytest.fixture(scope="module")
def plan() -> pf.Plan:
    return pf.plan(WAYPOINTS, vehicle="crazyflie-2.1", pieces=2)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, plan: pf.Plan) -> Path:
    monkeypatch.chdir(tmp_path)
    for name in ("one", "two"):
        Path(name).mkdir()
        plan.save(Path(name) / "plan.json")
    Path("lap.csv").write_text("x,y,z\n" + "\n".join(",".join(map(str, p)) for p in WAYPOINTS))
    return tmp_path


@pytest.fixture
def run() -> Run:
    def invoke(*arguments: object) -> Result:
        return CliRunner().invoke(application, [str(argument) for argument in arguments])

    return invoke


def refused(result: Result, *words: str) -> None:
    assert result.exit_code == 2
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    for word in words:
        assert word in result.stderr


@pytest.mark.parametrize("name", FLIGHT_FORMATS)
def test_every_format_is_written_beside_the_plan(name: str, run: Run, folder: Path) -> None:
    (folder / "one" / "plan.json").rename("one/lap.json")
    result = run("export", "one/lap.json", "--to", name)
    assert (result.exit_code, result.stderr) == (0, "")
    path = folder / "one" / FLIGHT_FORMATS[name].filename
    assert f"wrote {Path('one') / path.name}: {name}, {path.stat().st_size} bytes" in result.stdout
    assert "proven again as it is read" in result.stdout
    assert "jumps at joints" in result.stdout


def test_plans_are_not_written_over(run: Run) -> None:
    before = Path("one/plan.json").read_bytes()
    itself = ("is the plan itself; name another file with -o",)
    refused(run("export", "one/plan.json", "--to", "json"), *itself)
    for output in ("one/plan.json", "one/../one/plan.json", "link"):
        Path("link").unlink(missing_ok=True)
        Path("link").symlink_to("one/plan.json")
        refused(run("export", "one/plan.json", "--to", "samples", "-o", output), *itself)
    both = ("one/plan.json", "two/plan.json")
    refused(run("export", *both, "--to", "skyc", "-o", "two/plan.json"), *itself)
    assert Path("one/plan.json").read_bytes() == Path("two/plan.json").read_bytes() == before


def test_another_plan_is_not_replaced_unless_it_is_named(run: Run) -> None:
    slower = json.loads(Path("two/plan.json").read_text())
    slower["message"] = "another"
    Path("one/other.json").write_text(json.dumps(slower))
    before = Path("one/plan.json").read_bytes()
    refused(run("export", "one/other.json", "--to", "json"), "name the file with -o")
    assert Path("one/plan.json").read_bytes() == before
    assert run("export", "one/other.json", "--to", "json", "-o", "one/plan.json").exit_code == 0
    assert run("export", "one/other.json", "--to", "json").exit_code == 0  # the same again
    assert json.loads(Path("one/plan.json").read_text())["message"] == "another"


def test_json_is_one_object(run: Run) -> None:
    result = run("export", "one/plan.json", "--to", "crazyflie", "-o", "c.csv", "--json")
    printed = json.loads(result.stdout)
    assert (printed["format"], printed["path"], printed["feasible"]) == (
        "crazyswarm",
        "c.csv",
        True,
    )
    (flight,) = printed["flights"]
    assert set(flight["difference"]) == {"position", "velocity", "acceleration"}
    assert flight["peaks"]["jerk"] <= 1.0001
    assert Path("c.csv").is_file()


def test_a_show_of_two(run: Run) -> None:
    result = run("export", "one/plan.json", "two/plan.json", "--to", "skyc", "-o", "show.skyc")
    assert result.exit_code == 0
    assert "distances between drones are no such limit" in " ".join(result.stdout.split())
    assert "note: one and two come nearest, at " in result.stdout
    assert [line.split()[0] for line in result.stdout.splitlines() if "%" in line][:2] == [
        "one",
        "two",
    ]


def test_no_refit_that_breaks_a_limit_ends_with_1(run: Run) -> None:
    limits = pf.Limits(speed=5.0, thrust_acceleration=12.4, jerk=300.0, snap=9000.0)
    fine = pf.plan([[0, 0, 1], [0.3, 0, 1], [0.3, 0.3, 1]], limits=limits, pieces=4)
    fine.save("fine.json")
    result = run("export", "fine.json", "--to", "skyc", "--no-refit")
    assert result.exit_code == 1
    assert "not proven to keep the limits as it is read" in result.stdout
    assert "is allowed for rounding" in result.stderr
    again = run("export", "fine.json", "--to", "skyc", "--json")
    assert json.loads(again.stdout)["flights"][0]["cost"] > 0.1


def test_list_names_every_format(run: Run) -> None:
    listed = run("export", "--list").stdout
    assert all(f"{name}: {one.summary}" in listed for name, one in FLIGHT_FORMATS.items())
    formats = json.loads(run("export", "--list", "--json").stdout)["formats"]
    assert [one["name"] for one in formats] == list(FLIGHT_FORMATS)


def test_bad_input_is_one_line(run: Run, folder: Path) -> None:
    refused(run("export"), "name a plan")
    refused(run("export", "one/plan.json"), "--to FORMAT is missing; one of samples")
    refused(run("export", "one/plan.json", "--to", "pdf"), "'pdf' is not one of")
    refused(run("export", "none.json", "--to", "px4"), "none.json: no such file")
    refused(run("export", "lap.csv", "--to", "px4"), "lap.csv: line 1 is not JSON")
    refused(run("export", "one/plan.json", "--to", "px4", "-o", "two"), "two: is a folder")
    refused(run("export", "one/plan.json", "two/plan.json", "--to", "px4"), "holds one drone")
    refused(run("export", "one/plan.json", "--to", "px4", "-o", "no/f.py"), "cannot be written")
    lift = ("export", "one/plan.json", "--to", "px4", "--lift")
    for text in ("up", "1_5"):
        refused(run(*lift, text), f"'{text}' is neither auto nor a number of m")
    refused(run(*lift, "-1"), "lift is -1 m; it must be auto or a number of m from 0 on")
    values = json.loads(Path("one/plan.json").read_text())
    values["problem"]["vehicle"] = None
    Path("bare.json").write_text(json.dumps(values))
    refused(run("export", "bare.json", "--to", "agilicious"), "needs a vehicle")
    assert sorted(path.name for path in folder.iterdir()) == ["bare.json", "lap.csv", "one", "two"]


def test_lift_moves_the_plan_up_and_says_so(run: Run) -> None:
    for lift, by in (("auto", 0.0), ("1.5", 1.5)):
        result = run("export", "one/plan.json", "--to", "px4", "--lift", lift, "--json")
        assert result.exit_code == 0
        said = json.loads(result.stdout)
        assert said["lift"] == by
        assert any(note.startswith("moved up by 1.500 m") for note in said["notes"]) == (by > 0.0)
    Path("down.csv").write_text("x,y,z\n0,0,0.2\n0.8,0.4,-0.6\n1.2,1.0,0.2\n")
    assert run("plan", "down.csv", "--vehicle", "crazyflie-2.1", "-o", "down").exit_code == 0
    refused(run("export", "down/plan.json", "--to", "px4"), "--lift auto")
    result = run("export", "down/plan.json", "--to", "px4", "--lift", "auto")
    assert result.exit_code == 0
    assert "is 0.500 m above z = 0" in " ".join(result.stdout.split())


def test_plan_writes_what_it_is_asked_for(run: Run, folder: Path) -> None:
    options = ("--vehicle", "crazyflie-2.1", "--pieces", "1", "--no-figures", "-o", "out")
    asked = ("crazyflie", "agilicious", "skyc", "cflib")
    result = run("plan", "lap.csv", *options, *(f"--export={name}" for name in asked))
    assert result.exit_code == 0
    names = {"plan.json", "crazyflie.csv", "agilicious.csv", "show.skyc", "fly_cflib.py"}
    assert {path.name for path in (folder / "out").iterdir()} == names
    assert "full state and rotor thrusts at 100 Hz" in result.stdout
    refused(run("plan", "lap.csv", "--export", "agilicious"), "--export agilicious needs --vehicle")
