"""How kernels are compiled, and where the result is kept."""

import gc
import hashlib
import logging
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numba
import numba.core.config
import numpy as np
from numpy.typing import ArrayLike

_config: Any = numba.core.config


def _cache_folder() -> str:
    """A folder that can be written to, named after the source of all kernels.

    Numba looks only at the file of the function that Python calls to see whether what it has kept
    is still right, and refuses to compile at all where it finds no folder to write to.
    """
    here = Path(__file__).parent
    digest = hashlib.sha256(b"".join(f.read_bytes() for f in sorted(here.glob("*.py"))))
    name = f"peakflight-{digest.hexdigest()[:12]}"
    if _config.CACHE_DIR:
        return str(Path(_config.CACHE_DIR) / name)
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    for folder in (here / "__pycache__", home):
        try:
            (folder / name).mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder / name, os.W_OK):
            _forget_old(folder, name)
            return str(folder / name)
    return tempfile.mkdtemp(prefix=f"{name}-")


def _forget_old(folder: Path, name: str) -> None:
    """Remove what was compiled from other sources, if it has not been touched for a week."""
    for other in folder.glob("peakflight-*"):
        with suppress(OSError):
            if other.name != name and time.time() - other.stat().st_mtime > WEEK:
                shutil.rmtree(other)


WEEK = 7 * 86400.0
FOLDER = _cache_folder()
"""Where compiled kernels are kept."""


def _compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    def decorate(function: Callable[..., Any]) -> Any:
        others = _config.CACHE_DIR
        _config.CACHE_DIR = FOLDER
        try:
            return numba.njit(cache=True, error_model="numpy", **options)(function)
        finally:
            _config.CACHE_DIR = others

    return decorate


_INNER = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}

kernel = _compiled(nogil=True, no_cfunc_wrapper=True)
"""Decorator of every kernel that Python calls; other threads run meanwhile."""
inner = _compiled(**_INNER)
"""Decorator of kernels that only kernels call: no entry point from Python, less to compile."""
within = _compiled(**_INNER, inline="always")
"""As `inner`, for what has one caller and is large: it is written into the caller. Compiled by
itself first, it and all that it calls would go through the optimiser once more at every level."""
vector = _compiled(**_INNER, fastmath={"reassoc", "contract", "nsz"})
"""As `inner`, for loops over samples: sums may be taken in any order. NaN and infinity stay."""


_ready: set[str] = set()


@contextmanager
def announced(name: str, log: logging.Logger) -> Iterator[None]:
    """Around the use of kernels: says so when they must be compiled first, once on a machine.

    `name` tells one set of kernels from others; a mark beside the cache remembers it.
    """
    if name in _ready or _config.DISABLE_JIT:
        yield
        return
    if is_ready(name):
        yield
    else:
        log.warning("compiling the planner for this machine, once; this takes some seconds")
        with _hurried():
            yield
    _mark(name).touch()
    _ready.add(name)


def is_ready(name: str) -> bool:
    """Whether a set of kernels has been compiled on this machine, or never will be."""
    return name in _ready or bool(_config.DISABLE_JIT) or _mark(name).exists()


def _mark(name: str) -> Path:
    return Path(FOLDER) / f"{name}.ready"


@contextmanager
def _hurried() -> Iterator[None]:
    """Compiles sooner, to code as fast.

    Without collection of cyclic garbage: the compiler makes millions of objects, of which little is
    garbage. And at LLVM's second level of optimisation in place of the third (`docs/benchmarks.md`
    has what that is worth). A level in NUMBA_OPT stays.
    """
    enabled = gc.isenabled()
    level = _config.OPT
    gc.disable()
    if "NUMBA_OPT" not in os.environ:
        _config.OPT = type(level)(SECOND_LEVEL)
    try:
        yield
    finally:
        _config.OPT = level
        if enabled:
            gc.enable()


SECOND_LEVEL = 2


def fresh(array: ArrayLike) -> np.ndarray:
    """Copy to the one kind of array that kernels are compiled for."""
    return np.array(array, dtype=np.float64, order="C", copy=True)
