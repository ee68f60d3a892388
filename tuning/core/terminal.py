"""What the commands print: errors in a line, progress, reports. Text from users never meets markup."""

import contextlib
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

console = Console(width=None if sys.stdout.isatty() else 140, markup=False, highlight=False)


def say(text: str) -> None:
    """Print a line as it is."""
    console.print(text, soft_wrap=True)


def say_step(text: str) -> None:
    """Print a line beneath what a command does."""
    say(f"  {text}")


@contextlib.contextmanager
def clear_errors(source: Path | None = None) -> Iterator[None]:
    """What the user can mend is said in a line, without a traceback; of a configuration with its file, `source`."""
    from tuning.core.config import ConfigError

    try:
        yield
    except (ValueError, OSError) as error:
        names_file = source is None or not isinstance(error, ConfigError) or str(source) in str(error)
        console.print("error:", style="red", end=" ")
        say(str(error) if names_file else f"{source}: {error}")
        raise typer.Exit(2) from None


@contextlib.contextmanager
def bar(label: str):
    """A progress callback (done, total, cost): a bar on a terminal, a line now and then elsewhere."""
    if console.is_terminal:
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TimeElapsedColumn(),
            TextColumn("best {task.fields[cost]:.4f}"),
        )
        with Progress(*columns, console=console) as progress:
            task = progress.add_task(escape(label), total=None, cost=float("nan"))
            yield lambda done, total, cost: progress.update(task, completed=done, total=total, cost=cost)
        return
    begun = time.monotonic()
    say(f"{label} ...")

    def line(done: int, total: int, cost: float) -> None:
        if done == 1 or done % max(1, total // 8) == 0:
            say(f"  {done}/{total}  cost {cost:.4f}  {time.monotonic() - begun:.0f} s")

    yield line


def print_report(report: Any) -> None:
    """Print the tables, lines and files of a `tuning.core.report.Report`."""
    from tuning.core.report import rows_tables

    for title, rows in report.tables.items():
        for table in rows_tables(rows, title, console.width, in_parts=console.is_terminal):
            console.print(table, crop=False)
    if report.verdict is not None:
        say(f"verdict: {report.verdict}")
    for line in (*(f"  {reason}" for reason in report.reasons), *report.lines, *report.warnings):
        say(line)
    if report.written:
        say("written: " + ", ".join(map(str, report.written)))
