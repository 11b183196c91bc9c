"""Making one file for one person, on a thread of its own: flight files take a while."""

import logging
import threading
from typing import Any, Protocol

from peakflight.errors import PeakflightError
from peakflight.page import files
from peakflight.page.edited import Edited
from peakflight.result import Plan

_log = logging.getLogger("peakflight")
_one_at_a_time = threading.Lock()


class Saying(Protocol):
    """Shows what became of a file: to everyone, and to whoever asked as a notification."""

    def __call__(self, text: str, *, good: bool, client: Any = None) -> None:  # noqa: D102
        ...


class Saving:
    """What is saved: the course, its plan if there is one that answers it, and for whom."""

    def __init__(
        self, say: Saying, what: str, plan: Plan | None, edited: Edited, client: Any
    ) -> None:
        self._say, self._what, self._plan = say, what, plan
        self._edited, self._client = edited, client

    def start(self) -> None:
        """Make it and send it when it is there."""
        threading.Thread(target=self._run, name="peakflight file", daemon=True).start()

    def _run(self) -> None:
        """Make it and send it, or say why not."""
        try:
            with _one_at_a_time:
                name, content, said = self._made()
        except PeakflightError as error:
            self._say(str(error), good=False, client=self._client)
            return
        except Exception as error:  # a bug must be seen on the page, too
            _log.exception("a file could not be made")
            text = f"unexpected {type(error).__name__}: {error}; this is a bug"
            self._say(text, good=False, client=self._client)
            return
        if self._client is not None:
            self._client.send_file_download(name, content, save_immediately=True)
        self._say(said, good=True)

    def _made(self) -> tuple[str, bytes, str]:
        """Name, content, and what is said about it."""
        stem = self._edited.name
        if self._what == "course":
            return f"{stem}.csv", files.course_csv(self._edited), f"saved {stem}.csv"
        if self._plan is None:
            raise PeakflightError("there is no plan of the course as it is yet")
        if self._what == "plan":
            said = (
                "saved plan.json"
                if self._plan.report.feasible
                else ("saved plan.json, which is not proven to keep the limits")
            )
            return "plan.json", files.plan_json(self._plan), said
        if self._what == "report":
            content = files.report(self._plan, stem)
            return f"{stem}_report.html", content, f"saved {stem}_report.html"
        to = self._what.partition(":")[2]
        name, content, report = files.flight_file(self._plan, to)
        if not report.feasible:
            raise PeakflightError(f"{name}: not proven to keep the limits: {report.problems[0]}")
        notes = "; ".join(("proven again as it is read", *report.notes))
        return name, content, f"exported {name}: {notes}"
