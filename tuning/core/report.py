"""Results as tables."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.table import Table
from rich.text import Text

from tuning.core.files import write_csv

LONGEST_NAME = 100
"""Characters of a table's file."""


class Report(NamedTuple):
    """What a task found: tables by title, lines of text, files written."""

    tables: dict[str, list[dict[str, Any]]]
    lines: list[str]
    files: list[Path]
    interrupted: bool = False
    """whether it was ended from the keyboard"""
    verdict: str | None = None
    """in a word, whether what was found can be trusted; None where nothing is judged"""
    reasons: Sequence[str] = ()
    """of the verdict"""
    warnings: Sequence[str] = ()
    """lines that whoever uses what was found should have read"""
    seeds: Mapping[str, Any] = {}
    """of random numbers, by what is drawn, where no configuration has them"""
    results: Mapping[Path, Mapping[str, Any]] = {}
    """what is written as JSON once the page that tells of it is there, by its file"""

    @property
    def written(self) -> list[Path]:
        """All its files."""
        return [*self.files, *self.results]


def cell(value: float | None, digits: int = 2) -> str:
    """A number, or a dash."""
    return "-" if value is None else f"{value:.{digits}f}"


def rows_table(rows: Sequence[Mapping[str, Any]], title: str) -> Table:
    """Rows with the same keys as a table: a key a column."""
    table = Table(title=Text(title))
    for key, value in rows[0].items():
        table.add_column(Text(key.replace("_", " ")), justify="left" if isinstance(value, str) else "right")
    for row in rows:
        table.add_row(*map(_shown, row.values()))
    return table


def _shown(value: Any) -> Text | str:
    """A value as a cell; a dash for none."""
    if isinstance(value, str):
        return Text(value.replace("_", " "))
    return "-" if value is None else f"{value:g}"


def table_name(title: str) -> str:
    """Of its file, after the title up to a colon."""
    return re.sub(r"[^a-z0-9]+", "_", title.lower().split(":")[0]).strip("_")[:LONGEST_NAME] or "table"


def write_tables(report: Report, folder: Path) -> list[Path]:
    """The tables of a report as CSV, named after their titles."""
    folder.mkdir(parents=True, exist_ok=True)
    return [write_csv(rows, folder / f"{table_name(title)}.csv") for title, rows in report.tables.items()]
