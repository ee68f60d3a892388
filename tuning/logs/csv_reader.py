"""Tables of text: separator, decimal sign, encoding and header are found, not asked for.

A line is of the table if at least half of its cells are numbers and it is as wide as most such lines. The line of text
above the first is the header; where two such lines follow each other and the lower one holds units, those are the
units. Whatever stands above is left out: loggers write there what car and driver were.
"""

import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from tuning.logs.recording import MISSING, LogError, Recording, table_recording
from tuning.logs.units import is_unit

LOOKED_AT = 300
"""Lines at either end from which separator and decimal sign are found."""
MARKS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))
COMMENT = ("#", "//", "%")
NUMBER = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"),
    ",": re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?"),
}
INSTANT = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d.*|(\d+:)?\d+:\d\d([.,]\d+)?")
"""A date with a time, or hours, minutes and seconds."""


class Dialect(NamedTuple):
    """How a table of text is written."""

    separator: str
    decimal: str
    width: int
    """cells of a line"""


def read_csv(path: Path) -> Recording:
    """A table of text as it stands: comma, semicolon, tabulator, bar or blanks between its cells.

    Raises:
        LogError: naming file and row, if it is not a table with a header.
    """
    lines = _lines(path)
    filled = [i for i, line in enumerate(lines) if line.strip(" \t;,|") and not line.isspace()]
    if not filled:
        raise LogError(f"{path}: the file is empty")
    plain = [i for i in filled if not lines[i].lstrip().startswith(COMMENT)]
    looked_at = plain if len(plain) <= 2 * LOOKED_AT else plain[:LOOKED_AT] + plain[-LOOKED_AT:]
    dialect = _dialect([lines[i] for i in looked_at])
    if dialect is None:
        if len(plain) == 1:
            raise LogError(f"{path}: a header and no samples")
        raise LogError(f"{path}: not a table of separated values: no header with lines of numbers below it")
    first = _first(lines, plain, dialect)
    names, units, above = _header(path, lines, filled, plain, first, dialect)
    body = plain[first:]
    header = {lines[i].strip() for i in above}
    rows = [i for i in body if lines[i].strip() not in header]
    notes = []
    if len(rows) < len(body):
        notes.append(f"the header stands {len(body) - len(rows)} more times in between; left out")
    rows = _checked(path, lines, rows, len(names), dialect, notes)
    text = "\n".join(lines[i] for i in rows)
    separator = r"\s+" if dialect.separator == " " else dialect.separator
    try:
        table = pd.read_csv(
            io.StringIO(text),
            sep=separator,
            header=None,
            names=range(len(names)),
            dtype=str,
            na_filter=False,
            skipinitialspace=True,
            index_col=False,
        )
    except (pd.errors.ParserError, pd.errors.EmptyDataError) as error:
        raise LogError(f"{path}: not a table of separated values: {error}") from None
    if len(table) != len(rows):
        raise LogError(f"{path}: not a table of separated values: a quotation mark is never closed")
    used = [k for k, name in enumerate(names) if name]
    table = pd.DataFrame(table[used]).set_axis([names[k] for k in used], axis=1)
    numbers = np.asarray(rows, int) + 1
    return table_recording(
        path, table, units=[units[k] for k in used], rows=numbers, decimal=dialect.decimal, notes=notes
    )


