"""What is planned next: the newest request wins, one plan at a time, a draft before the whole.

While something is being dragged, drafts follow it: from the last plan with its pieces where that is
quick, else with one piece a leg. When it rests, it is planned as `peakflight plan` would, from the
beginning, so that the same course gives the same plan however one got there.
"""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from peakflight.page.edited import Edited
from peakflight.page.process import SolverProcess
from peakflight.page.solver import Answer, Notice, Request
from peakflight.page.states import States
from peakflight.result import Plan

QUIET = 0.2
"""Rest after which a course is planned in whole, s."""
SWIFT = 0.12
"""What a whole plan may take for drafts to keep its pieces, s; they take about a third of that."""
SLUGGISH = 0.06
"""What a draft with all pieces may take before the next ones have one a leg, s."""
PATIENCE, GRACE = 1.0, 0.2
"""How long a draft, and a whole plan, may take when there is something newer, s; then it is
stopped, and a process with it, once another one is ready."""
WARM_LEGS = 2
"""Legs of the course by which a new process is warmed up."""

_log = logging.getLogger("peakflight")


@dataclass(frozen=True, eq=False, kw_only=True)
class Shown:
    """A plan to be shown, or why there is none."""

    edited: Edited
    """What it is about."""
    plan: Plan | None = None
    states: States | None = None
    """What the vehicle does on it; there if the plan is."""
    error: str = ""
    guess: float | None = None
    """Total time of the paper's initial guess, s, if known."""
    seconds: float = 0.0
    """What planning took."""
    whole: bool = False
    """Whether this is the last word; else a draft."""
    asked_at: float = 0.0
    """When it was asked for, by `time.perf_counter`."""


@dataclass(frozen=True, eq=False)
class _Wish:
    edited: Edited
    serial: int
    at: float
    """By `time.perf_counter`."""
    rests: bool
    """Nothing is being dragged."""
    drafted: bool = False


@dataclass(frozen=True, eq=False)
class _Job:
    wish: _Wish
    whole: bool
    number: int
    began: float


