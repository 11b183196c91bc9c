import json

import numpy as np
import pytest

import peakflight as pf
from benchmarks import fuzz_readers
from peakflight.formats import write_crazyflie, write_samples
from peakflight.heading import heading

MUTATED = 400
"""Files here; `python -m benchmarks.fuzz_readers` does 10,000."""


def differences(found, plan, orders=3):
    """Largest difference from a plan's trajectory by order of derivative."""
    start = plan.trajectory.start_time - found.start_time
    times = np.linspace(plan.trajectory.start_time, plan.trajectory.end_time, 1001)
    inside = np.clip(times - start, found.start_time, found.end_time)
    return [
        float(np.abs(found(inside, order) - plan.trajectory(times, order)).max())
        for order in range(orders)
    ]


def pieces_file(path, plan):
    write_crazyflie(plan, path)
    return path.read_text().split("\n")


class TestPieces:
    def test_what_we_write_comes_back(self, hand_plan, tmp_path):
        plan = hand_plan(yaw=[0.0, 1.0, 2.0, 1.0])
        write_crazyflie(plan, tmp_path / "c.csv")
        found = pf.read_trajectory_file(tmp_path / "c.csv")
        assert "Crazyswarm" in found.form
        assert found.plan is None
        assert max(differences(found.trajectory, plan)) < 1e-6
        times = np.linspace(0.0, 0.999 * plan.duration, 100)
        np.testing.assert_allclose(found.yaw(times), heading(plan)(times), atol=1e-6)
        np.testing.assert_array_equal(
            pf.read_trajectory(tmp_path / "c.csv").coefficients, found.trajectory.coefficients
        )

    @pytest.mark.parametrize(
        "change",
        [
            lambda lines: lines[1:],
            lambda lines: [line.replace(",", ", ") for line in lines],
            lambda lines: [line + "," for line in lines[1:] if line],
            lambda lines: [line.replace(",", " ") for line in lines[1:]],
            lambda lines: [line.replace(",", "\t") for line in lines],
            lambda lines: [line.replace(",", ";") for line in lines],
            lambda lines: ["\ufeff" + lines[0], *(line + "\r" for line in lines[1:])],
            lambda lines: ["# " + lines[0], *lines[1:]],
            lambda lines: ["", "# flown in 2019", *lines, "# the end"],
            lambda lines: [lines[0].upper(), *lines[1:]],
            lambda lines: [lines[0].replace("duration", "Duration"), *lines[1:]],
            lambda lines: [",".join(line.split(",")[:25]) for line in lines],
            lambda lines: [",".join(line.split(",")[:25]) for line in lines[1:]],
            lambda lines: [",".join(reversed(line.split(","))) for line in lines if line],
        ],
    )
    def test_as_people_have_them(self, change, hand_plan, tmp_path):
        plan = hand_plan()
        lines = pieces_file(tmp_path / "c.csv", plan)
        (tmp_path / "theirs.csv").write_text("\n".join(change(lines)))
        found = pf.read_trajectory_file(tmp_path / "theirs.csv")
        assert "Crazyswarm" in found.form
        assert max(differences(found.trajectory, plan)) < 1e-6
        assert found.yaw is None

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            (lambda text: text.replace("duration", "length"), "no column duration"),
            (lambda text: text.replace("x^0", "w^0"), r"no column x\^0"),
            (lambda text: text.replace("x^1", "x^0"), r"names column x\^0 twice"),
            (lambda text: text.replace("x^7", "x^99"), "degree 11 is the highest"),
            (lambda text: text.split("\n")[0], "only a header"),
            (lambda text: text.rstrip("\n").rsplit(",", 1)[0], "line 5 has 32 columns"),
            (lambda text: text.rstrip("\n").rsplit(",", 1)[0] + ",nan", r"line 5: yaw\^7 is 'nan'"),
            (
                lambda text: text.rstrip("\n").rsplit(",", 1)[0] + ",1e400",
                "must be a finite number",
            ),
            (lambda text: text.replace("\n", "\n-", 2), "line 2: duration is -"),
            (lambda text: text.replace("\n", "\n1e300", 2), "line 2"),
        ],
    )
    def test_what_is_wrong_is_named(self, change, message, hand_plan, tmp_path):
        text = "\n".join(pieces_file(tmp_path / "c.csv", hand_plan()))
        (tmp_path / "bad.csv").write_text(change(text))
        with pytest.raises(pf.InvalidFile, match=message) as caught:
            pf.read_trajectory_file(tmp_path / "bad.csv")
        assert str(caught.value).startswith(str(tmp_path / "bad.csv"))


