import builtins
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from peakflight.course import Course, tidy
from peakflight.errors import InvalidFile, MissingExtra, PeakflightError
from peakflight.formats import COURSE_READERS, LARGEST_FILE, read_course
from peakflight.limits import Limits
from peakflight.problem import Problem

EXAMPLES = Path(__file__).parent.parent / "examples" / "courses"
EXAMPLE_FILES = sorted(path for path in EXAMPLES.iterdir() if path.suffix != ".md")
POINTS = [[0.0, 0.5, 1.0], [1.0, -0.5, 1.5], [2.0, 0.0, 1e-3]]
YAW = [0.0, 0.5, -1.0]
TIMES = [0.0, 1.5, 4.0]


@pytest.fixture
def read(tmp_path):
    """Reads a course from text or bytes, in a file whose name says nothing of the format."""

    def read_text(content, name="course.dat"):
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return read_course(path)

    return read_text


@pytest.fixture
def refusal(read):
    """The message with which a file is refused: one line that begins with the file's name."""

    def refuse(content):
        with pytest.raises(InvalidFile) as caught:
            read(content)
        message = str(caught.value)
        assert "course.dat: " in message
        assert "\n" not in message
        assert len(message.partition("course.dat: ")[2]) < 250
        return message.partition("course.dat: ")[2]

    return refuse


def assert_is(course, points=POINTS, yaw=None, times=None):
    assert isinstance(course, Course)
    np.testing.assert_array_equal(course.waypoints, points)
    for found, wanted in ((course.yaw, yaw), (course.times, times)):
        assert (found is None) == (wanted is None)
        if wanted is not None:
            np.testing.assert_array_equal(found, wanted)


def rows(*columns, separator=","):
    table = np.column_stack(columns).tolist()
    return "".join(separator.join(map(str, row)) + "\n" for row in table)


# ---- CSV ------------------------------------------------------------------------------------


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", "  ", ", ", " ;\t"])
@pytest.mark.parametrize("header", [False, True])
def test_csv_separators(separator, header, read):
    text = separator.join("xyz") + "\n" if header else ""
    assert_is(read(text + rows(POINTS, separator=separator)))


def test_csv_without_a_header_tells_columns_by_their_number(read):
    assert_is(read(rows(POINTS)))
    back = [[2.0 - x, y, z] for x, y, z in POINTS]
    assert_is(read(rows(back, YAW)), points=back, yaw=YAW)
    assert_is(read(rows(TIMES, POINTS, YAW)), yaw=YAW, times=TIMES)


def test_csv_with_a_header_finds_columns_by_name(read):
    assert_is(read("x,y,z,yaw\n" + rows(POINTS, YAW)), yaw=YAW)
    assert_is(read("t,x,y,z\n" + rows(TIMES, POINTS)), times=TIMES)
    x, y, z = np.transpose(POINTS)
    assert_is(read("Yaw,Z,gate id,X,Time,Y\n" + rows(YAW, z, x, x, TIMES, y)), yaw=YAW, times=TIMES)
    assert_is(read("p_x p_y p_z\n" + rows(POINTS, separator=" ")))
    assert_is(read('"x","y","z"\n"0","0.5","1"\n"1","-0.5","1.5"\n"2","0","0.001"\n'))


def test_csv_columns_that_are_ignored_may_hold_anything(read):
    assert_is(read("gate,x,y,z [m],v [furlong]\nA_1,0,0.5,1,-\nnan,1,-0.5,1.5,?\n,2,0,0.001,x\n"))


