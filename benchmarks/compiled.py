"""The only place that knows kernels: what a public call asks of them, and how long that takes.

No kernel is called by its own signature. A public function runs once while every kernel that
Python can call notes its arguments; those are then replayed from within a compiled loop, so that
neither the checks of Python nor the conversion of arguments counts. The one thing assumed is that
what a kernel works on in place is called `times` or `coefficients`.
"""

import inspect
import pkgutil
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from itertools import cycle
from typing import Any

import numpy as np
from numba import njit
from numba.core.dispatcher import Dispatcher

import peakflight.kernels

IN_PLACE = {"times": 1, "coefficients": 3}
"""Arguments that kernels replace, and their dimensions: put back before each repetition."""


@dataclass(frozen=True, eq=False)
class Call:
    """One call of a kernel from Python."""

    name: str
    kernel: Dispatcher
    arguments: tuple[Any, ...]
    restored: tuple[np.ndarray, ...]
    """The arrays of `IN_PLACE`, as they are in `arguments`; empty ones where there is none."""
    originals: tuple[np.ndarray, ...]
    """What they held before."""
    seconds: float
    """CPU time of the call itself, s, the conversion of arguments included."""

    def repeat(self, count: int) -> None:
        """Call again and again, from within a compiled loop."""
        _loop(self.kernel)(count, *self.restored, *self.originals, self.arguments)


def recorded(call: Callable[[], Any], *, warm: bool = True) -> list[Call]:
    """The calls of kernels that a Python function makes, in their order.

    With `warm` the function first runs once more, to have all kernels compiled.
    """
    if warm:
        call()
    calls: list[Call] = []
    with _spies(calls):
        call()
    if not calls:
        raise RuntimeError("no kernel was called through its module: see benchmarks/compiled.py")
    return calls


def recorded_often(call: Callable[[], Any], count: int) -> list[list[Call]]:
    """Several sets of the calls that a Python function makes, warm."""
    return [recorded(call), *(recorded(call, warm=False) for _ in range(count - 1))]


def by_name(calls: list[Call], *names: str) -> list[Call]:
    """The calls of some kernels, by `module.function`.

    Raises
    ------
    LookupError
        If there is none.
    """
    found = [call for call in calls if call.name in names]
    if not found:
        made = ", ".join(sorted({call.name for call in calls}))
        raise LookupError(f"no call of {' or '.join(names)}; there were {made}")
    return found


def replays(sets: Sequence[Sequence[Call]]) -> list[Callable[[int], None]]:
    """Contenders for `measure`, one for each call of a set.

    Several sets of the same calls take turns: where arrays lie in memory is worth some per cent,
    and should not be that of one draw.
    """
    return [_in_turn(calls) for calls in zip(*sets, strict=True)]


def _in_turn(calls: Sequence[Call]) -> Callable[[int], None]:
    turns = cycle(calls)
    return lambda count: next(turns).repeat(count)


@lru_cache
def entries() -> tuple[tuple[Any, str, Dispatcher], ...]:
    """Module, name and kernel of each kernel that Python can call."""
    found = []
    for info in pkgutil.iter_modules(peakflight.kernels.__path__):
        module = import_module(f"{peakflight.kernels.__name__}.{info.name}")
        for name, value in vars(module).items():
            if (
                isinstance(value, Dispatcher)
                and value.py_func.__module__ == module.__name__
                and not value.targetoptions.get("no_cpython_wrapper")
            ):
                found.append((module, name, value))
    return tuple(found)


@contextmanager
def _spies(calls: list[Call]) -> Iterator[None]:
    for module, name, kernel in entries():
        setattr(module, name, _spy(calls, f"{module.__name__.rpartition('.')[2]}.{name}", kernel))
    try:
        yield
    finally:
        for module, name, kernel in entries():
            setattr(module, name, kernel)


def _spy(calls: list[Call], name: str, kernel: Dispatcher) -> Callable[..., Any]:
    signature = inspect.signature(kernel.py_func)

    def spy(*positional: Any, **named: Any) -> Any:
        bound = signature.bind(*positional, **named)
        arrays = tuple(
            bound.arguments.get(key, np.empty((0,) * dimensions))
            for key, dimensions in IN_PLACE.items()
        )
        originals = tuple(array.copy() for array in arrays)
        began = time.thread_time()
        result = kernel(*bound.args)
        seconds = time.thread_time() - began
        calls.append(Call(name, kernel, tuple(bound.args), arrays, originals, seconds))
        return result

    return spy


@lru_cache
def _loop(kernel: Dispatcher) -> Dispatcher:
    @njit
    def loop(count, times, coefficients, first_times, first_coefficients, arguments):
        for _ in range(count):
            times[:] = first_times
            coefficients[:] = first_coefficients
            kernel(*arguments)

    return loop
