"""The same work on many items: on several processes or machines, one result at a time.

What is done is a `Work`; where, a `concurrent.futures.Executor`. Whatever happens to an item is its
outcome, and never keeps the others from theirs.
"""

import logging
from collections import deque
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from peakflight.batch.keys import key_of, plain
from peakflight.batch.processes import Processes, checked_workers
from peakflight.batch.store import Store
from peakflight.errors import ExecutorFailed, InvalidProblem
from peakflight.files import PathLike

_log = logging.getLogger("peakflight")

CHUNKS = 64
"""Parts that a batch is sent in, at least: results come early, and workers end together."""
LARGEST_CHUNK = 16
"""Items of a part at most: enough to make the cost of sending them small."""
IN_FLIGHT = 256
"""Parts that an executor of unknown size is given at a time."""
IN_FLIGHT_A_WORKER = 2
"""Parts that a process of this machine is given at a time: one to do, and one to go on with."""

Item = TypeVar("Item")
Value = TypeVar("Value")
_Item_contra = TypeVar("_Item_contra", contravariant=True)
_Value_co = TypeVar("_Value_co", covariant=True)


class Work(Protocol[_Item_contra, _Value_co]):
    """What is done with each item. It is sent to workers: its module must be importable there."""

    name: str
    """In a word, for the store."""

    @property
    def settings(self) -> Any:
        """What every outcome depends on, beside its item; see `keys.plain`."""

    def perform(self, item: _Item_contra) -> dict[str, Any]:
        """Do it, in a worker; plain data comes back."""

    def value(self, item: _Item_contra, answer: dict[str, Any]) -> _Value_co:
        """What that data stands for."""

    def first(self, item: _Item_contra) -> str:
        """Name what the first of all items has to prepare for others, such as compiled kernels.

        Others of the same name wait for it. Empty where nothing is to be prepared.
        """


