import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import peakflight as pf
from peakflight.batch import Done, Processes, run
from peakflight.batch.keys import key_of, plain
from peakflight.cli.application import application
from peakflight.limits import PAPER_LIMITS

WAIT = 60.0
"""s, that a test waits for another process; it takes one or two."""


@dataclass(frozen=True)
class Squares:
    """Work that tests can look into: each performance leaves a mark in a folder."""

    marks: Path | None = None
    factor: int = 1
    name = "square"

    @property
    def settings(self) -> dict[str, int]:
        return {"factor": self.factor}

    def perform(self, item: Any) -> dict[str, Any]:
        if self.marks is not None:
            with (self.marks / "log").open("a") as stream:
                stream.write(f"{item} {os.getpid()}\n")
        if item == "raise":
            raise ValueError("no square\nof this")
        if item == "die":
            os._exit(7)
        if item == "lock":
            return {"square": lambda: item}  # which cannot be sent back
        if item == "sleep":
            time.sleep(WAIT)
        return {"square": self.factor * item**2, "process": os.getpid()}

    def value(self, item: Any, answer: dict[str, Any]) -> int:
        return answer["square"]

    def first(self, item: Any) -> str:
        return ""

    @property
    def performed(self) -> list[str]:
        assert self.marks is not None
        path = self.marks / "log"
        return [line.split()[0] for line in path.read_text().split("\n")[:-1]]


def values(results: Iterator[Done[Any, int]]) -> dict[int, int | str]:
    return {one.index: one.value if one.failure is None else one.failure.kind for one in results}


def problems(count: int, legs: int = 4) -> list[pf.Problem]:
    walks = [
        np.cumsum(np.random.default_rng(seed).uniform(-2.0, 2.0, (legs + 1, 3)), axis=0)
        for seed in range(count)
    ]
    return [pf.Problem(walk, limits=PAPER_LIMITS) for walk in walks]


def bits(plan: pf.Plan | None) -> dict[str, Any]:
    assert plan is not None
    return {name: value for name, value in plan.to_dict().items() if name != "wall_time_s"}


@pytest.fixture(scope="module")
def plans() -> list[pf.Plan]:
    slow = [replace(one, limits=pf.Limits(speed=1.0, jerk=20.0)) for one in problems(3)]
    return [pf.plan(one, method="proportional") for one in slow]


@contextmanager
def dask() -> Iterator[Executor]:
    distributed = pytest.importorskip("distributed", reason="extra cluster is missing")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=":0"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client.get_executor()


