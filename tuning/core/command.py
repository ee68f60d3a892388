"""What the commands of the command line share: options, checks before work begins, and reports after it."""

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tuning.core.about import About
from tuning.core.interruption import INTERRUPTED, answered, interruptible, keeping
from tuning.core.terminal import bar, clear_errors, print_report, say

if TYPE_CHECKING:
    from tuning.core.report import Report

__all__ = ["Force", "Out", "Resume", "carry_out", "configuration", "journal_path", "say", "tune", "tuned"]

Out = Annotated[Path, typer.Option("--out", help="Folder for results and figures; made if missing.")]
Force = Annotated[bool, typer.Option("--force", help="Write into a folder that holds another run.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with the run in the folder, to the identical result.")]
Work = Callable[[], tuple[Sequence[Path | None], Callable[[], Any]]]
"""Says which files it reads, and gives what makes a report, or reports as they come."""
Run = Callable[[Any, Any], Any]
"""Makes a report, from where to tell of its progress and the journal it keeps."""
GO_ON = "; go on with --resume"


def carry_out(
    out: Path,
    work: Work,
    *,
    about: About | None = None,
    source: Path | None = None,
    force: bool = False,
    resume: bool | None = None,
) -> None:
    """Do the work of a command: checked before it begins, what it finds printed and reported, errors said in a line.

    Its tables are written as CSV, and all there is into one page, `report.html`.

    Args:
        about: what the command says of itself on that page; its help if None.
        source: the file of the configuration, for messages.
        resume: whether the run in the folder goes on; None of a command whose runs cannot.
    """
    with clear_errors(source), interruptible():
        from tuning.core.compilation import drop_if_many
        from tuning.core.files import require_folder

        kept, more = _Kept(out, about), True
        try:
            inputs, run = work()
            require_folder(out, inputs, force=force, resume=bool(resume))
            found = run()
            more = isinstance(found, Iterator)
            for report in found if isinstance(found, Iterator) else (found,):
                kept.add(report, ended=not more)
                print_report(kept.reports[-1])
                drop_if_many()
                if report.interrupted:
                    break
            if more:
                more = False
                kept.write(ended=True)
        except KeyboardInterrupt as interruption:
            if kept.reports:
                kept.write(ended=True, interrupted=more)
            what = f"; {'what came before' if more else 'all of it'} is on a page: {kept.page}" if kept.reports else ""
            begun = more and resume is not None and GO_ON in getattr(interruption, "__notes__", ())
            say(f"interrupted{what}{GO_ON if begun else ''}")
            raise typer.Exit(INTERRUPTED) from None
        say(f"done in {time.monotonic() - kept.begun:.0f} s; all of it on a page: {kept.page}")
        if kept.reports[-1].interrupted:
            say(f"interrupted: this is the best there is{'' if resume is None else GO_ON}")
            raise typer.Exit(INTERRUPTED)


class _Kept:
    """What a run has found, in its folder: tables, the page, and last the results that the page tells of."""

    def __init__(self, out: Path, about: About | None):
        self.out, self.about, self.page, self.begun = out, about, out / "report.html", time.monotonic()
        self.reports: list[Report] = []
        self._unwritten: dict[Path, Any] = {}

    def add(self, report: "Report", *, ended: bool) -> None:
        """Keep a further report."""
        self.reports.append(report)
        self._unwritten |= report.results
        self.write(ended=ended)

    def write(self, *, ended: bool, interrupted: bool = False) -> None:
        """Write what is not written yet, and the page anew.

        Args:
            ended: whether there is no more to come.
            interrupted: whether the last report is what an interruption has left.
        """
        from tuning.core.files import write_json
        from tuning.core.page import write_page
        from tuning.core.report import write_tables

        last = self.reports[-1]
        files = dict.fromkeys([*last.files, *write_tables(last, self.out / "tables")])
        self.reports[-1] = last._replace(files=list(files), interrupted=last.interrupted or interrupted)
        # A run that is killed leaves no result without its page.
        for path in self._unwritten:
            path.unlink(missing_ok=True)
        write_page(self.page, self.reports, self.about, time.monotonic() - self.begun, ended=ended)
        for path, data in list(self._unwritten.items()):
            write_json(path, data)
            del self._unwritten[path]


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
    journal = Journal(journal_path(out), identity, resume=resume)

    def kept() -> str:
        if not journal.begun:
            return "nothing is found yet"
        what = "the best set by then is judged and written" if answered() else "no result is written"
        return f"{what}; every evaluation is kept in {journal.path}"

    label = f"{command}: {wanted.rounds} iterations and generations, {wanted.starts} starts"
    try:
        with keeping(kept), bar(label) as progress:
            return run(progress, journal)
    except KeyboardInterrupt as interruption:
        if journal.begun:
            interruption.add_note(GO_ON)
        raise


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
