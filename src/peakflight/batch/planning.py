"""Many plans: the planner on every problem of a batch."""

from collections.abc import Generator, Iterable, Mapping
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass, fields, replace
from typing import Any

from peakflight import methods
from peakflight.batch.run import Done, Failure, run
from peakflight.errors import InvalidProblem
from peakflight.files import PathLike
from peakflight.kernels import jit
from peakflight.planner import plan
from peakflight.problem import Problem
from peakflight.result import Plan


@dataclass(frozen=True, eq=False, kw_only=True)
class BatchResult:
    """What became of one problem of a batch: a plan, or a failure."""

    index: int
    """Of the problem in the batch, from 0."""
    problem: Problem
    plan: Plan | None = None
    """Feasible or not, as its report says; None if planning ended in an error."""
    failure: Failure | None = None
    """Why there is no plan."""
    resumed: bool = False
    """It was in the store from an earlier run."""

    @property
    def feasible(self) -> bool:
        """Whether there is a plan that is proven to keep every limit."""
        return self.plan is not None and self.plan.feasible


def plan_many(
    problems: Iterable[Problem],
    *,
    method: str = methods.DEFAULT_METHOD,
    settings: Any = None,
    executor: Executor | None = None,
    workers: int | None = None,
    chunk: int | None = None,
    store: PathLike | None = None,
    **options: Any,
) -> Generator[BatchResult, None, None]:
    """Plan many problems by one method, on all processors or on a cluster.

    Results come as they are done, in any order; `index` says of which problem. What fails is a
    result too, and never ends the batch. Plans are those of `plan`, bit for bit but for
    `wall_time_s`, unless the method has a `time_limit`; their `memory` is left behind.

    Parameters
    ----------
    problems
        What to plan.
    method, settings
        As of `plan`.
    executor
        Any `concurrent.futures.Executor`, such as that of a Dask client
        (`client.get_executor()`); it is not shut down. None for processes of this machine.
    workers
        How many processes, without an executor; None for as many as there are processors. With 1,
        all is planned in this process.
    chunk
        Problems that are sent together; None for some sixty parts, of up to 16 problems.
    store
        File of JSON lines that keeps every result. If it holds results of this batch, these come
        first and are not planned again, so that an interrupted batch goes on where it was.
    options
        Any field of the settings, such as `pieces` or `effort` of method joint.

    Raises
    ------
    InvalidProblem
        At once, if an argument or setting is against a rule, or an entry is not a `Problem`.
    InvalidFile
        When results are asked for: if the store cannot be read or written, or is of a different
        batch.
    ExecutorFailed
        Likewise: if the executor is broken. Results so far are in the store.
    """
    module = methods.find(method)
    known = {one.name for one in fields(module.Settings)}
    if unknown := set(options) - known:
        raise InvalidProblem(
            f"unknown option {min(unknown)!r}; method {method} has {', '.join(sorted(known))}"
        )
    if settings is None:
        settings = module.Settings(**options)
    elif not isinstance(settings, module.Settings):
        raise InvalidProblem(
            f"settings is {settings!r}; method {method} takes its own Settings "
            f"(peakflight.methods.{method}.Settings)"
        )
    else:
        settings = replace(settings, **options)  # type: ignore[type-var]
    problems = list(problems)
    for index, problem in enumerate(problems):
        if not isinstance(problem, Problem):
            raise InvalidProblem(
                f"problem {index} is of type {type(problem).__name__}; it must be a "
                "peakflight.Problem"
            )
    done = run(
        Planning(method, settings),
        problems,
        executor=executor,
        workers=workers,
        chunk=chunk,
        store=store,
    )
    return _results(done)


@dataclass(frozen=True, eq=False)
class Planning:
    """The work of `plan_many`."""

    method: str
    tuning: Any
    """Settings of the method."""
    name = "plan"

    @property
    def settings(self) -> Mapping[str, Any]:
        """Method and its settings."""
        return {"method": self.method, "settings": self.tuning}

    def perform(self, problem: Problem) -> dict[str, Any]:
        """Plan it."""
        return plan(problem, method=self.method, settings=self.tuning).to_dict()

    def value(self, problem: Problem, answer: dict[str, Any]) -> Plan:
        """The plan, as it reads from its file."""
        del problem
        return Plan.from_dict(answer)

    def first(self, problem: Problem) -> str:
        """The kernels that have to be compiled for it."""
        try:
            name = methods.find(self.method).kernels(problem, self.tuning)
        except InvalidProblem:  # which is for the outcome to say
            return ""
        return "" if jit.is_ready(name) else name


def _results(
    done: Generator[Done[Problem, Plan], None, None],
) -> Generator[BatchResult, None, None]:
    with closing(done):
        for one in done:
            yield BatchResult(
                index=one.index,
                problem=one.item,
                plan=one.value,
                failure=one.failure,
                resumed=one.resumed,
            )
