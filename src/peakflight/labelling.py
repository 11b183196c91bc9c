"""Which of many things are labelled, and with what."""

from collections.abc import Sequence

import numpy as np

SAME_PLACE = 1e-6
"""Waypoints that are no further apart share a label, relative to the size of the course."""
MOST_LABELS = 25
"""With more waypoints than this, only every second, fifth, tenth, ... is numbered."""
MOST_NUMBERS = 5
"""A place that is passed more often lists its first numbers only."""


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
    shown = [number for number in numbers[:MOST_NUMBERS] if number != last]
    words = [names.get(number, str(number)) for number in shown]
    if len(numbers) > MOST_NUMBERS:
        words.append("…")
    if last in numbers:
        words.append(names[last])
    return ", ".join(words)


def even_step(count: int, most: int) -> int:
    """Find the least of 1, 2, 5, 10, ... that numbers `count` things with `most` labels."""
    decade = 1
    while count > most * 5 * decade:
        decade *= 10
    return next(step * decade for step in (1, 2, 5) if count <= most * step * decade)
