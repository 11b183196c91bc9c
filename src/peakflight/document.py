"""A document of sections, with text, tables and pictures, as Markdown and as one page of HTML.

In texts `code` stands between backticks; whatever else would mean something to Markdown or HTML is
escaped. The page of HTML holds its pictures itself and asks nothing of any other place.
"""

import base64
import html
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeAlias

RIGHT = ">"
"""A column whose name begins with it is set to the right."""


@dataclass(frozen=True, kw_only=True)
class Table:
    """Cells in rows under names."""

    title: str
    columns: tuple[str, ...]
    """Those of numbers begin with >."""
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A PNG with what it shows."""

    name: str
    """Of its file beside the Markdown, without .png."""
    caption: str
    png: bytes


@dataclass(frozen=True)
class Points:
    """A list of texts, each with its own dot."""

    texts: tuple[str, ...]


Block: TypeAlias = str | Points | Table | Picture
"""A string is a paragraph."""


@dataclass(frozen=True)
class Section:
    """Blocks under a heading."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, kw_only=True)
class Document:
    """A title, what it is in a few words, and sections."""

    title: str
    lead: str
    sections: tuple[Section, ...]


def as_code(text: str) -> str:
    """Mark a text as code, for the texts of a document."""
    return f"`{' '.join(text.replace('`', chr(39)).split())}`"


def as_markdown(document: Document) -> str:
    """Write the document as Markdown; pictures are files beside it."""
    parts = [f"# {_markdown_text(document.title)}", _markdown_text(document.lead)]
    for section in document.sections:
        parts.append(f"## {_markdown_text(section.title)}")
        parts += [_markdown(block) for block in section.blocks]
    return "\n\n".join(parts) + "\n"


def as_html(document: Document) -> str:
    """Write the document as one page of HTML that needs no other file."""
    body = [f"<h1>{_html_text(document.title)}</h1>", f"<p>{_html_text(document.lead)}</p>"]
    for section in document.sections:
        body.append(f"<h2>{_html_text(section.title)}</h2>")
        body += [_html(block) for block in section.blocks]
    title = html.escape(document.title.replace("`", ""))
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(body)
        + "\n</body>\n</html>\n"
    )


STYLE = """\
body { max-width: 60rem; margin: 2rem auto 4rem; padding: 0 1.2rem; color: #1f1f1f;
  background: #fff; font: 16px/1.55 system-ui, -apple-system, "Segoe UI", sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.25; margin-bottom: 0.6rem; }
h2 { font-size: 1.25rem; margin-top: 2.6rem; padding-top: 0.8rem; border-top: 1px solid #d4d4d4; }
p, li { max-width: 46rem; }
li { margin-bottom: 0.35rem; }
code { font: 0.9em ui-monospace, Menlo, Consolas, monospace; background: #f4f4f4;
  padding: 0.05em 0.3em; border-radius: 3px; }
figure { margin: 1.6rem 0; }
figure img { display: block; max-width: 100%; height: auto; }
figcaption { max-width: 46rem; font-size: 0.9rem; color: #555; margin-top: 0.4rem; }
.table { overflow-x: auto; margin: 1.4rem 0; }
table { border-collapse: collapse; font-size: 0.92rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding-bottom: 0.4rem; }
th, td { padding: 0.3rem 1.1rem 0.3rem 0; text-align: left; vertical-align: top; }
th { font-weight: 500; color: #555; border-bottom: 1px solid #767676; }
td { border-bottom: 1px solid #e6e6e6; }
.number { text-align: right; white-space: nowrap; }
"""


def _markdown(block: Block) -> str:
    if isinstance(block, str):
        return _markdown_text(block)
    if isinstance(block, Points):
        return "\n".join(f"- {_markdown_text(text)}" for text in block.texts)
    if isinstance(block, Picture):
        caption = _markdown_text(block.caption)
        return f"![{_markdown_text(block.name.replace('-', ' '))}]({block.name}.png)\n\n{caption}"
    rule = ["---:" if name.startswith(RIGHT) else "---" for name in block.columns]
    names = [_markdown_text(name.removeprefix(RIGHT)) for name in block.columns]
    rows = [names, rule, *([_markdown_text(cell) for cell in row] for row in block.rows)]
    lines = "\n".join(f"| {' | '.join(cells)} |" for cells in rows)
    return f"**{_markdown_text(block.title)}**\n\n{lines}"


def _html(block: Block) -> str:
    if isinstance(block, str):
        return f"<p>{_html_text(block)}</p>"
    if isinstance(block, Points):
        return f"<ul>\n{_tagged('li', block.texts)}\n</ul>"
    if isinstance(block, Picture):
        data = base64.b64encode(block.png).decode("ascii")
        caption = _html_text(block.caption)
        alt = html.escape(block.name.replace("-", " "))
        return (
            f'<figure>\n<img alt="{alt}" src="data:image/png;base64,{data}">\n'
            f"<figcaption>{caption}</figcaption>\n</figure>"
        )
    classes = [' class="number"' if name.startswith(RIGHT) else "" for name in block.columns]

    def row(tag: str, cells: Iterable[str]) -> str:
        pairs = zip(classes, cells, strict=True)
        return "".join(f"<{tag}{kind}>{_html_text(cell)}</{tag}>" for kind, cell in pairs)

    head = row("th", (name.removeprefix(RIGHT) for name in block.columns))
    body = "\n".join(f"<tr>{row('td', cells)}</tr>" for cells in block.rows)
    return (
        f'<div class="table"><table>\n<caption>{_html_text(block.title)}</caption>\n'
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table></div>"
    )


def _tagged(tag: str, texts: Iterable[str]) -> str:
    return "\n".join(f"<{tag}>{_html_text(text)}</{tag}>" for text in texts)


def _markdown_text(text: str) -> str:
    return _inline(text, lambda plain: re.sub(r"([\\*_\[\]<>|#])", r"\\\1", plain), "`{}`".format)


def _html_text(text: str) -> str:
    return _inline(text, html.escape, lambda code: f"<code>{html.escape(code)}</code>")


def _inline(text: str, plain: Callable[[str], str], code: Callable[[str], str]) -> str:
    """Write what stands between backticks, and what does not, each in its own way."""
    parts = text.split("`")
    return "".join(code(part) if index % 2 else plain(part) for index, part in enumerate(parts))
