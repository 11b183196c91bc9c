"""Generated scripts, run dry: the real libraries where there are any, over recorded links."""

import ast
import asyncio
import importlib.util
import io
import re
import sys
import time
import types
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import peakflight as pf
from peakflight.formats import FLIGHT_FORMATS
from peakflight.limits import KINDS

WAYPOINTS = [[0.0, 0.0, 1.0], [0.8, 0.4, 1.2], [1.2, 1.0, 0.9]]


@pytest.fixture(scope="module")
def plan() -> pf.Plan:
    return pf.plan(WAYPOINTS, vehicle="crazyflie-2.1", yaw=0.5, pieces=2)


class Clock:
    """Time that passes only by sleeping."""

    def __init__(self) -> None:
        self.now = 100.0
        self.ring: tuple[float, Callable[[], None]] | None = None

    def monotonic(self) -> float:
        return self.now

    def time(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += max(seconds, 1e-4)
        if self.ring is not None and self.now >= self.ring[0]:
            ring, self.ring = self.ring[1], None
            ring()


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))  # nobody presses Enter
    return Clock()


def load(path: Path, clock: Clock) -> ModuleType:
    """A script as a module, with our time; not run yet."""
    compile(path.read_text(), str(path), "exec")
    spec = importlib.util.spec_from_file_location("flown", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    if hasattr(module, "time"):
        module.time = clock
    return module


def press_enter(module: ModuleType, clock: Clock, after: float) -> None:
    """Let Enter be pressed so long after now."""
    keys: list[Any] = []
    original = module.AbortKey.__init__

    def remember(self: Any) -> None:
        original(self)
        keys.append(self)

    module.AbortKey.__init__ = remember

    def press() -> None:
        keys[0].presses += 1

    clock.ring = (clock.now + after, press)


# ---- cflib ------------------------------------------------------------------------------------


class Link:
    """A Crazyflie below cflib's own commander, supervisor and memory: records bytes."""

    def __init__(self, clock: Clock) -> None:
        from cflib.crazyflie.high_level_commander import HighLevelCommander
        from cflib.crazyflie.mem import MemoryElement, TrajectoryMemory

        self.clock = clock
        self.packets: list[tuple[float, bytes]] = []
        self.memory = b""
        self.armed: list[bool] = []
        self.stopped = 0
        self.platform = SimpleNamespace(get_protocol_version=lambda: 12)
        self.high_level_commander = HighLevelCommander(self)
        self.trajectory = TrajectoryMemory(1, MemoryElement.TYPE_TRAJ, 4096, self)
        self.mem = SimpleNamespace(get_mems=lambda _: [self.trajectory])
        self.supervisor = SimpleNamespace(
            send_arming_request=self.armed.append, send_emergency_stop=self._stop
        )

    def _stop(self) -> None:
        self.stopped += 1

    def send_packet(self, packet: Any) -> None:
        self.packets.append((self.clock.now, bytes(packet.data)))

    def write(self, memory: Any, address: int, data: bytes, **_: Any) -> None:
        assert address == 0
        self.memory = bytes(data)
        memory.write_done(memory, address)

    @property
    def commands(self) -> list[int]:
        return [data[0] for _, data in self.packets]


def fly_cflib(module: ModuleType, clock: Clock) -> Link:
    link = Link(clock)

    class Scf:
        cf = link

        def __init__(self, uri: str, cf: Any) -> None:
            assert uri == "radio://0/1"

        def __enter__(self) -> "Scf":
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def wait_for_params(self) -> None:
            pass

    class Logger:
        def __init__(self, *_: Any) -> None:
            pass

        def __enter__(self) -> Iterator[Any]:
            return iter([(0, {f"stateEstimate.{axis}": 0.25 for axis in "xyz"}, None)])

        def __exit__(self, *_: object) -> None:
            pass

    module.SyncCrazyflie, module.SyncLogger = Scf, Logger
    module.Crazyflie = lambda **_: None
    module.reset_estimator = lambda _: None
    module.cflib.crtp.init_drivers = lambda: None
    assert module.main(["radio://0/1"]) == 0
    return link


@pytest.mark.parametrize("name", ["cflib", "cflib-compressed"])
def test_cflib_script_flies(name: str, plan: pf.Plan, tmp_path: Path, clock: Clock) -> None:
    pf.export(plan, to=name, path=tmp_path / "fly.py")
    module = load(tmp_path / "fly.py", clock)
    from cflib.crazyflie.high_level_commander import HighLevelCommander as H

    link = fly_cflib(module, clock)
    started = [H.COMMAND_START_TRAJECTORY_2]
    expected = [H.COMMAND_DEFINE_TRAJECTORY, H.COMMAND_TAKEOFF_2, H.COMMAND_GO_TO_2, *started]
    assert link.commands == [*expected, H.COMMAND_LAND_2, H.COMMAND_STOP]
    assert link.armed == [True]
    assert link.stopped == 0
    go_to = np.frombuffer(link.packets[2][1][4:], dtype="<f4")
    np.testing.assert_allclose(go_to[:4], [0.0, 0.0, 1.0, 0.5], atol=2e-3)
    start = link.packets[3][1]
    assert tuple(start[2:5]) == (0, 0, 0)  # not relative, not reversed
    flown = link.packets[4][0] - link.packets[3][0]
    assert flown == pytest.approx(plan.duration * 1.0 + module.PAUSE, rel=0.3)
    assert flown >= module.DURATION
    other = "crazyswarm" if name == "cflib" else "crazyflie-compressed"
    if name == "cflib":
        assert len(link.memory) == 132 * len(module.PIECES)
        assert link.packets[0][1][3] == 0
    else:
        pf.export(plan, to=other, path=tmp_path / "other")
        assert link.memory == (tmp_path / "other").read_bytes()
        assert link.packets[0][1][3] == 1


def test_cflib_script_aborts(plan: pf.Plan, tmp_path: Path, clock: Clock) -> None:
    from cflib.crazyflie.high_level_commander import HighLevelCommander as H

    pf.export(plan, to="cflib", path=tmp_path / "fly.py")
    module = load(tmp_path / "fly.py", clock)
    press_enter(module, clock, after=3.0)  # while it climbs
    link = fly_cflib(module, clock)
    assert H.COMMAND_START_TRAJECTORY_2 not in link.commands
    assert link.commands[-2:] == [H.COMMAND_LAND_2, H.COMMAND_STOP]
    assert link.packets[-2][0] < 104.0


# ---- Crazyswarm2 ------------------------------------------------------------------------------


class Robot:
    def __init__(self, name: str, record: Callable[..., None]) -> None:
        self.name, self.record = name, record
        self.initialPosition = np.array([0.0, 0.0, 0.0])

    def __getattr__(self, command: str) -> Callable[..., None]:
        if command.startswith("_"):
            raise AttributeError(command)
        return lambda *values, **named: self.record(self.name, command, values, named)


@pytest.fixture
def crazyswarm(monkeypatch: pytest.MonkeyPatch, clock: Clock) -> list[Any]:
    """crazyflie_py, which only ROS has: what it is called with."""
    calls: list[Any] = []

    def record(*call: Any) -> None:
        calls.append((clock.now, *call))

    class Polynomial4D:
        def __init__(self, duration: float, *axes: np.ndarray) -> None:
            self.duration = duration
            self.px, self.py, self.pz, self.pyaw = (SimpleNamespace(p=axis) for axis in axes)

    class Crazyswarm:
        def __init__(self) -> None:
            robots = [Robot(f"cf{number}", record) for number in (1, 2, 3)]
            self.allcfs = Robot("all", record)
            self.allcfs.crazyflies = robots
            self.allcfs.crazyfliesByName = {robot.name: robot for robot in robots}
            self.timeHelper = clock

    package = types.ModuleType("crazyflie_py")
    package.Crazyswarm = Crazyswarm  # type: ignore[attr-defined]
    module = types.ModuleType("crazyflie_py.uav_trajectory")
    module.Polynomial4D = Polynomial4D  # type: ignore[attr-defined]
    module.Trajectory = SimpleNamespace  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "crazyflie_py", package)
    monkeypatch.setitem(sys.modules, "crazyflie_py.uav_trajectory", module)
    return calls