class Planner:
    """Plans in a process, and keeps another one ready for when that has to be stopped."""

    def __init__(
        self, shown: Callable[[Shown], None], noticed: Callable[[str], None] = lambda text: None
    ) -> None:
        self._shown, self._noticed = shown, noticed
        self._changed = threading.Condition()
        self._wish: _Wish | None = None
        self._job: _Job | None = None
        self._answer: Answer | None = None
        self._stop = self._closed = False
        self._serial = self._number = 0
        self._last: Plan | None = None
        self._single: Plan | None = None
        self._keeps = True
        self._drafted_at = 0.0
        self._spare_ready = self._spare_asked = False
        self._process = SolverProcess(self._hear)
        self._spare: SolverProcess | None = SolverProcess(self._hear)
        self._thread = threading.Thread(target=self._run, name="peakflight planner", daemon=True)
        self._thread.start()

    def ask(self, edited: Edited, *, rests: bool = True) -> None:
        """Plan this; whatever was asked for before and has not begun is forgotten.

        rests: nothing is being dragged, so that the whole plan need not wait.
        """
        with self._changed:
            self._serial += 1
            self._wish = _Wish(edited, self._serial, time.perf_counter(), rests)
            self._changed.notify_all()

    def rest(self) -> None:
        """What was dragged has been let go."""
        with self._changed:
            if self._wish is not None:
                self._wish = replace(self._wish, rests=True)
                self._changed.notify_all()

    def cancel(self) -> None:
        """Stop the solve at hand and forget what waits; what is shown stays."""
        with self._changed:
            self._wish, self._stop = None, True
            self._changed.notify_all()

    @property
    def busy(self) -> float | None:
        """How long the solve at hand has been going on, s; None if there is none."""
        with self._changed:
            if self._job is None or self._answer is not None:
                return None
            return time.perf_counter() - self._job.began

    @property
    def idle(self) -> bool:
        """Whether there is nothing to do, and all that was done has been shown."""
        with self._changed:
            return self._job is None and self._wish is None

    @property
    def pids(self) -> list[int]:
        """Numbers of the processes, for whoever measures their memory."""
        both = (self._process, self._spare)
        return [process.pid for process in both if process is not None]

    def close(self) -> None:
        """End the processes and the thread."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join()
        for process in (self._process, self._spare):
            if process is not None:
                process.kill()

    def _run(self) -> None:
        """Take up what is wished for, one after the other."""
        while (job := self._begin()) is not None:
            try:
                self._do(job)
            except Exception as error:  # whatever it is, what comes next is planned
                _log.exception("the planner failed at something")
                text = f"unexpected {type(error).__name__}: {error}; the next change begins anew"
                self._show(job, Answer(number=job.number, error=text))
            with self._changed:
                self._job = None

    def _do(self, job: _Job) -> None:
        """Plan one thing and show it, unless it is stopped."""
        if not self._process.alive:
            self._replace(job.wish.edited)
        self._process.send(self._request(job))
        answer = self._finish(job)
        if answer is None:
            return
        self._learn(job, answer)
        if not job.whole:
            self._drafted_at = time.perf_counter()
        self._show(job, answer)
        if not self._spare_asked:
            self._prepare(job.wish.edited)

    def _show(self, job: _Job, answer: Answer) -> None:
        with self._changed:
            self._answer = answer
        shown = Shown(
            edited=job.wish.edited,
            plan=answer.plan,
            states=answer.states,
            error=answer.error,
            guess=answer.guess,
            seconds=answer.seconds,
            whole=job.whole,
            asked_at=job.wish.at,
        )
        try:
            self._shown(shown)
        except Exception:  # drawing may fail; the thread must live on to plan what is asked next
            _log.exception("a plan could not be shown")
        with self._changed:
            self._job = None

    def _begin(self) -> _Job | None:
        """Wait for something to do, and take it up; None at the end."""
        with self._changed:
            while not self._closed:
                wish = self._wish
                if wish is not None:
                    whole = self._is_whole(wish)
                    quiet = max(wish.at, self._drafted_at) + QUIET - time.perf_counter()
                    wait = 0.0 if wish.rests or not whole else quiet
                    if wait <= 0.0 or (whole and not wish.drafted):
                        break
                    self._changed.wait(wait)
                else:
                    self._changed.wait()
            if self._closed or wish is None:
                return None
            self._stop = False
            self._number += 1
            job = _Job(wish, whole, self._number, time.perf_counter())
            self._job, self._answer = job, None
            self._wish = None if whole else replace(wish, drafted=True)
        return job

    def _is_whole(self, wish: _Wish) -> bool:
        """Whether it is next planned in whole: after its draft, or where that gains nothing."""
        if wish.drafted or wish.edited.method != "joint":
            return True
        last = self._last
        if last is None or not wish.rests or last.wall_time_s >= SWIFT:
            return False
        return len(wish.edited.waypoints) < 2 * len(last.problem.waypoints)

    def _request(self, job: _Job) -> Request:
        edited = job.wish.edited
        options = edited.options
        if not job.whole:
            options |= self._draft(edited)
        return Request(
            number=job.number,
            problem=edited.problem,
            method=edited.method,
            options=options,
            guess=job.whole,
        )

    def _draft(self, edited: Edited) -> dict[str, object]:
        """What makes a plan of method joint quick."""
        legs = len(edited.waypoints) - 1
        last, single = self._last, self._single
        if last is not None and len(last.pieces) == legs and self._keeps:
            return {"initial": last, "pieces": "auto"}
        if single is not None and len(single.pieces) == legs:
            return {"initial": single, "pieces": 1}
        return {"pieces": 1}

    def _learn(self, job: _Job, answer: Answer) -> None:
        """Remember what the next draft can begin from, and whether it can keep the pieces."""
        plan = answer.plan
        if plan is None or plan.method != "joint" or not plan.feasible:
            return
        if job.whole:
            self._keeps = plan.wall_time_s < SWIFT
            self._last = plan
        elif self._keeps and set(plan.pieces) != {1}:
            self._keeps = answer.seconds < SLUGGISH
            self._last = plan
        if set(plan.pieces) == {1}:
            self._single = plan

    def _finish(self, job: _Job) -> Answer | None:
        """Wait for the answer; None if the solve was stopped."""
        process = self._process
        with self._changed:
            while self._answer is None and not (self._closed or process.ended or self._stop):
                newer = self._wish is not None and self._wish.serial != job.wish.serial
                left = job.began + (GRACE if job.whole else PATIENCE) - time.perf_counter()
                if newer and left <= 0.0 and self._spare_ready:
                    break
                self._changed.wait(left if newer and left > 0.0 else None)
            answer, ended = self._answer, process.ended
            if answer is not None or self._closed:
                return answer
        self._replace(job.wish.edited)
        if ended:
            text = f"the process that plans {ended}; the next change begins anew"
            return Answer(number=job.number, error=text)
        return None

    def _replace(self, edited: Edited) -> None:
        """Go on with the process that stands ready, and prepare another one."""
        old, spare = self._process, self._spare
        self._spare, self._spare_ready, self._spare_asked = None, False, False
        if spare is not None and not spare.alive:
            spare.kill()
            spare = None
        try:
            self._process = spare or SolverProcess(self._hear)
        finally:
            old.kill()
        self._prepare(edited)

    def _prepare(self, edited: Edited) -> None:
        """Have another process plan something alike, so that it has loaded what that takes.

        Without one, what is newer waits for what is at hand.
        """
        try:
            spare = self._spare = self._spare or SolverProcess(self._hear)
        except OSError:
            _log.warning("no other process can be kept ready", exc_info=True)
            return
        try:
            few = edited.problem.waypoints[: WARM_LEGS + 1]
            problem = replace(edited.problem, waypoints=few, derivatives={}, yaw=None)
        except ValueError:
            return
        self._spare_asked = True
        spare.send(Request(number=0, problem=problem, method=edited.method, guess=True))

    def _hear(self, process: SolverProcess, said: Answer | Notice | None) -> None:
        """Called from the threads that listen."""
        if isinstance(said, Notice):
            self._noticed(said.text)
            return
        with self._changed:
            if process is self._spare and said is not None:
                self._spare_ready = True
                self._changed.notify_all()
            if process is not self._process:
                return
            if self._job and said is not None and said.number == self._job.number:
                self._answer = said
            self._changed.notify_all()