def _lines(path: Path) -> list[str]:
    """The lines of a text; a last one that is empty is none."""
    data = path.read_bytes()
    marked = next((name for mark, name in MARKS if data.startswith(mark)), None)
    if marked is None and data[:400].count(0) > 0.4 * len(data[:400]):
        marked = "utf-16-be" if data[0] == 0 else "utf-16-le"
    try:
        text = data.decode(marked or "utf-8")
    except UnicodeDecodeError:
        if marked:
            raise LogError(f"{path}: not a table of text: {marked} does not decode it") from None
        text = data.decode("latin-1")
    if "\0" in text:
        raise LogError(f"{path}: not a table of text: it holds bytes that are zero")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line, without quotation marks and blanks around them."""
    if separator == " ":
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]


def _numeric(cells: Sequence[str], decimal: str) -> int:
    return sum(bool(NUMBER[decimal].fullmatch(cell) or INSTANT.fullmatch(cell)) for cell in cells)


def _is_data(cells: Sequence[str], decimal: str) -> bool:
    """Whether a line may be of the table: half of what it says are numbers; all of it, if it has but two cells."""
    told = [cell for cell in cells if cell.lower() not in MISSING]
    share = _numeric(told, decimal) / len(told) if told else 0.0
    return share == 1.0 if len(cells) <= 2 else share >= 0.5


def _dialect(lines: Sequence[str]) -> Dialect | None:
    """The way of writing in which most numbers are found; None if there is no line of any."""
    best, found, tables = (0, 0, 0), None, []
    for separator in (",", ";", "\t", "|", " "):
        table = [cells_of(line, separator) for line in lines]
        # Separators that no line has leave the same table.
        if table in tables:
            continue
        tables.append(table)
        for decimal in (".", ","):
            data = [cells for cells in table if _is_data(cells, decimal)]
            if not data:
                continue
            width, often = Counter(map(len, data)).most_common(1)[0]
            count = sum(_numeric(cells, decimal) for cells in data if len(cells) == width)
            score = (count, often, -width)
            if score > best:
                best, found = score, Dialect(separator, decimal, width)
    return found


def _belongs(line: str, dialect: Dialect) -> bool:
    cells = cells_of(line, dialect.separator)
    return len(cells) == dialect.width and _is_data(cells, dialect.decimal)


def _first(lines: Sequence[str], plain: Sequence[int], dialect: Dialect) -> int:
    """Position, among the lines, of the first of the table; one with a bad cell above belongs to it."""
    at = next(k for k, i in enumerate(plain) if _belongs(lines[i], dialect))
    while at > 1:
        cells = cells_of(lines[plain[at - 1]], dialect.separator)
        if len(cells) != dialect.width or not 2 * _numeric(cells, dialect.decimal) >= max(2, dialect.width - 1):
            break
        at -= 1
    return at


def _header(path: Path, lines, filled, plain, first: int, dialect: Dialect):
    """Names and units of the columns, and the lines they stand in."""
    above = plain[max(0, first - 2) : first]
    if not above:
        comments = [i for i in filled if i < plain[first]][-1:]
        stripped = [lines[i].lstrip().lstrip("#/%").strip() for i in comments]
        if not stripped or len(cells_of(stripped[0], dialect.separator)) != dialect.width:
            raise LogError(
                f"{path}, row {plain[first] + 1}: numbers, and no header above them; "
                "a line with the names of the columns is needed"
            )
        return _padded(cells_of(stripped[0], dialect.separator), dialect.width), [""] * dialect.width, comments
    rows = [cells_of(lines[i], dialect.separator) for i in above]
    width = max(dialect.width, len(rows[-1]))
    paired = len(above) == 2 and above[1] == above[0] + 1 and len(rows[0]) > 1
    told = [cell for cell in rows[-1] if cell]
    if paired and abs(len(rows[0]) - len(rows[1])) <= 1 and all(map(is_unit, told)) and not all(map(is_unit, rows[0])):
        units = [cell.strip("[]() ") for cell in rows[1]]
        return _padded(rows[0], width), _padded(units, width), above
    return _padded(rows[-1], width), [""] * width, above[-1:]


def _padded(cells: list[str], width: int) -> list[str]:
    return cells + [""] * (width - len(cells))


def _checked(path: Path, lines, rows: list[int], width: int, dialect: Dialect, notes: list[str]) -> list[int]:
    """The rows, each as wide as the header but for empty cells at its end; a last one that was cut off left out."""
    separator = dialect.separator
    for k, i in enumerate(rows):
        line = lines[i]
        plain = separator != " " and '"' not in line
        count = line.count(separator) + 1 if plain else len(cells_of(line, separator))
        if count > width and any(cells_of(line, separator)[width:]):
            raise LogError(
                f"{path}, row {i + 1}: not a table of separated values: {count} cells, the header has {width}"
            )
        if count < min(width, dialect.width):
            if k == len(rows) - 1 and k:
                notes.append(f"the last line, row {i + 1}, is cut off; left out")
                return rows[:-1]
            raise LogError(
                f"{path}, row {i + 1}: not a table of separated values: {count} cells, the header has {width}"
            )
    return rows
