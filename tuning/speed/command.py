"""`speed-study`: estimators of the vehicle's speed tuned and compared."""

from pathlib import Path
from typing import Annotated

import typer

from tuning.core.command import Force, Out, Resume, tune
from tuning.speed.about import SPEED_STUDY


def speed_study(
    out: Out,
    config: Annotated[
        Path | None, typer.Option(help="JSON, see `tuning.speed.config.SpeedConfig`; or a result to go on from.")
    ] = None,
    resume: Resume = False,
    force: Force = False,
) -> None:
    """Vehicle speed from wheels and an accelerometer: estimators tuned on anti-lock stops, judged on others."""

    def load():
        from tuning.speed import tasks
        from tuning.speed.config import SpeedConfig

        def prepare(wanted):
            return lambda progress, journal: tasks.speed_study(wanted, out, progress, journal)

        return SpeedConfig, prepare

    tune("speed-study", out, config, load, about=SPEED_STUDY, resume=resume, force=force)
