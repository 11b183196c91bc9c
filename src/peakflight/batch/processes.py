"""Processes of this machine, for batches: an executor that leaves nothing behind."""

import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from types import TracebackType
from typing import Any, TypeVar

from peakflight.errors import ExecutorFailed, InvalidProblem

MOST_WORKERS = 61 if os.name == "nt" else 1024
"""What Windows can wait for, and what no machine has use for."""
_T = TypeVar("_T")


class Processes(Executor):
    """Processes that begin anew (`spawn`), so that they hold no locks or threads of this one.

    Ctrl-C is for the process that started them alone. When the block in which this is used ends by
    an error, they are ended at once; when this process dies, however it does, they end by
    themselves.

    Raises
    ------
    InvalidProblem
        If the number of workers is out of range.
    """

    def __init__(self, workers: int | None = None) -> None:
        self.workers = checked_workers(workers)
        self._context = _Context()
        self._pool = self._new_pool()

    def start(self) -> None:
        """Wait until a process answers.

        Raises
        ------
        ExecutorFailed
            If none can be started.
        """
        try:
            self._pool.submit(_hello).result()
        except BrokenProcessPool:
            raise ExecutorFailed(
                "no worker process could be started; in a script, what starts them must stand "
                "below: if __name__ == '__main__':"
            ) from None

    def restart(self) -> None:
        """Begin anew with other processes, after one has died."""
        self.terminate()
        self._pool = self._new_pool()
        self.start()

    def submit(self, fn: Callable[..., _T], /, *args: Any, **options: Any) -> Future[_T]:
        """Have a function called in one of the processes."""
        return self._pool.submit(fn, *args, **options)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let the processes end after the work that they have."""
        self._pool.shutdown(wait, cancel_futures=cancel_futures)

    def terminate(self) -> None:
        """End the processes at once, whatever they do."""
        for process in self._context.started:
            if process.is_alive():
                process.terminate()
        self._pool.shutdown(wait=True, cancel_futures=True)
        for process in self._context.started:
            process.join()
        self._context.started.clear()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            self.shutdown(cancel_futures=True)
        else:
            self.terminate()

    def _new_pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.workers, mp_context=self._context, initializer=_begin)


def checked_workers(workers: int | None) -> int:
    """A number of workers; None is for as many as there are processors for this process.

    Raises
    ------
    InvalidProblem
        If it is not a whole number from 1 to `MOST_WORKERS`.
    """
    if workers is None:
        return min(_processors(), MOST_WORKERS)
    if isinstance(workers, bool) or not isinstance(workers, int):
        raise InvalidProblem(f"workers is {workers!r}; it must be a whole number")
    if not 1 <= workers <= MOST_WORKERS:
        raise InvalidProblem(f"workers is {workers}; it must be from 1 to {MOST_WORKERS}")
    return workers


def _processors() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Worker(SpawnProcess):
    """A process that Ctrl-C does not reach, from its first instant on."""

    def start(self) -> None:
        if not hasattr(signal, "pthread_sigmask"):
            super().start()
            return
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            super().start()  # which inherits what is blocked
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Context(SpawnContext):
    """Remembers the processes that a pool has started, so that they can be ended."""

    def __init__(self) -> None:
        super().__init__()
        self.started: list[SpawnProcess] = []

    def Process(self, *args: Any, **options: Any) -> SpawnProcess:  # type: ignore[override]  # noqa: N802
        process = _Worker(*args, **options)
        self.started.append(process)
        return process


def _begin() -> None:
    """What a worker does first."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where signals cannot be blocked
    # what the library says is for the process that has asked
    logging.getLogger("peakflight").addHandler(logging.NullHandler())
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process as soon as the one that started it has, even if it was killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _hello() -> int:
    return os.getpid()
