"""Tables of figures with a bar and a verdict beside each, as Markdown and as JSON."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.machine import Machine
from benchmarks.scope import Scope

Cell = str | float | int | bool | None
Column = tuple[str, str]
"""Key of a cell, and the format of its numbers."""


@dataclass(kw_only=True)
class Row:
    """One line of a table."""

    cells: dict[str, Cell]
    """Column to value, numbers unrounded."""
    bar: str = ""
    """What the figure should be, in words; empty if there is no bar."""
    met: bool | None = None
    """Whether it is; None without a bar. A failure with a bar is False."""
    note: str = ""
    """Why it failed, or what to know."""


@dataclass(kw_only=True)
class Table:
    """One table, printed and stored."""

    title: str
    columns: Sequence[Column]
    rows: list[Row]
    note: str = ""
    """Below the title: what the figures are."""
    about: dict[str, Any] = field(default_factory=dict)
    """Of the run: duration, load of the machine."""


def judged(cells: dict[str, Cell], key: str, most: float, bar: str, note: str = "") -> Row:
    """A row whose figure `key` should be `most` at most; a missing figure does not meet it."""
    value = cells.get(key)
    met = isinstance(value, int | float) and math.isfinite(value) and value <= most
    return Row(cells=cells, bar=bar, met=bool(met), note=note)


def failure(cells: dict[str, Cell], error: object, bar: str = "") -> Row:
    """A row for what could not be measured."""
    text = f"{type(error).__name__}: {error}" if isinstance(error, Exception) else str(error)
    return Row(cells=cells, bar=bar, met=False if bar else None, note=f"failed: {_short(text)}")


def in_words(seconds: float) -> str:
    """A time with the unit that suits it."""
    size = abs(seconds)
    if size >= 1.0:
        return f"{seconds:.3g} s"
    return f"{1e3 * seconds:.4g} ms" if size >= 1e-3 else f"{1e6 * seconds:.4g} us"


def as_markdown(table: Table) -> str:
    """A table with a verdict in each row."""
    keys = [key for key, _ in table.columns]
    head = [*keys, "bar", "verdict", "note"]
    lines = [
        [_format(row.cells.get(key), form) for key, form in table.columns] for row in table.rows
    ]
    body = [
        [*line, row.bar, _verdict(row), row.note]
        for line, row in zip(lines, table.rows, strict=True)
    ]
    used = [i for i in range(len(head)) if i < len(keys) or any(line[i] for line in body)]
    widths = [max(len(line[i]) for line in [head, *body]) for i in range(len(head))]

    def draw(line: Sequence[str]) -> str:
        return "| " + " | ".join(line[i].ljust(widths[i]) for i in used) + " |"

    rule = "|" + "|".join("-" * (widths[i] + 2) for i in used) + "|"
    text = [f"## {table.title}\n"]
    if table.note:
        text.append(f"{table.note}\n")
    return "\n".join([*text, draw(head), rule, *(draw(line) for line in body), ""])


def missed(tables: Sequence[Table]) -> str:
    """How many bars are met, and the ones that are not."""
    rows = [(table, row) for table in tables for row in table.rows if row.met is not None]
    lines = [f"## {sum(row.met is True for _, row in rows)} of {len(rows)} bars met\n"]
    for table, row in rows:
        if not row.met:
            cells = (_format(row.cells.get(key), form) for key, form in table.columns)
            line = f"- not met: {table.title}: {' '.join(filter(None, cells))} (bar {row.bar})"
            lines.append(f"{line}; {row.note}" if row.note else line)
    return "\n".join(lines)


def write_json(
    path: Path, machine: Machine, scope: Scope, tables: Sequence[Table], crashes: Sequence[str]
) -> None:
    """Everything that was printed, with all digits."""
    values = {
        "machine": asdict(machine),
        "scope": scope.name,
        "crashes": list(crashes),
        "tables": [
            {
                "title": table.title,
                "note": table.note,
                "about": table.about,
                "rows": [asdict(row) for row in table.rows],
            }
            for table in tables
        ],
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(_finite(values), indent=1, allow_nan=False) + "\n")


def _verdict(row: Row) -> str:
    return "" if row.met is None else "met" if row.met else "not met"


def _format(value: Cell, form: str) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else format(value, form)


def _short(text: str) -> str:
    text = " ".join(text.replace("|", "/").split())
    return text if len(text) <= 200 else f"{text[:200]}..."


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