def test_crazyswarm2_script_flies(
    plan: pf.Plan, tmp_path: Path, clock: Clock, crazyswarm: list[Any]
) -> None:
    pf.export([plan, plan], to="crazyswarm2", path=tmp_path / "fly.py", names=["a", "b"])
    module = load(tmp_path / "fly.py", clock)
    assert module.main(["cf3", "cf1"]) == 0
    for name in ("cf3", "cf1"):
        done = [call for call in crazyswarm if call[1] == name]
        commands = ["uploadTrajectory", "arm", "takeoff", "goTo", "startTrajectory", "land"]
        assert [call[2] for call in done] == commands
        number, offset, flight = done[0][3]
        assert (number, offset) == (0, 0)
        assert flight.duration == pytest.approx(plan.duration)
        assert flight.polynomials[0].px.p.tolist()[:1] == [0.0]
        np.testing.assert_allclose(done[3][3][0], [0.0, 0.0, 1.0])
        assert done[4][4] == {"timescale": 1.0, "relative": False}
        assert done[5][0] - done[4][0] >= plan.duration
    with pytest.raises(SystemExit, match="no robot is called cf9"):
        module.main(["cf9", "cf1"])
    with pytest.raises(SystemExit, match="2 flights need as many robots; there are 1"):
        module.main(["cf1"])


