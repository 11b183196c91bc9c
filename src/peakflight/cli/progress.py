"""What is being done, and how much of it, on one line of a terminal; the library's own messages."""

import logging
import shutil
import sys
import threading
import time
from types import TracebackType
from typing import Self

INTERVAL = 0.1
"""Time between two updates of the line, s."""
PATIENCE = 2.0
"""Work that takes longer than this gets a bar, s."""
WIDTH = 20
"""Of the bar, in characters."""


class Progress:
    """Shows the stage of the work and the time since it began, on stderr if that is a terminal.

    After two seconds there is a bar too: it fills where the part that is done is known, and moves
    to and fro where it is not, since a compiled solver does not report back.

    Whatever the logger `peakflight` says while this is open goes to stderr, a line each.
    """

    def __init__(self) -> None:
        self._stream = sys.stderr
        self._is_live = self._stream.isatty()
        self._began = time.perf_counter()
        self._text = ""
        self._part: float | None = None
        self._shown = 0
        self._lock = threading.RLock()
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._handler = _Lines(self)

    def __enter__(self) -> Self:
        logging.getLogger("peakflight").addHandler(self._handler)
        if self._is_live:
            self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._done.set()
        if self._is_live:
            self._thread.join()
            with self._lock:
                self._clear()
        logging.getLogger("peakflight").removeHandler(self._handler)

    def stage(self, text: str, part: float | None = None) -> None:
        """Say what begins now, and which part of work of its kind, from 0 to 1, is done by then."""
        with self._lock:
            self._text = text
            self._part = part
            self._draw()

    def say(self, line: str) -> None:
        """Write a line that stays."""
        with self._lock:
            self._clear()
            self._stream.write(f"{line}\n")
            self._stream.flush()
            self._draw()

    def _watch(self) -> None:
        while not self._done.wait(INTERVAL):
            with self._lock:
                self._draw()

    def _draw(self) -> None:
        if not (self._is_live and self._text):
            return
        width = shutil.get_terminal_size().columns - 1
        elapsed = time.perf_counter() - self._began
        bar = f"{_bar(self._part, elapsed)} " if elapsed > PATIENCE else ""
        line = f"{bar}{self._text} ({elapsed:.1f} s)"[:width]
        self._stream.write("\r" + line.ljust(min(self._shown, width)))
        self._stream.flush()
        self._shown = len(line)

    def _clear(self) -> None:
        if self._shown:
            self._stream.write("\r" + " " * self._shown + "\r")
            self._stream.flush()
            self._shown = 0


def _bar(part: float | None, elapsed: float) -> str:
    """A bar filled by the part that is done; if that is unknown, a mark that moves with time."""
    if part is not None:
        return "[" + ("#" * round(WIDTH * part)).ljust(WIDTH, ".") + "]"
    step = round(elapsed / INTERVAL) % (2 * (WIDTH - 1))
    place = min(step, 2 * (WIDTH - 1) - step)
    return "[" + ("." * place + "#").ljust(WIDTH, ".") + "]"


class _Lines(logging.Handler):
    """Hands log records to the progress line, which steps aside for them."""

    def __init__(self, progress: Progress) -> None:
        super().__init__()
        self._progress = progress

    def emit(self, record: logging.LogRecord) -> None:
        self._progress.say(f"peakflight: {record.getMessage()}")
