"""What is planned: the courses of `examples/`, seeded random ones, and the paper's limits."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import peakflight as pf
from peakflight import paper

FOLDER = Path(__file__).parent.parent / "examples" / "courses"
SEED = 20240229


@dataclass(frozen=True)
class Task:
    """A class of spline and its limits."""

    name: str
    minimize: str
    degree: int
    limits: pf.Limits
    known: dict[str, float]
    """Course to the best known flight time of this kind of spline, s."""

    def problem(self, waypoints: np.ndarray) -> pf.Problem:
        """The problem of a course."""
        return pf.Problem(waypoints, limits=self.limits, minimize=self.minimize, degree=self.degree)


JERK = Task(
    "min jerk",
    "jerk",
    5,
    paper.PRINTED[0].limits,
    {
        "tight_then_fast": 4.7148,
        "mfbo_traj_2": 4.6369,
        "random_10": 6.6040,
        "pmm_slalom": 29.3463,
        "uzh_19wp": 56.2267,
        "random_100": 70.5013,
    },
)
SNAP = Task(
    "min snap",
    "snap",
    7,
    paper.PRINTED[1].limits,
    {
        "tight_then_fast": 5.1162,
        "mfbo_traj_2": 4.8904,
        "random_10": 7.2549,
        "pmm_slalom": 32.6289,
        "uzh_19wp": 57.7787,
        "random_100": 76.1404,
    },
)


def course(name: str) -> np.ndarray:
    """(K+1, 3) m, waypoints of one of the examples."""
    return pf.read_course(FOLDER / f"{name}.json").waypoints


def names() -> list[str]:
    """Every JSON course, from short to long."""
    return sorted((path.stem for path in FOLDER.glob("*.json")), key=lambda n: len(course(n)))


def unseen(
    index: int, legs: tuple[int, int] = (2, 40), lengths: tuple[float, float] = (0.05, 20.0)
) -> np.ndarray:
    """(K+1, 3) m: 2 to 40 legs of 0.05 to 20 m (log-uniform), in any direction."""
    rng = np.random.default_rng([SEED, index])
    count = int(rng.integers(legs[0], legs[1] + 1))
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    distances = np.exp(rng.uniform(*np.log(lengths), size=(count, 1)))
    return np.vstack((np.zeros(3), np.cumsum(distances * directions, axis=0)))


def walk(legs: int, *index: int) -> np.ndarray:
    """(K+1, 3) m: a random walk with normal steps of 1.5, 1.5 and 0.5 m; one for each index."""
    rng = np.random.default_rng([SEED, legs, *index])
    steps = rng.normal(size=(legs, 3)) * (1.5, 1.5, 0.5)
    return np.vstack((np.zeros(3), np.cumsum(steps, axis=0)))


def sized(legs: int) -> tuple[str, np.ndarray]:
    """A course of so many legs and its name: the stored ones at 10 and 100, else a walk."""
    if legs in (10, 100):
        return f"random_{legs}", course(f"random_{legs}")
    return f"walk of {legs:,}", walk(legs)


def even_times(waypoints: np.ndarray, speed: float = 2.0) -> np.ndarray:
    """(K,) s, times of an even speed, for splines whose times are given."""
    return np.linalg.norm(np.diff(waypoints, axis=0), axis=1) / speed
