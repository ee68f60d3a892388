"""The command line: identify a road, tune anti-lock control, observers, the encoder chain, and study each."""

import contextlib
import os
import time
from importlib import resources
from pathlib import Path
from typing import Annotated

import jax
import matplotlib
import typer

from tuning.core.terminal import bar, clear_errors, console, print_report, print_study

app = typer.Typer(add_completion=False, no_args_is_help=True, help=__doc__, pretty_exceptions_enable=False)
Out = Annotated[Path, typer.Option("--out", help="Folder for results and figures; made if missing.")]


@app.callback()
def _setup() -> None:
    """Double precision, every core a device, and figures without a screen."""
    matplotlib.use("Agg")
    jax.config.update("jax_enable_x64", True)
    with contextlib.suppress(RuntimeError):
        jax.config.update("jax_num_cpu_devices", len(os.sched_getaffinity(0)))


@app.command()
def identify(
    log: Annotated[Path, typer.Argument(help="Brake log, CSV with a header.")],
    out: Out,
    columns: Annotated[
        str | None, typer.Option(help="SIGNAL=COLUMN[:UNIT], comma-separated, where they differ.")
    ] = None,
    car: Annotated[Path | None, typer.Option(help="JSON with inertia, radius, load, brake_efficiency.")] = None,
    load: Annotated[float | None, typer.Option(help="Vertical load on the wheel [N]; overrides the car.")] = None,
    start: Annotated[float | None, typer.Option("--from", help="Use the log from this time on [s].")] = None,
    end: Annotated[float | None, typer.Option("--to", help="Use the log up to this time [s].")] = None,
) -> None:
    """The road's friction curve from a brake log: result.json and figures.

    Without --car, a JSON file of the log's name beside it is taken for the car if there is one, and the
    default wheel if not.
    """
    with clear_errors():
        _identify(log, out, columns, car, load, start, end)


def _identify(log, out, columns, car, load, start, end):
    import dataclasses

    from absjax.plant.wheel import Wheel
    from tuning.core.files import write_json
    from tuning.core.report import identification_table
    from tuning.logs.brake_log import parse_columns, read_csv
    from tuning.logs.car import car_of, read_car
    from tuning.road.figures import identification_figures
    from tuning.road.identify import identify as run

    car = car_of(log, car)
    wheel = Wheel() if car is None else read_car(car)
    if load is not None:
        wheel = dataclasses.replace(wheel, load=load)
    console.print(
        f"car: {car or 'default wheel'}, load {float(wheel.load):g} N, radius {float(wheel.radius):g} m",
        highlight=False,
    )
    data = read_csv(log, parse_columns(columns), start=start, end=end, radius=float(wheel.radius))
    result = run(data, wheel, progress=lambda text: console.print(f"  {text}", highlight=False))
    console.print(identification_table(result))
    for segment in result.segments:
        for statement in segment.statements:
            console.print(f"{segment.start:.3f} s: {statement}", highlight=False)
    written = [write_json(out / "result.json", result.to_json()), *identification_figures(result, data, wheel, out)]
    console.print("written: " + ", ".join(map(str, written)), highlight=False, soft_wrap=True)
    return result


@app.command("tune-abs")
def tune_abs(
    config: Annotated[
        Path, typer.Option(help="JSON, see `tuning.controllers.config.TuningConfig`; or a result to go on from.")
    ],
    out: Out,
) -> None:
    """An anti-lock controller, for a batch of roads and speeds, with its limit cycles: result.json and figures."""
    with clear_errors():
        from tuning.controllers.config import TuningConfig

        _tune(TuningConfig.from_json(configuration(config)), out, "tuned thresholds")


def configuration(path: Path | None):
    """What a configuration file holds, nothing without one; a result goes on from its parameters."""
    from tuning.core.files import read_json

    data = {} if path is None else read_json(path)
    if isinstance(data, dict) and "parameters" in data and "config" in data:
        data = {**data["config"], "start": data["parameters"]}
    return data


def _tune(config, out: Path, title: str):
    from tuning.controllers.figures import tuning_figures
    from tuning.controllers.tune import tune_abs as run
    from tuning.core.files import write_json
    from tuning.core.report import cycles_line, parameter_line, rows_table, tuning_rows

    with bar(f"{title}: {config.iterations} iterations, {config.starts} starts") as progress:
        result = run(config, progress=progress)
    console.print(
        rows_table(tuning_rows(result), f"{title}: distances from the pedal [m]; then the published quantity")
    )
    console.print(parameter_line(result), highlight=False)
    console.print(cycles_line(result), highlight=False)
    if result.on_limit:
        console.print("* on its limit", highlight=False)
    for warning in result.warnings:
        console.print(f"warning: {warning}", highlight=False)
    written = [write_json(out / "result.json", result.to_json()), *tuning_figures(result, out)]
    console.print("written: " + ", ".join(map(str, written)), highlight=False, soft_wrap=True)
    return result


@app.command("abs-sets")
def abs_sets(
    out: Out,
    only: Annotated[str | None, typer.Option(help="Recipes to follow, comma-separated; all if missing.")] = None,
) -> None:
    """Tune the shipped controller sets anew, from untuned values: a result for each, and controllers.json."""
    with clear_errors():
        from tuning.controllers.recipes import recipes, write_sets
        from tuning.core.config import choice

        wanted = list(recipes()) if only is None else only.split(",")
        for name in wanted:
            choice("--only", name, recipes())
        found = [(name, _tune(recipes()[name], out / name, name.replace("_", " "))) for name in wanted]
        console.print(f"written: {write_sets(found, out / 'controllers.json')}", highlight=False)


