"""Values as plain data, always written alike, and the keys made of it."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.result import Plan

KEY_LENGTH = 32
"""Hexadecimal digits of a key: no two of 1e15 different values are expected to share one."""
OF_THE_RUN = ("iterations", "wall_time_s", "version", "message", "history")
"""Entries of a plan that say how it was found, not what it is."""


def plain(value: Any) -> Any:
    """A value as numbers, texts, lists and mappings, the same for equal values.

    Raises
    ------
    InvalidProblem
        If it holds something that cannot be told from others of its kind, such as a function.
    """
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Plan):
        entries = value.to_dict()
        return {name: entries[name] for name in entries if name not in OF_THE_RUN}
    if hasattr(value, "to_dict"):
        return plain(value.to_dict())
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: plain(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, Mapping):
        return {str(name): plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    raise InvalidProblem(
        f"{value!r} is of type {type(value).__name__}, which a store cannot tell from others"
    )


def key_of(value: Any) -> str:
    """A name for a value: the same in every process, another for every other value."""
    text = json.dumps(plain(value), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:KEY_LENGTH]
