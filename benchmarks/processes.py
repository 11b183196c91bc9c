"""Measurements that need a process of their own."""

import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
LONGEST = 600.0
"""Seconds until a process counts as stuck."""


class ProcessFailed(Exception):
    """A process ended badly; the message is the end of what it said."""


@dataclass(frozen=True)
class Run:
    """What a process took and said."""

    wall: float
    cpu: float
    output: str


def python(arguments: Sequence[str], *, cwd: Path = ROOT, **environment: str) -> Run:
    """Run this interpreter, as a user would: with byte code kept.

    Raises
    ------
    ProcessFailed
        If it does not end well.
    """
    variables = {**os.environ, **environment}
    variables.pop("PYTHONDONTWRITEBYTECODE", None)
    before = _children()
    began = time.perf_counter()
    try:
        process = subprocess.run(
            [sys.executable, *arguments], cwd=cwd, env=variables, timeout=LONGEST,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise ProcessFailed(f"no end after {LONGEST:g} s") from None
    wall = time.perf_counter() - began
    if process.returncode != 0:
        said = (process.stderr or process.stdout).strip().splitlines() or ["it said nothing"]
        raise ProcessFailed(f"exit code {process.returncode}: {said[-1]}")
    return Run(wall, _children() - before, process.stdout)


def median(runs: Sequence[Run]) -> tuple[float, float]:
    """Median wall and CPU time."""
    return statistics.median(r.wall for r in runs), statistics.median(r.cpu for r in runs)


def _children() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