class TestPlans:
    def test_are_those_of_plan_to_the_last_bit_on_two_processes(self) -> None:
        asked = problems(6)
        results = list(pf.plan_many(asked, workers=2))
        assert sorted(one.index for one in results) == list(range(6))
        for one in results:
            assert one.problem is asked[one.index]
            assert one.feasible
            assert not one.resumed
            assert bits(one.plan) == bits(pf.plan(one.problem))

    def test_are_the_same_to_the_last_bit_on_a_dask_cluster(self, tmp_path: Path) -> None:
        asked = problems(40, legs=10)
        local = {one.index: bits(one.plan) for one in pf.plan_many(asked, workers=1)}
        with dask() as executor:
            far = list(pf.plan_many(asked, executor=executor, chunk=3, store=tmp_path / "s"))
        assert {one.index: bits(one.plan) for one in far} == local
        again = list(pf.plan_many(asked, store=tmp_path / "s"))
        assert all(one.resumed for one in again)
        assert {one.index: bits(one.plan) for one in again} == local

    def test_take_settings_and_options_of_the_method(self) -> None:
        asked = problems(1)
        one = next(pf.plan_many(asked, method="joint", pieces=1, effort=0.01))
        assert bits(one.plan) == bits(pf.plan(asked[0], pieces=1, effort=0.01))

    @pytest.mark.parametrize("workers", [1, 2])
    def test_a_problem_that_a_method_refuses_is_a_failure_beside_plans(self, workers: int) -> None:
        fine, other = problems(2)
        refused = replace(other, start={"snap": [1.0, 0.0, 0.0]}, degree=7)
        asked = [refused, fine]
        results = {one.index: one for one in pf.plan_many(asked, pieces=1, workers=workers)}
        with pytest.raises(pf.InvalidProblem) as caught:
            pf.plan(refused, method="joint", pieces=1)
        assert results[1].feasible
        assert results[1].failure is None
        assert results[0].plan is None
        assert not results[0].feasible
        assert results[0].problem is refused
        assert results[0].failure is not None
        assert results[0].failure.kind == "InvalidProblem"
        assert results[0].failure.text == str(caught.value)

    def test_an_infeasible_problem_has_a_plan_that_says_so(self) -> None:
        moving = pf.Problem(
            [[0, 0, 0], [1, 0, 0]], limits=pf.Limits(speed=1.0), start={"velocity": [3, 0, 0]}
        )
        one = next(pf.plan_many([moving]))
        assert one.failure is None
        assert one.plan is not None
        assert one.plan.status is pf.Status.INFEASIBLE
        assert not one.feasible

    @pytest.mark.parametrize(
        ("options", "words"),
        [
            ({"method": "fastest"}, "unknown method 'fastest'"),
            ({"speed": 3}, "unknown option 'speed'; method joint has"),
            ({"pieces": 0}, "pieces is 0"),
            ({"settings": 3}, "settings is 3; method joint takes its own Settings"),
            ({"workers": 0}, "workers is 0; it must be from 1"),
            ({"workers": 2.0}, "workers is 2.0; it must be a whole number"),
            ({"chunk": 0}, "chunk is 0"),
            ({"executor": "here"}, "executor is 'here'"),
        ],
    )
    def test_wrong_arguments_are_refused_before_anything_is_planned(
        self, options: dict[str, Any], words: str
    ) -> None:
        with pytest.raises(pf.InvalidProblem, match=words):
            pf.plan_many(problems(1), **options)

    def test_what_is_not_a_problem_is_named(self) -> None:
        with pytest.raises(pf.InvalidProblem, match="problem 1 is of type list"):
            pf.plan_many([*problems(1), [[0, 0, 0], [1, 1, 1]]])  # type: ignore[list-item]

    def test_workers_beside_an_executor_are_refused(self) -> None:
        with (
            ThreadPoolExecutor(1) as executor,
            pytest.raises(pf.InvalidProblem, match="workers given beside an executor"),
        ):
            pf.plan_many(problems(1), executor=executor, workers=2)


class TestFlights:
    OPTIONS: dict[str, Any] = {  # noqa: RUF012 (a constant)
        "vehicle": "crazyflie-2.1",
        "conditions": pf.Conditions(position_noise=1e-3, seed=5),
        "settings": pf.FlySettings(ground=None),
    }

    @pytest.mark.parametrize("samples", [False, True])
    def test_are_those_of_fly_to_the_last_bit(
        self, plans: list[pf.Plan], samples: bool, tmp_path: Path
    ) -> None:
        options = {**self.OPTIONS, "samples": samples, "store": tmp_path / "s"}
        found = list(pf.fly_many(plans, workers=2, **options))
        again = list(pf.fly_many(plans, workers=1, **options))
        assert sorted(one.index for one in found) == [0, 1, 2]
        assert all(one.resumed for one in again)
        for one in (*found, *again):
            assert one.plan is plans[one.index]
            flight = pf.fly(one.plan, **self.OPTIONS)
            assert one.summary is not None
            assert one.summary.rms_error == flight.rms_error
            assert one.summary.top_error == flight.top_error
            assert one.summary.saturation_share == flight.saturation_share
            assert one.summary.crash == flight.crash
            if samples:
                assert one.flight is not None
                assert one.flight.to_dict() == flight.to_dict()
            else:
                assert one.flight is None

    def test_a_plan_that_no_vehicle_flies_is_a_failure(self, plans: list[pf.Plan]) -> None:
        one = next(pf.fly_many(plans[:1], workers=1))
        assert one.summary is None
        assert one.failure is not None
        assert one.failure.kind == "InvalidProblem"
        assert "names no vehicle" in one.failure.text

    @pytest.mark.parametrize(
        ("options", "words"),
        [
            ({"controller": "by hand"}, "unknown controller 'by hand'"),
            ({"vehicle": "kite"}, "kite"),
            ({"workers": 0}, "workers is 0"),
        ],
    )
    def test_wrong_arguments_are_refused_at_once(
        self, plans: list[pf.Plan], options: dict[str, Any], words: str
    ) -> None:
        with pytest.raises(pf.InvalidProblem, match=words):
            pf.fly_many(plans, **options)

    def test_what_is_not_a_plan_is_named(self, plans: list[pf.Plan]) -> None:
        with pytest.raises(pf.InvalidProblem, match="plan 1 is of type Trajectory"):
            pf.fly_many([plans[0], plans[0].trajectory])  # type: ignore[list-item]


