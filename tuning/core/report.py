"""Results as tables for the terminal."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.markup import escape
from rich.table import Table

from tuning.controllers.batch import Figures
from tuning.controllers.tune import ResultRow, TuningResult
from tuning.core.files import write_csv
from tuning.road.identify import PARAMETERS, Identification


class Report(NamedTuple):
    """What a task found: tables by title, lines of text, files written."""

    tables: dict[str, list[dict[str, Any]]]
    lines: list[str]
    files: list[Path]


def identification_table(result: Identification) -> Table:
    """One row per surface: coefficients, peak, 95 % half-widths."""
    table = Table(title=f"{result.log}: the road's friction curve, +- 95 %")
    for heading in ("from [s]", "to [s]", *PARAMETERS, "peak friction", "peak slip", "method"):
        table.add_column(heading, justify="right")
    for segment in result.segments:
        cells = []
        for name in (*PARAMETERS, "peak_friction", "peak_slip"):
            value = getattr(segment, name)
            cells.append(
                f"{value:.4g} ± {value - segment.ci95[name][0]:.2g}" + ("" if segment.identifiable[name] else " ?")
            )
        table.add_row(f"{segment.start:.3f}", f"{segment.end:.3f}", *cells, segment.method)
    return table


def tuning_rows(result: TuningResult) -> list[dict[str, Any]]:
    """Distances from the pedal and their ideal; then the published quantity, which begins at the first switching."""
    sampled = f"sampled {result.config.sampled_period * 1e3:g} ms"
    return [
        {
            "km/h": row.speed_kmh,
            "road": row.road,
            "pedal [bar/s]": "-" if row.pedal_bar_s is None else f"{row.pedal_bar_s:.0f}",
            "ideal": cell(row.ideal),
            "untuned": stop_cell(row.untuned),
            "tuned": stop_cell(row.tuned),
            sampled: stop_cell(row.sampled),
            "above ideal [%]": excess_cell(row),
            "onset [s]": cell(row.tuned.onset_s),
            "cycles": row.tuned.cycles,
            "lock > 15 km/h [s]": cell(row.sampled.lock_s_above_15, 3),
            "quantity: published": cell(row.published),
            "untuned quantity": cell(row.untuned.published_quantity),
            "tuned quantity": cell(row.tuned.published_quantity),
            "<= published": {True: "yes", False: "no", None: "-"}[row.reached],
        }
        for row in result.rows
    ]


def cell(value: float | None, digits: int = 2) -> str:
    """A number, or a dash."""
    return "-" if value is None else f"{value:.{digits}f}"


def stop_cell(figures: Figures) -> str:
    """A distance from the pedal, or how the stop failed to end."""
    return cell(figures.distance) if figures.outcome == "STOPPED" else figures.outcome.lower().replace("_", " ")


def excess_cell(row: ResultRow) -> str:
    """The worse of both semantics above the ideal [%]."""
    distances = (row.tuned.distance, row.sampled.distance)
    if row.ideal is None or None in distances:
        return "-"
    return f"{100 * (max(distances) / row.ideal - 1):.2f}"


def parameter_line(result: TuningResult) -> str:
    """The tuned parameters on a line; those on a limit are marked."""
    marks = {name: "*" if name in result.on_limit else "" for name in result.parameters}
    return ", ".join(f"{name} {value:.4g}{marks[name]}" for name, value in result.parameters.items())


def cycles_line(result: TuningResult) -> str:
    """What is certified of the limit cycles, on a line."""
    if not result.cycles:
        return "it does not cycle"
    attractive = [row for row in result.cycles if row.certified]
    line = f"limit cycles: {len(attractive)} of {len(result.cycles)} roads and speeds found and attractive"
    found = [row for row in result.cycles if row.contraction is not None]
    if found:
        worst = max(found, key=lambda row: row.contraction)
        line += f", largest contraction {worst.contraction:.3g} ({worst.road}, {worst.speed_kmh:g} km/h)"
    return line.replace("_", " ")


def rows_table(rows: Sequence[Mapping[str, Any]], title: str) -> Table:
    """Rows with the same keys as a table: a key a column."""
    table = Table(title=escape(title))
    for key, value in rows[0].items():
        table.add_column(escape(key.replace("_", " ")), justify="left" if isinstance(value, str) else "right")
    for row in rows:
        table.add_row(*(value.replace("_", " ") if isinstance(value, str) else f"{value:g}" for value in row.values()))
    return table


def write_tables(report: Report, folder: Path) -> list[Path]:
    """The tables of a report as CSV, named after their titles up to a colon."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for title, rows in report.tables.items():
        name = re.sub(r"[^a-z0-9]+", "_", title.lower().split(":")[0]).strip("_")
        written.append(write_csv(rows, folder / f"{name}.csv"))
    return written