def test_csv_units_are_converted(read):
    text = "t [ms],x [cm],y(mm),z [ m ],yaw [deg]\n0,100,500,1,180\n1500,-50,0,2,-90\n"
    course = read(text)
    np.testing.assert_allclose(course.waypoints, [[1.0, 0.5, 1.0], [-0.5, 0.0, 2.0]], rtol=1e-15)
    np.testing.assert_allclose(course.yaw, [math.pi, -math.pi / 2], rtol=1e-15)
    np.testing.assert_allclose(course.times, [0.0, 1.5], rtol=1e-15)
    np.testing.assert_allclose(
        read("x [ cm ] y (m) z\n1 2 3\n4 5 6\n").waypoints[:, 0], [0.01, 0.04]
    )


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_csv_comments_and_empty_lines_are_skipped_and_lines_are_known(end, read):
    lines = ["# a course", "", "x,y,z  # metres", "0,0.5,1", "  ", "# then", "1,-0.5,1.5,"]
    course = read(end.join([*lines, "2,0,0.001 # the end", "", ""]))
    assert_is(course)
    assert course.lines == (4, 7, 8)


def test_csv_header_in_a_comment(read, tmp_path):
    np.savetxt(tmp_path / "np.csv", np.column_stack((TIMES, POINTS)), header="t x y z")
    assert_is(read_course(tmp_path / "np.csv"), times=TIMES)
    assert_is(read("# x, y, z and yaw\n" + rows(np.array(POINTS)[::-1], YAW)), POINTS[::-1], YAW)
    assert_is(read("# x, y, z\n" + rows(np.array(POINTS)[::-1], YAW)), POINTS[::-1], YAW)
    assert_is(read("# z,y,x\n" + rows(POINTS)), points=np.array(POINTS)[:, ::-1])


def test_csv_with_a_byte_order_mark(read):
    assert_is(read("\ufeffx,y,z\n" + rows(POINTS)))


@pytest.mark.parametrize("first", [[0, 1, 2], [0, 0.1, 7.5]])
def test_csv_that_may_be_timed_or_have_yaw_is_refused(first, refusal):
    message = refusal(rows(first, POINTS))
    assert message == (
        "line 1: 4 columns, the first rising from 0, may be x,y,z,yaw or t,x,y,z; "
        "say which in a header line"
    )


@pytest.mark.parametrize("first", [[0, 0, 1], [0.1, 1, 2], [0, 2, 1]])
def test_csv_that_cannot_be_timed_from_zero_has_yaw(first, read):
    y, z = [1.0, 2.0, 3.0], [1.0, 1.0, 1.0]
    assert_is(read(rows(first, y, z, YAW)), points=np.column_stack((first, y, z)), yaw=YAW)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2,3\n4,five,6\n", "line 2: y is 'five'; it must be a number"),
        ("\n# c\n1,2,3\n\n4,5,six seven\n", "line 5: z is 'six seven'; it must be a number"),
        ("x,y,z\n1,2,3\n4,,6\n", "line 3: y is ''; it must be a number"),
        ("1;2;3\n0,5;1;2\n", "line 2: x is '0,5'; it must be a number with a decimal point"),
        ("1,2,3\n1_0,2,3\n", "line 2: x is '1_0'; it must be a number"),
        ("1,2,3\n0x1,2,3\n", "line 2: x is '0x1'; it must be a number"),
        ("1,2,3\nx,y,z\n4,5,6\n", "line 2: x is 'x'; it must be a number"),
        ("1,2,3\n4,5," + "9a" * 300 + "\n", f"line 2: z is {'9a' * 20!r}...; it must be a number"),
        ("1,2,3\n1,2,nan\n", "waypoint 1 (line 2) has z = nan; it must be finite"),
        ("x,y,z\n1,2,3\n-inf,2,3\n", "waypoint 1 (line 3) has x = -inf; it must be finite"),
        ("1,2,3\n1,1e999,3\n", "waypoint 1 (line 2) has y = inf; it must be finite"),
        ("1,2,3\n1,1e300,3\n", "waypoint 1 (line 2) has y = 1e+300 m; it must be within"),
        ("x,y,z,yaw\n1,2,3,0\n1,2,4,nan\n", "waypoint 1 (line 3) has yaw = nan"),
        ("t,x,y,z\n1,0,0,1\n1,1,0,1\n", "waypoint 1 (line 3) has t = 1 s after 1 s; times must"),
        ("1,2,3\n4,5\n", "line 2 has 2 columns, and the first line 3"),
        ("1,2,3\n4,5,6,7\n", "line 2 has 4 columns, and the first line 3"),
        ("x,y,z\n1 2 3\n", "line 2 has 1 column, and the first line 3"),
        ("1,2\n3,4\n", "line 1 has 2 columns; without a header there must be 3 (x,y,z), 4 (x,y,z,"),
        ("1,2,3,4,5,6\n", "line 1 has 6 columns; without a header"),
        ("x,y\n1,2\n", "line 1: the header 'x,y' names no column z; x, y and z are needed"),
        ("lat,lon,alt\n1,2,3\n", "line 1: the header 'lat,lon,alt' names no column x"),
        ("x,y,z,X\n1,2,3,4\n", "line 1: the header names column x twice"),
        ("x [ft],y,z\n1,2,3\n", "line 1: column x has the unit 'ft'; known are m, cm, mm"),
        ("x,y,z,yaw [turns]\n1,2,3,4\n", "line 1: column yaw has the unit 'turns'; known are rad"),
        ("1,2,3\n", "1 waypoint given; a trajectory needs at least two"),
        ("x,y,z\n", "holds no waypoints, only a header"),
        ("# nothing\n\n#\n", "holds no waypoints, only comments"),
        ("hello world\n", "line 1: the header 'hello,world' names no column x"),
        ("<html><body>404</body></html>\n", "line 1: the header '<html><body>404</body></html>'"),
        ("import numpy as np\n", "line 1: the header 'import,numpy,as,np' names no column x"),
    ],
)
def test_wrong_csv(text, message, refusal):
    assert refusal(text).startswith(message)


