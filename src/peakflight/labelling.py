"""Which of many things are labelled, and with what."""

from collections.abc import Sequence

import numpy as np

SAME_PLACE = 1e-6
"""Waypoints that are no further apart share a label, relative to the size of the course."""
MOST_LABELS = 25
"""With more waypoints than this, only every second, fifth, tenth, ... is numbered."""
MOST_OF_A_PLACE = 5
"""A place that is passed more often lists its first numbers only."""
MOST_BORDERS = 60
"""With more legs, only the borders of every second, fifth, ... are drawn against time."""
MOST_LEGS = 40
"""With more legs, only every second, fifth, ... is numbered there."""
FAR = 4.0
"""A limit that is further beyond the curves than this is named, but not drawn to scale."""


def waypoint_texts(waypoints: np.ndarray) -> dict[int, str]:
    """Say what to write at which of (K+1, 2 or 3) m `waypoints`, the start and the end first.

    A place that is passed several times has one text with all its numbers.
    """
    last = len(waypoints) - 1
    grid = SAME_PLACE * max(float(np.ptp(waypoints, axis=0).max()), 1e-300)
    cells = np.round((waypoints - waypoints[0]) / grid)
    _, group = np.unique(cells, axis=0, return_inverse=True)
    members: dict[int, list[int]] = {}
    for index, key in enumerate(group.ravel()):
        members.setdefault(int(key), []).append(index)
    step = even_step(len(members), MOST_LABELS)
    ends = [numbers for numbers in members.values() if numbers[0] == 0 or numbers[-1] == last]
    inner = [
        numbers
        for numbers in members.values()
        if numbers not in ends and any(number % step == 0 for number in numbers)
    ]
    return {numbers[0]: _list(numbers, last) for numbers in ends + inner}


def _list(numbers: Sequence[int], last: int) -> str:
    names = {0: "0 start", last: f"{last} end"}
    shown = [number for number in numbers[:MOST_OF_A_PLACE] if number != last]
    words = [names.get(number, str(number)) for number in shown]
    if len(numbers) > MOST_OF_A_PLACE:
        words.append("…")
    if last in numbers:
        words.append(names[last])
    return ", ".join(words)


def drawn_borders(passed: np.ndarray) -> np.ndarray:
    """Of the times at which waypoints are passed, s, those between legs, as many as can be seen."""
    inner = passed[1:-1]
    return inner[:: even_step(len(inner), MOST_BORDERS)]


def numbered_legs(count: int) -> range:
    """Of so many legs, those that are numbered against time."""
    return range(0, count, even_step(count, MOST_LEGS))


def even_step(count: int, most: int) -> int:
    """Find the least of 1, 2, 5, 10, ... that numbers `count` things with `most` labels."""
    decade = 1
    while count > most * 5 * decade:
        decade *= 10
    return next(step * decade for step in (1, 2, 5) if count <= most * step * decade)
