"""What a command reads is not what it writes."""

from collections.abc import Sequence
from pathlib import Path

from peakflight.errors import InvalidFile


def keep_inputs(path: Path, plans: Sequence[Path]) -> None:
    """Refuse to write a file over a plan that is read.

    Raises
    ------
    InvalidFile
        If `path` is one of them, by whatever name.
    """
    try:
        is_input = path.exists() and any(path.samefile(plan) for plan in plans)
    except OSError:  # no file that could be lost; writing says why
        return
    if is_input:
        raise InvalidFile(f"{path}: is the plan itself; name another file with -o")
