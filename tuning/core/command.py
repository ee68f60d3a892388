"""What the commands of the command line share: options, checks before work begins, and reports after it."""

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from tuning.core.about import About
from tuning.core.interruption import INTERRUPTED, interruptible, keeping
from tuning.core.terminal import bar, clear_errors, print_report, say

__all__ = ["Force", "Out", "Resume", "carry_out", "configuration", "journal_path", "say", "tune", "tuned"]

Out = Annotated[Path, typer.Option("--out", help="Folder for results and figures; made if missing.")]
Force = Annotated[bool, typer.Option("--force", help="Write into a folder that holds another run.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with the run in the folder, to the identical result.")]
Work = Callable[[], tuple[Sequence[Path | None], Callable[[], Any]]]
"""Says which files it reads, and gives what makes a report, or reports as they come."""
Run = Callable[[Any, Any], Any]
"""Makes a report, from where to tell of its progress and the journal it keeps."""


def carry_out(
    out: Path,
    work: Work,
    *,
    about: About | None = None,
    source: Path | None = None,
    force: bool = False,
    resume: bool = False,
) -> None:
    """Do the work of a command: checked before it begins, what it finds printed and reported, errors said in a line.

    Its tables are written as CSV, and all there is into one page, `report.html`.

    Args:
        about: what the command says of itself on that page; its help if None.
        source: the file of the configuration, for messages.
    """
    with clear_errors(source), interruptible():
        from tuning.core.compilation import drop_if_many
        from tuning.core.files import require_folder, write_json
        from tuning.core.page import write_page
        from tuning.core.report import write_tables

        begun, reports, page = time.monotonic(), [], out / "report.html"

        def told(*, ended: bool) -> None:
            write_page(page, reports, about, time.monotonic() - begun, ended=ended)

        try:
            inputs, run = work()
            require_folder(out, inputs, force=force, resume=resume)
            found = run()
            for report in found if isinstance(found, Iterator) else (found,):
                reports.append(report._replace(files=[*report.files, *write_tables(report, out / "tables")]))
                # A run that is killed leaves a result with the page that tells of it, or none.
                for path in report.results:
                    path.unlink(missing_ok=True)
                told(ended=found is report)
                for path, data in report.results.items():
                    write_json(path, data)
                print_report(reports[-1])
                drop_if_many()
                if report.interrupted:
                    break
            told(ended=True)
        except KeyboardInterrupt:
            if reports:
                reports[-1] = reports[-1]._replace(interrupted=True)
                told(ended=True)
            more = f"; what came before is on a page: {page}" if reports else ""
            say(f"interrupted{more}" + ("; go on with --resume" if journal_path(out).exists() else ""))
            raise typer.Exit(INTERRUPTED) from None
        say(f"done in {time.monotonic() - begun:.0f} s; all of it on a page: {page}")
        if reports[-1].interrupted:
            say("interrupted: this is the best there is; go on with --resume")
            raise typer.Exit(INTERRUPTED)


def tune(
    command: str,
    out: Path,
    path: Path | None,
    load: Callable[[], tuple[Any, Callable[[Any], Run]]],
    *,
    about: About | None = None,
    changes: dict[str, Any] | None = None,
    inputs: dict[str, Path | None] | None = None,
    resume: bool = False,
    force: bool = False,
) -> None:
    """Do the work of a command that tunes.

    Args:
        command: its name.
        path: of the configuration.
        load: gives the class of the configuration, and what prepares a run of one; imports what they need.
        about: what the command says of itself in its report.
        changes: entries of the command line that override those of the file.
        inputs: further files the run is of, by name.
    """

    def work():
        kind, prepare = load()
        data = configuration(path, out, resume=resume)
        if changes and isinstance(data, dict):
            data = {**data, **changes}
        wanted = kind.from_json(data)
        run, of = (
            prepare(wanted),
            {name: None if file is None else str(file) for name, file in (inputs or {}).items()},
        )
        return (path, *(inputs or {}).values()), lambda: tuned(command, wanted, out, run, of=of, resume=resume)

    carry_out(out, work, about=about, source=path, force=force, resume=resume)


def tuned(
    command: str, wanted: Any, out: Path, run: Run, *, of: dict[str, Any] | None = None, resume: bool = False
) -> Any:
    """Report of a run of a configuration, with its journal in the folder and its progress on the terminal.

    Args:
        of: what else the run is of, for the journal.
    """
    from tuning.core.journal import Journal

    identity = {"command": command, "config": wanted.to_json(), **(of or {})}
    journal, searching = Journal(journal_path(out), identity, resume=resume), True

    def kept() -> str:
        if not journal.begun:
            return "nothing is found yet"
        what = "the best set by then, if there is one, is judged and written" if searching else "no result is written"
        return f"{what}; every evaluation is kept in {journal.path} for --resume"

    with (
        keeping(kept),
        bar(f"{command}: {wanted.rounds} iterations and generations, {wanted.starts} starts") as progress,
    ):

        def told(done: int, total: int, cost: float) -> None:
            nonlocal searching
            searching = done < total
            progress(done, total, cost)

        return run(told, journal)


def journal_path(out: Path) -> Path:
    """Where a run keeps its journal."""
    return out / "journal"


def configuration(path: Path | None, out: Path | None = None, *, resume: bool = False) -> Any:
    """What a configuration file holds, nothing without one; a result goes on from its parameters.

    Resumed without a file, it is that of the run in `out`.

    Raises:
        ValueError: if the file is not JSON, or there is no run to resume.
    """
    from tuning.core.files import read_json

    if resume and path is None and out is not None:
        from tuning.core.journal import identity_of

        return identity_of(journal_path(out))["config"]
    data = {} if path is None else read_json(path)
    if isinstance(data, dict) and "parameters" in data and "config" in data:
        if not isinstance(data["config"], dict):
            raise ValueError(f"{path}: config is a dictionary, not {type(data['config']).__name__}")
        data = {**data["config"], "start": data["parameters"]}
    return data
