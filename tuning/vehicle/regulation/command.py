"""`regulation`, `regulation-study`: controllers of a car screened after UN Regulation No. 13-H, Annex 6."""

from pathlib import Path
from typing import Annotated

import typer

from tuning.core.command import Force, Out, carry_out, configuration
from tuning.vehicle.about import REGULATION, REGULATION_STUDY


def regulation(
    out: Out,
    config: Annotated[
        Path | None,
        typer.Option(help="JSON: a result of tune-abs, or `tuning.controllers.config.TuningConfig`."),
    ] = None,
    controller: Annotated[str | None, typer.Option(help="A shipped tuned set instead, by its controller.")] = None,
    cars: Annotated[
        str | None,
        typer.Option(help="Comma-separated, own: those of the configuration. If missing these, or all shipped."),
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


def regulation_study(
    out: Out,
    controllers: Annotated[str | None, typer.Option(help="Comma-separated; all if missing.")] = None,
    cars: Annotated[str | None, typer.Option(help="Comma-separated; all shipped if missing.")] = None,
    wiring: Annotated[
        str, typer.Option(help="independent, select_low_rear, or select_low on both axles.")
    ] = "select_low_rear",
    speed: Annotated[
        str | None, typer.Option(help="What estimates the car's speed, as kalman; the true one if missing.")
    ] = None,
    bias: Annotated[
        float | None, typer.Option(help="Of the accelerometer, where the speed is estimated, m/s^2; 0.5.")
    ] = None,
    gain: Annotated[
        float | None, typer.Option(help="Its error of scale: by which share decelerations are told too large; 0.02.")
    ] = None,
    slope: Annotated[
        float | None, typer.Option(help="Added to what it tells from the pedal on, m/s^2: positive uphill; 0.")
    ] = None,
    rolling: Annotated[
        float | None, typer.Option(help="Free rolling before the pedal, by which the bias is found, s; 2. 0: none.")
    ] = None,
    errors: Annotated[
        bool, typer.Option("--errors", help="Instead every set told wrongly: scale, slope, turned on by the pedal.")
    ] = False,
    located: Annotated[bool, typer.Option("--located", help="Switchings located instead of sampled.")] = False,
    force: Force = False,
) -> None:
    """Every controller screened on every car: untuned, tuned on one wheel, tuned on a car."""

    def work():
        from tuning.cars.entry import VehicleEntry
        from tuning.controllers.config import TuningConfig
        from tuning.vehicle.regulation import study, tasks

        told = {"--bias": bias, "--gain": gain, "--slope": slope, "--rolling": rolling}
        entries = {"wiring": wiring, "speed": speed, **study.estimation(speed, located, told, errors)}
        VehicleEntry(model="four_wheel", **entries)
        names = study.chosen(None if controllers is None else controllers.split(","))
        chosen = tasks.cars_of(TuningConfig(), None if cars is None else cars.split(","))
        if errors:
            return (), lambda: study.study_of_errors(chosen, names, out, **entries)
        return (), lambda: study.study(chosen, names, out, located=located, **entries)

    carry_out(out, work, about=REGULATION_STUDY, force=force)
