"""The paper's results run again: the numbers are those of plans, the page stands by itself."""

import base64
import csv
import html.parser
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

import peakflight as pf
import peakflight.paper
from peakflight.cli.application import application
from peakflight.compare import Row
from peakflight.course import Course
from peakflight.document import Document, Picture, Points, Section, Table, as_html, as_markdown
from peakflight.formats import read_course
from peakflight.paper import (
    ALGORITHM_1,
    DEFAULT_COURSE,
    GUESS,
    JOINT,
    MELLINGER,
    PEAK,
    PRINTED,
    RECONSTRUCTION,
    PaperComparison,
    Reproduction,
    is_same,
    reproduce,
)
from peakflight.paper_page import PICTURE_FORMATS, paper_document, write_paper

Run = Callable[..., Result]
COURSES = Path(__file__).parent.parent / "examples" / "courses"
SMALL = "x,y,z\n0,0,1\n0.6,0.5,1.2\n0.2,0.9,1\n2.5,1.2,1.4\n"
PICTURES = {
    "example-derivatives", "example-paths-algorithm-1", "example-paths-peak",
    "example-segment-times-algorithm-1", "example-segment-times-peak", "jerk-derivatives",
    "jerk-leg-times", "jerk-paths", "snap-derivatives", "snap-leg-times", "snap-paths",
}  # fmt: skip
TEXTS = {
    "paper.html", "paper.md", "paper.json", "beside-paper.csv", "methods.csv", "leg-times.csv",
}  # fmt: skip


@pytest.fixture(scope="module")
def result() -> Reproduction:
    return reproduce()