@app.command("abs-study")
def abs_study(
    out: Out, stops: Annotated[int, typer.Option(min=20, help="Scattered stops of each controller.")] = 2000
) -> None:
    """All controllers: limit cycles, the published table of distances, further roads, robustness; with figures."""
    with clear_errors():
        from tuning.controllers.study.tasks import run_study

        print_study(run_study(out, stops), out)


@app.command("tune-observer")
def tune_observer(
    out: Out,
    config: Annotated[
        Path | None,
        typer.Option(help="JSON, see `tuning.observers.config.ObserverConfig`; or a result to go on from."),
    ] = None,
    observer: Annotated[
        str | None, typer.Option(help="constant, known_road, unknown_road or adaptive; overrides the config.")
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
) -> None:
    """Gains of an observer of XBS with their certificate: result.json and figures."""
    with clear_errors():
        from tuning.observers.config import ObserverConfig
        from tuning.observers.tasks import tune, tune_on_log

        data = configuration(config)
        if observer is not None and isinstance(data, dict):
            data = {**data, "observer": observer}
        wanted = ObserverConfig.from_json(data)
        with bar(f"{wanted.observer} observer: {wanted.iterations} iterations, {wanted.starts} starts") as progress:
            if log is None:
                report = tune(wanted, out, progress)
            else:
                report = tune_on_log(wanted, log, columns, car, out, progress)
        print_report(report)


@app.command("observer-study")
def observer_study(out: Out) -> None:
    """Published gains against tuned: settling, noise, wrong speed, a rig log, tracking; tables and figures."""
    with clear_errors():
        from tuning.observers.tasks import study

        print_study(study(out), out)


@app.command()
def encoder(
    log: Annotated[Path, typer.Argument(help="Edge times of an encoder, CSV with a header, a row an edge.")],
    out: Out,
    teeth: Annotated[int, typer.Option(help="Teeth (pulses in a revolution).")] = 60,
    clock: Annotated[float, typer.Option(help="Length of a clock tick [s].")] = 1e-6,
    column: Annotated[str, typer.Option(help="Column with the edge times, integer ticks.")] = "edge_tick",
    period: Annotated[float, typer.Option(help="Sampling period of the control unit [s].")] = 1e-3,
    events: Annotated[int, typer.Option(help="Edges in the fit, n.")] = 15,
    harmonics: Annotated[int | None, typer.Option(help="Harmonics compensated, M; all if missing.")] = None,
    chain: Annotated[Path | None, typer.Option(help="A result of tune-encoder; overrides n and M.")] = None,
) -> None:
    """Wheel speed and acceleration from edge times, the encoder's errors taken off: CSV, result.json and figures."""
    with clear_errors():
        from tuning.encoder.tasks import chain_for, study_edges
        from tuning.logs.edges import read_edges

        data = read_edges(log, teeth=teeth, clock=clock, column=column)
        print_report(study_edges(data, out, chain_for(data, events, harmonics, chain), period))


@app.command("tune-encoder")
def tune_encoder(
    out: Out,
    config: Annotated[
        Path | None, typer.Option(help="JSON, see `tuning.encoder.config.EncoderConfig`; or a result to go on from.")
    ] = None,
) -> None:
    """The compensation of encoder errors, on simulated encoders: result.json and figures."""
    with clear_errors():
        from tuning.encoder.config import EncoderConfig
        from tuning.encoder.tasks import tune

        wanted = EncoderConfig.from_json(configuration(config))
        with bar(f"encoder chain: {wanted.iterations} iterations, {wanted.starts} starts") as progress:
            report = tune(wanted, out, progress)
        print_report(report)


@app.command("encoder-study")
def encoder_study(
    out: Out,
    encoders: Annotated[int, typer.Option(min=1, help="Encoders in the loop.")] = 20,
    hours: Annotated[float, typer.Option(min=0.001, help="Length of the endurance run.")] = 1.0,
) -> None:
    """The published table, other encoders, endurance, and the chain in the loop; tables and figures."""
    with clear_errors():
        from tuning.encoder.tasks import study

        print_study(study(out, encoders, hours), out)


@app.command()
def demo(out: Out = Path("demo")) -> None:
    """Identify a road from the log shipped here, then tune five-phase thresholds, from untuned, under a given pedal."""
    begun = time.monotonic()
    with clear_errors():
        from tuning.controllers.demo import limit_costs, limited
        from tuning.core.report import rows_table

        with resources.as_file(resources.files("tuning") / "data") as data:
            console.rule("1  the road from a brake log")
            _identify(data / "stop_dry_wet.csv", out / "identify", None, None, None, None, None)
        console.rule("2  thresholds under a given pedal: 400 bar/s; brake 750 bar/s, 5 ms; thresholds >= 10 m/s²")
        result = _tune(limited(), out / "tuned", "five phases, from the default set")
        console.rule("3  what each limit costs")
        with bar("tuned under one limit at a time") as progress:
            rows = limit_costs(result, progress)
        console.print(
            rows_table(rows, "from the pedal, above ideal, by the limits in force; tuned, switchings located")
        )
    console.print(f"done in {time.monotonic() - begun:.0f} s; open the figures in {out}/", highlight=False)
