"""Splines at fixed times beside those of other packages, which take turns with ours."""

from collections.abc import Callable
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

import peakflight as pf
from benchmarks.courses import even_times, sized
from benchmarks.measure import Sample, ratio, repeated, side_by_side
from benchmarks.report import Cell, Column, Row, Table, failure
from benchmarks.scope import Scope
from benchmarks.speed import core_of, spline_call

POINTS = 200
"""Where the path of a peer is compared with ours."""
NO_LIMIT = 1e3
"""m/s: rotorpy wants a limit of speed; this one is never active."""

COLUMNS: list[Column] = [
    ("who", ""), ("spline", ""), ("legs", "d"), ("time a solve [us]", ".4g"), ("spread", ".1%"),
    ("/ our core", ".3g"), ("/ our function", ".3g"), ("furthest from our path [m]", ".1e"),
]  # fmt: skip

Solve = Callable[[], Any]
Follow = Callable[[Any, np.ndarray], np.ndarray]


class Peer(NamedTuple):
    """How another package is called."""

    name: str
    minimize: str
    prepare: Callable[[np.ndarray, np.ndarray], tuple[Solve, Follow]]
    """From waypoints and times: a solve, and the positions (n, 3) of its result at times (n,)."""


def run(scope: Scope) -> list[Table]:
    """One table, with ours measured in the same rounds as the others."""
    rows: list[Row] = []
    for legs in (10, 100):
        for minimize, degree in (("jerk", 5), ("snap", 7)):
            rows += _compare(legs, minimize, degree, scope.pick(3, 9), skip_slow=scope.quick)
    text = (
        "The same waypoints and times, rest to rest, three axes (rotorpy also solves for yaw). "
        "Each package from its own Python call to its own result object; ours twice: the compiled "
        "core, and `minimum_effort_spline` with all its checks. Above 1: the peer is slower."
    )
    return [Table(title="Side by side with other packages", note=text, columns=COLUMNS, rows=rows)]


def _compare(legs: int, minimize: str, degree: int, rounds: int, *, skip_slow: bool) -> list[Row]:
    _, waypoints = sized(legs)
    times = even_times(waypoints)
    ours = spline_call(waypoints, minimize, degree)
    core = core_of(ours)
    what: dict[str, Cell] = {"spline": f"min {minimize}, degree {degree}", "legs": legs}
    failures: list[Row] = []
    ready: list[tuple[Peer, Solve, float]] = []
    for peer in PEERS:
        if peer.minimize != minimize:
            continue
        if skip_slow and peer.name == "rotorpy" and legs > 10:
            failures.append(Row(cells={"who": peer.name, **what}, note="left out of a quick run"))
            continue
        try:
            solve, follow = peer.prepare(waypoints, times)
            distance = _distance(follow, solve(), ours(), times)
        except Exception as error:  # a failure is a row
            failures.append(failure({"who": peer.name, **what}, error))
            continue
        ready.append((peer, solve, distance))
    contenders = [core, repeated(ours), *(repeated(solve) for _, solve, _ in ready)]
    inside, outside, *others = side_by_side(contenders, rounds)
    rows = [
        _row("peakflight, compiled core", what, inside, inside, outside, None),
        _row("peakflight, minimum_effort_spline", what, outside, inside, outside, None),
    ]
    for (peer, _, distance), sample in zip(ready, others, strict=True):
        rows.append(_row(peer.name, what, sample, inside, outside, distance))
    return [*rows, *failures]


def _row(
    name: str,
    what: dict[str, Cell],
    sample: Sample,
    inside: Sample,
    outside: Sample,
    distance: float | None,
) -> Row:
    return Row(
        cells={
            "who": name,
            **what,
            "time a solve [us]": 1e6 * sample.median,
            "spread": sample.spread,
            "/ our core": ratio(sample, inside),
            "/ our function": ratio(sample, outside),
            "furthest from our path [m]": distance,
        }
    )


def _distance(follow: Follow, theirs: Any, ours: pf.Trajectory, times: np.ndarray) -> float:
    when = np.linspace(0.0, times.sum(), POINTS)
    return float(np.linalg.norm(follow(theirs, when) - ours(when), axis=1).max())


def _spline_trajectory(kind: str) -> Callable[[np.ndarray, np.ndarray], tuple[Solve, Follow]]:
    def prepare(waypoints: np.ndarray, times: np.ndarray) -> tuple[Solve, Follow]:
        spline = getattr(import_module("spline_trajectory"), kind)
        when = np.concatenate(([0.0], np.cumsum(times))).tolist()  # a list, as it wants

        def follow(result: Any, t: np.ndarray) -> np.ndarray:
            return np.asarray(result.evaluate_batch(t.tolist()))

        return lambda: spline(when, waypoints), follow

    return prepare


def _minsnap_trajectories(waypoints: np.ndarray, times: np.ndarray) -> tuple[Solve, Follow]:
    package = import_module("minsnap_trajectories")
    when = np.concatenate(([0.0], np.cumsum(times)))
    rest = dict.fromkeys(("velocity", "acceleration", "jerk"), np.zeros(3))
    last = len(waypoints) - 1
    points = [
        package.Waypoint(time=when[k], position=point, **(rest if k in (0, last) else {}))
        for k, point in enumerate(waypoints)
    ]

    def solve() -> Any:
        return package.generate_trajectory(
            points, 7, idx_minimized_orders=4, num_continuous_orders=4
        )

    def follow(result: Any, t: np.ndarray) -> np.ndarray:
        return np.asarray(package.compute_trajectory_derivatives(result, t, 1)[0])

    return solve, follow


def _rotorpy(waypoints: np.ndarray, times: np.ndarray) -> tuple[Solve, Follow]:
    package = import_module("rotorpy.trajectories.minsnap")
    lengths = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    speed = float(lengths.sum() / times.sum())

    def solve() -> Any:
        return package.MinSnap(waypoints, v_avg=speed, v_max=NO_LIMIT, verbose=False)

    def follow(result: Any, t: np.ndarray) -> np.ndarray:
        return np.array([result.update(moment)["x"] for moment in t])

    return solve, follow


PEERS = (
    Peer("spline-trajectory (C++)", "jerk", _spline_trajectory("QuinticSpline3D")),
    Peer("spline-trajectory (C++)", "snap", _spline_trajectory("SepticSpline3D")),
    Peer("minsnap-trajectories", "snap", _minsnap_trajectories),
    Peer("rotorpy", "snap", _rotorpy),
)