@pytest.fixture(scope="module")
def folder(result: Reproduction, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("paper")
    names, notes = write_paper(result, folder)
    assert sorted(names) == sorted(path.name for path in folder.iterdir())
    assert notes == ()
    return folder


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.csv").write_text(SMALL)

    def invoke(*arguments: object) -> Result:
        result = CliRunner().invoke(application, ["paper", *map(str, arguments)])
        assert result.exception is None or isinstance(result.exception, SystemExit)
        return result

    return invoke


class Page(html.parser.HTMLParser):
    """Checks that tags close in order; gathers attributes and text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.attributes: list[tuple[str, str, str]] = []
        self.text = ""
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        if tag not in ("meta", "img"):
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def rows_of(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


def planned(printed: peakflight.paper.Printed, name: str) -> pf.Plan:
    """As anyone would ask for it."""
    options = {"limits": printed.limits, "minimize": printed.name}
    waypoints = read_course(COURSES / "tight_then_fast.csv").waypoints
    if name == JOINT:
        return pf.plan(waypoints, method="joint", **options)
    if name == ALGORITHM_1:
        return pf.plan(waypoints, method="peak", variant="paper", degree=5, **options)
    method = {GUESS: "proportional", MELLINGER: "mellinger", PEAK: "peak"}[name]
    return pf.plan(waypoints, method=method, degree=5, **options)


@pytest.mark.parametrize("known", [DEFAULT_COURSE, RECONSTRUCTION], ids=lambda known: known.name)
def test_known_courses_are_those_in_the_examples(known: Course) -> None:
    assert is_same(read_course(COURSES / f"{known.name}.csv"), known)


def test_the_page_says_that_the_reconstruction_was_fitted() -> None:
    pages = [
        as_markdown(paper_document(reproduce(Course(course.waypoints, name="mine")), {}))
        for course in (RECONSTRUCTION, DEFAULT_COURSE)
    ]
    assert ["is therefore no evidence" in page for page in pages] == [True, False]
    assert ["a course of our own" in page for page in pages] == [False, True]


def test_what_the_paper_prints() -> None:
    jerk, snap = PRINTED
    assert jerk.limits.to_dict() == {
        "speed": 5.0, "thrust_acceleration": 15.5, "jerk": 62.0, "snap": 800.0,
    }  # fmt: skip
    assert snap.limits.to_dict() == {
        "speed": 5.0, "thrust_acceleration": 14.5, "jerk": 54.0, "snap": 800.0,
    }  # fmt: skip
    assert jerk.durations == {PEAK: 3.9, MELLINGER: 5.6, GUESS: 6.7}
    assert snap.durations == {PEAK: 4.3, MELLINGER: 5.3, GUESS: 6.9}
    assert jerk.speed_gains == {(PEAK, GUESS): 125.0, (PEAK, MELLINGER): 88.0}
    for printed in PRINTED:  # what it says in percent follows from its totals, to a percent
        for (name, other), percent in printed.reductions.items():
            part = 1.0 - printed.durations[name] / printed.durations[other]
            assert 100.0 * part == pytest.approx(percent, abs=1.0)


class TestFigures:
    def test_are_those_of_plans(self, result: Reproduction, folder: Path) -> None:
        values = json.loads((folder / "paper.json").read_text())
        lines = {(one["comparison"], one["method"]): one for one in rows_of(folder / "methods.csv")}
        for printed, one in zip(PRINTED, values["comparisons"], strict=True):
            assert (one["name"], one["degree"]) == (printed.name, 5)
            assert one["continuity"] == {"jerk": 4, "snap": 3}[printed.name]
            assert list(one["methods"]) == [GUESS, MELLINGER, PEAK, ALGORITHM_1, JOINT]
            for name, said in one["methods"].items():
                plan = planned(printed, name)
                assert plan.feasible
                assert said["duration"] == plan.duration
                assert said["leg_times"] == np.diff(plan.waypoint_times).tolist()
                assert said["certified"] is True
                assert said["iterations"] == plan.iterations
                line = lines[printed.name, name]
                assert float(line["duration [s]"]) == plan.duration
                paper = printed.durations.get(name)
                assert line["paper's duration [s]"] == ("" if paper is None else str(paper))
                assert said["paper_duration"] == paper

    def test_stand_beside_the_papers(self, result: Reproduction, folder: Path) -> None:
        found = {
            (line["comparison"], line["quantity"]): (float(line["paper"]), float(line["ours"]))
            for line in rows_of(folder / "beside-paper.csv")
        }
        assert len(found) == 7 + 5
        for one in result.comparisons:
            for name, value in one.printed.durations.items():
                ours = one.rows[name].duration
                assert found[one.printed.name, f"total time, {name}"] == (value, ours)
        jerk = result.comparisons[0].rows
        key = ("jerk", f"reduction of the total time, {PEAK} against {GUESS}")
        ours = 100.0 * (1.0 - jerk[PEAK].duration / jerk[GUESS].duration)
        assert found[key] == (42.0, pytest.approx(ours))
        ours = 100.0 * (jerk[PEAK].top_speed / jerk[MELLINGER].top_speed - 1.0)
        assert found["jerk", f"gain in top speed, {PEAK} against {MELLINGER}"] == (
            88.0,
            pytest.approx(ours),
        )

    def test_leg_times_add_up(self, result: Reproduction, folder: Path) -> None:
        lines = rows_of(folder / "leg-times.csv")
        for one in result.comparisons:
            of_it = [line for line in lines if line["comparison"] == one.printed.name]
            assert [int(line["leg"]) for line in of_it] == list(range(8))
            for name, row in one.rows.items():
                total = sum(float(line[f"{name} [s]"]) for line in of_it)
                assert total == pytest.approx(row.duration)

    def test_the_guess_of_the_example_takes_5_s(self, result: Reproduction) -> None:
        lengths = np.linalg.norm(np.diff(DEFAULT_COURSE.waypoints, axis=0), axis=1)
        expected = 5.0 * lengths / lengths.sum()
        np.testing.assert_allclose(result.guess.segment_times, expected)
        assert not pf.certify(result.guess, PRINTED[0].limits).feasible
        history = result.example.rows[ALGORITHM_1].plan.history
        np.testing.assert_allclose(history.segment_times[0], expected)


class TestFiles:
    def test_are_all_there(self, folder: Path) -> None:
        pictures = {f"{name}.{kind}" for name in PICTURES for kind in PICTURE_FORMATS}
        assert {path.name for path in folder.iterdir()} == TEXTS | pictures
        for name in PICTURES:
            assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG\r\n")
            assert b"<svg" in (folder / f"{name}.svg").read_bytes()

    def test_html_needs_nothing_else(self, folder: Path) -> None:
        text = (folder / "paper.html").read_text()
        page = Page(text)
        sources = [value for _, name, value in page.attributes if name in ("src", "href")]
        assert len(sources) == len(PICTURES)
        for source in sources:
            head, data = source.split(",", 1)
            assert head == "data:image/png;base64"
            assert base64.b64decode(data, validate=True).startswith(b"\x89PNG\r\n")
            text = text.replace(source, "")
        assert len(text) < 100_000, "pictures are taken out"
        assert "http" not in text
        assert "url(" not in text
        assert "@import" not in text

    def test_pages_say_the_same(self, result: Reproduction, folder: Path) -> None:
        page = Page((folder / "paper.html").read_text()).text
        markdown = (folder / "paper.md").read_text().replace("\\", "")
        for text in (page, markdown):
            assert "does not print its waypoints" in text
            for one in result.comparisons:
                for row in one.rows.values():
                    assert f"{row.duration:.3f} s" in text
                for beside in one.beside_paper:
                    assert f"{beside.paper:g} {beside.unit}" in text
        for name in PICTURES:
            assert f"]({name}.png)" in markdown


@pytest.mark.parametrize("legs", [1, 200])
def test_any_number_of_legs(legs: int, tmp_path: Path) -> None:
    steps = np.random.default_rng(5).normal(size=(legs + 1, 3))
    course = pf.Course(np.cumsum(steps, axis=0), name="a_walk <&>")
    printed = PRINTED[0]
    problem = pf.Problem(course.waypoints, limits=printed.limits, degree=5)
    row = peakflight.paper.run_method(problem, "proportional")
    failed = Row(
        method="joint", status="failed", certified=False, message="no <b>reason</b> | at all"
    )
    comparisons = tuple(
        PaperComparison(
            printed=one,
            problem=problem,
            rows={GUESS: row, MELLINGER: row, PEAK: row, ALGORITHM_1: row, JOINT: failed},
        )
        for one in PRINTED
    )
    names, _ = write_paper(Reproduction(course=course, comparisons=comparisons), tmp_path)
    assert "jerk-leg-times.png" in names
    page = Page((tmp_path / "paper.html").read_text())
    assert failed.message in page.text
    assert "a_walk <&>" in page.text


def test_methods_without_a_plan_are_rows_and_the_page_comes_out(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def refuse(problem: pf.Problem, method: str, settings: object = None) -> Row:
        return Row(method=method, status="refused", certified=False, message="it cannot")

    monkeypatch.setattr(peakflight.paper, "run_method", refuse)
    result = reproduce()
    names, _ = write_paper(result, tmp_path)
    assert {name for name in names if name.endswith(".png")} == {"example-derivatives.png"}
    assert all(figure.ours is None for one in result.comparisons for figure in one.beside_paper)
    assert "refused. it cannot" in Page((tmp_path / "paper.html").read_text()).text


class TestCommand:
    def test_another_course(self, run: Run, tmp_path: Path) -> None:
        result = run("small.csv", "-o", "new/out")
        assert result.exit_code == 0
        assert "small: 4 waypoints, 3 legs" in result.stdout
        assert "total time, Mellinger" in result.stdout
        assert max(map(len, result.stdout.splitlines())) <= 80
        assert {path.name for path in (tmp_path / "new" / "out").iterdir()} >= TEXTS
        assert "the course small." in Page((tmp_path / "new/out/paper.html").read_text()).text

    def test_json_is_one_object(self, run: Run, tmp_path: Path) -> None:
        result = run("small.csv", "--json")
        assert result.exit_code == 0
        values = json.loads(result.stdout)
        assert values["course"] == "small"
        assert str(Path("out/paper/paper.html")) in values["files"]
        written = json.loads((tmp_path / "out" / "paper" / "paper.json").read_text())
        assert written == {key: values[key] for key in written}

    def test_the_default_course_needs_no_file(
        self, run: Run, result: Reproduction, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(peakflight.paper, "reproduce", lambda course, **_: result)
        said = run("--json")
        assert json.loads(said.stdout)["course"] == "tight_then_fast"

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (("missing.csv",), "missing.csv: no such file"),
            (("bad.csv",), "bad.csv: waypoint 1 (line 2) has y = nan"),
            (("near.csv", "--strict"), "near.csv: waypoint 2 (line 3)"),
            (("small.csv", "-o", "small.csv"), "small.csv: is a file"),
            (("small.csv", "bad.csv"), "unexpected extra argument"),
        ],
    )
    def test_bad_input(
        self, run: Run, tmp_path: Path, arguments: tuple[str, ...], words: str
    ) -> None:
        (tmp_path / "bad.csv").write_text("0,0,1\n1,nan,1\n2,0,1\n")
        (tmp_path / "near.csv").write_text("0,0,1\n1,0,1\n1,0,1.0004\n2,0,1\n")
        result = run(*arguments)
        assert (result.exit_code, result.stdout) == (2, "")
        assert result.stderr.count("\n") == 1
        assert words in result.stderr
        assert not (tmp_path / "out").exists()

    def test_no_feasible_trajectory(self, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
        row = Row(method="", status="infeasible", certified=False)
        monkeypatch.setattr(peakflight.paper, "run_method", lambda *_: row)
        result = run("small.csv")
        assert result.exit_code == 1
        assert "note: peak: infeasible" in result.stdout
        assert result.stderr.endswith("no feasible trajectory for minimum jerk, minimum snap\n")

    def test_an_interrupt_leaves_nothing(
        self, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def interrupt(*_: object, **__: object) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(peakflight.paper, "run_method", interrupt)
        assert run("small.csv").exit_code == 130
        assert not (tmp_path / "out").exists()

    def test_without_matplotlib_there_are_no_pictures(self, tmp_path: Path) -> None:
        code = (
            "import sys; sys.modules['matplotlib'] = None; sys.argv[1:] = ['paper', '--json']\n"
            "from peakflight.cli import main; main()"
        )
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, cwd=tmp_path, check=False
        )
        assert done.returncode == 0, done.stderr
        values = json.loads(done.stdout)
        assert values["notes"][0].startswith("no pictures: figures need matplotlib")
        assert {path.name for path in (tmp_path / "out" / "paper").iterdir()} == TEXTS


def test_a_document_says_what_it_is_given_in_both_forms() -> None:
    odd = "a_b *c* <i>&</i> [d](e) #1 | f"
    table = Table(title=odd, columns=("name", ">number"), rows=((odd, "1"),))
    picture = Picture(name="a-picture", caption=odd, png=b"png")
    blocks = (f"{odd} `x_y<z`", Points((odd,)), table, picture)
    document = Document(title=odd, lead=odd, sections=(Section(odd, blocks),))
    page = Page(as_html(document))
    assert page.text.count(odd) == 8 + 1  # the page has its title in its head too
    assert "x_y<z" in page.text
    assert ("img", "src", f"data:image/png;base64,{base64.b64encode(b'png').decode()}") in (
        page.attributes
    )
    markdown = as_markdown(document)
    plain = markdown.replace("`x_y<z`", "").replace("![a picture](a-picture.png)", "")
    assert "\\_b \\*c\\* \\<i\\>&\\</i\\> \\[d\\](e) \\#1 \\| f" in plain
    assert "`x_y<z`" in markdown
    cells = [line for line in markdown.splitlines() if line.startswith("|")]
    assert len({line.replace("\\|", "").count("|") for line in cells}) == 1