class TestSamples:
    @pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-6])
    def test_our_own_come_back_within_the_tolerance(self, tolerance, hand_plan, tmp_path):
        plan = hand_plan(yaw=[0.0, 1.0, 2.0, 1.0], start_time=3.0)
        write_samples(plan, tmp_path / "s.csv")
        found = pf.read_trajectory_file(tmp_path / "s.csv", tolerance=tolerance)
        assert found.form == "samples"
        assert found.samples == len((tmp_path / "s.csv").read_text().split("\n")) - 2
        # a tolerance is for each axis, a distance for all three
        for order, error in enumerate(found.fit_errors):
            assert error <= np.sqrt(3.0) * 10.0**order * tolerance
        # between samples the flight is as near: they are dense
        off = differences(found.trajectory, plan)
        assert off[0] < 1.5 * tolerance
        assert off[1] < 20.0 * tolerance
        assert found.trajectory.start_time == 3.0
        # pieces join smoothly by themselves
        assert pf.certify(found.trajectory, plan.problem.limits).joint_residual < 1e-8
        times = np.linspace(3.0, 3.0 + plan.duration - 1e-6, 100)
        np.testing.assert_allclose(found.yaw(times), heading(plan)(times), atol=2e-3)

    def test_fewer_digits_of_tolerance_take_fewer_pieces(self, hand_plan, tmp_path):
        write_samples(hand_plan(pieces=(2, 3, 3)), tmp_path / "s.csv")
        counts = [
            len(pf.read_trajectory(tmp_path / "s.csv", tolerance=tolerance))
            for tolerance in (1e-1, 1e-4, 1e-7)
        ]
        assert counts[0] < counts[1] < counts[2]

    @pytest.mark.parametrize("derivatives", [0, 1, 2, 3])
    def test_agilicious_columns(self, derivatives, hand_plan, tmp_path):
        plan = hand_plan()
        times = np.linspace(0.0, plan.duration, 200)
        names = [["p_"], ["v_"], ["a_lin_"], ["jerk_"]][: derivatives + 1]
        header = [
            "t",
            *(f"{name}{axis}" for (name,) in names for axis in "xyz"),
            "q_w",
            "q_x",
            "q_y",
            "q_z",
            "u_1",
        ]
        half = 0.5 * np.sin(times)
        turn = [np.cos(half), 0 * half, 0 * half, np.sin(half), half]
        values = np.column_stack(
            [times, *(plan.trajectory(times, order) for order in range(derivatives + 1)), *turn]
        )
        rows = [",".join(f"{value:.9g}" for value in row) for row in values]
        (tmp_path / "a.csv").write_text("\n".join([",".join(header), *rows]))
        found = pf.read_trajectory_file(tmp_path / "a.csv")
        assert found.notes == ()
        assert found.trajectory.degree == (7 if derivatives == 3 else 5)
        assert len(found.fit_errors) == min(derivatives + 1, 3)
        assert differences(found.trajectory, plan)[0] < 2e-4
        np.testing.assert_allclose(found.yaw(times[:-1])[:, 0], np.sin(times[:-1]), atol=2e-3)

    def test_derivatives_that_are_not_are_left_out_and_said(self, hand_plan, tmp_path):
        plan = hand_plan()
        times = np.linspace(0.0, plan.duration, 200)
        states = [plan.trajectory(times, order) for order in range(3)]
        states[2] = states[2] + [0.0, 0.0, 9.81]  # as an accelerometer has it
        header = "t,x,y,z,vx,vy,vz,ax,ay,az"
        rows = [",".join(map(str, row)) for row in np.column_stack([times, *states])]
        (tmp_path / "a.csv").write_text("\n".join([header, *rows]))
        found = pf.read_trajectory_file(tmp_path / "a.csv")
        assert found.notes == ("its acceleration does not go with its velocity, and is not used",)
        assert differences(found.trajectory, plan)[0] < 2e-4

    @pytest.mark.parametrize("separator", [",", ";", " ", "\t"])
    def test_plain_columns_and_units(self, separator, tmp_path):
        times = np.linspace(0.0, 2.0, 50)
        points = np.column_stack([np.sin(times), np.cos(times), 1.0 + 0 * times])
        table = [
            separator.join(map(repr, row)) for row in np.column_stack([times, points]).tolist()
        ]
        (tmp_path / "plain.csv").write_text("\n".join(table))
        found = pf.read_trajectory(tmp_path / "plain.csv")
        np.testing.assert_allclose(found(times), points, atol=1.01e-4)
        assert found.degree == 5
        scaled = np.column_stack([1e3 * times, 100.0 * points])
        table = [",".join(map(repr, row)) for row in scaled.tolist()]
        (tmp_path / "cm.csv").write_text("\n".join(["Time [ms],x [cm],y [cm],z (cm)", *table]))
        np.testing.assert_allclose(
            pf.read_trajectory(tmp_path / "cm.csv")(times), points, atol=1.01e-4
        )

    @pytest.mark.parametrize("count", [2, 3, 4, 5, 6, 7])
    def test_few_samples_are_passed(self, count, tmp_path):
        points = np.random.default_rng(count).uniform(-1, 1, (count, 3))
        rows = [f"{t},{x!r},{y!r},{z!r}" for t, (x, y, z) in enumerate(points.tolist())]
        (tmp_path / "few.csv").write_text("\n".join(["t,x,y,z", *rows]))
        found = pf.read_trajectory(tmp_path / "few.csv")
        np.testing.assert_allclose(found(np.arange(count)), points, atol=1.01e-4)

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("t,x,y,z\n0,0,0,0\n0,1,1,1", "line 3: t is 0 s after 0 s; times must increase"),
            ("t,x,y,z\n0,0,0,0", "has one sample"),
            ("t,x,y\n0,0,0", "names no column z"),
            ("t,x,y,z,x\n0,0,0,0,0", "names column x twice"),
            ("t,x [ft],y,z\n0,0,0,0", "has the unit 'ft'"),
            ("1,2,3\n2,3,4", "has 3 columns and no header"),
            ("t,x,y,z\n0,0,0,0\n1,1e8,0,0", "line 3: x is 1e.08; it must be within 1e.07"),
            ("t,x,y,z\n0,0,0,0\n1,a,0,0", "line 3: x is 'a'; it must be a finite number"),
            ("t,x,y,z\n0,0,0,0\n1,1_0,0,0", "line 3: x is '1_0'"),
            ("t,x,y,z\n0,0,0,0\n1e300,1,0,0", "times go from 0 s"),
            ("# nothing", "only comments"),
            ("\n \n", "the file is empty"),
            ("t,x,y,z\n0,0,0,0\n1,1,\0,0", "zero byte"),
        ],
    )
    def test_what_is_wrong_is_named(self, text, message, tmp_path):
        (tmp_path / "bad.csv").write_text(text)
        with pytest.raises(pf.InvalidFile, match=message) as caught:
            pf.read_trajectory_file(tmp_path / "bad.csv")
        assert str(caught.value).startswith(str(tmp_path / "bad.csv"))