class TestRunning:
    @pytest.mark.parametrize("workers", [1, 2])
    @pytest.mark.parametrize("chunk", [None, 3])
    def test_every_item_has_its_outcome(self, workers: int, chunk: int | None) -> None:
        items = [3, "raise", 4, 5, "raise", 6]
        found = list(run(Squares(), items, workers=workers, chunk=chunk))
        expected = {0: 9, 1: "ValueError", 2: 16, 3: 25, 4: "ValueError", 5: 36}
        assert values(iter(found)) == expected
        failure = next(one.failure for one in found if one.index == 1)
        assert failure is not None
        assert failure.text == "no square of this"
        assert not failure.lost
        assert {one.item for one in found if one.failure} == {"raise"}

    def test_no_items_have_no_results(self, tmp_path: Path) -> None:
        assert list(run(Squares(), [], store=tmp_path / "s")) == []

    def test_threads_will_do(self) -> None:
        with ThreadPoolExecutor(3) as executor:
            found = values(run(Squares(), range(50), executor=executor))
            assert executor.submit(len, "on").result() == 2
        assert found == {item: item**2 for item in range(50)}

    @pytest.mark.parametrize("chunk", [1, 4])
    def test_an_item_that_kills_its_process_is_found_and_the_rest_is_done(
        self, chunk: int, tmp_path: Path
    ) -> None:
        items = [1, 2, 3, "die", 4, 5, 6, 7]
        work = Squares(tmp_path)
        found = list(run(work, items, workers=2, chunk=chunk, store=tmp_path / "s"))
        expected = {place: item**2 for place, item in enumerate(items) if item != "die"}
        assert values(iter(found)) == {**expected, 3: "BrokenProcessPool"}
        assert [one.failure.lost for one in found if one.failure is not None] == [True]
        # what was lost is tried again, and only that
        (tmp_path / "log").unlink()
        again = list(run(work, items, workers=2, store=tmp_path / "s"))
        assert set(work.performed) == {"die"}
        assert sum(one.resumed for one in again) == 7

    def test_what_cannot_be_sent_back_is_lost_alone(self) -> None:
        found = values(run(Squares(), [1, "lock", 2, 3], workers=2, chunk=4))
        assert {place: found[place] for place in (0, 2, 3)} == {0: 1, 2: 4, 3: 9}
        assert found[1] in {"AttributeError", "PicklingError"}

    def test_an_executor_of_the_user_that_breaks_ends_the_batch(self, tmp_path: Path) -> None:
        with (
            ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor,
            pytest.raises(pf.ExecutorFailed, match="give a new executor and the same store"),
        ):
            list(run(Squares(), [1, "die", 2], executor=executor, chunk=1, store=tmp_path / "s"))
        found = list(run(Squares(), [1, 3, 2], workers=1, store=tmp_path / "s"))
        assert values(iter(found)) == {0: 1, 1: 9, 2: 4}
        assert [one.resumed for one in found] == [True, False, False]

    def test_processes_can_be_kept_for_several_batches(self) -> None:
        with Processes(1) as executor:
            seen = {
                executor.submit(os.getpid).result(),
                *(executor.submit(os.getpid).result() for _ in range(3)),
            }
            assert values(run(Squares(), [2, 3], executor=executor)) == {0: 4, 1: 9}
            assert values(run(Squares(), [4, 5], executor=executor)) == {0: 16, 1: 25}
            assert {executor.submit(os.getpid).result()} == seen

    def test_the_first_of_a_kind_goes_before_the_others(self) -> None:
        class Kinds(Squares):
            def first(self, item: Any) -> str:
                return "" if item < 2 else "even" if item % 2 == 0 else "odd"

        sent: list[list[int]] = []

        class Watched(ThreadPoolExecutor):
            def submit(self, fn: Any, /, *args: Any, **options: Any) -> Future[Any]:
                future = super().submit(fn, *args, **options)
                sent.append(args[1])
                future.result()
                return future

        with Watched(1) as executor:
            found = values(run(Kinds(), range(10), executor=executor, chunk=2))
        assert found == {item: item**2 for item in range(10)}
        assert sent[:3] == [[2], [3], [0, 1]]
        assert sorted(map(tuple, sent[3:])) == [(4, 6), (5, 7), (8,), (9,)]

    def test_leaving_early_ends_the_processes(self) -> None:
        results = run(Squares(), [1, *["sleep"] * 6], workers=2, chunk=1)
        assert next(results).value == 1
        began = time.monotonic()
        results.close()
        assert time.monotonic() - began < 0.5 * WAIT


