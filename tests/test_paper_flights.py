"""The paper's experiment in simulation: the figures are those of flights and of their records."""

import csv
import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

import peakflight as pf
from peakflight.cli.application import application
from peakflight.compare import Row, run_method
from peakflight.figures import FlownPlan, flown_figures
from peakflight.flight.differences import Samples
from peakflight.paper import (
    ALGORITHM_1,
    GUESS,
    JOINT,
    MELLINGER,
    PEAK,
    PRINTED,
    PaperComparison,
    Reproduction,
)
from peakflight.paper_flights import (
    AT_REST,
    DEFAULT_VEHICLE,
    PRINTED_FLIGHTS,
    PRINTED_REDUCTIONS,
    SETTINGS,
    Experiment,
    Flown,
    fly_paper,
)
from peakflight.paper_page import paper_document, write_paper

Run = Callable[..., Result]
SMALL = "x,y,z\n0,0,1\n0.6,0.5,1.2\n0.2,0.9,1\n2.5,1.2,1.4\n"
METHODS = {GUESS: "proportional", MELLINGER: "mellinger", PEAK: "peak"}
FLOWN = {f"flown-{name}-{kind}" for name in ("jerk", "snap")
         for kind in ("paths", "derivatives", "errors")}  # fmt: skip
WEAK = "crazyflie-2.1"
"""It has less thrust than the limits ask for."""


def planned(waypoints: np.ndarray) -> Reproduction:
    """The paper's three methods; the two others, which nobody flies, are left out."""
    none = Row(method="", status="refused", certified=False)
    comparisons = []
    for printed in PRINTED:
        problem = pf.Problem(waypoints, limits=printed.limits, minimize=printed.name, degree=5)
        rows = {name: run_method(problem, method) for name, method in METHODS.items()}
        rows |= {ALGORITHM_1: none, JOINT: none}
        comparisons.append(PaperComparison(printed=printed, problem=problem, rows=rows))
    return Reproduction(course=pf.Course(waypoints, name="small"), comparisons=tuple(comparisons))


@pytest.fixture(scope="module")
def result() -> Reproduction:
    return planned(np.array([[0, 0, 1], [0.6, 0.5, 1.2], [0.2, 0.9, 1], [2.5, 1.2, 1.4]], float))


@pytest.fixture(scope="module")
def experiment(result: Reproduction) -> Experiment:
    return fly_paper(result)


@pytest.fixture(scope="module")
def crashed(result: Reproduction) -> Experiment:
    """Rotors that hold the vehicle up and no more: nothing flies to its end."""
    stock = pf.VEHICLES[WEAK]
    return fly_paper(result, replace(stock, name="too-weak", mass=0.0485, sources={}))


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.csv").write_text(SMALL)

    def invoke(*arguments: object) -> Result:
        result = CliRunner().invoke(application, ["paper", *map(str, arguments)])
        assert result.exception is None or isinstance(result.exception, SystemExit)
        return result

    return invoke


