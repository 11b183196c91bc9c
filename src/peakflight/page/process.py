"""A process that plans, as seen from the server."""

import contextlib
import logging
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import TypeAlias

from peakflight.page.solver import Answer, Notice, Request

Heard: TypeAlias = Callable[["SolverProcess", Answer | Notice | None], None]
"""Told what a process says; None when there is nothing more to come from it."""

_log = logging.getLogger("peakflight")


class SolverProcess:
    """One process of `peakflight.page.solver`; it ends with this one, however this one ends."""

    def __init__(self, heard: Heard) -> None:
        self._heard = heard
        self._ended = ""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "peakflight.page.solver"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        threading.Thread(target=self._listen, name="peakflight answers", daemon=True).start()

    @property
    def pid(self) -> int:
        """Its number, for whoever measures its memory."""
        return self._process.pid

    @property
    def ended(self) -> str:
        """Why nothing more comes from it, once all that it said has been heard; else empty."""
        return self._ended

    @property
    def alive(self) -> bool:
        """Whether it still runs, and can be heard."""
        return not self._ended and self._process.poll() is None

    def send(self, request: Request) -> None:
        """Ask for a plan; the answer comes to `heard`. Nothing is sent to one that has ended."""
        stream = self._process.stdin
        assert stream is not None
        with contextlib.suppress(BrokenPipeError, ValueError):
            stream.write(pickle.dumps(request, protocol=pickle.HIGHEST_PROTOCOL))
            stream.flush()

    def kill(self) -> None:
        """End it at once, whatever it does."""
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()

    def _listen(self) -> None:
        stream = self._process.stdout
        assert stream is not None
        try:
            while True:
                self._heard(self, pickle.load(stream))
        except (EOFError, OSError, ValueError, pickle.UnpicklingError):
            self._ended = "has died"
        except Exception as error:  # whoever waits for an answer must learn that none comes
            _log.exception("an answer cannot be read")
            self._ended = f"cannot be understood ({type(error).__name__}: {error})"
        self._heard(self, None)