# ---- YAML and JSON --------------------------------------------------------------------------


RPG_TIME_OPTIMAL = """\
gates: [[1.0, -0.5, 1.5]]
initial:
  position: [0, 0.5, 1.0]
  attitude: [1, 0, 0, 0]
  velocity: [0, 0, 0]
  omega: [0, 0, 0]

end:
  position: [2.0, 0, 0.001]
ring: false
"""
PMM_UAV_PLANNER = """\
# Config with testing paths for PMM trajectory generation

start:
 position: [ 0,0.5,1.0]
 velocity: [0 , 0 , 0]
end:
 position: [ 2, 0, 1e-3 ]
 velocity: [0 , 0 , 0]
waypoints: [[ 1.0 , -0.5 , 1.5 ]]
"""
TOGT_PLANNER = """\
initState:
  pos: [0.0, 0.5, 1.0]
  vel: [0.0, 0.0, 0.0]
  rot: [1.0, 0.0, 0.0, 0.0]
  cthrustmass: 9.8066
endState:
  pos: [2.0, 0.0, 0.001]
orders: ['Gate1']

Gate1:
  type: 'SingleBall'
  position: [1.0, -0.5, 1.5]
  radius: 0.3
  stationary: true
"""
START_END = """\
start: [0, 0.5, 1]
waypoints: [[1, -0.5, 1.5]]
end: [2, 0, 0.001]
"""
MAPPINGS = """\
waypoints:
- {x: 0, y: 0.5, z: 1}
- x: 1
  y: -0.5
  z: 1.5
- pos: {x: 2, y: 0, z: 0.001}
"""
YAML_FORMS = {
    "rpg_time_optimal": RPG_TIME_OPTIMAL,
    "pmm_uav_planner": PMM_UAV_PLANNER,
    "togt": TOGT_PLANNER,
    "start, waypoints, end": START_END,
    "positions": START_END.replace("start", "start_position").replace("end", "end_position"),
    "flow": "{start: [0, 0.5, 1], waypoints: [[1, -0.5, 1.5]], end: [2, 0, 0.001]}",
    "mappings": MAPPINGS,
    "waypoints": "waypoints:\n  - [0, 0.5, 1]\n  - [1, -0.5, 1.5]\n  - [2, 0, 0.001]\n",
    "plain list": "# a list\n- [0, 0.5, 1]\n- [1, -0.5, 1.5]\n- [2, 0, 0.001]\n",
    "nested items": "---\n- - 0\n  - 0.5\n  - 1\n- [1, -0.5, 1.5]\n- position: [2, 0, 0.001]\n",
    "aliases": "a: &a [1, -0.5, 1.5]\nstart: [0, 0.5, 1]\nwaypoints: [*a]\nend: [2, 0, 0.001]\n",
    "ends only": "start: [0, 0.5, 1]\ngoal: [2, 0, 0.001]\ngates: []\n",
}


