"""What a batch has found so far, as lines of JSON in a file that outlives any interruption.

The first line says what the batch is; each further one holds one outcome with its key. A line is
written at once and reaches the disk before its outcome is handed on, so only the last one can be
incomplete: it is then cut off, and its work done again.
"""

import json
import os
from collections import defaultdict, deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

from peakflight.errors import LONGEST_QUOTE, InvalidFile, quoted
from peakflight.files import PathLike, parse_json, read_text, reason, write_atomically
from peakflight.version import __version__

HEADER = "peakflight_batch"
FORMAT = 1
"""Of the file; the value of `HEADER` in its first line."""

Entry = Mapping[str, Any]
"""One line: its `key`, and `answer` or `failure` with what else there is to say."""


class Store:
    """The file of a batch: what it held when it was opened, and a way to add to it.

    Parameters
    ----------
    path
        Created if there is no such file.
    work
        What is done, in a word.
    settings
        What all outcomes depend on beside their own problem, as plain data.
    """

    def __init__(self, path: PathLike, *, work: str, settings: Mapping[str, Any]) -> None:
        self.path = Path(path)
        self._header = {
            HEADER: FORMAT,
            "work": work,
            "version": __version__,
            # as it reads back from the file
            "settings": json.loads(json.dumps(settings)),
        }
        self._stream: BinaryIO | None = None
        self._found: dict[str, deque[Entry]] = {}

    def __enter__(self) -> Self:
        """Open the file, or create it.

        Raises
        ------
        InvalidFile
            If it cannot be read or written, is in use, damaged, or of a different batch.
        """
        if not self.path.exists() or (self.path.is_file() and self.path.stat().st_size == 0):
            write_atomically(self.path, _line(self._header))
        try:
            if self.path.is_dir():
                raise InvalidFile(f"{self.path}: is a folder; name a file in it")
            self._stream = self.path.open("ab", buffering=0)
            _lock(self._stream, self.path)
            self._read()
        except OSError as error:
            self.close()
            raise InvalidFile(f"{self.path}: cannot be written ({reason(error)})") from None
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leave the file to others."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def take(self, keys: Sequence[str]) -> list[Entry | None]:
        """What the file holds for each key; a key that comes twice has two entries, or one.

        Raises
        ------
        InvalidFile
            If the file holds an entry that is none of these.
        """
        found = {key: deque(entries) for key, entries in self._found.items()}
        taken = [found[key].popleft() if found.get(key) else None for key in keys]
        left = next((entry for entries in found.values() for entry in entries), None)
        if left is not None:
            raise InvalidFile(
                f"{self.path}: line {left['line']} is about a problem that is not in this batch; "
                "name another file for a different batch"
            )
        return taken

    def add(self, entries: Sequence[Entry]) -> None:
        """Write entries, so that they are on the disk afterwards.

        Raises
        ------
        InvalidFile
            If the disk does not take them.
        """
        if self._stream is None or not entries:
            return
        try:
            data = memoryview("".join(map(_line, entries)).encode())
            while data:
                data = data[self._stream.write(data) :]
            os.fsync(self._stream.fileno())
        except OSError as error:
            raise InvalidFile(f"{self.path}: cannot be written ({reason(error)})") from None

    def _read(self) -> None:
        text = read_text(self.path)
        lines = text.split("\n")
        self._check(lines[0])
        if len(lines) == 1:
            raise InvalidFile(f"{self.path}: line 1 has no end; name another file")
        if lines[-1]:
            self._cut_off(len(lines[-1].encode()))
        found: defaultdict[str, deque[Entry]] = defaultdict(deque)
        for number, line in enumerate(lines[1:-1], start=2):
            try:
                entry = json.loads(line)
            except ValueError:
                entry = None
            if not (
                isinstance(entry, dict)
                and isinstance(entry.get("key"), str)
                and (
                    isinstance(entry.get("answer"), dict) or isinstance(entry.get("failure"), dict)
                )
            ):
                raise InvalidFile(
                    f"{self.path}: line {number} is damaged: {quoted(line)} is no outcome of a "
                    "batch; remove the line to have its problem done again"
                )
            found[entry["key"]].append({**entry, "line": number})
        self._found = dict(found)

    def _check(self, first: str) -> None:
        """Refuse a file that is not of this batch."""
        try:
            header = parse_json(first, self.path)
        except InvalidFile:
            header = None
        if not isinstance(header, dict) or HEADER not in header:
            raise InvalidFile(f"{self.path}: is not the store of a batch; name another file")
        for name in (HEADER, "work", "version"):
            if header.get(name) != self._header[name]:
                raise InvalidFile(
                    f"{self.path}: is the store of a different batch: {_NAMES[name]} is "
                    f"{header.get(name)!r}, here {self._header[name]!r}; name another file"
                )
        stored, mine = header.get("settings"), self._header["settings"]
        if stored != mine:
            raise InvalidFile(
                f"{self.path}: is the store of a different batch: {_difference(stored, mine)}; "
                "name another file"
            )

    def _cut_off(self, count: int) -> None:
        """Remove an incomplete last line of so many bytes."""
        assert self._stream is not None
        self._stream.truncate(self.path.stat().st_size - count)


_NAMES = {HEADER: "its format", "work": "what is done", "version": "the version of peakflight"}


def _line(entry: Entry) -> str:
    return json.dumps(entry, allow_nan=False, separators=(",", ":")) + "\n"


def _difference(stored: Any, mine: Mapping[str, Any]) -> str:
    """Name the first setting that differs."""
    if not isinstance(stored, dict):
        return "it has no settings"
    for name in (*mine, *stored):
        there, here = stored.get(name), mine.get(name)
        if there != here:
            if isinstance(there, dict) and isinstance(here, dict):
                return _difference(there, here)
            return f"{name} is {_shown(there)}, here {_shown(here)}"
    return "its settings differ"


def _shown(value: Any) -> str:
    return quoted(value) if isinstance(value, str) else json.dumps(value)[:LONGEST_QUOTE]


def _lock(stream: BinaryIO, path: Path) -> None:
    """Keep other processes from adding to the same file, where the system can."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InvalidFile(f"{path}: is in use by another batch that is running") from None
    except OSError:
        with suppress(OSError):  # some network folders have no locks
            fcntl.flock(stream, fcntl.LOCK_UN)
