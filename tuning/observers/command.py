"""`tune-observer`, `observer-study`: gains of observers of XBS tuned, and studied."""

from pathlib import Path
from typing import Annotated

import typer

from tuning.core.command import Force, Out, Resume, carry_out, tune
from tuning.observers.about import OBSERVER_STUDY, TUNE_OBSERVER


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

    def load():
        from tuning.observers import tasks
        from tuning.observers.config import ObserverConfig

        def prepare(wanted):
            if log is None:
                return lambda progress, journal: tasks.tune(wanted, out, progress, journal)
            task = tasks.log_bench_of(wanted, log, columns, car)
            return lambda progress, journal: tasks.tune_on_log(task, out, progress, journal)

        return ObserverConfig, prepare

    changes, inputs = {} if observer is None else {"observer": observer}, {"log": log, "car": car}
    tune(
        "tune-observer",
        out,
        config,
        load,
        about=TUNE_OBSERVER,
        changes=changes,
        inputs=inputs,
        resume=resume,
        force=force,
    )


def observer_study(out: Out, force: Force = False) -> None:
    """Default gains against tuned: settling, noise, wrong speed, a rig log, tracking; tables and figures."""

    def work():
        from tuning.observers.tasks import study

        return (), lambda: study(out)

    carry_out(out, work, about=OBSERVER_STUDY, force=force)