@pytest.mark.parametrize("form", YAML_FORMS)
def test_yaml_forms(form, read):
    points = [POINTS[0], POINTS[2]] if form == "ends only" else POINTS
    assert_is(read(YAML_FORMS[form]), points=points)


@pytest.mark.parametrize("form", sorted(set(YAML_FORMS) - {"aliases"}))
def test_json_takes_the_same_forms(form, read):
    points = [POINTS[0], POINTS[2]] if form == "ends only" else POINTS
    text = YAML_FORMS[form].replace("1e-3", "0.001")
    assert_is(read(json.dumps(yaml.safe_load(text))), points=points)


def test_yaml_and_json_yaw_times_and_name(read):
    values = {"name": "slalom", "waypoints": POINTS, "yaw": YAW, "times": TIMES}
    for text in (json.dumps(values), yaml.safe_dump(values)):
        course = read(text)
        assert_is(course, yaw=YAW, times=TIMES)
        assert course.name == "slalom"
    with_yaw = [[*point, angle] for point, angle in zip(POINTS, YAW, strict=True)]
    assert_is(read(json.dumps(with_yaw)), yaw=YAW)
    first, second = "- {x: 0, y: 0.5, z: 1, yaw: 0}\n", "- {position: [1, -0.5, 1.5], yaw: 0.5}\n"
    assert_is(read(f"{first}{second}- [2, 0, 0.001, -1]\n"), yaw=YAW)


@pytest.mark.parametrize("number", ["1e-3", ".001", "+0.001", "0.1e-2", "1E-3"])
def test_yaml_takes_every_way_to_write_a_number(number, read):
    assert read(f"- [{number}, 0, 1]\n- [1, 0, 1]\n").waypoints[0, 0] == 0.001


def test_yaml_knows_its_lines(read):
    course = read(YAML_FORMS["waypoints"])
    assert course.lines == (2, 3, 4)
    assert read(PMM_UAV_PLANNER).lines == (3, 9, 6)
    assert read(json.dumps(POINTS)).lines is None


def test_a_course_without_a_name_is_called_as_its_file(read):
    assert read(rows(POINTS), name="my race.csv").name == "my race"
    assert read(json.dumps({"name": "", "waypoints": POINTS}), name="a.json").name == "a"


