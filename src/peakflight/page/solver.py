"""The process that plans for the page: requests in, answers out, until there are no more.

It is a process of its own so that a long solve can be stopped at once, and so that it never holds
up the server. Requests and answers are pickled, one after the other, through its standard input
and output; whatever prints goes to the standard error.
"""

import logging
import os
import pickle
import queue
import signal
import sys
import threading
import time
import traceback
from dataclasses import dataclass, field
from typing import Any, BinaryIO

from peakflight.errors import PeakflightError
from peakflight.page.states import States, states
from peakflight.problem import Problem
from peakflight.result import Plan


@dataclass(frozen=True, eq=False, kw_only=True)
class Request:
    """What to plan."""

    number: int
    problem: Problem
    method: str
    options: dict[str, Any] = field(default_factory=dict)
    """Of the method."""
    guess: bool = False
    """Whether the paper's initial guess is planned too, to compare with."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Answer:
    """What came of a request."""

    number: int
    plan: Plan | None = None
    states: States | None = None
    """What the vehicle does on it."""
    error: str = ""
    """Why there is no plan."""
    guess: float | None = None
    """Total time of the initial guess, s, if it was asked for and keeps the limits."""
    seconds: float = 0.0
    """What it took."""


@dataclass(frozen=True)
class Notice:
    """A line on what is going on, such as compiling."""

    text: str


def main() -> None:
    """Answer requests until the input ends, which ends a solve at hand as well."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server
    replies = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    logging.getLogger("peakflight").addHandler(_Noticing(replies))
    requests: queue.SimpleQueue[Request] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(requests,), name="requests", daemon=True).start()
    while True:
        try:
            _send(replies, answer(requests.get()))
        except BrokenPipeError:
            return


def _read(requests: "queue.SimpleQueue[Request]") -> None:
    """Take in requests; where the input ends, the server has ended, and nobody wants an answer.

    It has a thread of its own since whoever solves does not look, and the system ends no process
    for that its parent has ended.
    """
    try:
        while True:
            requests.put(pickle.load(sys.stdin.buffer))
    except EOFError:
        os._exit(0)
    except BaseException:
        traceback.print_exc()
        os._exit(1)


def answer(request: Request) -> Answer:
    """Plan, and whatever goes wrong, say so."""
    from peakflight.planner import plan
    from peakflight.reporting.findings import initial_guess

    began = time.perf_counter()
    try:
        found = plan(request.problem, method=request.method, **request.options)
        first = initial_guess(found) if request.guess else None
        flown = states(found)
    except PeakflightError as error:
        return Answer(number=request.number, error=str(error))
    except Exception as error:  # a bug there must not end the page
        text = f"unexpected {type(error).__name__}: {error}; this is a bug"
        return Answer(number=request.number, error=text)
    seconds = time.perf_counter() - began
    guess = None if first is None else first.duration
    return Answer(number=request.number, plan=found, states=flown, guess=guess, seconds=seconds)


class _Noticing(logging.Handler):
    """Passes on what the planner logs."""

    def __init__(self, replies: BinaryIO) -> None:
        super().__init__()
        self._replies = replies

    def emit(self, record: logging.LogRecord) -> None:
        _send(self._replies, Notice(record.getMessage()))


def _send(replies: BinaryIO, value: Answer | Notice) -> None:
    pickle.dump(value, replies, protocol=pickle.HIGHEST_PROTOCOL)
    replies.flush()


if __name__ == "__main__":
    from peakflight.page import solver  # noqa: PLW0406 - what is pickled is not of __main__

    solver.main()