class TestStore:
    ITEMS = (3, 4, "raise", 5, 4)

    @pytest.fixture
    def store(self, tmp_path: Path) -> Path:
        path = tmp_path / "store.jsonl"
        list(run(Squares(), self.ITEMS, workers=1, store=path))
        return path

    def test_holds_every_outcome_with_its_key_and_failures_with_their_item(
        self, store: Path
    ) -> None:
        header, *lines = [json.loads(line) for line in store.read_text().splitlines()]
        assert header["work"] == "square"
        assert header["version"] == pf.__version__
        assert [line["index"] for line in lines] == [0, 1, 2, 3, 4]
        assert [line["key"] for line in lines] == [key_of(item) for item in self.ITEMS]
        assert lines[2]["item"] == "raise"
        assert lines[2]["failure"] == {"kind": "ValueError", "text": "no square of this"}

    def test_what_is_in_it_is_not_done_again(self, store: Path, tmp_path: Path) -> None:
        before = store.read_bytes()
        work = Squares(tmp_path)
        found = list(run(work, [*self.ITEMS, 6, 4], workers=1, store=store))
        assert [one.resumed for one in found] == [True] * 5 + [False] * 2
        assert work.performed == ["6", "4"]
        assert values(iter(found)) == {0: 9, 1: 16, 2: "ValueError", 3: 25, 4: 16, 5: 36, 6: 16}
        assert store.read_bytes().startswith(before)

    @pytest.mark.parametrize("back", [1, 2, 20, 60])
    def test_a_line_that_is_half_written_is_done_again(
        self, store: Path, tmp_path: Path, back: int
    ) -> None:
        whole = store.read_bytes()
        store.write_bytes(whole[:-back])
        work = Squares(tmp_path)
        found = list(run(work, self.ITEMS, workers=1, store=store))
        assert work.performed == ["4"]
        assert [one.index for one in found if not one.resumed] == [4]
        lines = [json.loads(line) for line in store.read_text().splitlines()]
        assert [line.get("index") for line in lines] == [None, 0, 1, 2, 3, 4]

    def test_an_empty_file_is_a_new_store(self, tmp_path: Path) -> None:
        (tmp_path / "s").touch()
        assert values(run(Squares(), [2], workers=1, store=tmp_path / "s")) == {0: 4}

    @pytest.mark.parametrize(
        ("change", "words"),
        [
            (lambda lines: [*lines[:2], "{", *lines[3:]], "line 3 is damaged"),
            (lambda lines: [*lines[:2], '{"key":1}', *lines[3:]], "line 3 is damaged"),
            (lambda lines: ['{"x":1}', *lines[1:]], "is not the store of a batch"),
            (lambda lines: ["x,y,z", *lines[1:]], "is not the store of a batch"),
            (lambda lines: [lines[0].replace(pf.__version__, "0.0.1"), *lines[1:]], "version"),
            (lambda lines: [lines[0].replace("square", "plan"), *lines[1:]], "what is done is"),
        ],
    )
    def test_a_wrong_file_is_refused_and_left_as_it_is(
        self, store: Path, change: Any, words: str
    ) -> None:
        store.write_text("\n".join([*change(store.read_text().splitlines()), ""]))
        before = store.read_bytes()
        with pytest.raises(pf.InvalidFile, match=words) as caught:
            list(run(Squares(), self.ITEMS, workers=1, store=store))
        assert str(caught.value).startswith(str(store))
        assert store.read_bytes() == before

    def test_other_settings_are_a_different_batch(self, store: Path) -> None:
        with pytest.raises(pf.InvalidFile, match="different batch: factor is 1, here 2"):
            list(run(Squares(factor=2), self.ITEMS, workers=1, store=store))

    def test_other_problems_are_a_different_batch(self, store: Path) -> None:
        with pytest.raises(pf.InvalidFile, match="line 2 is about a problem that is not in this"):
            list(run(Squares(), self.ITEMS[1:], workers=1, store=store))

    def test_a_folder_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(pf.InvalidFile, match="folder"):
            list(run(Squares(), [1], workers=1, store=tmp_path))

    def test_a_folder_that_is_missing_is_named(self, tmp_path: Path) -> None:
        with pytest.raises(pf.InvalidFile, match="no such file"):
            list(run(Squares(), [1], workers=1, store=tmp_path / "none" / "s"))

    def test_two_batches_cannot_write_to_one(self, store: Path) -> None:
        pytest.importorskip("fcntl", reason="no locks on this system")
        first = run(Squares(), self.ITEMS, workers=1, store=store)
        next(first)
        with pytest.raises(pf.InvalidFile, match="in use by another batch"):
            list(run(Squares(), self.ITEMS, workers=1, store=store))
        first.close()
        assert len(list(run(Squares(), self.ITEMS, workers=1, store=store))) == 5

    def test_a_number_that_json_lacks_is_not_written_half(self, tmp_path: Path) -> None:
        class Nan(Squares):
            def perform(self, item: Any) -> dict[str, Any]:
                return {"square": float("nan") if item == 2 else item}

        with pytest.raises(ValueError, match="JSON"):
            list(run(Nan(), [1, 2], workers=1, store=tmp_path / "s"))
        assert len((tmp_path / "s").read_text().splitlines()) == 2


