"""`side-slip`, `side-slip-study`, `tune-side-slip`: side-slip of a car from its logs."""

from pathlib import Path
from typing import Annotated

import typer

from tuning.core.command import Force, Out, Resume, carry_out, tune
from tuning.sideslip.about import SIDE_SLIP, SIDE_SLIP_STUDY, TUNE_SIDE_SLIP


def side_slip(
    log: Annotated[Path, typer.Argument(help="Log of a car, CSV with a header.")],
    out: Out,
    car: Annotated[Path | None, typer.Option(help="JSON of the car; the one beside the log if missing.")] = None,
    columns: Annotated[
        str | None, typer.Option(help="SIGNAL=COLUMN[:UNIT], comma-separated, where they differ.")
    ] = None,
    estimator: Annotated[
        str,
        typer.Option(help="better, published, offsets, fixed, linear_filter, extended_filter, kinematic, or a result."),
    ] = "better",
    force: Force = False,
) -> None:
    """Velocities, side-slip and friction of a car from a log: estimates.csv, result.json and figures."""

    def work():
        from tuning.logs.vehicle_log import parse_vehicle_columns
        from tuning.sideslip import tasks

        wanted = tasks.chosen(estimator)
        data, known = tasks.read_with_car(log, car, parse_vehicle_columns(columns))
        return (log, car), lambda: tasks.study(data, known, wanted, out)

    carry_out(out, work, about=SIDE_SLIP, force=force)


def side_slip_study(
    logs: Annotated[list[Path], typer.Argument(help="Logs with true velocities, the JSON of its car beside each.")],
    out: Out,
    tuned: Annotated[list[Path] | None, typer.Option(help="Result of tune-side-slip, to be compared too.")] = None,
    force: Force = False,
) -> None:
    """The observer, with and without bank adaptation, against all baselines over logs; tables and figures."""

    def work():
        from tuning.sideslip import tasks

        data = [tasks.read_with_car(log) for log in logs]
        given = [str(path) for path in tuned or []]
        return (*logs, *(tuned or [])), lambda: iter([tasks.compare(data, given, out)])

    carry_out(out, work, about=SIDE_SLIP_STUDY, force=force)


def tune_side_slip(
    out: Out,
    logs: Annotated[
        list[Path] | None, typer.Argument(help="Logs with true velocities to tune on, the JSON of its car beside each.")
    ] = None,
    held_out: Annotated[list[Path] | None, typer.Option(help="Log to judge on only; may be given again.")] = None,
    each: Annotated[bool, typer.Option("--each", help="Hold out every log in turn, besides.")] = False,
    estimator: Annotated[str | None, typer.Option(help="Name of the estimator; overrides the config.")] = None,
    config: Annotated[
        Path | None, typer.Option(help="JSON, see `tuning.sideslip.config.SideSlipConfig`; or a result to go on from.")
    ] = None,
    resume: Resume = False,
    force: Force = False,
) -> None:
    """An estimator of side-slip tuned on logs, judged on others: result.json and figures."""

    def load():
        from tuning.sideslip import tasks
        from tuning.sideslip.config import SideSlipConfig

        def prepare(wanted):
            data = tasks.prepare(wanted)
            return lambda progress, journal: tasks.tune(wanted, data, out, progress, journal)

        return SideSlipConfig, prepare

    changes: dict = {"logs": list(map(str, logs))} if logs else {}
    changes |= {"held_out": list(map(str, held_out))} if held_out else {}
    changes |= {"each": True} if each else {}
    changes |= {"estimator": estimator} if estimator else {}
    tune("tune-side-slip", out, config, load, about=TUNE_SIDE_SLIP, changes=changes, resume=resume, force=force)
