"""Results as tables."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

from rich.cells import cell_len
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


def rows_tables(rows: Sequence[Mapping[str, Any]], title: str, room: int, *, in_parts: bool = True) -> list[Table]:
    """Rows with the same keys as tables, a key a column, in which no word is cut.

    Args:
        room: characters there are in a line.
        in_parts: whether columns that find no room go into further tables, each of which begins with the columns that
            tell the rows apart; else lines are as long as the longest words ask for.
    """
    columns = [_Column(key, [row.get(key) for row in rows]) for key in rows[0]]
    if not in_parts:
        return [_table(columns, title, max(room, _least_width(columns)))]
    first = _telling(columns)
    parts = [columns[: first + 1]]
    for column in columns[first + 1 :]:
        if _least_width([*parts[-1], column]) <= room:
            parts[-1].append(column)
        else:
            parts.append([*columns[:first], column])
    return [_table(part, title if part is parts[0] else f"{title}, continued", room) for part in parts]


class _Column:
    """A column of a table: heading, cells, and the characters it takes."""

    def __init__(self, key: str, values: Sequence[Any]):
        self.heading, self.cells = key.replace("_", " "), [_shown(value) for value in values]
        self.justify: Literal["left", "right"] = "left" if isinstance(values[0], str) else "right"
        texts = [self.heading, *self.cells]
        self.least = max((cell_len(word) for text in texts for word in text.split()), default=1)
        self.most = max(map(cell_len, texts))

    def within(self, most: int) -> int:
        """Its width where none is to be wider, longest words apart."""
        return max(self.least, min(self.most, most))


def _telling(columns: Sequence[_Column]) -> int:
    """The first columns, as many as tell the rows apart; the first where none do."""
    cells = [column.cells for column in columns]
    apart = (n for n in range(1, len(cells)) if len(set(zip(*cells[:n]))) == len(cells[0]))
    return next(apart, 1)


def _width(columns: Sequence[_Column], widths: Sequence[int]) -> int:
    """Of a table with columns of these widths, with its frame."""
    return sum(widths) + 3 * len(columns) + 1


def _least_width(columns: Sequence[_Column]) -> int:
    return _width(columns, [column.least for column in columns])


def _table(columns: Sequence[_Column], title: str, room: int) -> Table:
    """A table, its widest columns made narrower down to their longest word where there is no room for them."""
    most = max(column.most for column in columns)
    while most > 0 and _width(columns, [column.within(most) for column in columns]) > room:
        most -= 1
    widths = [column.within(most) for column in columns]
    table = Table(title=Text(title), width=_width(columns, widths))
    for column, width in zip(columns, widths):
        table.add_column(Text(column.heading), justify=column.justify, width=width, overflow="fold")
    for cells in zip(*(column.cells for column in columns)):
        table.add_row(*map(Text, cells))
    return table


def _shown(value: Any) -> str:
    """A value as a cell; a dash for none."""
    if isinstance(value, str):
        return value.replace("_", " ")
    return "-" if value is None else f"{value:g}"


def table_name(title: str) -> str:
    """Of its file, after the title up to a colon."""
    return re.sub(r"[^a-z0-9]+", "_", title.lower().split(":")[0]).strip("_")[:LONGEST_NAME] or "table"


def write_tables(report: Report, folder: Path) -> list[Path]:
    """The tables of a report as CSV, named after their titles."""
    folder.mkdir(parents=True, exist_ok=True)
    return [write_csv(rows, folder / f"{table_name(title)}.csv") for title, rows in report.tables.items()]
