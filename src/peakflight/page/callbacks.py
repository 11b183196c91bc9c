"""Callbacks of widgets: they hand on what people do, never what the page sets itself."""

from collections.abc import Callable
from typing import Any

Callback = Callable[[Any], Any]


def with_value(deed: Callable[[Any], None]) -> Callback:
    """A callback that hands on the new value."""

    async def callback(event: Any) -> None:
        if event.client is not None:
            deed(event.target.value)

    return callback


def with_client(deed: Callable[[Any], None]) -> Callback:
    """A callback that hands on who it was."""

    async def callback(event: Any) -> None:
        if event.client is not None:
            deed(event.client)

    return callback


def alone(deed: Callable[[], None]) -> Callback:
    """A callback that hands on nothing: that it happened is all."""
    return with_client(lambda _: deed())