def test_plan_file_is_a_course(hand_plan, tmp_path):
    plan = hand_plan(yaw=[0.0, 1.0, 2.0, 3.0])
    plan.save(tmp_path / "plan.json")
    assert_is(read_course(tmp_path / "plan.json"), plan.problem.waypoints, plan.problem.yaw)
    hand_plan().save(tmp_path / "plan.json")
    assert_is(read_course(tmp_path / "plan.json"), hand_plan().problem.waypoints)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([[0, 0, 1], [1, "two", 1]], "[1] has y = 'two'; it must be a number"),
        ([[0, 0, 1], [1, True, 1]], "[1] has y = true; it must be a number"),
        ([[0, 0, 1], [1, 1, None]], "[1] has z = null; it must be a number"),
        ([[0, 0, 1], [1, 1, [2]]], "[1] has z = [2]; it must be a number"),
        (
            [[0, 0, 1], [1, 10**400, 1]],
            "[1] has y = a number of hundreds of digits; it must be fin",
        ),
        ([[0, 0, 1], [1, 1e300, 1]], "waypoint 1 has y = 1e+300 m; it must be within"),
        ([[0, 0], [1, 1]], "[0] has 2 numbers; it must have x, y, z or x, y, z, yaw"),
        ([1, 2, 3], "[0] is 1; it must be a point such as [x, y, z]"),
        ([[0, 0, 1]], "1 waypoint given; a trajectory needs at least two"),
        ([], "holds no waypoints; name them under the key waypoints"),
        ({}, "holds no waypoints; name them under the key waypoints"),
        ({"waypoints": []}, "holds no waypoints"),
        ({"waypoints": 3}, "waypoints is 3; it must be a list"),
        ({"waypoints": {"a": 1}}, "waypoints is a mapping; it must be a list"),
        ({"points": POINTS}, "holds no waypoints; name them under the key waypoints"),
        (
            {"waypoints": [{"x": 1, "z": 2}]},
            "waypoints[0] has no y; it must have x, y and z, or pos",
        ),
        ({"waypoints": POINTS, "gates": POINTS}, "gates stands beside waypoints; only one of them"),
        ({"waypoints": POINTS, "start": 1}, "start is 1; it must be a point such as [x, y, z]"),
        (
            {"waypoints": POINTS, "start": {"position": {"position": [1, 2, 3]}}},
            "start.position has no",
        ),
        (
            {"waypoints": POINTS, "start": {"pos": [0, 0, 0], "vel": [1, 0, 0]}},
            "start.vel is [1, 0, 0]; it must be zero, as a course has no motion",
        ),
        ({"waypoints": POINTS, "ring": True}, "ring is true; closed laps are not planned"),
        ({"waypoints": POINTS, "name": 5}, "name is 5; it must be text"),
        ({"waypoints": POINTS, "yaw": 1}, "yaw is 1; it must be a list of 3 numbers"),
        ({"waypoints": POINTS, "yaw": [1, 2]}, "yaw has 2 numbers; there are 3 waypoints"),
        ({"waypoints": POINTS, "yaw": [1, 2, "N"]}, "yaw has [2] = 'N'; it must be a number"),
        ({"waypoints": POINTS, "times": [0, 2, 1]}, "waypoint 2 has t = 1 s after 2 s; times must"),
        ({"waypoints": [[0, 0, 0, 1], [1, 1, 1]]}, "waypoints[1] has no yaw; give every point one"),
        (
            {"waypoints": [[0, 0, 0, 1]] * 2, "yaw": [0, 0]},
            "yaw is given twice; the points have it",
        ),
        (
            {"waypoints": [{"position": [0, 0, 0, 1], "yaw": 1}]},
            "waypoints[0].yaw is given twice; the position has a fourth number",
        ),
        ({"orders": ["a", "b"], "a": [0, 0, 0]}, "orders[1] is 'b'; it must be a key of the file"),
        ({"coefficients": [], "waypoints": None}, "holds no waypoints"),
    ],
)
def test_wrong_json(values, message, refusal):
    assert refusal(json.dumps(values)).startswith(message)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[0,0,1],\n[1,0,]]", "line 2 is not JSON"),
        ('{"waypoints": [[0,0,1]', "line 1 is not JSON"),
        ('{"waypoints": [[0,0,NaN],[1,1,1]]}', "the number NaN is not finite"),
        ('{"waypoints": [[0,0,1e999],[1,1,1]]}', "waypoints[0] has z = inf; it must be finite"),
        ("[" * 200_000, "is not JSON that can be read (nested too deeply)"),
    ],
)
def test_broken_json(text, message, refusal):
    assert refusal(text).startswith(message)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("waypoints: [[0, 0, 1],\n  [1, 0\nend: 3", "line 3 is not YAML ("),
        ("waypoints:\n\t- [1, 2, 3]\n", "line 2 is not YAML ("),
        ("start: [1, 2, 3]\n end: 4\n", "line 2 is not YAML ("),
        ('name: "\\x"\n', "line 1 is not YAML ("),
        ("name: é\na: \x07\n", "line 2 is not YAML (control characters"),
        ("name: !<tag:%C0%80> x", "is not YAML ("),
        (
            "waypoints:\n- [0, 0, 1]\n- [1, two, 1]\n",
            "line 3: waypoints[1] has y = 'two'; it must be",
        ),
        (
            "waypoints:\n- [0, 0, 1]\n- [1, '2', 1]\n",
            "line 3: waypoints[1] has y = '2'; it must be a",
        ),
        (
            "waypoints:\n- [0, 0, .nan]\n- [1, 2, 1]\n",
            "line 2: waypoints[0] has z = '.nan'; it must",
        ),
        (
            "waypoints:\n- [0, 0, inf]\n- [1, 2, 1]\n",
            "line 2: waypoints[0] has z = inf; it must be f",
        ),
        (
            "waypoints:\n- [0, 0, 1_0]\n- [1, 2, 1]\n",
            "line 2: waypoints[0] has z = '1_0'; it must be",
        ),
        ("waypoints:\n- [0, 0, 1]\n-\n", "line 3: waypoints[1] is null; it must be a point"),
        ("waypoints:\n- x: 0\n  y: 1\n", "line 2: waypoints[0] has no z; it must have x, y and z"),
        (
            "start:\n  position: [0, 0, 1]\n  velocity: [0, 2, 0]\n",
            "line 3: start.velocity is [0.0, 2.0, ",
        ),
        ("start: [0, 0, 1]\nstart: [1, 0, 1]\n", "line 2: key 'start' is given a second time"),
        (
            "waypoints: [[0, 0, 1], [1, 1, 1e9]]",
            "waypoint 1 (line 1) has z = 1e+09 m; it must be wi",
        ),
        ("waypoints: [*a]\n", "line 1: *a names nothing that is complete by here"),
        ("waypoints: &a [*a, *a]\n", "line 1: *a names nothing that is complete by here"),
        ("waypoints: &a\n  position: *a\n", "line 2: *a names nothing that is complete by here"),
        (
            "- [0, 0, 1]\n- [1, 0, 1]\n---\n- [2, 0, 1]\n",
            "line 3: a second document begins; a file holds one",
        ),
        ("name: nothing else\n", "holds no waypoints; name them under the key waypoints"),
        ("--- text\n", "holds 'text'; a course is a list or a mapping of points"),
        ("waypoints:[1,2,3]\n", "holds 'waypoints:[1,2,3]'; a course is a list or a mapping of"),
        ("- " * 100_000, "line 1: is nested more than 32 levels deep"),
        ("a: " + "[" * 100_000, "line 1: is nested more than 32 levels deep"),
    ],
)
def test_broken_yaml(text, message, refusal):
    assert refusal(text).startswith(message)


