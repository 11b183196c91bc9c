"""What commands print: tables for people, one JSON object for machines."""

import json
import sys
from collections.abc import Iterable, Sequence
from typing import Any

import click

NARROWEST, WIDEST = 80, 100
"""Columns that output is laid out for, whatever the terminal has."""
STYLES = {"good": "bold green", "bad": "bold red", "title": "bold", "plain": ""}
UNITS = ("m", "m/s", "m/s^2")
"""Of position, velocity and acceleration."""


class Printout:
    """Lines and tables, gathered and then printed at once.

    Colours are for terminals only; the tables read the same without them.
    """

    def __init__(self) -> None:
        from rich.console import Console

        self._console = Console(file=sys.stdout, highlight=False, markup=False, emoji=False)
        self._console.width = min(max(self._console.width, NARROWEST), WIDEST)
        self._console.begin_capture()

    def line(self, text: str = "", style: str = "plain") -> None:
        """Add a line of text, wrapped at words."""
        self._console.print(text, style=STYLES[style])

    def path(self, text: str) -> None:
        """Add a line that is not to be wrapped."""
        self._console.print(text, soft_wrap=True)

    def pairs(self, rows: Iterable[tuple[str, str]]) -> None:
        """Add names with what they are beside them."""
        from rich.table import Table

        table = Table.grid(padding=(0, 2))
        for name, value in rows:
            table.add_row(f"  {name}", value)
        self._console.print(table)

    def table(
        self, title: str, columns: Sequence[str], rows: Iterable[Sequence[str] | None]
    ) -> None:
        """Add a table; columns whose names begin with > are set to the right, None is a gap."""
        from rich import box
        from rich.table import Table

        table = Table(
            box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0), header_style=STYLES["plain"]
        )
        for column in columns:
            right = column.startswith(">")
            table.add_column(
                column.removeprefix(">"), justify="right" if right else "left", no_wrap=right
            )
        for row in rows:
            cells = ["..."] * len(columns) if row is None else row
            exceeded = row is not None and "exceeded" in row
            table.add_row(*cells, style=STYLES["bad"] if exceeded else None)
        self.line()
        self.line(title, "title")
        self._console.print(table)

    def show(self) -> None:
        """Print everything."""
        lines = self._console.end_capture().split("\n")
        click.echo("\n".join(line.rstrip(" ") for line in lines), nl=False)


def print_json(value: Any) -> None:
    """Print one JSON object on a line."""
    click.echo(json.dumps(value, allow_nan=False))


def amounts(values: Iterable[float]) -> str:
    """Print sizes of position, velocity and acceleration, as many as there are."""
    return ", ".join(f"{value:.1e} {unit}" for value, unit in zip(values, UNITS, strict=False))
