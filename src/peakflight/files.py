"""Reading and writing files so that nothing is ever half written and every error names its file."""

import json
import os
import tempfile
from pathlib import Path
from typing import Any, TypeAlias

from peakflight.errors import InvalidFile

PathLike: TypeAlias = str | os.PathLike[str]


def read_text(path: PathLike) -> str:
    """The text of a file.

    Raises
    ------
    InvalidFile
        If it is missing, a folder, unreadable, empty or not UTF-8.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InvalidFile(f"{path}: no such file") from None
    except IsADirectoryError:
        raise InvalidFile(f"{path}: is a folder; name a file in it") from None
    except UnicodeDecodeError as error:
        raise InvalidFile(f"{path}: byte {error.start} is not UTF-8 text") from None
    except (OSError, ValueError) as error:
        raise InvalidFile(f"{path}: cannot be read ({reason(error)})") from None
    if not text.strip():
        raise InvalidFile(f"{path}: the file is empty")
    return text


def write_atomically(path: PathLike, content: str | bytes) -> None:
    """Write to a temporary file in the same folder, then rename it over `path`.

    Raises
    ------
    InvalidFile
        If the folder is missing or cannot be written to, or `path` is a folder.
    """
    path = Path(path)
    data = content.encode() if isinstance(content, str) else content
    temporary = None
    try:
        if path.is_dir():
            raise InvalidFile(f"{path}: is a folder; name a file in it")
        with tempfile.NamedTemporaryFile(
            dir=path.parent, prefix=f".{path.name}.", delete=False
        ) as stream:
            temporary = Path(stream.name)
            stream.write(data)
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except OSError as error:
        raise InvalidFile(f"{path}: cannot be written ({reason(error)})") from None
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def prepare_folder(path: PathLike) -> Path:
    """Create the folder `path` if need be and make sure that files can be written in it.

    Raises
    ------
    InvalidFile
        If it is a file, or cannot be created or written to.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except FileExistsError:
        raise InvalidFile(f"{folder}: is a file; name a folder for the output") from None
    except OSError as error:
        raise InvalidFile(f"{folder}: cannot be written to ({reason(error)})") from None
    return folder


def read_json(path: PathLike, what: str = "") -> Any:
    """The value that a JSON file holds; numbers must be finite.

    what: the file should be, for messages.

    Raises
    ------
    InvalidFile
        As `read_text`, or if it is not JSON.
    """
    return parse_json(read_text(path), path, what)


def parse_json(text: str, path: PathLike, what: str = "") -> Any:
    """The value of JSON `text`; `path`, and what it should be, are named in errors."""
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        rule = f", which {what} is" if what else ""
        line = f"{path}: line {error.lineno} is not JSON ({error.msg}){rule}"
        raise InvalidFile(line) from None
    except RecursionError:
        raise InvalidFile(f"{path}: is not JSON that can be read (nested too deeply)") from None
    except ValueError as error:
        raise InvalidFile(f"{path}: {error}") from None


def write_json(path: PathLike, value: Any) -> None:
    """Store `value` as JSON that reads back without loss."""
    write_atomically(path, json_text(value))


def json_text(value: Any) -> str:
    """The JSON of `value`, in a line."""
    return json.dumps(value, allow_nan=False) + "\n"


def _refuse_constant(name: str) -> float:
    raise ValueError(f"the number {name} is not finite")


def reason(error: Exception) -> str:
    """What went wrong with a file, as the system says it."""
    return (getattr(error, "strerror", None) or str(error)).lower()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