def test_yaml_bomb_of_aliases_is_not_unfolded(refusal):
    layers = ["a0: &a0 [" + "1, " * 50 + "1]"]
    layers += [f"a{n}: &a{n} [" + f"*a{n - 1}, " * 50 + "]" for n in range(1, 20)]
    start = time.process_time()
    message = refusal("\n".join([*layers, "waypoints: *a19\n"]))
    assert time.process_time() - start < 1.0
    assert message == ("line 20: waypoints[0] has 50 numbers; it must have x, y, z or x, y, z, yaw")


def test_yaml_without_libyaml(read, refusal, monkeypatch):
    monkeypatch.delattr(yaml, "CSafeLoader")
    assert_is(read(RPG_TIME_OPTIMAL))
    assert refusal('name: "\\U00110000"\n').startswith("is not YAML (")
    assert refusal("name: é\na: \x07\n").startswith("line 2 is not YAML (special characters")
    assert refusal("waypoints: [1\nend: 3").startswith("line 2 is not YAML (")
    assert "32 levels" in refusal("a: " + "[" * 1000)


def test_yaml_without_pyyaml_names_the_extra(read, monkeypatch):
    importing = builtins.__import__

    def without_yaml(name, *arguments):
        if name == "yaml":
            raise ImportError(name)
        return importing(name, *arguments)

    monkeypatch.setattr(builtins, "__import__", without_yaml)
    with pytest.raises(MissingExtra, match=r"pip install 'peakflight\[cli\]'"):
        read(RPG_TIME_OPTIMAL)
    assert_is(read(rows(POINTS)))


