"""The folder that a command fills: all of its files together, or none."""

import re
import shutil
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self
from uuid import uuid4

from peakflight.errors import InvalidFile
from peakflight.files import PathLike, prepare_folder, reason

LONGEST_NAME = 80
"""Characters of a course's name in that of its folder or files."""

_ODD = re.compile(r"[^\w.+-]+")
"""What does not belong in the name of a folder or file on every system."""


class OutputFolder:
    """Gathers files out of sight, and moves them into a folder when all are complete.

    Made before the work whose results it takes, so that a folder that cannot be written to is
    found at once. When an error ends the work, the files that are complete are kept; when the user
    does, nothing is, and neither is a folder that was not there before.

    Raises
    ------
    InvalidFile
        If the folder cannot be made or written to.
    """

    def __init__(self, path: PathLike) -> None:
        self.path = Path(path)
        self.stage = self.path / f".peakflight-{uuid4().hex[:12]}"
        """Where files are written until all are complete."""
        self._made: list[Path] = []

    def __enter__(self) -> Self:
        folders = (self.path, *self.path.parents)
        try:
            self._made = [folder for folder in folders if not folder.exists()]
            prepare_folder(self.path)
            self.stage.mkdir()
        except OSError as error:
            self._tidy_up()
            raise InvalidFile(f"{self.path}: cannot be written to ({reason(error)})") from None
        except BaseException:
            self._tidy_up()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        staged = str(self.stage)
        try:
            if error is None or isinstance(error, Exception):
                self._publish()
        finally:
            self._tidy_up()
        if isinstance(error, InvalidFile) and staged in str(error):
            raise InvalidFile(str(error).replace(staged, str(self.path))) from None

    def published(self, name: str) -> Path:
        """Where a file will be."""
        return self.path / name

    def _publish(self) -> None:
        for staged in sorted(self.stage.iterdir()):
            target = self.published(staged.name)
            try:
                staged.replace(target)
            except OSError as error:
                raise InvalidFile(f"{target}: cannot be written ({reason(error)})") from None

    def _tidy_up(self) -> None:
        """Remove what is not complete, and folders that were made for nothing."""
        shutil.rmtree(self.stage, ignore_errors=True)
        for folder in self._made:
            with suppress(OSError):
                folder.rmdir()


def folder_for(course: str) -> Path:
    """Where the plan of a course goes unless the user says otherwise: in the current folder."""
    return Path(f"{file_name(course)}-plan")


def file_name(course: str) -> str:
    """What a file or folder of a course may be called on every system."""
    return _ODD.sub("-", course).strip("-.")[:LONGEST_NAME] or "course"
