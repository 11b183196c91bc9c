"""Courses in YAML: `start`, `waypoints` and `end`; `initial`, `gates` and `end`; and the like."""

import re
from collections.abc import Iterator
from typing import Any

from peakflight.course import Course
from peakflight.errors import InvalidFile, MissingExtra, PeakflightError
from peakflight.files import PathLike
from peakflight.formats.tree import Entries, Items, Tree, course_from
from peakflight.numerals import as_number

DEEPEST = 32
"""Levels of lists and mappings that are followed; a course has four."""
WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}
"""What plain words mean that are not text."""

_BEGINNING = re.compile(r"""---|%YAML|\{|-(?:\s|$)|[A-Za-z_][\w .-]*+:|["'][\w .-]*+["']\s*+:""")


def recognises(text: str) -> bool:
    """Whether the first line that is neither empty nor a comment begins as YAML does."""
    lines = (line.strip() for line in text.split("\n"))
    first = next((line for line in lines if line and not line.startswith("#")), "")
    return _BEGINNING.match(first) is not None


def read(text: str, path: PathLike) -> Course:
    """The course in YAML `text`; the forms are those of `peakflight.formats.tree`.

    Raises
    ------
    InvalidFile
        If it is not YAML or holds no course; the message names line, key and rule.
    InvalidProblem
        If the values are against a rule of `Course`.
    MissingExtra
        If PyYAML is not installed.
    """
    return course_from(Tree(parse(text, path), path))


def parse(text: str, path: PathLike) -> Any:
    """The value of YAML `text`: numbers, text, lists and mappings; `path` is named in errors.

    Raises
    ------
    InvalidFile
        If it is not YAML, or more than one document; the message names the line.
    MissingExtra
        If PyYAML is not installed.
    """
    try:
        import yaml
    except ImportError:
        raise MissingExtra(
            f"{path}: reading YAML needs PyYAML: pip install 'peakflight[cli]'"
        ) from None
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        return _Builder(yaml.parse(text, Loader=loader), path).document()
    except PeakflightError:
        raise
    except (yaml.YAMLError, ValueError) as error:  # the second from broken escapes
        raise InvalidFile(f"{path}: {_wrong(text, error)}") from None


def _wrong(text: str, error: Exception) -> str:
    """What a parser's error says, with the line that it knows or that its character is in."""
    line = ""
    if mark := getattr(error, "problem_mark", None):
        line = f"line {mark.line + 1} "
    elif character := getattr(error, "character", None):
        line = f"line {text.partition(chr(character))[0].count(chr(10)) + 1} "
    reason = getattr(error, "problem", None) or getattr(error, "reason", None) or error
    return f"{line}is not YAML ({reason})"


class _Builder:
    """Makes values of parser events.

    PyYAML's own composer recurses as deep as the file says, until the interpreter crashes. Here
    depth is bounded, and an alias is the value it names, not a copy.
    """

    def __init__(self, events: Iterator[Any], path: PathLike) -> None:
        self._events = events
        self._path = path
        self._anchors: dict[str, Any] = {}

    def document(self) -> Any:
        """The value of the only document."""
        next(self._events)  # the stream starts
        next(self._events)  # the document starts
        value = self._value(next(self._events), 0)
        next(self._events)  # the document ends
        event = next(self._events)
        if type(event).__name__ != "StreamEndEvent":
            raise self._error(event, "a second document begins; a file holds one")
        return value

    def _value(self, event: Any, depth: int) -> Any:
        kind = type(event).__name__
        if kind == "AliasEvent":
            if event.anchor not in self._anchors:
                raise self._error(event, f"*{event.anchor} names nothing that is complete by here")
            return self._anchors[event.anchor]
        value: Any
        if kind == "ScalarEvent":
            value = _scalar(event)
        elif depth == DEEPEST:
            raise self._error(event, f"is nested more than {DEEPEST} levels deep")
        elif kind == "SequenceStartEvent":
            value = self._items(depth + 1)
        else:
            value = self._entries(depth + 1)
        if event.anchor is not None:
            self._anchors[event.anchor] = value
        return value

    def _items(self, depth: int) -> Items:
        items = Items()
        for event in self._events:
            if type(event).__name__ == "SequenceEndEvent":
                break
            items.lines.append(event.start_mark.line + 1)
            items.append(self._value(event, depth))
        return items

    def _entries(self, depth: int) -> Entries:
        entries = Entries()
        for event in self._events:
            if type(event).__name__ == "MappingEndEvent":
                break
            self._value(event, depth)
            value = self._value(next(self._events), depth)
            if type(event).__name__ != "ScalarEvent":
                continue  # such a key is none of a course's
            if event.value in entries:
                raise self._error(event, f"key {event.value!r} is given a second time")
            entries.lines[event.value] = event.start_mark.line + 1
            entries[event.value] = value
        return entries

    def _error(self, event: Any, message: str) -> InvalidFile:
        return InvalidFile(f"{self._path}: line {event.start_mark.line + 1}: {message}")


def _scalar(event: Any) -> float | str | bool | None:
    """A number, text, or one of `WORDS`; what is in quotes is text."""
    text: str = event.value
    if event.style:
        return text
    try:
        return as_number(text)
    except ValueError:
        return WORDS.get(text.lower(), text)
