"""One thread on which everything of the page happens, in order.

Callbacks of the server, answers of the planner and ticks of the clock come from threads of their
own; each leaves what is to be done here. What is left under a key replaces what waits under it, so
that a fast hand or a slow drawing never makes a queue.
"""

import logging
import threading
from collections.abc import Callable
from typing import TypeAlias

Deed: TypeAlias = Callable[[], None]
_log = logging.getLogger("peakflight")


class PageThread:
    """Runs what it is given, one after the other."""

    def __init__(self, failed: Callable[[Exception], None]) -> None:
        self._failed = failed
        self._waiting: dict[object, Deed] = {}
        self._changed = threading.Condition()
        self._closed = self._busy = False
        self.failures = 0
        """Deeds that raised, which is a bug each."""
        self._thread = threading.Thread(target=self._run, name="peakflight page", daemon=True)
        self._thread.start()

    def post(self, deed: Deed, key: object = None) -> None:
        """Have something done; under a key, in place of what waits under the same.

        It is done after all that was posted before it, wherever what it replaces stood.
        """
        with self._changed:
            self._waiting.pop(key, None)
            self._waiting[object() if key is None else key] = deed
            self._changed.notify_all()

    def settle(self, timeout: float = 60.0) -> bool:
        """Wait until there is nothing to do; whether that came to be in time, s."""
        with self._changed:
            return self._changed.wait_for(lambda: not (self._waiting or self._busy), timeout)

    def close(self) -> None:
        """End after the deed at hand."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._busy = False
                self._changed.notify_all()
                self._changed.wait_for(lambda: self._waiting or self._closed)
                if self._closed:
                    return
                deed = self._waiting.pop(next(iter(self._waiting)))
                self._busy = True
            try:
                deed()
            except Exception as error:  # one bug must not end the page
                self.failures += 1
                _log.exception("the page failed at something")
                self._failed(error)