@dataclass(frozen=True, kw_only=True)
class Failure:
    """Why an item has no result."""

    kind: str
    """Type of the error: InvalidProblem where the item is to blame, others are defects."""
    text: str
    """What the error says."""
    lost: bool = False
    """The worker died, or could not be reached: the item may yet be done elsewhere."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Done(Generic[Item, Value]):
    """What became of an item."""

    index: int
    """Of the item in the batch."""
    item: Item
    value: Value | None = None
    failure: Failure | None = None
    """Why there is no value."""
    resumed: bool = False
    """It was in the store from an earlier run."""


@dataclass(frozen=True)
class _Outcome:
    """As it comes from a worker."""

    answer: dict[str, Any] | None = None
    failure: Failure | None = None


def run(
    work: Work[Item, Value],
    items: Iterable[Item],
    *,
    executor: Executor | None = None,
    workers: int | None = None,
    chunk: int | None = None,
    store: PathLike | None = None,
) -> Generator[Done[Item, Value], None, None]:
    """Do the same work on many items; results come as they are done, those of a store first.

    Parameters
    ----------
    executor
        Where; it is not shut down. None for processes of this machine that end with the batch, or
        when the iterator is closed.
    workers
        How many processes, without an executor; None for as many as there are processors. With 1,
        all is done in this process.
    chunk
        Items that are sent together; None for some sixty parts, of up to 16 items.
    store
        File that keeps every result; if it holds some of this batch, these are not done again.
        Items that were lost with their worker are.

    Raises
    ------
    InvalidProblem
        At once, if an argument is against a rule.
    InvalidFile
        If the store cannot be read or written, or is that of a different batch.
    ExecutorFailed
        If the executor is broken; results so far are in the store.
    """
    if executor is not None and workers is not None:
        raise InvalidProblem("workers given beside an executor, which has its own")
    if executor is not None and not isinstance(executor, Executor):
        raise InvalidProblem(
            f"executor is {executor!r}; it must be a concurrent.futures.Executor "
            "(of a Dask client: client.get_executor())"
        )
    if chunk is not None and (isinstance(chunk, bool) or not isinstance(chunk, int) or chunk < 1):
        raise InvalidProblem(f"chunk is {chunk!r}; it must be a whole number from 1")
    count = None if executor is not None else checked_workers(workers)
    return _results(work, list(items), executor, count, chunk, store)


def _results(
    work: Work[Item, Value],
    items: list[Item],
    executor: Executor | None,
    workers: int | None,
    chunk: int | None,
    path: PathLike | None,
) -> Generator[Done[Item, Value], None, None]:
    with ExitStack() as stack:
        store, keys = None, []
        todo = list(range(len(items)))
        if path is not None:
            store = stack.enter_context(
                Store(path, work=work.name, settings={"of": plain(work.settings)})
            )
            keys = [key_of(item) for item in items]
            entries = store.take(keys)
            todo = [index for index in todo if entries[index] is None]
            for index, entry in enumerate(entries):
                if entry is not None:
                    yield _done(work, items, index, _from_entry(entry), resumed=True)
        if not todo:
            return
        outcomes: Iterator[list[tuple[int, _Outcome]]]
        if executor is None and workers == 1:
            outcomes = ([(index, _outcome(work, items[index]))] for index in todo)
        else:
            if executor is None:
                own = Processes(min(workers or 1, len(todo)))
                executor = stack.enter_context(own)
                own.start()
            outcomes = _Dispatch(work, items, executor, chunk).outcomes(todo)
        for finished in outcomes:
            if store is not None:
                store.add(
                    [
                        {"key": keys[index], "index": index, **_entry(items[index], outcome)}
                        for index, outcome in finished
                        if outcome.failure is None or not outcome.failure.lost
                    ]
                )
            for index, outcome in finished:
                yield _done(work, items, index, outcome)


class _Dispatch(Generic[Item, Value]):
    """Gives an executor its work, and finds out what kills workers."""

    def __init__(
        self, work: Work[Item, Value], items: Sequence[Item], executor: Executor, chunk: int | None
    ) -> None:
        self._work = work
        self._items = items
        self._executor = executor
        self._chunk = chunk or min(max(len(items) // CHUNKS, 1), LARGEST_CHUNK)
        self._most = IN_FLIGHT
        if isinstance(executor, Processes):
            self._most = IN_FLIGHT_A_WORKER * executor.workers
        self._waiting: deque[list[int]] = deque()
        """Parts to be given away."""
        self._held: dict[str, list[int]] = {}
        """What waits for the first of its kind, by what that prepares."""
        self._suspects: deque[int] = deque()
        """Items that were under way when a process died: done one by one, nothing beside them."""
        self._running: dict[Future[list[_Outcome]], list[int]] = {}
        self._broken: BrokenExecutor | None = None
        """Why the executor, which is not ours to mend, does no more."""

    def outcomes(self, todo: Sequence[int]) -> Iterator[list[tuple[int, _Outcome]]]:
        """Outcomes of items by their indices, as they come."""
        leaders = self._arrange(todo)
        try:
            while self._waiting or self._suspects or self._running:
                finished = self._step()
                for index, _ in finished:
                    if index in leaders:
                        self._give(self._held.pop(leaders.pop(index)))
                if finished:
                    yield finished
        finally:
            for future in self._running:
                future.cancel()

    def _arrange(self, todo: Sequence[int]) -> dict[int, str]:
        """Put all in line; the first of each kind, and what it prepares."""
        leaders: dict[int, str] = {}
        free = []
        for index in todo:
            name = self._work.first(self._items[index])
            if not name:
                free.append(index)
            elif name in self._held:
                self._held[name].append(index)
            else:
                self._held[name] = []
                leaders[index] = name
        if leaders:
            _log.warning("compiling for this machine, once; this takes some seconds")
        self._waiting.extend([index] for index in leaders)
        self._give(free)
        return leaders

    def _give(self, indices: Sequence[int]) -> None:
        for begin in range(0, len(indices), self._chunk):
            self._waiting.append(list(indices[begin : begin + self._chunk]))

    def _step(self) -> list[tuple[int, _Outcome]]:
        """Send what there is room for, and wait for something to end."""
        if self._broken is not None:
            return self._mend(self._broken, [], alone=False)
        alone = bool(self._suspects)
        try:
            if alone and not self._running:
                self._send([self._suspects[0]])
                self._suspects.popleft()
            while not alone and self._waiting and len(self._running) < self._most:
                self._send(self._waiting[0])
                self._waiting.popleft()
        except BrokenExecutor as error:
            return self._mend(error, [], alone=False)
        ended, _ = wait(self._running, return_when=FIRST_COMPLETED)
        finished: list[tuple[int, _Outcome]] = []
        broken: BrokenExecutor | None = None
        lost: list[int] = []
        for future in ended:
            indices = self._running.pop(future)
            try:
                finished += zip(indices, future.result(), strict=True)
            except BrokenExecutor as error:
                broken, lost = error, lost + indices
            except Exception as error:
                if len(indices) > 1:
                    self._waiting.extendleft([index] for index in reversed(indices))
                else:
                    finished.append((indices[0], _lost(error)))
        if broken is not None and finished and not isinstance(self._executor, Processes):
            self._broken = broken  # what came with it is handed on, and kept, first
            self._waiting.append(lost)
        elif broken is not None:
            finished += self._mend(broken, lost, alone=alone)
        return finished

    def _send(self, indices: list[int]) -> None:
        items = [self._items[index] for index in indices]
        self._running[self._executor.submit(_perform, self._work, items)] = indices

    def _mend(
        self, error: BrokenExecutor, lost: list[int], *, alone: bool
    ) -> list[tuple[int, _Outcome]]:
        """Go on with new processes after one has died; what was under way is done item by item.

        An item that was alone then is what killed it.
        """
        if not isinstance(self._executor, Processes):
            raise ExecutorFailed(
                f"the executor is broken ({error}); the results so far are in the store, if there "
                "is one: give a new executor and the same store"
            ) from None
        for indices in self._running.values():
            lost += indices
        self._running.clear()
        self._executor.restart()
        if alone and len(lost) == 1:
            return [(lost[0], _lost(error))]
        self._suspects.extend(sorted(lost))
        return []


def _perform(work: Work[Item, Value], items: Sequence[Item]) -> list[_Outcome]:
    """What a worker is called with."""
    return [_outcome(work, item) for item in items]


def _outcome(work: Work[Item, Value], item: Item) -> _Outcome:
    try:
        return _Outcome(answer=work.perform(item))
    except Exception as error:  # whatever it is, it is the outcome
        return _Outcome(failure=Failure(kind=type(error).__name__, text=_text(error)))


def _lost(error: Exception) -> _Outcome:
    return _Outcome(failure=Failure(kind=type(error).__name__, text=_text(error), lost=True))


def _text(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _entry(item: Any, outcome: _Outcome) -> dict[str, Any]:
    """As a store keeps it; a failure with its item."""
    if outcome.failure is None:
        return {"answer": outcome.answer}
    failure = {"kind": outcome.failure.kind, "text": outcome.failure.text}
    return {"failure": failure, "item": plain(item)}


def _from_entry(entry: Any) -> _Outcome:
    if "answer" in entry:
        return _Outcome(answer=entry["answer"])
    failure = entry["failure"]
    return _Outcome(failure=Failure(kind=str(failure["kind"]), text=str(failure["text"])))


def _done(
    work: Work[Item, Value],
    items: Sequence[Item],
    index: int,
    outcome: _Outcome,
    *,
    resumed: bool = False,
) -> Done[Item, Value]:
    item = items[index]
    value = None
    if outcome.answer is not None:
        value = work.value(item, outcome.answer)
    return Done(index=index, item=item, value=value, failure=outcome.failure, resumed=resumed)
