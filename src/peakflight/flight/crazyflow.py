"""Plans flown in crazyflow, a simulator that nobody here wrote: the independent check.

It has the rigid body of each Crazyflie with identified rotors, and the firmware's Mellinger
controller. It is given what the Crazyflie's commander would be: position, velocity, acceleration,
yaw and body rates at 100 Hz. A flight begins as the plan does, and verdicts follow the same rules
as those of `peakflight.fly`: the same question, asked of another model.

Needs the extra crazyflow (JAX and MuJoCo, about 1.1 GB).
"""

import math
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from peakflight.errors import InvalidProblem, MissingExtra, PeakflightError
from peakflight.flight import crazyflow_worlds as worlds
from peakflight.flight.conditions import Conditions
from peakflight.flight.flight import Flight
from peakflight.flight.simulate import FlySettings, Outcome, Task, prepare
from peakflight.kernels import controllers as rows
from peakflight.kernels import flight as kernels
from peakflight.kernels import rigid_body as states
from peakflight.limits import GRAVITY
from peakflight.result import Plan
from peakflight.trajectory import Trajectory
from peakflight.vehicle import Vehicle
from peakflight.vehicles import VEHICLES, VehicleLike

NAME = "crazyflow"
DRONES: Mapping[str, str] = {
    "crazyflie-2.1": "cf2x_L250",
    "crazyflie-2.1-plus": "cf2x_P250",
    "crazyflie-2.1-upgrade": "cf2x_T350",
    "crazyflie-brushless": "cf21B_500",
}
"""Name of a vehicle to what crazyflow calls it."""
EVERY = worlds.RATE // worlds.COMMAND_RATE
"""Runs of the attitude loop between two set-points."""
MOST_SAMPLES = 1_500_000
"""Of all worlds at once: some 400 MB."""
MOST_UNEQUAL = 4.0
"""How much longer the longest flight of those flown at once may be than the shortest: all last as
long, but each length is compiled anew."""
SHARED = {"SCIPY_ARRAY_API": "1", "JAX_PLATFORMS": "cpu"}
"""What the environment of its process says: the first is what crazyflow asks for."""
LAST_LINES = 3
"""Of what the process said, if it failed."""


def fly_crazyflow(
    plans: Sequence[Plan | Trajectory],
    *,
    vehicle: VehicleLike | None = None,
    settings: FlySettings | None = None,
) -> list[Flight]:
    """Fly plans in crazyflow, all at once.

    Parameters
    ----------
    plans
        Plans, or trajectories in three axes, which are flown with yaw 0.
    vehicle
        What flies all of them; by default each plan's own. One of `DRONES`, unchanged but for its
        limits.
    settings
        How flights are judged: `hold`, `ground`, `clearance`, `lost_distance` and `lost_angle`.

    Returns
    -------
    A flight a plan, sampled at 500 Hz; its controller is "crazyflow".

    Raises
    ------
    InvalidProblem
        If a vehicle is not one that crazyflow knows, or as `peakflight.fly`.
    MissingExtra
        If crazyflow is not installed.
    """
    judged = FlySettings() if settings is None else settings
    judged = replace(judged, control_rate=float(worlds.RATE), position_divider=EVERY)
    tasks = [
        replace(
            prepare(plan, vehicle=vehicle, controller="firmware", settings=judged), controller=NAME
        )
        for plan in plans
    ]
    for task in tasks:
        drone_of(task.vehicle)
    require_crazyflow()
    batches = list(_batches(tasks))
    flights: dict[int, Flight] = {}
    for batch, samples in zip(batches, _flown(tasks, batches), strict=True):
        for index, flown in zip(batch, samples, strict=True):
            flights[index] = tasks[index].flight(_judged(tasks[index], flown), Conditions())
    return [flights[index] for index in range(len(tasks))]


def drone_of(vehicle: Vehicle) -> str:
    """What crazyflow calls a vehicle.

    Raises
    ------
    InvalidProblem
        If it has no such vehicle, or another one of that name.
    """
    known = VEHICLES.get(vehicle.name) if vehicle.name in DRONES else None
    if known is None or _body(known) != _body(vehicle):
        which = "has no" if known is None else "has another"
        raise InvalidProblem(
            f"crazyflow {which} vehicle {vehicle.name!r}; it flies {', '.join(DRONES)}, with the "
            "figures of the presets"
        )
    return DRONES[vehicle.name]


def require_crazyflow() -> None:
    """Look whether crazyflow is there.

    Raises
    ------
    MissingExtra
        If it is not installed.
    """
    if find_spec("crazyflow") is None:
        raise MissingExtra(
            "flying in crazyflow needs the extra crazyflow: pip install 'peakflight[crazyflow]'"
        )


class Samples(NamedTuple):
    """One flight at 500 Hz, before anyone has judged it."""

    states: np.ndarray
    """(n, 13) as `peakflight.kernels.rigid_body` names them."""
    rotor_thrusts: np.ndarray
    """(n, 4) N."""
    saturated: np.ndarray
    """(n,) whether a rotor was asked for an end of its range."""


def _body(vehicle: Vehicle) -> dict[str, Any]:
    """What makes a vehicle fly as it does."""
    values = vehicle.to_dict()
    return {
        name: value
        for name, value in values.items()
        if name not in ("limits", "sources", "reasons", "body_rate")
    }


