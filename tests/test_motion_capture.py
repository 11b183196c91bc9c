import json
import math
from collections.abc import Callable
from math import comb
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.polynomial import Polynomial

import peakflight as pf
from peakflight.cli.application import application
from peakflight.figures import motion_capture_figures
from peakflight.flight.differences import Samples, differentiate, sample_positions
from peakflight.flight.motion_capture import analyse
from peakflight.formats.flight_log import read_flight_log

RATE = 100.0
HALF = 2.5 / RATE
"""s, to either side of a derivative's time."""


@pytest.fixture(scope="module")
def plan() -> pf.Plan:
    waypoints = [[0, 0, 1], [1, 0.5, 1.2], [1.5, 2, 1.0], [0, 1, 1.4]]
    limits = pf.Limits(speed=3.0, thrust_acceleration=14.0, jerk=40.0, snap=600.0, tilt=0.7)
    return pf.plan(waypoints, limits=limits, method="peak")


def even(function: Callable[[np.ndarray], np.ndarray], count: int = 80) -> Samples:
    times = np.arange(count) / RATE
    return Samples(times, np.stack([function(times)] * 3, axis=1))


def record(
    plan: pf.Plan,
    *,
    start: float = 0.0,
    before: float = 0.5,
    after: float = 0.5,
    rate: float = RATE,
    noise: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Times and positions of a vehicle that flies exactly, and hovers before and after."""
    count = math.floor((before + plan.duration + after) * rate)
    times = start - before + np.arange(count) / rate
    positions = plan.trajectory(np.clip(times - start, 0.0, plan.duration))
    random = np.random.default_rng(7)
    return times, positions + noise * random.standard_normal(positions.shape)


class TestDifferentiate:
    def test_is_the_difference_and_the_mean_of_five_at_every_step(self) -> None:
        values = np.random.default_rng(1).standard_normal((60, 3))
        twin, times = values, np.arange(60) / RATE
        for order, found in enumerate(differentiate(Samples(times, values), RATE), start=1):
            steps = (twin[1:] - twin[:-1]) * RATE
            twin = np.array([steps[k : k + 5].mean(axis=0) for k in range(len(steps) - 4)])
            # rounding of numbers of the size 500^order
            np.testing.assert_allclose(found.values, twin, atol=1e-13 * (2.0 * RATE) ** order)
            assert len(found.values) == 60 - 5 * order

    @pytest.mark.parametrize("order", [1, 2, 3, 4])
    def test_is_exact_one_degree_above_the_order(self, order: int) -> None:
        polynomial = Polynomial(np.arange(1.0, order + 3.0))
        found = differentiate(even(polynomial), RATE)[order - 1]
        expected = polynomial.deriv(order)(found.times)
        # eps times the size of positions, amplified by the differences
        atol = 1e-14 * (2.0 / (2.0 * HALF)) ** order
        np.testing.assert_allclose(found.values[:, 0], expected, atol=atol)

    def test_is_off_by_the_cubic_term_on_a_cubic(self) -> None:
        found = differentiate(even(lambda t: t**3), RATE)[0]
        np.testing.assert_allclose(found.values[:, 0], 3.0 * found.times**2 + HALF**2, atol=1e-12)

    @pytest.mark.parametrize("order", [1, 2, 3, 4])
    def test_flattens_a_sine_by_its_sinc(self, order: int) -> None:
        omega = 25.0
        found = differentiate(even(lambda t: np.sin(omega * t)), RATE)[order - 1]
        kept = (math.sin(omega * HALF) / (omega * HALF)) ** order
        exact = omega**order * np.sin(omega * found.times + order * math.pi / 2.0)
        np.testing.assert_allclose(found.values[:, 0], kept * exact, atol=1e-12 * 40.0**order)
        assert kept < 0.95

    @pytest.mark.parametrize("order", [1, 2, 3, 4])
    def test_noise_grows_as_the_binomial_says(self, order: int) -> None:
        sigma, count = 1e-4, 40_000
        noise = sigma * np.random.default_rng(order).standard_normal((count, 3))
        found = differentiate(Samples(np.arange(count) / RATE, noise), RATE)[order - 1]
        expected = sigma * math.sqrt(comb(2 * order, order)) / (2.0 * HALF) ** order
        # 120,000 numbers, some alike: the standard deviation is known to about 1 %
        assert found.values.std() == pytest.approx(expected, rel=0.03)

    def test_too_short_a_record_has_none(self) -> None:
        found = differentiate(even(np.sin, count=12), RATE)
        assert [len(one.values) for one in found] == [7, 2, 0, 0]
        assert [len(one.times) for one in found] == [7, 2, 0, 0]

    def test_a_missing_sample_is_missing_in_what_is_made_of_it(self) -> None:
        samples = even(np.sin)
        samples.positions[30] = np.nan
        first = differentiate(samples, RATE)[0]
        # the mean of five differences needs the first and last of six samples alone
        assert np.flatnonzero(np.isnan(first.values[:, 0])).tolist() == [25, 30]


class TestSamplePositions:
    def test_samples_at_the_same_times_stay(self) -> None:
        times = np.arange(500) / 500.0
        positions = np.random.default_rng(3).standard_normal((500, 3))
        found = sample_positions(times, positions, 100.0)
        np.testing.assert_allclose(found.times, times[::5], atol=1e-15)
        np.testing.assert_allclose(found.positions, positions[::5], atol=1e-12)

    def test_is_exact_on_a_cubic_at_uneven_times(self) -> None:
        times = np.cumsum(np.random.default_rng(4).uniform(0.005, 0.02, 200))
        found = sample_positions(times, np.stack([times**3 - times] * 3, axis=1), 100.0)
        np.testing.assert_allclose(found.positions[:, 1], found.times**3 - found.times, atol=1e-11)
        assert found.times[-1] <= times[-1] < found.times[-1] + 0.01

    def test_a_gap_is_left_open(self) -> None:
        times = np.delete(np.arange(100) / 100.0, range(40, 50))
        positions = np.stack([times] * 3, axis=1)
        found = sample_positions(times, positions, 100.0, gap=0.025)
        assert np.flatnonzero(np.isnan(found.positions[:, 0])).tolist() == list(range(40, 50))
        closed = sample_positions(times, positions, 100.0)
        np.testing.assert_allclose(closed.positions[:, 0], closed.times, atol=1e-12)

    @pytest.mark.parametrize(
        ("times", "positions", "rate", "words"),
        [
            ([0.0, 0.0], np.zeros((2, 3)), 100.0, "sample 1 is at 0 s, after 0 s"),
            ([0.0, math.nan], np.zeros((2, 3)), 100.0, "time of sample 1 is nan"),
            ([0.0, 1.0], np.zeros((3, 3)), 100.0, "positions has shape"),
            ([0.0, 1.0], np.zeros((2, 3)), 0.0, "rate is 0.0 Hz"),
            ([0.0], np.full((1, 3), np.nan), 100.0, "no sample has a position"),
        ],
    )
    def test_wrong_arguments_are_named(
        self, times: Any, positions: Any, rate: float, words: str
    ) -> None:
        with pytest.raises(pf.InvalidProblem, match=words):
            sample_positions(times, positions, rate)


class TestAnalyse:
    def test_an_exact_flight_has_no_error(self, plan: pf.Plan) -> None:
        found = analyse(*record(plan), plan, start=0.0)
        assert found.top_error < 1e-12
        assert found.start_given
        assert found.notes == ()
        assert found.gaps == ()
        for curve in found.curves.values():
            np.testing.assert_allclose(curve.flown, curve.planned, rtol=1e-6, atol=1e-6)

    def test_errors_are_the_distances(self, plan: pf.Plan) -> None:
        times, positions = record(plan, before=0.0, after=0.0)
        shift = 0.03 * np.sin(7.0 * times)[:, None] * np.array([2.0, 1.0, -2.0]) / 3.0
        found = analyse(times, positions + shift, plan, start=0.0)
        expected = 0.03 * np.abs(np.sin(7.0 * times))
        np.testing.assert_allclose(found.errors, expected, atol=1e-12)
        assert found.rms_error == pytest.approx(math.sqrt(np.mean(expected**2)))
        assert found.top_error == pytest.approx(expected.max())
        assert found.top_error_time == pytest.approx(times[expected.argmax()])

    @pytest.mark.parametrize("start", [0.0, 3.21717, 1.7e9 + 0.1234])
    @pytest.mark.parametrize(("before", "after"), [(0.5, 0.5), (3.0, 8.0), (-0.1, -0.1)])
    def test_the_start_is_found(
        self, plan: pf.Plan, start: float, before: float, after: float
    ) -> None:
        times, positions = record(plan, start=start, before=before, after=after)
        found = analyse(times, positions, plan)
        # the rounding of a Unix time is 2e-7 s
        assert found.start == pytest.approx(start, abs=2e-6)
        assert not found.start_given
        assert found.top_error < 1e-5

    def test_the_start_is_found_in_noise(self, plan: pf.Plan) -> None:
        found = analyse(*record(plan, start=1.2345, noise=5e-3), plan)
        # noise over the root of the sum of squared velocities of the samples
        speeds = np.linalg.norm(plan.trajectory(np.arange(0, plan.duration, 0.01), 1), axis=1)
        assert found.start == pytest.approx(1.2345, abs=4.0 * 5e-3 / np.sqrt((speeds**2).sum()))
        assert found.rms_error == pytest.approx(5e-3 * math.sqrt(3.0), rel=0.1)

    def test_a_delay_is_an_error_if_the_start_is_given(self, plan: pf.Plan) -> None:
        times, positions = record(plan, start=0.05)
        assert analyse(times, positions, plan, start=0.0).rms_error > 0.05
        assert analyse(times, positions, plan).rms_error < 1e-5

    def test_plans_that_begin_at_another_time_are_flown_alike(self, plan: pf.Plan) -> None:
        from dataclasses import replace

        later = replace(plan, trajectory=plan.trajectory.shift(12.0))
        found = analyse(*record(plan, start=2.0), later)
        assert found.start == pytest.approx(2.0, abs=2e-6)
        assert found.top_error < 1e-5

    def test_peaks_are_those_of_the_filtered_flight(self, plan: pf.Plan) -> None:
        times, positions = record(plan)
        found = analyse(times, positions, plan, start=0.0)
        velocity = differentiate(Samples(times, positions), RATE)[0]
        within = (velocity.times >= 0.0) & (velocity.times <= plan.duration)
        speeds = np.linalg.norm(velocity.values[within], axis=1)
        peak = found.peaks["speed"]
        assert peak.flown == pytest.approx(speeds.max(), rel=1e-9)
        assert peak.time == pytest.approx(velocity.times[within][speeds.argmax()], abs=1e-9)
        assert peak.ratio == pytest.approx(speeds.max() / 3.0, rel=1e-9)
        assert peak.planned == pytest.approx(float(plan.report.peaks["speed"].max()) * 3.0)
        assert list(found.peaks) == ["speed", "thrust_acceleration", "jerk", "snap", "tilt"]

    def test_a_flight_with_twice_the_speed_has_twice_the_ratio(self, plan: pf.Plan) -> None:
        times, positions = record(plan, before=0.0, after=0.0)
        middle = positions.mean(axis=0)
        one = analyse(times, positions, plan, start=0.0)
        two = analyse(times, middle + 2.0 * (positions - middle), plan, start=0.0)
        for name in ("speed", "jerk", "snap"):
            assert two.peaks[name].ratio == pytest.approx(2.0 * one.peaks[name].ratio)

    def test_gaps_are_named_and_left_out(self, plan: pf.Plan) -> None:
        times, positions = record(plan)
        positions[100:110] = np.nan
        found = analyse(times, positions, plan, start=0.0)
        assert len(found.gaps) == 1
        assert found.gaps[0] == pytest.approx((0.49, 0.6))
        assert "no positions from 0.490 to 0.600 s" in found.notes[0]
        assert np.isnan(found.curves["speed"].flown).any()
        assert found.peaks["speed"].flown is not None
        assert found.top_error < 1e-12

    def test_what_the_record_lacks_at_its_ends_is_a_gap(self, plan: pf.Plan) -> None:
        found = analyse(*record(plan, before=-0.2, after=-0.3), plan, start=0.0)
        assert [gap[0] for gap in found.gaps] == pytest.approx(
            [0.0, plan.duration - 0.31], abs=0.02
        )

    def test_fast_records_are_sampled_as_in_the_paper(self, plan: pf.Plan) -> None:
        times, positions = record(plan, rate=480.0)
        assert analyse(times, positions, plan).rate == 100.0
        assert analyse(times, positions, plan, rate=240.0).rate == 240.0
        assert analyse(*record(plan, rate=60.0), plan).rate == pytest.approx(60.0)

    def test_a_record_in_another_frame_is_told_so(self, plan: pf.Plan) -> None:
        times, positions = record(plan, noise=1e-3)
        found = analyse(times, positions + np.array([0.4, 0.0, -0.1]), plan, start=0.0)
        np.testing.assert_allclose(found.offset, [0.4, 0.0, -0.1], atol=1e-3)
        assert "another frame" in found.notes[0]

    def test_a_plan_flown_twice_is_told_so(self, plan: pf.Plan) -> None:
        _, positions = record(plan, after=1.0, noise=1e-3)
        twice = np.vstack((positions, positions))
        later = np.arange(len(twice)) / RATE
        found = analyse(later, twice, plan)
        assert "fits about as well" in found.notes[0]

    def test_uneven_steps_are_told_so(self, plan: pf.Plan) -> None:
        times, positions = record(plan)
        times = times + np.random.default_rng(5).uniform(0.0, 6e-3, len(times))
        assert "differ by" in analyse(times, positions, plan).notes[0]

    @pytest.mark.parametrize(
        ("options", "words"),
        [
            ({"start": 90.0}, "the plan runs from 90 to"),
            ({"start": math.nan}, "start is nan"),
            ({"rate": 0.0}, "rate is 0 Hz"),
            ({"rate": 1000.0}, "at most the record's 100 Hz"),
        ],
    )
    def test_wrong_arguments_are_named(
        self, plan: pf.Plan, options: dict[str, float], words: str
    ) -> None:
        with pytest.raises(pf.InvalidProblem, match=words):
            analyse(*record(plan), plan, **options)

    def test_a_record_without_positions_is_refused(self, plan: pf.Plan) -> None:
        times, positions = record(plan)
        with pytest.raises(pf.InvalidProblem, match="0 samples have a position"):
            analyse(times, np.full_like(positions, np.nan), plan)

    def test_a_short_record_has_no_snap(self, plan: pf.Plan) -> None:
        times, positions = record(plan)
        found = analyse(times[55:67], positions[55:67], plan, start=0.0)
        assert found.peaks["speed"].flown is not None
        assert found.peaks["snap"].flown is None
        assert found.peaks["snap"].ratio is None
        assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["samples"] == 12

    def test_is_drawn(self, plan: pf.Plan) -> None:
        times, positions = record(plan, noise=1e-4)
        positions[100:110] = np.nan
        found = analyse(times, positions, plan)
        figures = motion_capture_figures(found, plan, title="lap")
        assert list(figures) == ["path", "derivatives", "error"]
        assert len(figures["derivatives"].axes) == len(found.curves)
        line = figures["error"].axes[0].lines[0].get_ydata()
        assert np.isnan(line).sum() == 1
        np.testing.assert_allclose(line[np.isfinite(line)], 100.0 * found.errors)


class TestLog:
    def read(self, folder: Path, text: str) -> Any:
        path = folder / "log.csv"
        path.write_text(text)
        return read_flight_log(path)

    @pytest.mark.parametrize(
        "text",
        [
            "0,1,2,3\n0.5,4,5,6\n",
            "t,x,y,z\n0,1,2,3\n0.5,4,5,6\n",
            "# made by hand\nt [s];x [m];y [m];z [m]\n0;1;2;3\n\n0.5;4;5;6\n",
            "Time (ms)\tq\tTZ (mm)\tTX (cm)\tTY\n0\tok\t3000\t100\t2\n500\tno\t6000\t400\t5\n",
            "t [s] x [cm] y [cm] z [cm]\n0 100 200 300\n0.5 400 500 600",
            '"t [ms]","x","y","z"\n"0","1","2","3"\n"500","4","5","6"\n',
        ],
    )
    def test_forms_of_a_record(self, tmp_path: Path, text: str) -> None:
        found = self.read(tmp_path, text)
        np.testing.assert_allclose(found.times, [0.0, 0.5])
        np.testing.assert_allclose(found.positions, [[1, 2, 3], [4, 5, 6]])
        assert found.notes == ()

    def test_a_simulated_flight_can_be_read(self, tmp_path: Path, plan: pf.Plan) -> None:
        from peakflight.formats.flight_samples import write_flight_samples

        flight = pf.fly(plan, vehicle="crazyflie-2.1-upgrade")
        write_flight_samples(flight, tmp_path / "flight.csv")
        found = read_flight_log(tmp_path / "flight.csv")
        np.testing.assert_allclose(found.positions, flight.position, rtol=1e-8, atol=1e-9)
        analysis = analyse(found.times, found.positions, plan, start=0.0)
        # the flight holds every run of the controller, its error is taken up to the end alike
        assert analysis.rms_error == pytest.approx(flight.rms_error, rel=1e-4)

    def test_missing_positions_are_counted_and_named(self, tmp_path: Path) -> None:
        found = self.read(tmp_path, "t,x,y,z\n0,1,2,3\n1e-2,NaN,nan,nan\n2e-2,,,\n3e-2,1,2,3\n")
        assert np.isnan(found.positions[1:3]).all()
        assert np.isfinite(found.positions[[0, 3]]).all()
        assert found.notes == ("2 samples without a position (lines 3, 4)",)

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("", "the file is empty"),
            ("# nothing\n", "holds no samples, only comments"),
            ("hello there\n", "names no column t"),
            ("t,x,y,z\n", "holds 0 samples"),
            ("t,x,y,z\n0,1,2,3\n", "holds 1 sample; a flight needs at least two"),
            ("0,1,2\n1,1,2\n", "line 1 has 3 columns; without a header there must be 4"),
            ("t,x,y\n0,1,2\n", "names no column z"),
            ("t,x,x,y,z\n0,1,2,3,4\n", "names column x twice"),
            ("t [h],x,y,z\n0,1,2,3\n1,1,2,3\n", "column t has the unit 'h'"),
            ("t,x,y,z\n0,1,2,3\n1,1,two,3\n", "line 3: y is 'two'; it must be a finite number"),
            ("t,x,y,z\n0,1,2,3\n1,1,inf,3\n", "line 3: y is 'inf'"),
            ("t,x,y,z\n0,1,2,3\nnan,1,2,3\n", "line 3: t is 'nan'"),
            ("t;x;y;z\n0;1;2;3\n1;1;2,5;3\n", "line 3: y is '2,5'; .* with a decimal point"),
            ("t,x,y,z\n0,1,2,3\n1,1,2\n", "line 3 has 3 columns, and the first line 4"),
            ("t,x,y,z\n1,1,2,3\n0.5,1,2,3\n", "line 3: t is 0.5 s, after 1 s; times must rise"),
            ("t,x,y,z\n1,1,2,3\n1,1,2,3\n", "times must rise"),
            ("t,x,y,z\n0,1,2,3\n10,1,2,3\n20,1,2,3\n", "if the times are in ms, say so"),
            ("t,x,y,z\n0,nan,2,3\n1,,2,3\n", "no sample has a position"),
        ],
    )
    def test_what_is_wrong_is_named(self, tmp_path: Path, text: str, words: str) -> None:
        with pytest.raises(pf.InvalidFile, match=words) as caught:
            self.read(tmp_path, text)
        assert str(caught.value).startswith(str(tmp_path / "log.csv"))

    def test_a_folder_and_a_missing_file_are_named(self, tmp_path: Path) -> None:
        with pytest.raises(pf.InvalidFile, match="is a folder"):
            read_flight_log(tmp_path)
        with pytest.raises(pf.InvalidFile, match="no such file"):
            read_flight_log(tmp_path / "none.csv")


class TestCommand:
    @pytest.fixture
    def files(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, plan: pf.Plan
    ) -> tuple[str, str]:
        monkeypatch.chdir(tmp_path)
        plan.save("plan.json")
        times, positions = record(plan, start=4.2, noise=1e-4)
        rows = [
            f"{t:.6f},{x:.6f},{y:.6f},{z:.6f}"
            for t, (x, y, z) in zip(times, positions, strict=True)
        ]
        Path("log.csv").write_text("\n".join(rows))
        return "log.csv", "plan.json"

    def invoke(self, *arguments: str) -> Any:
        return CliRunner().invoke(application, ["analyse", *arguments])

    def test_prints_and_writes(self, files: tuple[str, str], plan: pf.Plan) -> None:
        log, plan_file = files
        result = self.invoke(log, "--plan", plan_file, "-o", "out")
        assert result.exit_code == 0
        assert "4.2000 s of the record, where the record fits best" in result.stdout
        assert {path.name for path in Path("out").iterdir()} == {
            "analysis.json",
            "errors.csv",
            "path.png",
            "derivatives.png",
            "error.png",
        }
        rows = Path("out/errors.csv").read_text().splitlines()
        values = json.loads(Path("out/analysis.json").read_text())
        assert len(rows) - 1 == values["samples"]
        errors = np.array([float(row.rpartition(",")[2]) for row in rows[1:]])
        assert math.sqrt(np.mean(errors**2)) == pytest.approx(values["rms_error"], rel=1e-6)

    def test_json_is_one_object(self, files: tuple[str, str]) -> None:
        log, plan_file = files
        result = self.invoke(log, "--plan", plan_file, "--json", "--start", "4.2")
        values = json.loads(result.stdout)
        assert values["start"] == 4.2
        assert values["start_given"] is True
        assert values["rms_error"] < 1e-3

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (("none.csv", "--plan", "plan.json"), "none.csv: no such file"),
            (("log.csv", "--plan", "none.json"), "none.json: no such file"),
            (("log.csv", "--plan", "log.csv"), "log.csv: line 1 is not JSON"),
            (("log.csv", "--plan", "plan.json", "--start", "99"), "log.csv: the plan runs from"),
            (("log.csv",), "missing option '--plan'"),
        ],
    )
    def test_bad_input_takes_one_line(
        self, files: tuple[str, str], arguments: tuple[str, ...], words: str
    ) -> None:
        result = self.invoke(*arguments)
        assert result.exit_code == 2
        assert result.stdout == ""
        assert result.stderr.count("\n") == 1
        assert words in result.stderr