def rows_of(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


def test_what_the_paper_prints() -> None:
    errors = [[100.0 * one.rms_error for one in each.values()] for each in PRINTED_FLIGHTS.values()]
    np.testing.assert_allclose(errors, [[7.9, 11.4, 10.2], [12.2, 11.7, 9.0]])
    for printed in PRINTED:
        flights = PRINTED_FLIGHTS[printed.name]
        assert set(flights) == set(METHODS)
        for name, flight in flights.items():  # no flight is shorter than its plan
            assert flight.duration > printed.durations[name]
        for (name, other), percent in PRINTED_REDUCTIONS[printed.name].items():
            part = 1.0 - flights[name].duration / flights[other].duration
            assert 100.0 * part == pytest.approx(percent, abs=1.0)


class TestFlights:
    def test_are_those_of_fly_and_analyse(
        self, result: Reproduction, experiment: Experiment
    ) -> None:
        assert experiment.vehicle.name == DEFAULT_VEHICLE
        for printed, one in zip(PRINTED, experiment.comparisons, strict=True):
            for name, flight in one.flights.items():
                plan = result.comparisons[PRINTED.index(printed)].rows[name].plan
                factor = flight.printed.duration / printed.durations[name]
                slowed = plan.trajectory.stretch(factor)
                for found, flown in ((flight.flown, plan), (flight.slowed, slowed)):
                    again = pf.fly(
                        flown, vehicle=DEFAULT_VEHICLE, controller="firmware", settings=SETTINGS
                    )
                    np.testing.assert_allclose(found.flight.position, again.position, atol=1e-9)
                    # the controller runs at 500 Hz, so that every fifth sample is one at 100 Hz
                    every = again.times[::5], again.position[::5]
                    seen = pf.analyse(*every, found.plan, start=0.0)
                    assert seen.rate == pytest.approx(100.0)
                    assert found.rms_error == pytest.approx(seen.rms_error, rel=1e-9)
                    assert found.top_error == pytest.approx(seen.top_error, rel=1e-9)
                    for kind, peak in seen.peaks.items():
                        assert found.analysis.peaks[kind].flown == pytest.approx(
                            peak.flown, rel=1e-6
                        )

    def test_the_thrust_of_the_default_vehicle_is_enough_and_the_stock_one_s_is_not(self) -> None:
        asked = max(printed.limits.thrust_acceleration for printed in PRINTED)
        assert pf.VEHICLES[DEFAULT_VEHICLE].top_thrust_acceleration > asked
        assert pf.VEHICLES[WEAK].top_thrust_acceleration < asked

    def test_rest_is_when_nothing_moves_any_more(self, experiment: Experiment) -> None:
        for one in experiment.comparisons:
            for flown in one.flown.values():
                rest, flight = flown.rest_time, flown.flight
                assert flown.plan.duration - 0.5 < rest < flight.times[-1]
                speed = np.linalg.norm(flight.velocity, axis=1)
                # the filter looks 25 ms to either side
                assert (speed[flight.times > rest + 0.03] < 1.1 * AT_REST).all()
                before = (flight.times > rest - 0.06) & (flight.times < rest)
                assert speed[before].max() > 0.9 * AT_REST

    def test_no_rest_of_what_moves_to_the_end(self, experiment: Experiment) -> None:
        flown = experiment.comparisons[0].flown[PEAK]
        times = np.arange(50) / 100.0
        moving = Samples(times, np.outer(times, [1.0, 0.0, 0.0]))
        still = Samples(times, np.zeros((50, 3)))
        assert replace(flown, samples=moving).rest_time is None
        assert replace(flown, samples=still).rest_time is None, "it never moved"

    def test_a_crash_has_a_cause_and_no_error(self, crashed: Experiment) -> None:
        for one in crashed.comparisons:
            assert not one.any_flew
            assert all(figure.ours is None for figure in one.beside_paper)
            for flown in one.flown.values():
                assert flown.rms_error is flown.top_error is flown.rest_time is None
                said = flown.to_dict()
                assert said["rms_error"] is None
                assert said["crash"] == {
                    "cause": flown.flight.crash.cause, "time": flown.flight.crash.time,
                }  # fmt: skip
                assert flown.analysis.times[-1] == pytest.approx(flown.flight.crash.time, abs=0.01)

    def test_a_method_without_a_plan_is_not_flown(self, result: Reproduction) -> None:
        jerk, snap = result.comparisons
        none = Row(method="peak", status="infeasible", certified=False)
        without = replace(jerk, rows={**jerk.rows, PEAK: none})
        found = fly_paper(replace(result, comparisons=(without, snap)))
        assert found.comparisons[0].flights[PEAK].flown is None
        assert list(found.comparisons[0].flown) == [GUESS, MELLINGER]
        assert found.comparisons[0].reduction(PEAK, GUESS) is None
        json.dumps(found.to_dict(), allow_nan=False)
        assert "| jerk, peak | 3.9 s | - | 4.50 s | - |" in markdown(result, found)


def markdown(result: Reproduction, experiment: Experiment) -> str:
    from peakflight.document import as_markdown

    return as_markdown(paper_document(result, {}, experiment=experiment))


class TestFiles:
    def test_stand_beside_the_papers(
        self, result: Reproduction, experiment: Experiment, tmp_path: Path
    ) -> None:
        names, notes = write_paper(result, tmp_path, experiment=experiment)
        assert notes == ()
        assert sorted(names) == sorted(path.name for path in tmp_path.iterdir())
        for name in FLOWN:
            assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG\r\n")
            assert b"<svg" in (tmp_path / f"{name}.svg").read_bytes()
        values = json.loads((tmp_path / "paper.json").read_text())["experiment"]
        assert values == json.loads(json.dumps(experiment.to_dict()))
        lines = {
            (one["comparison"], one["method"]): one for one in rows_of(tmp_path / "flights.csv")
        }
        samples = rows_of(tmp_path / "flown-positions.csv")
        pages = [
            (tmp_path / "paper.html").read_text(),
            (tmp_path / "paper.md").read_text(),
        ]
        assert len(lines) == 6
        for one, name, flight in experiment.flights:
            comparison = one.comparison.printed.name
            flown, line = flight.flown, lines[comparison, name]
            assert float(line["RMS error [m]"]) == flown.rms_error
            assert float(line["paper's RMS error [m]"]) == flight.printed.rms_error
            assert float(line["at rest [s]"]) == flown.rest_time
            assert float(line["slowed RMS error [m]"]) == flight.slowed.rms_error
            assert line["crash"] == ""
            said = values["comparisons"][PRINTED.index(one.comparison.printed)]["flights"][name]
            assert said["flown"]["rms_error"] == flown.rms_error
            for page in pages:
                assert f"{100.0 * flown.rms_error:.1f} cm" in page
                assert f"{flown.rest_time:.2f} s" in page
                assert f"{100.0 * flight.printed.rms_error:.1f} cm" in page
            own = [s for s in samples if (s["comparison"], s["method"]) == (comparison, name)]
            errors = np.array([float(sample["error [m]"]) for sample in own])
            assert np.sqrt(np.mean(errors**2)) == pytest.approx(flown.rms_error, rel=1e-6)
            assert np.diff([float(sample["t [s]"]) for sample in own]) == pytest.approx(0.01)

    def test_crashes_are_on_the_page(
        self, result: Reproduction, crashed: Experiment, tmp_path: Path
    ) -> None:
        write_paper(result, tmp_path, experiment=crashed)
        page = (tmp_path / "paper.md").read_text()
        for one in crashed.comparisons:
            for name, flown in one.flown.items():
                crash = flown.flight.crash
                said = f"{one.comparison.printed.name}, {name}: crashed at {crash.time:.2f} s"
                assert f"{said}, {crash.cause}" in page
        assert "less than that: it cannot fly plans that go to the limit" in page
        lines = rows_of(tmp_path / "flights.csv")
        assert all(line["crash"] and not line["RMS error [m]"] for line in lines)

    def test_the_page_without_flights_says_nothing_of_them(self, result: Reproduction) -> None:
        from peakflight.document import as_markdown

        text = as_markdown(paper_document(result, {}))
        assert "The flights" not in text
        assert "run again" in text


def test_a_crash_does_not_press_other_curves_flat(
    experiment: Experiment, crashed: Experiment
) -> None:
    good, bad = (one.comparisons[0].flown for one in (experiment, crashed))

    def shown(flown: Flown) -> FlownPlan:
        crash = flown.flight.crash
        return FlownPlan(flown.plan, flown.analysis, crash.time if crash else None)

    both = {"good": shown(good[PEAK]), "bad": shown(bad[MELLINGER])}
    figures = flown_figures(both, title="Both")
    (axes,) = figures["errors"].axes
    top = axes.get_ylim()[1]
    assert top < 2.0 * 100.0 * good[PEAK].top_error
    curves = {len(line.get_xdata()): line for line in axes.lines}
    for flown in (good[PEAK], bad[MELLINGER]):
        line = curves[len(flown.analysis.times)]
        np.testing.assert_allclose(line.get_ydata(), 100.0 * flown.analysis.errors)
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert texts[0] == f"good: RMS {100.0 * good[PEAK].rms_error:.1f} cm"
    assert texts[1] == f"bad: crash at {bad[MELLINGER].flight.crash.time:.2f} s"


class TestCommand:
    def test_flies_another_vehicle(self, run: Run, tmp_path: Path) -> None:
        result = run("small.csv", "--fly", "--vehicle", "crazyflie-brushless", "-o", "out")
        assert result.exit_code == 0, result.stderr
        assert "RMS position errors, beside the paper: crazyflie-brushless" in result.stdout
        assert max(map(len, result.stdout.splitlines())) <= 80
        assert {f"{name}.png" for name in FLOWN} <= {path.name for path in Path("out").iterdir()}
        lines = rows_of(tmp_path / "out" / "flights.csv")
        assert f"{100.0 * float(lines[0]['RMS error [m]']):.1f} cm" in result.stdout

    def test_json_has_the_experiment(self, run: Run, tmp_path: Path) -> None:
        result = run("small.csv", "--fly", "--json")
        assert result.exit_code == 0
        values = json.loads(result.stdout)
        assert values["experiment"]["vehicle"] == DEFAULT_VEHICLE
        assert [one["name"] for one in values["experiment"]["comparisons"]] == ["jerk", "snap"]
        assert str(Path("out/paper/flights.csv")) in values["files"]
        written = json.loads((tmp_path / "out" / "paper" / "paper.json").read_text())
        assert written == {key: values[key] for key in written}

    def test_ends_with_1_if_nothing_of_a_comparison_flies(
        self, run: Run, monkeypatch: pytest.MonkeyPatch, crashed: Experiment
    ) -> None:
        monkeypatch.setattr("peakflight.paper_flights.fly_paper", lambda *_, **__: crashed)
        result = run("small.csv", "--fly")
        assert result.exit_code == 1
        assert "note: jerk, peak: crashed at" in result.stdout
        assert result.stderr.endswith("no flight to the end of minimum jerk, minimum snap\n")

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (("--fly", "--vehicle", "pigeon"), "unknown vehicle 'pigeon'; known are"),
            (("--fly", "--vehicle", "./none.yaml"), "none.yaml: no such file"),
            (("--vehicle", "crazyflie-2.1"), "--vehicle is of --fly"),
            (("missing.csv", "--fly"), "missing.csv: no such file"),
        ],
    )
    def test_bad_input(
        self, run: Run, tmp_path: Path, arguments: tuple[str, ...], words: str
    ) -> None:
        result = run(*arguments)
        assert (result.exit_code, result.stdout) == (2, "")
        assert result.stderr.count("\n") == 1
        assert words in result.stderr
        assert not (tmp_path / "out").exists()

    def test_without_fly_nothing_of_flights_is_imported(self, tmp_path: Path) -> None:
        (tmp_path / "small.csv").write_text(SMALL)
        code = (
            "import sys; sys.argv[1:] = ['paper', 'small.csv']\n"
            "from peakflight.cli import main\n"
            "try: main()\n"
            "except SystemExit as end: assert not end.code\n"
            "found = [name for name in sys.modules if name.startswith("
            "('peakflight.flight.', 'peakflight.paper_flight'))]\n"
            "assert not found, found"
        )
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=False
        )
        assert done.returncode == 0, done.stderr
        files = {path.name for path in (tmp_path / "out" / "paper").iterdir()}
        assert not any(name.startswith(("flown", "flights")) for name in files)