class TestKeys:
    def test_equal_problems_have_one_key_and_others_another(self) -> None:
        one, other = problems(2)
        copied = pf.Problem.from_dict(one.to_dict())
        assert key_of(one) == key_of(copied)
        different = [
            other,
            replace(one, degree=7),
            replace(one, minimize="snap"),
            replace(one, limits=pf.Limits(speed=5.0)),
            replace(one, start={"velocity": [1e-300, 0, 0]}),
            pf.Problem(np.nextafter(one.waypoints, 9.0), limits=one.limits),
        ]
        assert len({key_of(problem) for problem in (one, *different)}) == 7

    def test_a_plan_found_again_has_the_same_key(self) -> None:
        problem = problems(1)[0]
        first, second = (pf.plan(problem, method="proportional") for _ in range(2))
        assert first.wall_time_s != second.wall_time_s
        assert key_of(first) == key_of(second)
        assert key_of(first) != key_of(pf.plan(problem, method="peak"))

    def test_what_has_no_identity_is_refused(self) -> None:
        with pytest.raises(pf.InvalidProblem, match="of type function"):
            plain({"a": [lambda: 1]})


SCRIPT = """
    import sys
    from pathlib import Path
    sys.path.insert(0, {tests!r})
    from test_batch import Squares
    from peakflight.batch import run

    def main():
        folder = Path({folder!r})
        for one in run(Squares(folder), [1, 2, 3, *["sleep"] * 4], workers=2, chunk=1,
                       store=folder / "store"):
            print(one.index, flush=True)

    {start}
"""
GUARDED = 'if __name__ == "__main__":\n        main()'