def test_crazyswarm2_script_aborts(
    plan: pf.Plan, tmp_path: Path, clock: Clock, crazyswarm: list[Any]
) -> None:
    pf.export(plan, to="crazyswarm2", path=tmp_path / "fly.py")
    module = load(tmp_path / "fly.py", clock)
    press_enter(module, clock, after=2.0)
    assert module.main([]) == 0
    assert [call[2] for call in crazyswarm][-1] == "land"
    assert "startTrajectory" not in [call[2] for call in crazyswarm]


# ---- PX4 --------------------------------------------------------------------------------------


def fly_px4(
    module: ModuleType,
    clock: Clock,
    monkeypatch: pytest.MonkeyPatch,
    taken: float = float("inf"),
) -> list[Any]:
    calls: list[Any] = []
    modes = module.FlightMode
    offboard_from = [float("inf")]

    class Vehicle:
        def __init__(self, _: Any) -> None:
            pass

        def __getattr__(self, command: str) -> Callable[..., Any]:
            async def called(*values: Any) -> bool:
                calls.append((clock.now, command, *values))
                if command == "start":
                    offboard_from[0] = clock.now + 0.2  # telemetry tells it later
                return False

            return called

        async def flight_mode(self) -> Any:
            offboard = offboard_from[0] <= clock.now < taken
            return modes.OFFBOARD if offboard else modes.POSCTL

        async def subscribe_position_velocity_ned(self) -> Any:
            yield SimpleNamespace(position=SimpleNamespace(north_m=0.1, east_m=0.2, down_m=-0.05))

    class Mavsdk:
        def __init__(self, _: Any) -> None:
            pass

        async def __aenter__(self) -> "Mavsdk":
            return self

        async def __aexit__(self, *_: object) -> None:
            pass

        async def add_any_connection(self, address: str) -> None:
            calls.append((clock.now, "connect", address))

        async def first_autopilot(self, timeout_s: float) -> object:
            return object()

    async def sleep(seconds: float) -> None:
        clock.sleep(seconds)

    for name in ("ActionAsync", "OffboardAsync", "TelemetryAsync"):
        setattr(module, name, Vehicle)
    module.Mavsdk = Mavsdk
    monkeypatch.setattr(asyncio, "sleep", sleep)
    assert module.main(["udpin://0.0.0.0:1"]) == 0
    return calls


