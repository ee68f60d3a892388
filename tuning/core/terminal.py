"""What the commands print: errors in a line, progress, reports."""

import contextlib
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

console = Console(width=None if sys.stdout.isatty() else 140)


@contextlib.contextmanager
def clear_errors() -> Iterator[None]:
    """What the user can mend is said in a line, without a traceback."""
    try:
        yield
    except (ValueError, OSError) as error:
        console.print(f"[red]error:[/red] {error}", highlight=False, soft_wrap=True)
        raise typer.Exit(2) from None


@contextlib.contextmanager
def bar(label: str):
    """A progress callback (done, total, cost): a bar on a terminal, a line now and then elsewhere."""
    if console.is_terminal:
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TimeElapsedColumn(),
            TextColumn("worst {task.fields[cost]:.4f}"),
        )
        with Progress(*columns, console=console) as progress:
            task = progress.add_task(label, total=None, cost=float("nan"))
            yield lambda done, total, cost: progress.update(task, completed=done, total=total, cost=cost)
        return
    begun = time.monotonic()
    console.print(f"{label} ...")

    def line(done: int, total: int, cost: float) -> None:
        if done == 1 or done % max(1, total // 8) == 0:
            console.print(f"  {done}/{total}  cost {cost:.4f}  {time.monotonic() - begun:.0f} s")

    yield line


def print_study(reports, out: Path) -> None:
    """Print the reports of a study as they come, their tables written as CSV besides."""
    from tuning.core.report import write_tables

    begun = time.monotonic()
    for report in reports:
        print_report(report._replace(files=[*report.files, *write_tables(report, out / "tables")]))
    console.print(f"done in {time.monotonic() - begun:.0f} s; open the figures in {out}/", highlight=False)


def print_report(report) -> None:
    from tuning.core.report import rows_table

    for title, rows in report.tables.items():
        console.print(rows_table(rows, title))
    for line in report.lines:
        console.print(line, highlight=False)
    if report.files:
        console.print("written: " + ", ".join(map(str, report.files)), highlight=False, soft_wrap=True)
