"""CPU time of one thread, warm, as a median over rounds."""

import gc
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

BATCH = 0.02
"""Calls are repeated within a batch until it lasts so many seconds."""
WARM = 5
"""One part in so many of a batch is run beforehand, untimed."""
BUDGET = 6.0
"""Seconds of one contender's rounds; what is slower gets fewer rounds, but two at least."""


@dataclass(frozen=True)
class Sample:
    """CPU seconds of one call, one entry a round."""

    rounds: tuple[float, ...]

    @property
    def median(self) -> float:
        """The typical one."""
        return statistics.median(self.rounds)

    @property
    def spread(self) -> float:
        """Half the distance between the quartiles, relative to the median."""
        if len(self.rounds) < 3:
            return (max(self.rounds) - min(self.rounds)) / 2.0 / abs(self.median)
        low, _, high = statistics.quantiles(self.rounds, n=4, method="inclusive")
        return (high - low) / 2.0 / abs(self.median)


def ratio(one: Sample, other: Sample) -> float:
    """How many times longer `one` takes than `other`: the median over rounds run side by side."""
    pairs = zip(one.rounds, other.rounds, strict=False)
    return statistics.median(a / b for a, b in pairs)


def repeated(call: Callable[[], object]) -> Callable[[int], object]:
    """A contender that repeats a Python call."""

    def repeat(count: int) -> None:
        for _ in range(count):
            call()

    return repeat


def side_by_side(contenders: Sequence[Callable[[int], object]], rounds: int) -> list[Sample]:
    """CPU time of one call of each contender, which take turns in every round.

    A contender gets how often to repeat itself, so that a compiled loop can do it.
    """
    counts = [_batch_size(contender) for contender in contenders]
    found: list[list[float]] = [[] for _ in contenders]
    with _no_collection():
        for _ in range(rounds):
            for times, contender, count in zip(found, contenders, counts, strict=True):
                if len(times) < 2 or sum(times) * count < BUDGET:
                    contender(count // WARM)  # others have emptied the caches
                    times.append(_time(contender, count) / count)
    return [Sample(tuple(times)) for times in found]


def _batch_size(contender: Callable[[int], object]) -> int:
    """How many calls make a batch; warms up on the way."""
    contender(1)
    count = 1
    while True:
        seconds = _time(contender, count)
        if seconds >= BATCH / 2.0:
            return max(1, round(count * BATCH / seconds))
        count = count * 10 if seconds < BATCH / 20.0 else round(count * BATCH / seconds) + 1


def _time(contender: Callable[[int], object], count: int) -> float:
    began = time.thread_time()
    contender(count)
    return time.thread_time() - began


@contextmanager
def _no_collection() -> Iterator[None]:
    """Keep the garbage collector out, as `timeit` does."""
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