def _flown(tasks: Sequence[Task], batches: Sequence[list[int]]) -> Iterator[list[Samples]]:
    """What each batch flew, in order."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        for number, batch in enumerate(batches):
            np.savez(
                folder / worlds.REQUEST.format(number),
                drone=np.array(drone_of(tasks[batch[0]].vehicle)),
                commands=_together([_commands(tasks[index]) for index in batch]),
                start=np.stack([_start(tasks[index]) for index in batch]),
            )
        done = subprocess.run(
            # without -P this folder would hide the package crazyflow
            [sys.executable, "-P", worlds.__file__, name],
            cwd=folder,
            env=os.environ | SHARED,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            said = " / ".join(done.stderr.strip().splitlines()[-LAST_LINES:])
            raise PeakflightError(f"crazyflow ended with an error: {said}")
        for number, batch in enumerate(batches):
            with np.load(folder / worlds.ANSWER.format(number)) as answer:
                arrays = {key: answer[key] for key in answer.files}
            yield [_samples(tasks[index], arrays, place) for place, index in enumerate(batch)]


def _batches(tasks: Sequence[Task]) -> Iterator[list[int]]:
    """Indices of plans to fly together: of one vehicle and about one length."""
    for name in dict.fromkeys(task.vehicle.name for task in tasks):
        those = [index for index, task in enumerate(tasks) if task.vehicle.name == name]
        batch: list[int] = []
        for index in sorted(those, key=lambda index: len(tasks[index].rehearsal.times)):
            longest = len(tasks[index].rehearsal.times)
            shortest = len(tasks[batch[0]].rehearsal.times) if batch else longest
            too_many = (len(batch) + 1) * longest > MOST_SAMPLES
            if batch and (too_many or longest > MOST_UNEQUAL * shortest):
                yield batch
                batch = []
            batch.append(index)
        if batch:
            yield batch


def _together(commands: Sequence[np.ndarray]) -> np.ndarray:
    """(ticks, worlds, 16): shorter ones stay at their last set-point."""
    longest = max(map(len, commands))
    filled = [np.pad(one, ((0, longest - len(one)), (0, 0)), mode="edge") for one in commands]
    return np.stack(filled, axis=1)


def _start(task: Task) -> np.ndarray:
    """(17,) where and how a plan begins, and the thrusts of the rotors."""
    row = task.rehearsal.rows[0]
    start = np.concatenate(
        (
            row[rows.PLANNED_POSITION : rows.PLANNED_THRUST],
            row[rows.PLANNED_ATTITUDE : rows.PLANNED_ACCELERATION],
            task.rehearsal.rotor_thrusts,
        )
    )
    start[2] += _lift(task)
    return start


def _samples(task: Task, arrays: Mapping[str, np.ndarray], place: int) -> Samples:
    """One world's flight, without what others last longer."""
    part = slice(len(task.rehearsal.times))
    flown = arrays["states"][part, place].copy()
    flown[:, 2] -= _lift(task)
    return Samples(flown, arrays["thrusts"][part, place], arrays["saturated"][part, place])


def _lift(task: Task) -> float:
    """How far up a plan is moved, m: the ground of crazyflow is at height 0, always."""
    ground = float(task.bounds[0])
    if math.isfinite(ground):
        return -ground
    lowest = float(task.rehearsal.rows[:, rows.PLANNED_POSITION + 2].min())
    return 2.0 * task.settings.lost_distance - lowest


def _commands(task: Task) -> np.ndarray:
    """(n, 16) set-points at 100 Hz: position, its two derivatives, yaw as a quaternion, rates."""
    planned = task.rehearsal.firmware_rows(1.0)[::EVERY]
    commands = np.zeros((len(planned), 16))
    commands[:, :6] = planned[:, rows.PLANNED_POSITION : rows.PLANNED_THRUST]
    commands[:, 2] += _lift(task)
    commands[:, 6:9] = planned[:, rows.PLANNED_THRUST : rows.PLANNED_YAW] - [0.0, 0.0, GRAVITY]
    commands[:, 11] = np.sin(0.5 * planned[:, rows.PLANNED_YAW])
    commands[:, 12] = np.cos(0.5 * planned[:, rows.PLANNED_YAW])
    commands[:, 13:] = planned[:, rows.PLANNED_RATE : rows.PLANNED_ACCELERATION]
    return commands


def _judged(task: Task, samples: Samples) -> Outcome:
    """End a flight where it has crashed, by the rules of `peakflight.fly`."""
    ground, distance, cosine = (float(bound) for bound in task.bounds)
    planned = task.rehearsal.rows
    flown = samples.states
    finite = np.isfinite(flown).all(axis=1) & np.isfinite(samples.rotor_thrusts).all(axis=1)
    with np.errstate(invalid="ignore"):
        miss = np.linalg.norm(
            flown[:, : states.VELOCITY] - planned[:, : rows.PLANNED_VELOCITY], axis=1
        )
        axes = _axis(flown[:, states.ATTITUDE : states.RATE])
        wanted = _axis(planned[:, rows.PLANNED_ATTITUDE : rows.PLANNED_RATE])
        lost = {
            kernels.DIVERGED: ~finite,
            kernels.HIT_GROUND: flown[:, 2] < ground,
            kernels.ATTITUDE_LOST: (axes * wanted).sum(axis=1) < cosine,
            kernels.LEFT_PATH: miss > distance,
        }
    first = {code: int(np.argmax(where)) for code, where in lost.items() if where.any()}
    code = min(first, key=lambda code: first[code]) if first else kernels.FLEW
    end = first[code] + (code != kernels.DIVERGED) if first else len(flown)
    return Outcome(
        flown[:end], samples.rotor_thrusts[:end], int(samples.saturated[:end].sum()), code
    )


def _axis(attitude: np.ndarray) -> np.ndarray:
    """(n, 3) z axis of the body in the world."""
    w, x, y, z = attitude.T
    return np.stack(
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)), axis=1
    )
