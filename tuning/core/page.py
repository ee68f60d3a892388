"""The report of a run as one page of HTML that needs nothing else: figures lie in it, all text is escaped."""

import base64
import json
import math
import platform
import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import jinja2

from tuning.core.about import About
from tuning.core.call import CALL, Call
from tuning.core.files import write_whole
from tuning.core.report import Report, table_name
from tuning.core.version import VERSION

MOST_ROWS = 40
"""Of a table that are shown; the CSV has them all."""
CONFIGURED = ("config", "wheel", "car")
"""Entries of a result that say what it was made with."""
MEANINGS = {
    "sound": "What was found goes with the data; nothing speaks against it.",
    "nothing looks wrong": "Which says that the data hold together, not that they are right.",
    "doubtful": "Something in the data looks wrong, or does not go with the rest. To be used with care, because:",
    "refuted": "The data contradict what was found. It should not be used, because:",
}
"""Of the verdicts that commands give."""
COLOURS = {
    "sound": "good",
    "nothing looks wrong": "good",
    "certified": "good",
    "every row passed": "good",
    "doubtful": "care",
    "refuted": "bad",
    "NOT certified": "bad",
    "rows failed": "bad",
}
"""Of a box, by how a verdict begins."""
LIBRARIES = ("jax", "jaxlib", "numpy", "scipy")
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
NUMBER = re.compile(r"[-+−–±<>≤≥~]*\s*(\.?\d|nan$|inf$|$)", re.IGNORECASE)
ENVIRONMENT = jinja2.Environment(
    loader=jinja2.PackageLoader("tuning.core", "."),
    autoescape=True,
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)


class Shown(NamedTuple):
    """A table as the page has it."""

    title: str
    caption: str
    columns: list[tuple[str, bool]]
    """names, and whether they hold numbers"""
    rows: list[list[str]]
    note: str
    """what was left out, and where it is"""


class Picture(NamedTuple):
    """A figure as the page has it."""

    name: str
    caption: str
    source: str


class Part(NamedTuple):
    """One report of the run."""

    lines: Sequence[str]
    tables: list[Shown]
    pictures: list[Picture]


def write_page(
    path: Path, reports: Sequence[Report], about: About | None = None, seconds: float = 0.0, *, ended: bool = True
) -> Path:
    """Write the page of a run; one that is there is replaced.

    Args:
        path: of the page, in the folder of the run.
        reports: what the run found, in order; their figures are read from `files`.
        about: what the command says of itself; its help if None.
        seconds: how long it took.
        ended: whether there is no more to come.
    """
    call = CALL.get() or Call("", "", "", {})
    about = about or About(call.command or "report", call.purpose)
    files = [file for report in reports for file in report.written]
    configurations = _configurations(reports, path.parent)
    text = ENVIRONMENT.get_template("report.html").render(
        about=about,
        call=call,
        date=datetime.now().astimezone().strftime("%d %B %Y, %H:%M %Z"),
        took=f"{seconds / 60:.0f} min" if seconds >= 120 else f"{seconds:.0f} s",
        meanings=MEANINGS,
        colours=COLOURS,
        verdicts=[report for report in reports if report.verdict is not None],
        warnings=[said for report in reports for said in report.warnings],
        interrupted=any(report.interrupted for report in reports),
        ended=ended,
        parts=[_part(report, about, path.parent) for report in reports],
        configurations=configurations,
        versions={"absjax": VERSION, "Python": platform.python_version()} | {n: version(n) for n in LIBRARIES},
        seeds=_seeds(reports, configurations),
        files=[_within(file, path.parent) for file in files],
    )
    return write_whole(path, text)


def shown(value: Any) -> str:
    """A value as text for a reader."""
    if hasattr(value, "item"):
        value = value.item()
    if value is None or value in ("", [], (), {}):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}" if math.isfinite(value) else str(value)
    if isinstance(value, list | tuple) and not any(isinstance(entry, Mapping | list | tuple) for entry in value):
        return ", ".join(map(shown, value))
    if isinstance(value, Mapping | list | tuple):
        value = json.dumps(value, ensure_ascii=False, default=str)
    return CONTROL.sub("\ufffd", str(value))


ENVIRONMENT.filters["shown"] = shown


def _part(report: Report, about: About, folder: Path) -> Part:
    pictures = [
        Picture(_within(file, folder), about.caption(file.name) or file.stem.replace("_", " "), _embedded(file))
        for file in report.files
        if file.suffix == ".png"
    ]
    return Part(report.lines, [_table(title, rows, about) for title, rows in report.tables.items()], pictures)


def _table(title: str, rows: Sequence[Mapping[str, Any]], about: About) -> Shown:
    cells = [[shown(value) for value in row.values()] for row in rows[:MOST_ROWS]]
    columns = [(shown(name), all(NUMBER.match(row[i]) is not None for row in cells)) for i, name in enumerate(rows[0])]
    file = f"tables/{table_name(title)}.csv"
    note = f"{MOST_ROWS} of {len(rows)} rows; all of them are in {file}" if len(rows) > MOST_ROWS else ""
    return Shown(title, about.caption(title), columns, cells, note)


def _embedded(file: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(file.read_bytes()).decode()


def _within(file: Path, folder: Path) -> str:
    return str(file.relative_to(folder) if file.is_relative_to(folder) else file)


def _configurations(reports: Sequence[Report], folder: Path) -> dict[str, Mapping[str, Any]]:
    """What the results of a run were made with, by result and entry."""
    results = [pair for report in reports for pair in report.results.items()]
    return {
        f"{key}, of {_within(file, folder)}": data[key]
        for file, data in results
        for key in CONFIGURED
        if isinstance(data.get(key), dict)
    }


def _seeds(reports: Sequence[Report], configurations: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    found = {name: config["seed"] for name, config in configurations.items() if "seed" in config}
    for report in reports:
        found |= report.seeds
    return found
