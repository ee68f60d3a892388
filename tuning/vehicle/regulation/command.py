"""`regulation`: controllers of a car screened after UN Regulation No. 13-H, Annex 6."""

from pathlib import Path
from typing import Annotated

import typer

from tuning.core.command import Force, Out, carry_out, configuration
from tuning.vehicle.about import REGULATION


def regulation(
    out: Out,
    config: Annotated[
        Path | None,
        typer.Option(help="JSON: a result of tune-abs, or `tuning.controllers.config.TuningConfig`."),
    ] = None,
    controller: Annotated[str | None, typer.Option(help="A shipped tuned set instead, by its controller.")] = None,
    cars: Annotated[
        str | None, typer.Option(help="Comma-separated; all shipped if missing, own: that of the configuration.")
    ] = None,
    located: Annotated[bool, typer.Option("--located", help="Switchings located instead of sampled.")] = False,
    force: Force = False,
) -> None:
    """Screening after UN Regulation 13-H, Annex 6: a simulation after it, no certificate."""

    def work():
        from tuning.controllers.regulation import on_car
        from tuning.vehicle.regulation import tasks

        wanted = tasks.config_of(None if config is None else configuration(config), controller)
        chosen = tasks.cars_of(wanted, None if cars is None else cars.split(","))
        for figures in chosen.values():
            on_car(wanted, figures, laden=False)
        return (config,), lambda: tasks.regulation(wanted, chosen, out, located=located)

    carry_out(out, work, about=REGULATION, source=config, force=force)