class TestJson:
    def test_a_plan_comes_back_whole(self, hand_plan, tmp_path):
        plan = hand_plan(yaw=[0.0, 1.0, 2.0, 1.0])
        plan.save(tmp_path / "plan.json")
        found = pf.read_trajectory_file(tmp_path / "plan.json")
        assert found.plan.to_dict() == plan.to_dict()
        assert found.fit_errors is None

    def test_coefficients_alone_will_do(self, hand_plan, tmp_path):
        plan = hand_plan()
        whole = np.concatenate(
            (plan.trajectory.coefficients, np.ones((len(plan.trajectory), 8, 1))), axis=2
        )
        values = {"coefficients": whole.tolist(), "segment_times": plan.segment_times.tolist()}
        (tmp_path / "bare.json").write_text(json.dumps(values))
        found = pf.read_trajectory_file(tmp_path / "bare.json")
        assert max(differences(found.trajectory, plan)) == 0.0
        assert found.yaw.axes == 1

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("{}", "has no coefficients"),
            ("[1, 2]", "has no coefficients"),
            ("{", "is not JSON"),
            ('{"coefficients": 1}', "segment_times is missing"),
            ('{"coefficients": [[[1, 2]]], "segment_times": [1]}', "has 2 axes"),
            ('{"coefficients": [[[1, 2, 3]]], "segment_times": [-1]}', "lasts -1.0 s"),
            ('{"coefficients": [[[1, 2, 1e9]]], "segment_times": [1]}', "piece 0 is not within"),
            (
                '{"coefficients": [[[1, 2, 3]]], "segment_times": [1], "start_time": "x"}',
                "wrong kind",
            ),
            (
                json.dumps({"coefficients": [[[0.0] * 3] * 13], "segment_times": [1]}),
                "degree 12; 11 is the highest",
            ),
            ('{"coefficients": [[[1, 2, 3]]], "waypoints": []}', "key 'status' is missing"),
        ],
    )
    def test_what_is_wrong_is_named(self, text, message, tmp_path):
        (tmp_path / "bad.json").write_text(text)
        with pytest.raises(pf.InvalidFile, match=message):
            pf.read_trajectory_file(tmp_path / "bad.json")


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.nan, np.inf])
def test_bad_tolerance_is_refused(tolerance, tmp_path):
    with pytest.raises(pf.InvalidProblem, match="tolerance is"):
        pf.read_trajectory(tmp_path / "x.csv", tolerance=tolerance)


def test_no_file_and_a_folder_are_clear_errors(tmp_path):
    with pytest.raises(pf.InvalidFile, match="no such file"):
        pf.read_trajectory(tmp_path / "x.csv")
    with pytest.raises(pf.InvalidFile, match="is a folder"):
        pf.read_trajectory(tmp_path)


@pytest.mark.parametrize("seed", [11, 12])
def test_mutated_files_give_a_trajectory_or_a_clear_error(seed):
    counts, wrong = fuzz_readers.run(MUTATED, seed)
    assert not wrong, wrong[0][1]
    assert counts["read"] > MUTATED / 10  # both ends are reached
    assert counts["refused"] > MUTATED / 10