def test_px4_script_flies(
    plan: pf.Plan, tmp_path: Path, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mavsdk.asyncio.plugins.offboard import AccelerationNed, PositionNedYaw, VelocityNedYaw

    pf.export(plan, to="px4", path=tmp_path / "fly.py")
    module = load(tmp_path / "fly.py", clock)
    calls = fly_px4(module, clock, monkeypatch)
    names = [call[1] for call in calls]
    assert names[0] == "connect"
    assert names.index("arm") < names.index("start") < names.index("land")
    points = [call for call in calls if call[1].startswith("set_position")]
    assert names[1] == "set_position_velocity_acceleration_ned"  # before offboard starts
    for point in points:
        kinds = [type(value) for value in point[2:]]
        assert kinds == [PositionNedYaw, VelocityNedYaw, AccelerationNed]
        assert point[2].to_c_struct().north_m == pytest.approx(point[2].north_m, abs=1e-6)
    gaps = np.diff([point[0] for point in points])
    assert gaps.max() < 0.06  # PX4 leaves offboard mode below 2 Hz
    ends = points[-1][2]
    assert (ends.north_m, ends.east_m, ends.down_m) == pytest.approx((1.0, 1.2, -0.9))
    assert ends.yaw_deg == pytest.approx(90 - np.degrees(0.5))
    middle = plan.trajectory(0.5 * plan.duration)
    near = [
        abs(p[2].north_m - middle[1]) + abs(p[2].east_m - middle[0]) + abs(p[2].down_m + middle[2])
        for p in points
    ]
    assert min(near) < 0.05


@pytest.mark.parametrize("after", [1.0, 6.0, 8.5])
def test_px4_script_leaves_the_vehicle_to_the_pilot(
    after: float,
    plan: pf.Plan,
    tmp_path: Path,
    clock: Clock,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pf.export(plan, to="px4", path=tmp_path / "fly.py")
    module = load(tmp_path / "fly.py", clock)
    taken = clock.now + after
    calls = fly_px4(module, clock, monkeypatch, taken)
    assert capsys.readouterr().out.splitlines()[-1] == "the pilot has control"
    assert not {"land", "kill"} & {call[1] for call in calls}
    assert calls[-1][0] < taken  # nothing at all is sent from then on


def test_px4_script_aborts(
    plan: pf.Plan, tmp_path: Path, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    pf.export(plan, to="px4", path=tmp_path / "fly.py")
    module = load(tmp_path / "fly.py", clock)
    press_enter(module, clock, after=1.0)
    names = [call[1] for call in fly_px4(module, clock, monkeypatch)]
    assert names[-2:] == ["land", "in_air"]
    assert "kill" not in names


# ---- ArduPilot --------------------------------------------------------------------------------


LOITER = 5
"""The number of a mode of the pilot's."""


class Autopilot:
    """A vehicle behind pymavlink's own packer: what is sent is packed, and unpacked again."""

    def __init__(
        self, clock: Clock, refuses: int | None = None, taken: float | None = None
    ) -> None:
        from pymavlink.dialects.v20 import ardupilotmega as dialect

        self.dialect, self.clock, self.refuses = dialect, clock, refuses
        self.target_system = self.target_component = 0  # as pymavlink's before it is told
        self.parser = dialect.MAVLink(None)
        self.mav = dialect.MAVLink(self, srcSystem=255)
        self.received: list[Any] = []
        self.modes: list[str] = []
        self.height = 0.0
        self.mode, self.taken = LOITER, taken
        self.next_beat, self.ground_station, self.down_beats = 0.0, False, 0

    def write(self, data: bytes) -> None:
        for message in self.parser.parse_buffer(data) or []:
            self.received.append((self.clock.now, message))
            if getattr(message, "command", None) == self.dialect.MAV_CMD_NAV_TAKEOFF:
                self.height = message.param7

    def set_mode(self, mode: str) -> None:
        self.modes.append(mode)
        self.mode = {"GUIDED": 4, "LAND": 9}[mode]

    def recv_match(self, type: list[str], blocking: bool = False, **_: Any) -> Any:
        if blocking:
            self.clock.sleep(0.01)
        if self.taken is not None and self.clock.now >= self.taken:
            self.mode = LOITER
        if not blocking or type[0] == "HEARTBEAT":
            return self._beat()
        if type[0] == "LOCAL_POSITION_NED":
            return Message(type[0], x=0.0, y=0.0, z=-self.height)
        command = self.received[-1][1].command
        return Message(type[0], command=command, result=int(command == self.refuses))

    def _beat(self) -> Any:
        """A heartbeat each second of the vehicle, and one of a ground station."""
        if self.clock.now < self.next_beat:
            return None
        self.ground_station = not self.ground_station
        if self.ground_station:
            return Message("HEARTBEAT", 255, 190, autopilot=8, base_mode=0, custom_mode=0)
        self.next_beat = self.clock.now + 1.0
        landing = self.modes[-1:] == ["LAND"]
        self.down_beats += landing
        armed = 0 if self.down_beats > 2 else self.dialect.MAV_MODE_FLAG_SAFETY_ARMED
        return Message("HEARTBEAT", autopilot=3, base_mode=armed, custom_mode=self.mode)


class Message(SimpleNamespace):
    """What pymavlink gives of a message, of the vehicle unless said otherwise."""

    def __init__(self, kind: str, system: int = 1, component: int = 1, **values: Any) -> None:
        super().__init__(**values)
        self.get_type = lambda: kind
        self.get_srcSystem, self.get_srcComponent = lambda: system, lambda: component


def fly_ardupilot(module: ModuleType, vehicle: Autopilot) -> list[Any]:
    module.mavutil = SimpleNamespace(mavlink=vehicle.dialect, mavlink_connection=lambda _: vehicle)
    assert module.main(["udpin:0.0.0.0:1"]) == 0
    return [message for _, message in vehicle.received]


def test_ardupilot_script_flies(plan: pf.Plan, tmp_path: Path, clock: Clock) -> None:
    pf.export(plan, to="ardupilot", path=tmp_path / "fly.py")
    module = load(tmp_path / "fly.py", clock)
    vehicle = Autopilot(clock)
    messages = fly_ardupilot(module, vehicle)
    assert vehicle.modes == ["GUIDED", "LAND"]
    assert vehicle.down_beats == 3  # the ground station's are not taken for landed
    points = [m for m in messages if m.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
    assert {(m.target_system, m.target_component) for m in messages} == {(1, 1)}
    assert {(m.coordinate_frame, m.type_mask) for m in points} == {(1, 0)}
    last = points[-1]
    np.testing.assert_allclose((last.x, last.y, last.z), (1.0, 1.2, -0.9), atol=1e-6)
    assert last.yaw == pytest.approx(np.pi / 2 - 0.5)
    times = [at for at, m in vehicle.received if m.get_type() == points[0].get_type()]
    assert np.diff(times).max() < 0.06
    speeds = [np.hypot(m.vx, m.vy) for m in points]
    fastest = np.linalg.norm(plan.trajectory.sample(99, 1)[..., :2], axis=2).max()
    assert max(speeds) == pytest.approx(fastest, rel=0.02)


@pytest.mark.parametrize("after", [1.5, 6.0, 9.0])
def test_ardupilot_script_leaves_the_vehicle_to_the_pilot(
    after: float, plan: pf.Plan, tmp_path: Path, clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    """Taken over before the hover, on the way to the start, and on the plan or after."""
    pf.export(plan, to="ardupilot", path=tmp_path / "fly.py")
    module = load(tmp_path / "fly.py", clock)
    vehicle = Autopilot(clock, taken=clock.now + after)
    fly_ardupilot(module, vehicle)
    assert vehicle.modes == ["GUIDED"]  # neither landed nor taken back
    assert capsys.readouterr().out.splitlines()[-1] == "the pilot has control"
    assert vehicle.taken is not None
    assert max(at for at, _ in vehicle.received) <= vehicle.taken + 1.0  # the next heartbeat
    sent = {m.command for _, m in vehicle.received if m.get_type() == "COMMAND_LONG"}
    assert sent == {400, 22, 511}  # armed, take-off, how often to tell the position


def test_ardupilot_script_leaves_the_landing_to_the_pilot(
    plan: pf.Plan, tmp_path: Path, clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    pf.export(plan, to="ardupilot", path=tmp_path / "fly.py")
    module = load(tmp_path / "fly.py", clock)
    vehicle = Autopilot(clock)
    land = module.land

    def taken(link: Any, key: Any) -> None:
        vehicle.taken = clock.now + 1.5
        land(link, key)

    module.land = taken
    fly_ardupilot(module, vehicle)
    assert vehicle.modes == ["GUIDED", "LAND"]
    assert capsys.readouterr().out.splitlines()[-1] == "the pilot has control"


def test_ardupilot_script_lands_if_it_is_refused(
    plan: pf.Plan, tmp_path: Path, clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    pf.export(plan, to="ardupilot", path=tmp_path / "fly.py")
    module = load(tmp_path / "fly.py", clock)
    vehicle = Autopilot(clock, refuses=22)
    fly_ardupilot(module, vehicle)
    assert vehicle.modes == ["GUIDED", "LAND"]
    assert "the vehicle refuses command 22" in capsys.readouterr().out


# ---- what the header of a script says -----------------------------------------------------------

SCRIPTS = ("cflib", "cflib-compressed", "crazyswarm2", "px4", "ardupilot")


def docstring(path: Path) -> str:
    return ast.get_docstring(ast.parse(path.read_text())) or ""


@pytest.mark.parametrize("name", SCRIPTS)
@pytest.mark.parametrize("called", ['q""";print("INJECTED");"""', "ends in \\", "$name ${x}"])
def test_a_vehicles_name_stays_text(name: str, called: str, plan: pf.Plan, tmp_path: Path) -> None:
    assert plan.vehicle is not None
    problem = replace(plan.problem, vehicle=replace(plan.vehicle, name=called))
    path = tmp_path / "fly.py"
    pf.export(replace(plan, problem=problem), to=name, path=path)
    values = [
        node.value for node in ast.walk(ast.parse(path.read_text())) if type(node) is ast.Expr
    ]
    printed = [ast.unparse(call) for call in values if isinstance(call, ast.Call)]
    assert not any("INJECTED" in call for call in printed)
    assert f"for {re.sub('[^a-zA-Z .]', '_', called)}; planned" in docstring(path)
    (reading,) = FLIGHT_FORMATS[name].decode(path.read_bytes())
    assert reading.trajectory.duration == pytest.approx(plan.duration, rel=1e-3)


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_names_the_limits_that_it_is_held_to(
    name: str, plan: pf.Plan, tmp_path: Path
) -> None:
    (flight,) = pf.export(plan, to=name, path=tmp_path / "fly.py").flights
    said = docstring(tmp_path / "fly.py")
    assert "certified" not in said
    named = {kind.name for kind in KINDS if re.search(rf"[:,] {kind.label} \d", said)}
    assert named == set(flight.held)
    assert ("jerk" in named) == (name in ("cflib", "crazyswarm2"))


def test_ardupilot_script_knows_the_vehicle_on_a_real_link(
    plan: pf.Plan, tmp_path: Path, clock: Clock
) -> None:
    """Through pymavlink's own connection, over the loopback."""
    from pymavlink import mavutil

    pf.export(plan, to="ardupilot", path=tmp_path / "fly.py")
    module = load(tmp_path / "fly.py", clock)
    module.time = time
    link = mavutil.mavlink_connection("udpin:127.0.0.1:0")
    port = link.port.getsockname()[1]
    senders = {
        who: mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{port}", source_system=who[0], source_component=who[1]
        )
        for who in ((255, 190), (7, 1))
    }

    def beat(who: tuple[int, int], autopilot: int, mode: int) -> None:
        senders[who].mav.heartbeat_send(2, autopilot, 0, mode, 4)

    try:
        beat((255, 190), 8, 0)
        beat((7, 1), 3, LOITER)
        assert module.find_vehicle(link)
        assert (link.target_system, link.target_component) == (7, 1)
        beat((7, 1), 3, module.GUIDED)
        beat((255, 190), 8, 0)
        assert module.receive(link, "HEARTBEAT", 1.0).custom_mode == module.GUIDED
        module.check_mode(link)
        beat((7, 1), 3, LOITER)
        time.sleep(0.05)
        with pytest.raises(module.PilotHasControl):
            module.check_mode(link)
    finally:
        for one in (link, *senders.values()):
            one.close()