def script(folder: Path, start: str = GUARDED) -> subprocess.Popen[str]:
    """A process group of its own, as a terminal makes one."""
    source = SCRIPT.format(tests=str(Path(__file__).parent), folder=str(folder), start=start)
    file = folder / "script.py"
    file.write_text(textwrap.dedent(source))
    return subprocess.Popen(
        [sys.executable, str(file)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # what is started in the background of a shell ignores Ctrl-C
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509 - no threads
    )


def wait_for_sleepers(folder: Path) -> set[int]:
    """Process numbers of the workers, once both are busy with what takes long."""
    deadline = time.monotonic() + WAIT
    while time.monotonic() < deadline:
        log = folder / "log"
        lines = log.read_text().splitlines() if log.exists() else []
        busy = {int(line.split()[1]) for line in lines if line.startswith("sleep")}
        if len(busy) == 2:
            return busy
        time.sleep(0.05)
    raise AssertionError("the workers have not begun")


def is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    stat = Path(f"/proc/{process}/stat")
    return not (stat.exists() and stat.read_text().rpartition(")")[2].split()[0] == "Z")


def all_end(processes: set[int]) -> bool:
    deadline = time.monotonic() + WAIT / 2
    while any(map(is_alive, processes)) and time.monotonic() < deadline:
        time.sleep(0.05)
    return not any(map(is_alive, processes))


@pytest.mark.skipif(os.name == "nt", reason="signals of a terminal")
class TestInterruption:
    def test_ctrl_c_leaves_a_usable_store_and_no_process(self, tmp_path: Path) -> None:
        process = script(tmp_path)
        workers = wait_for_sleepers(tmp_path)
        os.killpg(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=WAIT / 2)
        assert process.returncode != 0
        assert said.count("KeyboardInterrupt") == 1  # of the script alone
        assert all_end(workers)
        stored = [json.loads(line) for line in (tmp_path / "store").read_text().splitlines()[1:]]
        assert {line["index"] for line in stored} == {0, 1, 2}
        found = list(run(Squares(), [1, 2, 3, 4], workers=1, store=tmp_path / "store"))
        assert [one.resumed for one in found] == [True, True, True, False]

    def test_workers_end_when_what_started_them_is_killed(self, tmp_path: Path) -> None:
        process = script(tmp_path)
        workers = wait_for_sleepers(tmp_path)
        process.kill()
        process.communicate(timeout=WAIT / 2)
        assert all_end(workers)
        found = run(Squares(), [1, 2, 3], workers=1, store=tmp_path / "store")
        assert [one.resumed for one in found] == [True] * 3

    def test_a_script_without_a_guard_is_told_so(self, tmp_path: Path) -> None:
        process = script(tmp_path, start="main()")
        _, said = process.communicate(timeout=WAIT)
        assert process.returncode == 1
        assert "if __name__ == '__main__':" in said.splitlines()[-1]


class TestCommand:
    @pytest.fixture(autouse=True)
    def folder(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
        monkeypatch.chdir(tmp_path)
        courses = tmp_path / "courses"
        courses.mkdir()
        (courses / "lap.csv").write_text("0,0,1\n1,1,1\n2,0,1.5\n")
        (courses / "Lap.json").write_text("[[0,0,1],[1,0,1]]")
        (courses / "readme.md").write_text("not a course")
        return tmp_path

    def invoke(self, *arguments: str) -> Any:
        return CliRunner().invoke(
            application, ["plan-many", *arguments, "--method", "proportional", "--workers", "1"]
        )

    def test_plans_every_course_of_a_folder(self, folder: Path) -> None:
        result = self.invoke("courses", "-o", "out")
        assert result.exit_code == 0
        assert "2 of 2 courses have a certified plan" in result.stdout
        made = {path.name for path in (folder / "out").iterdir()}
        assert made == {"batch.jsonl", "summary.csv", "Lap.plan.json", "lap-2.plan.json"}
        for name, waypoints in (("Lap", 2), ("lap-2", 3)):
            plan = pf.Plan.load(folder / "out" / f"{name}.plan.json")
            assert pf.certify_plan(plan).feasible
            assert len(plan.problem.waypoints) == waypoints

    def test_a_bad_course_is_a_row_and_the_others_are_planned(self, folder: Path) -> None:
        (folder / "courses" / "bad.csv").write_text("0,0,1\n1,one,1\n")
        result = self.invoke("courses", "-o", "out", "--json")
        assert result.exit_code == 2
        assert result.stderr == "peakflight: 1 course that cannot be read, of 3\n"
        rows = json.loads(result.stdout)["courses"]
        assert [row["status"] for row in rows] == ["solved", "bad input", "solved"]
        assert rows[1]["message"] == "line 2: y is 'one'; it must be a number"
        lines = (folder / "out" / "summary.csv").read_text().splitlines()
        assert len(lines) == 4

    def test_an_earlier_batch_is_gone_on_with_only_if_asked(self, folder: Path) -> None:
        assert self.invoke("courses", "-o", "out").exit_code == 0
        store = (folder / "out" / "batch.jsonl").read_bytes()
        again = self.invoke("courses", "-o", "out")
        assert again.exit_code == 2
        assert "add --resume to go on with it" in again.stderr
        (folder / "courses" / "more.csv").write_text("0,0,1\n5,1,1\n")
        (folder / "out" / "Lap.plan.json").unlink()
        more = self.invoke("courses", "-o", "out", "--resume")
        assert more.exit_code == 0
        assert "3 of 3" in more.stdout
        assert (folder / "out" / "batch.jsonl").read_bytes().startswith(store)
        assert (folder / "out" / "Lap.plan.json").exists()
        other = self.invoke("courses", "-o", "out", "--resume", "--limits", "speed=1")
        assert other.exit_code == 2
        assert "not in this batch" in other.stderr

    def test_files_that_no_batch_has_made_are_left_as_they_are(self, folder: Path) -> None:
        for name in ("summary.csv", "lap-2.plan.json"):
            for more in ((), ("--resume",)):
                kept = folder / "out" / name
                kept.parent.mkdir(exist_ok=True)
                kept.write_text("mine")
                result = self.invoke("courses", "-o", "out", *more)
                assert result.exit_code == 2
                assert f"{name}: is there already" in result.stderr
                assert kept.read_text() == "mine"
                assert [path.name for path in kept.parent.iterdir()] == [name]
            kept.unlink()

    def test_plans_are_not_written_among_courses(self, folder: Path) -> None:
        before = sorted(path.name for path in (folder / "courses").iterdir())
        result = self.invoke("courses", "-o", "out/../courses")
        assert result.exit_code == 2
        assert "the courses are in this folder" in result.stderr
        assert sorted(path.name for path in (folder / "courses").iterdir()) == before

    def test_a_folder_without_courses_is_refused(self, folder: Path) -> None:
        (folder / "empty").mkdir()
        result = self.invoke("empty", "-o", "out")
        assert result.exit_code == 2
        assert "empty: holds no course" in result.stderr
        assert not (folder / "out").exists()

    def test_a_missing_file_is_a_row(self) -> None:
        result = self.invoke("none.csv", "-o", "out")
        assert result.exit_code == 2
        assert "note: none: no such file" in result.stdout
