"""Results as tables for the terminal."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.markup import escape
from rich.table import Table

from tuning.identify import PARAMETERS, Identification
from tuning.tune_abs import TuningResult


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


def tuning_table(result: TuningResult, title: str) -> Table:
    """One row per road and speed: published, untuned, tuned, sampled, ideal."""
    table = Table(title=title)
    period = f"{result.config.sampled_period * 1e3:g} ms"
    for heading in (
        "km/h",
        "road",
        "published",
        "untuned",
        "tuned",
        f"sampled {period}",
        "ideal",
        "cycles",
        "<= published",
    ):
        table.add_column(heading, justify="left" if heading == "road" else "right")
    for row in result.rows:
        verdict = {True: "yes", False: "[red]no[/red]", None: "-"}[row.reached]
        table.add_row(
            f"{row.speed_kmh:g}",
            row.road.replace("_", " "),
            _distance(row.published),
            _distance(row.untuned),
            _distance(row.tuned, row.outcome),
            _distance(row.sampled, row.sampled_outcome),
            f"{row.ideal:.2f}",
            f"{row.cycles}",
            verdict,
        )
    return table


def _distance(distance: float | None, outcome: str = "STOPPED") -> str:
    return ("-" if distance is None else f"{distance:.2f}") + ("" if outcome == "STOPPED" else f" {outcome.lower()}")


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