def test_yaml_is_imported_only_for_yaml():
    code = (
        "import sys, peakflight.formats as f; f.read_course(sys.argv[1]);"
        "sys.exit('yaml' in sys.modules)"
    )
    course = EXAMPLES / "tight_then_fast.csv"
    assert subprocess.run([sys.executable, "-c", code, course], check=False).returncode == 0


# ---- any file -------------------------------------------------------------------------------


def test_no_such_file(tmp_path):
    with pytest.raises(InvalidFile, match=r"nothing\.csv: no such file"):
        read_course(tmp_path / "nothing.csv")


def test_folder(tmp_path):
    with pytest.raises(InvalidFile, match="is a folder; name a file in it"):
        read_course(tmp_path)


def test_path_may_be_text(tmp_path):
    (tmp_path / "c.csv").write_text(rows(POINTS))
    assert_is(read_course(str(tmp_path / "c.csv")))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "the file is empty"),
        (" \n\t\n", "the file is empty"),
        (b"\x89PNG\r\n\x1a\n\0\0", "byte 0 is not UTF-8 text"),
        (b"\0\1\2\3" * 100, "is not text (it holds a zero byte)"),
        (b"1,2,3\n4,5,6\0", "is not text (it holds a zero byte)"),
        ("1,2,3\n".encode("utf-16"), "byte 0 is not UTF-8 text"),
    ],
)
def test_not_text(content, message, refusal):
    assert refusal(content) == message


def test_huge_file_is_refused_unread(tmp_path):
    path = tmp_path / "huge.csv"
    path.touch()
    os.truncate(path, 3 * LARGEST_FILE)  # sparse: takes no room
    with pytest.raises(InvalidFile, match=r"huge\.csv: has 300 MB; a course has 100 MB at most"):
        read_course(path)


@pytest.mark.parametrize(
    ("before", "after"),
    [("1", "2 3"), ("x", "[[,y,z"), ("x [", "y z"), ("{", "x"), ("name", ": x"), ("'name'", "x")],
)
def test_long_runs_of_spaces_take_no_time(before, after, read):
    start = time.process_time()
    with pytest.raises(InvalidFile):
        read(f"{before}{' ' * 200_000}{after}\n")
    assert time.process_time() - start < 1.0


@pytest.mark.parametrize("name", ["csv", "yaml", "json"])
def test_five_thousand_waypoints(name, read):
    points = np.random.default_rng(0).normal(size=(5000, 3)).round(4)
    text = {
        "csv": rows(points),
        "json": json.dumps(points.tolist()),
        "yaml": "waypoints:\n" + "".join(f"- {point}\n" for point in points.tolist()),
    }[name]
    start = time.process_time()
    course = read(text)
    assert time.process_time() - start < 0.5  # 0.01 s here, YAML 0.05 s
    assert_is(course, points=points)


