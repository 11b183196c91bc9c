"""The few forms of HTML that a report is made of. Every text is escaped here."""

import html
from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeAlias


class Column(NamedTuple):
    """A column of a table."""

    name: str
    hint: str = ""
    """What it is, for whoever points at it."""
    is_number: bool = False


class Meter(NamedTuple):
    """A cell with a bar that is full where a limit is reached."""

    text: str
    part: float
    """From 0 to 1; beyond, a limit is exceeded."""


class Row(NamedTuple):
    """A row of a table."""

    cells: Sequence["Cell"]
    tone: str = ""
    """"bad", "binds" or nothing."""


Cell: TypeAlias = str | Meter


def text(value: str) -> str:
    """Write a text so that nothing in it means anything to a browser."""
    return html.escape(value, quote=True)


def table(columns: Sequence[Column], rows: Iterable[Row], *, name: str) -> str:
    """Write a table, in a box that scrolls where there is too little room for it.

    name: what it is, for those who do not see it.
    """
    kinds = ["number" if column.is_number else "words" for column in columns]
    head = "".join(
        f'<th scope="col" class="{kind}"{_hint(column.hint)}>{text(column.name)}</th>'
        for column, kind in zip(columns, kinds, strict=True)
    )
    body = "\n".join(
        f'<tr class="{row.tone}">'
        + "".join(
            f'<td class="{kind}">{_cell(cell)}</td>'
            for cell, kind in zip(row.cells, kinds, strict=True)
        )
        + "</tr>"
        for row in rows
    )
    return (
        f'<div class="table" role="region" aria-label="{text(name)}" tabindex="0"><table>'
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table></div>"
    )


def pairs(rows: Iterable[tuple[str, str]]) -> str:
    """Write names with what they are beside them."""
    items = "".join(f"<dt>{text(name)}</dt><dd>{text(value)}</dd>" for name, value in rows)
    return f'<dl class="pairs">{items}</dl>'


def tile(name: str, value: str, remark: str = "", *, hint: str = "") -> str:
    """Write one figure large, with its name above and a remark below."""
    below = f'<span class="remark">{text(remark)}</span>' if remark else ""
    return (
        f'<li class="tile"{_hint(hint)}><span class="name">{text(name)}</span>'
        f'<span class="value">{text(value)}</span>{below}</li>'
    )


def points(lines: Iterable[str], *, tone: str = "") -> str:
    """Write lines as a list."""
    items = "".join(f"<li>{text(line)}</li>" for line in lines)
    return f'<ul class="points {tone}">{items}</ul>' if items else ""


def paragraph(line: str, *, tone: str = "") -> str:
    """Write a line as a paragraph."""
    return f'<p class="{tone}">{text(line)}</p>' if tone else f"<p>{text(line)}</p>"


def code(lines: str) -> str:
    """Write what is to be typed; one click marks all of it."""
    return f"<pre><code>{text(lines)}</code></pre>"


def plot(name: str, height: int, label: str) -> str:
    """Reserve a place for a plot, with what it shows in words."""
    return (
        f'<div class="plot" id="{text(name)}" style="height:{height}px" role="img" '
        f'aria-label="{text(label)}"></div>'
    )


def section(name: str, title: str, blocks: Iterable[str], lead: str = "") -> str:
    """Write a part of the page under its title."""
    below = f'<p class="lead">{text(lead)}</p>' if lead else ""
    body = "\n".join(block for block in blocks if block)
    return f'<section id="{text(name)}">\n<h2>{text(title)}</h2>{below}\n{body}\n</section>'


def _cell(cell: Cell) -> str:
    if isinstance(cell, str):
        return text(cell)
    part = min(max(cell.part, 0.0), 1.0)
    return (
        f'<span class="meter" style="--part:{100.0 * part:.1f}%" aria-hidden="true"></span>'
        f"{text(cell.text)}"
    )


def _hint(hint: str) -> str:
    return f' title="{text(hint)}"' if hint else ""
