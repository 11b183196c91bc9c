"""How kernels are compiled: sooner the first time, and with nothing left behind."""

import gc
import logging

import numba
import pytest
from numba.core import config

from peakflight.kernels import jit

LOG = logging.getLogger("test")


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setattr(jit, "FOLDER", str(tmp_path))
    monkeypatch.setattr(jit, "_ready", set())
    monkeypatch.setattr(config, "DISABLE_JIT", 0)
    monkeypatch.delenv("NUMBA_OPT", raising=False)


def test_the_first_compilation_is_announced_and_hurried_once(empty_cache, caplog):
    before = config.OPT
    for first in (True, False):
        caplog.clear()
        with jit.announced("some kernels", LOG):
            assert gc.isenabled() is not first
            assert (jit.SECOND_LEVEL if first else before) == config.OPT
        assert bool(caplog.records) is first
        assert gc.isenabled()
        assert config.OPT is before
    assert jit.is_ready("some kernels")


def test_what_fails_to_compile_leaves_the_compiler_as_it_was_and_is_not_ready(empty_cache):
    before = config.OPT
    with pytest.raises(numba.TypingError), jit.announced("some kernels", LOG):
        numba.njit(lambda: undefined)()  # noqa: F821
    assert gc.isenabled()
    assert config.OPT is before
    assert not jit.is_ready("some kernels")


def test_a_level_that_the_user_asks_for_stays(empty_cache, monkeypatch):
    monkeypatch.setenv("NUMBA_OPT", "3")
    before = config.OPT
    with jit.announced("some kernels", LOG):
        assert config.OPT is before
