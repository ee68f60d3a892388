"""`tune-observer`, `observer-study`: gains of observers of XBS tuned, and studied."""

from pathlib import Path
from typing import Annotated

import typer

from tuning.core.command import Force, Out, Resume, carry_out, configuration, journal_path
from tuning.core.terminal import bar


def tune_observer(
    out: Out,
    config: Annotated[
        Path | None, typer.Option(help="JSON, see `tuning.observers.config.ObserverConfig`; or a result to go on from.")
    ] = None,
    observer: Annotated[
        str | None,
        typer.Option(help="constant, known_road, unknown_road, adaptive, module:Class; overrides the config."),
    ] = None,
    log: Annotated[
        Path | None, typer.Option(help="Tune on this brake log with measured force instead of simulated runs.")
    ] = None,
    columns: Annotated[
        str | None, typer.Option(help="SIGNAL=COLUMN[:UNIT], comma-separated, where the log's differ.")
    ] = None,
    car: Annotated[
        Path | None, typer.Option(help="JSON with the log's wheel; the one beside the log if missing.")
    ] = None,
    resume: Resume = False,
    force: Force = False,
) -> None:
    """Gains of an observer of XBS with their certificate: result.json and figures."""

    def work():
        from tuning.core.journal import Journal
        from tuning.observers.config import ObserverConfig
        from tuning.observers.tasks import log_bench_of, tune, tune_on_log

        data = configuration(config, out, resume=resume)
        if observer is not None and isinstance(data, dict):
            data = {**data, "observer": observer}
        wanted = ObserverConfig.from_json(data)
        identity = {"command": "tune-observer", "config": wanted.to_json(), "log": None if log is None else str(log)}

        def run():
            with bar(f"{wanted.observer} observer: {wanted.iterations} iterations, {wanted.starts} starts") as progress:
                if log is None:
                    return tune(wanted, out, progress, Journal(journal_path(out), identity, resume=resume))
                task = log_bench_of(wanted, log, columns, car)
                return tune_on_log(task, out, progress, Journal(journal_path(out), identity, resume=resume))

        return (config, log, car), run

    carry_out(out, work, source=config, force=force, resume=resume)


def observer_study(out: Out, force: Force = False) -> None:
    """Default gains against tuned: settling, noise, wrong speed, a rig log, tracking; tables and figures."""

    def work():
        from tuning.observers.tasks import study

        return (), lambda: study(out)

    carry_out(out, work, force=force)
