"""`tune-abs`, `abs-sets`, `demo`, and the studies: controllers tuned, made anew, and studied."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from tuning.controllers.about import ABS_SETS, ABS_STUDY, DEMO, GRADIENT_STUDY, SETTING_STUDY, TUNE_ABS
from tuning.core.command import Force, Out, Resume, carry_out, journal_path, tune, tuned
from tuning.core.terminal import bar, console, say_step


def tune_abs(
    out: Out,
    config: Annotated[
        Path | None,
        typer.Option(help="JSON, see `tuning.controllers.config.TuningConfig`; or a result to go on from."),
    ] = None,
    resume: Resume = False,
    force: Force = False,
) -> None:
    """An anti-lock controller, for a batch of roads and speeds, with its limit cycles: result.json and figures."""

    def load():
        from tuning.controllers.config import TuningConfig
        from tuning.controllers.setup import Setup

        if config is None and not resume:
            raise ValueError("--config: a configuration is needed, {} for the defaults; or --resume")

        def prepare(wanted):
            Setup.of(wanted).box()
            return run_of(wanted, out, "tuned thresholds")

        return TuningConfig, prepare

    tune("tune-abs", out, config, load, about=TUNE_ABS, resume=resume, force=force)


def run_of(config, out: Path, title: str) -> Any:
    """What tunes a controller as a configuration says, and reports."""

    def run(progress, journal):
        from tuning.cars.car import name_of_car
        from tuning.controllers.figures import tuning_figures
        from tuning.controllers.report import cycles_line, parameter_line, split_rows, tuning_rows
        from tuning.controllers.tune import tune_abs
        from tuning.core.report import Report

        result = tune_abs(config, progress=progress, journal=journal, say=say_step)
        lines = [parameter_line(result), cycles_line(result)]
        lines += ["* on its limit"] if result.on_limit else []
        if result.breached is not None:
            cars = ", ".join(map(name_of_car, config.vehicle.cars))
            lines.append(f"screened on {cars}, unladen and laden: {len(result.breached) or 'no'} rows breached")
        warnings = [f"warning: {warning}" for warning in (*result.warnings, *(result.breached or ()))]
        say_step("figures ...")
        files = tuning_figures(result, out)
        tables = {f"{title}: distances from the pedal [m]; then the published quantity": tuning_rows(result)}
        if result.splits:
            where = f"{config.setting}, a tick every {1e3 * config.sampled_period:g} ms"
            tables[f"{title}, scattered conditions: {where}"] = split_rows(result)
        results = {out / "result.json": result.to_json()}
        return Report(tables, lines, files, result.interrupted, warnings=warnings, results=results)

    return run


def abs_sets(
    out: Out,
    only: Annotated[str | None, typer.Option(help="Recipes to follow, comma-separated; all if missing.")] = None,
    resume: Resume = False,
    force: Force = False,
) -> None:
    """Tune the shipped controller sets anew, from untuned values: a result for each, and controllers.json."""

    def work():
        from tuning.controllers.recipes import recipes
        from tuning.core.config import choice

        wanted = list(recipes()) if only is None else only.split(",")
        for name in wanted:
            choice("--only", name, recipes())
        return (), lambda: _sets(wanted, out, resume)

    carry_out(out, work, about=ABS_SETS, force=force, resume=resume)


def _sets(wanted: list[str], out: Path, resume: bool) -> Iterator[Any]:
    from tuning.controllers.load import load_result
    from tuning.controllers.recipes import recipes, write_sets
    from tuning.core.report import Report

    for name in wanted:
        config, folder = recipes()[name], out / name
        goes_on = resume and journal_path(folder).exists()
        yield tuned("tune-abs", config, folder, run_of(config, folder, name.replace("_", " ")), resume=goes_on)
    found = [(name, load_result(out / name / "result.json")) for name in wanted]
    yield Report({}, [], [write_sets(found, out / "controllers.json")])


def abs_study(
    out: Out,
    stops: Annotated[int, typer.Option(min=20, help="Scattered stops of each controller.")] = 2000,
    force: Force = False,
) -> None:
    """All controllers: limit cycles, the published table of distances, further roads, robustness; with figures."""

    def work():
        from tuning.controllers.study.tasks import run_study

        return (), lambda: run_study(out, stops)

    carry_out(out, work, about=ABS_STUDY, force=force)


def gradient_study(
    out: Out,
    pairs: Annotated[int, typer.Option(min=32, help="Pairs of lanes: phases of the clock, and initial speeds.")] = 2048,
    roads: Annotated[str | None, typer.Option(help="Roads, comma-separated; the published five if missing.")] = None,
    force: Force = False,
) -> None:
    """The slope of the mean stop under a control unit's clock, three ways; the stand-in of an encoder's chain."""

    def work():
        from tuning.controllers.study.running import run_gradients

        return (), lambda: run_gradients(out, pairs, None if roads is None else tuple(roads.split(",")))

    carry_out(out, work, about=GRADIENT_STUDY, force=force)


def setting_study(
    out: Out,
    only: Annotated[str | None, typer.Option(help="Controllers, comma-separated; all if missing.")] = None,
    draws: Annotated[int, typer.Option(min=1, help="Of clock and encoder, for each road and speed.")] = 8,
    stops: Annotated[int, typer.Option(min=15, help="Scattered stops of each set, test draws.")] = 2000,
    force: Force = False,
) -> None:
    """Sets tuned on the truth, for 1 ms, for 5 ms and for the chain, each in all four settings; scattered stops."""

    def work():
        from tuning.controllers.study.by_setting import controllers
        from tuning.controllers.study.running import run_settings
        from tuning.core.config import choice

        wanted = controllers() if only is None else tuple(only.split(","))
        for name in wanted:
            choice("--only", name, controllers())
        return (), lambda: run_settings(out, wanted, draws, stops)

    carry_out(out, work, about=SETTING_STUDY, force=force)


def demo(out: Out = Path("demo"), force: Force = False) -> None:
    """Identify a road from the log shipped here, then tune five-phase thresholds under a given pedal."""
    carry_out(out, lambda: ((), lambda: _demonstrated(out)), about=DEMO, force=force)


def _demonstrated(out: Path) -> Iterator[Any]:
    from tuning.controllers.demo import limit_costs, limited
    from tuning.controllers.load import load_result
    from tuning.core.files import data_folder
    from tuning.core.report import Report
    from tuning.road.command import identified

    console.rule("1  the road from a brake log")
    with data_folder() as data:
        yield identified(data / "stop_dry_wet.csv", out / "identify", car=data / "stop_dry_wet.json")
    console.rule("2  thresholds under a given pedal: 400 bar/s; brake 750 bar/s, 5 ms; thresholds >= 10 m/s²")
    run = run_of(limited(), out / "tuned", "five phases")
    yield tuned("tune-abs", limited(), out / "tuned", run)
    console.rule("3  what each limit costs")
    with bar("tuned under one limit at a time") as progress:
        rows = limit_costs(load_result(out / "tuned" / "result.json"), progress)
    yield Report({"from the pedal, above ideal, by the limits in force: tuned, switchings located": rows}, [], [])
