"""`vehicle-study`, `split-mu`, `drive-log`: anti-lock braking of whole vehicles, and a car driven by a log."""

from pathlib import Path
from typing import Annotated

import typer

from tuning.core.command import Force, Out, carry_out
from tuning.vehicle.about import DRIVE_LOG, SPLIT_MU, VEHICLE_STUDY


def vehicle_study(out: Out, force: Force = False) -> None:
    """Whole vehicles: the published scenario of two axles, distances of cars, split mu; with figures."""

    def work():
        from tuning.vehicle.tasks import study

        return (), lambda: study(out)

    carry_out(out, work, about=VEHICLE_STUDY, force=force)


def drive_log(
    log: Annotated[Path, typer.Argument(help="Log of a car, CSV with a header.")],
    out: Out,
    car: Annotated[Path | None, typer.Option(help="JSON of the car; the one beside the log if missing.")] = None,
    columns: Annotated[
        str | None, typer.Option(help="SIGNAL=COLUMN[:UNIT], comma-separated, where they differ.")
    ] = None,
    force: Force = False,
) -> None:
    """The four-wheel car driven by a log's wheel speeds and steering: yaw rate and side-slip against the truth."""

    def work():
        from tuning.logs.vehicle_log import parse_vehicle_columns
        from tuning.sideslip.tasks import read_with_car
        from tuning.vehicle import lateral_tasks as tasks

        data, known = read_with_car(log, car, parse_vehicle_columns(columns))
        return (log, car), lambda: tasks.drive_log(data, known, out)

    carry_out(out, work, about=DRIVE_LOG, force=force)


def split_mu(
    out: Out,
    right: Annotated[str, typer.Option(help="Surface under the right wheels; dry asphalt is on the left.")] = "snow",
    speed: Annotated[float, typer.Option(help="km/h")] = 100.0,
    tune: Annotated[
        bool, typer.Option("--tune", help="Search thresholds for the front of distance and yaw rate.")
    ] = False,
    force: Force = False,
) -> None:
    """Braking on split mu: independent control, select-low behind, on both axles; held steering wheel and a driver."""

    def work():
        from tuning.vehicle import lateral_tasks as tasks
        from tuning.vehicle.split_mu import checked
        from tuning.vehicle.trade_off import ELSEWHERE

        wanted = checked(right, speed, ELSEWHERE if tune else 1.0)
        return (), lambda: tasks.split_mu(*wanted, out, tune=tune)

    carry_out(out, work, about=SPLIT_MU, force=force)