def test_every_registered_reader_recognises_its_own():
    samples = {"csv": rows(POINTS), "json": json.dumps(POINTS), "yaml": PMM_UAV_PLANNER}
    assert set(samples) == set(COURSE_READERS)
    for name, text in samples.items():
        first = next(key for key, reader in COURSE_READERS.items() if reader.recognises(text))
        assert first == name


# ---- examples -------------------------------------------------------------------------------


@pytest.mark.parametrize("path", EXAMPLE_FILES, ids=lambda path: path.name)
def test_example_courses_are_tidy_and_listed(path):
    course = read_course(path)
    assert tidy(course, strict=True)[0] is course
    assert Problem(course.waypoints, limits=Limits(speed=1.0), yaw=course.yaw)
    assert course.name == path.stem
    row = next(
        line
        for line in (EXAMPLES / "README.md").read_text().splitlines()
        if f"]({path.name})" in line
    )
    assert row.split("|")[2].strip() == str(len(course) - 1)


def test_csv_and_json_example_are_the_same_course():
    csv, json_ = (read_course(EXAMPLES / f"tight_then_fast.{kind}") for kind in ("csv", "json"))
    np.testing.assert_array_equal(csv.waypoints, json_.waypoints)


# ---- broken bytes ---------------------------------------------------------------------------


VALID = [
    rows(POINTS),
    "t [s];x [m];y [m];z [m];yaw [deg]\n" + rows(TIMES, POINTS, YAW, separator=";"),
    "# x y z yaw\n" + rows(POINTS, YAW, separator=" "),
    json.dumps({"name": "n", "waypoints": POINTS, "yaw": YAW, "times": TIMES}),
    json.dumps({"coefficients": [], "waypoints": POINTS, "problem": {"yaw": YAW}}),
    *YAML_FORMS.values(),
    (EXAMPLES / "figure_eight.yaml").read_text(),
]
TOKENS = [
    *(bytes([value]) for value in range(128)),
    *(b"nan", b"inf", b"1e999", b"-1e308", b"9" * 400, b"\n", b"\r\n", b"- ", b": ", b"---\n"),
    *(b"&a ", b"*a", b"!!int ", b"<<: ", b"? ", b"|\n", b'"', b"'", b"\\U00110000", b"%YAML 1"),
    *(b"[", b"]", b"{", b"}", b"[[", b"]]", b"null", b"true", b"#", b"# t,x,y,z\n", b"x,y,z\n"),
    *(
        b"\xef\xbb\xbf",
        b"\xff\xfe",
        b"\xe2\x80\xa8",
        b"\xc2\x85",
        b"\xf0",
        b"ring: 1\n",
        b"position: ",
    ),
]


@st.composite
def broken_files(draw):
    content = bytearray(draw(st.sampled_from(VALID)).encode())
    for _ in range(draw(st.integers(1, 6))):
        start = draw(st.integers(0, len(content)))
        stop = min(len(content), start + draw(st.sampled_from([0, 0, 1, 1, 2, 5, 30])))
        kind = draw(st.sampled_from(["replace", "repeat", "move"]))
        if kind == "replace":
            content[start:stop] = draw(st.sampled_from(TOKENS))
        elif kind == "repeat":
            content[start:start] = content[start:stop] * draw(st.integers(1, 40))
        else:
            part = content[start:stop]
            del content[start:stop]
            place = draw(st.integers(0, len(content)))
            content[place:place] = part
    return bytes(content)


@pytest.fixture(scope="module")
def fuzzed_file():
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder) / "course.dat"


@given(content=broken_files())
@settings(max_examples=600, deadline=None, derandomize=True)
def test_broken_bytes_give_a_course_or_one_clear_error(content, fuzzed_file):
    fuzzed_file.write_bytes(content)
    try:
        course = read_course(fuzzed_file)
    except PeakflightError as error:
        message = str(error)
        assert str(fuzzed_file) in message
        assert len(message.splitlines()) == 1
    else:
        assert np.isfinite(course.waypoints).all()
        assert course.waypoints.shape == (len(course), 3)
