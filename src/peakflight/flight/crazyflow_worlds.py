"""The process in which crazyflow runs: set-points in, what was flown out, both as files.

It is a process of its own since crazyflow wants SciPy loaded in a way of its own, before anyone
else has loaded it, and since MuJoCo writes a log to where it runs. It knows nothing of plans, and
imports nothing of peakflight.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

RATE, COMMAND_RATE = 500, 100
"""Hz, of its physics and attitude loop, and of set-points and its loop of position."""
REQUEST, ANSWER = "request-{}.npz", "answer-{}.npz"
AT_END = 1e-5
"""Relative distance from the end of its range at which a rotor's command is saturated: float32."""


def main(folder: Path) -> None:
    """Fly every request in a folder."""
    number = 0
    while (request := folder / REQUEST.format(number)).exists():
        with np.load(request) as given:
            answer = _fly(str(given["drone"]), given["commands"], given["start"])
        np.savez(folder / ANSWER.format(number), **answer)  # type: ignore[arg-type]
        number += 1


def _fly(drone: str, commands: np.ndarray, start: np.ndarray) -> dict[str, np.ndarray]:
    """What worlds with one drone each do under set-points.

    Parameters
    ----------
    commands
        (ticks, worlds, 16) at 100 Hz.
    start
        (worlds, 17): position, velocity, attitude as w, x, y, z, body rates, rotor thrusts in N.

    Returns
    -------
    At 500 Hz, before each step: states (steps, worlds, 13) and thrusts (steps, worlds, 4) in the
    order of `start`; saturated (steps, worlds), whether a rotor was asked for an end of its range.
    """
    import jax
    import jax.numpy as jnp
    from crazyflow.control import Control
    from crazyflow.sim import Sim, functional
    from crazyflow.sim.sim import rotor_vel_limits

    simulation = Sim(
        n_worlds=commands.shape[1],
        drone=drone,
        control=Control.state,
        freq=RATE,
        state_freq=COMMAND_RATE,
        attitude_freq=RATE,
        force_torque_freq=RATE,
    )
    steps = tuple(simulation.step_pipeline.values())

    def step(data: Any, _: None) -> tuple[Any, tuple[Any, ...]]:
        now = data.states
        for part in steps:
            data = part(data)
        seen = (now.pos, now.vel, now.quat, now.ang_vel, now.rotor_vel, data.controls.rotor_vel)
        return data, tuple(one[:, 0] for one in seen)

    def tick(data: Any, command: Any) -> tuple[Any, tuple[Any, ...]]:
        data = functional.state_control(data, command[:, None])
        return jax.lax.scan(step, data, None, length=RATE // COMMAND_RATE)

    curve = np.asarray(simulation.data.params.rpm2thrust, dtype=float).ravel()
    c, b, a = curve
    speeds = (np.sqrt(b * b - 4.0 * a * (c - start[:, 13:])) - b) / (2.0 * a)
    values = {
        "pos": start[:, :3],
        "vel": start[:, 3:6],
        "quat": np.roll(start[:, 6:10], -1, axis=1),  # crazyflow's are x, y, z, w
        "ang_vel": start[:, 10:13],
        "rotor_vel": speeds,
    }
    begin = {name: jnp.asarray(one[:, None], jnp.float32) for name, one in values.items()}
    data = simulation.data.replace(states=simulation.data.states.replace(**begin))
    fly = jax.jit(lambda data, commands: jax.lax.scan(tick, data, commands)[1])
    flown = [_joined(one) for one in fly(data, jnp.asarray(commands, jnp.float32))]
    position, velocity, attitude, rate, speed, command = flown
    least, most = rotor_vel_limits(simulation.dynamics, simulation.drone)
    ended = (command <= least * (1.0 + AT_END)) | (command >= most * (1.0 - AT_END))
    return {
        "states": np.concatenate((position, velocity, np.roll(attitude, 1, axis=2), rate), axis=2),
        "thrusts": np.polynomial.polynomial.polyval(speed, curve),
        "saturated": ended.any(axis=2),
    }


def _joined(seen: Sequence[Any]) -> np.ndarray:
    """(steps, worlds, n) from (ticks, steps a tick, worlds, n)."""
    array = np.asarray(seen, dtype=float)
    return array.reshape(-1, *array.shape[2:])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
