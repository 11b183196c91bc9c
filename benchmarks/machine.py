"""Where and with what a run was made."""

import os
import platform
import subprocess
import sys
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = (
    "peakflight", "numpy", "scipy", "numba", "llvmlite", "matplotlib", "spline-trajectory",
    "minsnap-trajectories", "rotorpy", "cvxopt", "toppra", "drake",
)  # fmt: skip


@dataclass(frozen=True)
class Machine:
    """One machine at one time."""

    date: str
    processor: str
    cores: int
    memory_gib: float
    system: str
    python: str
    commit: str
    versions: dict[str, str]

    @property
    def line(self) -> str:
        """In one line."""
        known = ", ".join(f"{name} {number}" for name, number in self.versions.items() if number)
        return (
            f"{self.date}; {self.processor}, {self.cores} cores, {self.memory_gib:.1f} GiB; "
            f"{self.system}; Python {self.python}; commit {self.commit}; {known}"
        )


def describe() -> Machine:
    """What this machine is, now."""
    return Machine(
        date=datetime.now(UTC).isoformat(timespec="seconds"),
        processor=_processor(),
        cores=os.cpu_count() or 0,
        memory_gib=_memory(),
        system=f"{platform.system()} {platform.release()} {platform.machine()}",
        python=platform.python_version(),
        commit=_commit(),
        versions={name: _version(name) for name in PACKAGES},
    )


def load() -> list[float]:
    """Processes waiting for a core, on average over 1, 5 and 15 minutes."""
    return [round(value, 2) for value in os.getloadavg()] if hasattr(os, "getloadavg") else []


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or sys.platform
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _memory() -> float:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    except (AttributeError, ValueError, OSError):
        return 0.0


def _commit() -> str:
    try:
        answer = subprocess.run(
            ["git", "describe", "--always", "--dirty"],
            capture_output=True, text=True, check=True, cwd=Path(__file__).parent,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return answer.stdout.strip()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""
