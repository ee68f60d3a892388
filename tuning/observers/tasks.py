"""The observers' commands: tune on simulated runs or on a log, and the study of default against tuned gains."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np

from absjax.observers.along_a_run import certify_run
from absjax.observers.certificate import certify
from absjax.observers.excitation import decay_along
from absjax.observers.run import observe
from absjax.observers.switched import SwitchedObserver
from absjax.parameters import bounds_of
from absjax.plant.wheel import Wheel
from tuning.core.descent import Progress
from tuning.core.figures import save
from tuning.core.files import data_folder, write_json
from tuning.core.fit import unmoved
from tuning.core.journal import Journal
from tuning.core.report import Report
from tuning.core.terminal import say_step
from tuning.logs.brake_log import BrakeLog, parse_columns, read_log
from tuning.logs.car import Car, car_of, read_car
from tuning.logs.tables import LogError
from tuning.observers import curves, figures, singular
from tuning.observers.bench import Bench, log_bench
from tuning.observers.config import ObserverConfig
from tuning.observers.metrics import rms
from tuning.observers.scenarios import Scenarios
from tuning.observers.signals import LogSignals, force_stiffness, observer_signals
from tuning.observers.study import (
    HELD_OUT_ROADS,
    NOISE,
    NOISE_SEED,
    GainSet,
    clamp_rows,
    estimates,
    gain_sets,
    held_out_rows,
    held_out_runs,
    noise_rows,
    perturbation,
    rig_adaptive_rows,
    rig_sets,
    rig_states,
    rig_study,
    settling_rows,
    speed_rows,
    table_runs,
)
from tuning.observers.tracking import drive, loops, share_locked, summary, tracking_figure
from tuning.observers.tune import ObserverResult, trade_off, tune_observer
from tuning.road.identify import identify

EXCITATIONS = ("five_phase", "two_phase")
LOG_SHARE = 0.6
"""Share of a log that is tuned on; the rest is held out."""
SETTLE = 0.5
"""Beginning of a log on which errors do not count, s."""
LONGEST_WINDOW = 1.0
"""Over which the excitation of a log is looked at, s."""
TRADE_OFF_WEIGHTS = (0.02, 0.1, 0.3, 1.0, 3.0)


def _outcome(result: ObserverResult, out: Path, tables, files) -> Report:
    observer = result.observer()
    gains = "; ".join(f"{k} ({', '.join(f'{x:.6g}' for x in v)})" for k, v in result.gains.items())
    parameters = ", ".join(f"{k} {v:.5g}" for k, v in result.parameters.items())
    files = [
        write_json(out / "tables.json", tables),
        save(figures.tuning_figure(result.history, result.config.observer), out / "history.png"),
        *files,
    ]
    certificate = str(certify(observer)) if result.certificate else f"{result.config.observer} offers no certificate"
    verdict, *conditions = map(str.strip, certificate.splitlines())
    lines = [f"parameters: {parameters}", f"gains: {gains}"]
    results = {out / "result.json": result.to_json()}
    warnings = [f"warning: {said}" for said in unmoved(result.config.initial(), result.parameters)]
    return Report(
        tables,
        lines,
        files,
        result.interrupted,
        verdict=verdict,
        reasons=conditions,
        warnings=warnings,
        results=results,
    )


def _pair(result: ObserverResult) -> list[GainSet]:
    kind = result.config.observer
    return [GainSet("before", kind, result.config.initial()), GainSet("tuned", kind, result.parameters)]


def tune(config: ObserverConfig, out: Path, progress: Progress, journal: Journal) -> Report:
    """Tune on simulated runs, and judge on road changes that were not tuned on."""
    result = tune_observer(config, progress=progress, journal=journal)
    pair, held_out = _pair(result), []
    say_step("changes of the road that were not tuned on ...")
    for excitation in EXCITATIONS:
        held_out += held_out_rows(pair, held_out_runs(excitation), excitation)
    tuned_on = [
        {"gains": name, **{k: round(v, 4) for k, v in row.items()}}
        for name, row in (("before", result.before), ("tuned", result.after))
    ]
    tables = {"runs tuned on: settling [s], noise and error of XBS": tuned_on, HELD_OUT_TITLE: held_out}
    file = save(figures.held_out_figure(held_out, HELD_OUT_ROADS), out / "held_out.png")
    return _outcome(result, out, tables, [file])


HELD_OUT_TITLE = "settling on changes not tuned on, worst by the road changed to [s]"


class LogTask(NamedTuple):
    """A log to tune on: its first part, the rest to judge on."""

    config: ObserverConfig
    bench: Bench
    log: BrakeLog
    wheel: Wheel
    signals: LogSignals
    truth: np.ndarray
    cut: float
    """where the part tuned on ends, s"""


def log_bench_of(config: ObserverConfig, path: Path, columns: str | None, car: Path | None) -> LogTask:
    """A log with measured force as a bench.

    Raises:
        LogError: if the log has no force, or is too short to tune on one part and judge on the rest.
    """
    car = car_of(path, car)
    known = Car() if car is None else read_car(car)
    wheel = known.wheel
    log = read_log(path, parse_columns(columns), radius=float(wheel.radius), stated=known.stated)
    if log.force is None:
        raise LogError(f"{path}: no longitudinal force; XBS cannot be known without it")
    cut = log.time[0] + LOG_SHARE * (log.time[-1] - log.time[0])
    if cut < log.time[0] + 2 * SETTLE:
        raise LogError(f"{path}: {log.time[-1] - log.time[0]:g} s of log; {2 * SETTLE / LOG_SHARE:.2g} s at least")
    signals = observer_signals(log, wheel)
    truth = force_stiffness(signals, identify(log, wheel).segments[0].tyre)
    described = {name: float(getattr(wheel, name)) for name in bounds_of(wheel)}
    config = dataclasses.replace(config, noise_weight=None, period=log.period, wheel=described)
    bench = log_bench(config, signals, truth, wheel, log.time[0] + SETTLE, cut)
    return LogTask(config, bench, log, wheel, signals, truth, cut)


def tune_on_log(task: LogTask, out: Path, progress: Progress, journal: Journal) -> Report:
    """Tune on the first part of a log with measured force, and judge on the rest."""
    config, bench, log, wheel, signals, truth, cut = task
    result = tune_observer(config, bench, progress=progress, journal=journal)
    rows, found = [], {}
    for gains in _pair(result):
        run = observe(gains.observer(wheel), signals.samples, log.period, substeps=config.steps_per_sample)
        found[gains.label] = np.asarray(run.stiffness)
        error = found[gains.label] - truth
        parts = {"tuned on": (log.time >= log.time[0] + SETTLE) & (log.time < cut), "held out": log.time >= cut}
        rows.append({"gains": gains.label, **{k: round(float(rms(error, part)), 4) for k, part in parts.items()}})
    title = f"rms of XBS against force: before and after {cut:g} s of {log.name}"
    file = save(figures.log_figure(signals, truth, found, cut), out / "log.png")
    report = _outcome(result, out, {title: rows}, [file])
    window = min(LONGEST_WINDOW, 0.5 * (log.time[-1] - log.time[0]))
    return report._replace(
        lines=[*report.lines, f"{log.name}: {certify_run(signals.samples, log.period, wheel, window)}"]
    )


def study(out: Path) -> Iterator[Report]:
    """Every table and figure of default against tuned gains."""
    sets = gain_sets()
    runs = {excitation: table_runs(excitation) for excitation in EXCITATIONS}
    yield _curves(out)
    yield _certificates(sets, runs["five_phase"])
    yield _singular(runs, out)
    yield _settling(sets, runs, out)
    yield _figures_of_runs(sets, runs["five_phase"], out)
    yield _robustness(sets, runs["five_phase"], out)
    yield _trade_off(sets, out)
    yield _rig(sets, out)
    yield _tracking(sets, out)


def _certificates(sets: list[GainSet], runs: Scenarios) -> Report:
    """Certificates, and how fast the error of the linear observers decays along a run at the least."""
    lines, samples = [], jax.tree.map(lambda x: np.asarray(x)[0], runs.samples)
    for gains in sets:
        observer = gains.observer(runs.wheel)
        lines.append(f"{gains.label}: {certify(observer)}")
        if isinstance(observer, SwitchedObserver):
            decay = decay_along(observer, samples, runs.period)
            lines.append(f"  along a five-phase run every error decays at {decay:.3g} 1/s at least")
    return Report({}, lines, [])


def _curves(out: Path) -> Report:
    """The exponential basis of the 4-state observer against Burckhardt's curves."""
    title = "exponential basis: coefficients, and how far it is off"
    return Report({title: curves.rows()}, [], [save(curves.figure(), out / "basis.png")])


def _singular(runs: dict[str, Scenarios], out: Path) -> Report:
    """What the zeros of y cost, what runs offer, and the published observer in the loop."""
    found = singular.ride()
    tables = {
        "what a run offers an observer": singular.excited_rows(runs, found),
        f"five phases tracking on observed XBS, {singular.SPEED:g} m/s, triple pole {singular.POLE:g} as published": (
            singular.rows(found)
        ),
    }
    files = [
        write_json(out / "singular.json", tables),
        save(singular.singularity_figure(), out / "singularity.png"),
        save(singular.ride_figure(found), out / "singular_loop.png"),
        save(singular.error_plane_figure(found), out / "singular_error.png"),
    ]
    return Report(tables, [], files)


def _settling(sets, runs, out: Path) -> Report:
    tables = {"worst settling over 24 instants of the changes [s]": [], HELD_OUT_TITLE: [], NOISE_TITLE: []}
    settled, held_out, noise = tables.values()
    for excitation in EXCITATIONS:
        settled += settling_rows(sets, runs[excitation], excitation)
        held_out += held_out_rows(sets, held_out_runs(excitation), excitation)
        noise += noise_rows(sets, runs[excitation], excitation)
    file = save(figures.held_out_figure(held_out, HELD_OUT_ROADS), out / "held_out.png")
    return Report(tables, [], [write_json(out / "settling.json", tables), file], seeds={"noise on x2": NOISE_SEED})


NOISE_TITLE = f"XBS rms caused by {NOISE:g} m/s² of noise on x2 at 1 kHz"


def _figures_of_runs(sets, runs, out: Path) -> Report:
    one = runs.select(slice(0, 1))
    shaken, files = perturbation(one), []
    chosen = {gains.label: gains for gains in sets if gains.label != "4-state, poles -100"}
    for name, noise in (("ideal", 0.0), ("perturbed", shaken)):
        found = {label: estimates(gains, one, noise) for label, gains in chosen.items()}
        stiffness = {label: np.asarray(observed.stiffness) for label, observed in found.items()}
        states = figures.states_figure(one, found["adaptive, default"], title=f"adaptive observer, {name}")
        files.append(save(states, out / f"{name}_states.png"))
        files.append(save(figures.stiffness_figure(one, stiffness, title=name), out / f"{name}_xbs.png"))
    four = {"4-state, poles -60": np.asarray(estimates(chosen["4-state, poles -60"], one).stiffness)}
    change = figures.stiffness_figure(one, four, title="a change of road, 4-state observer", zoom=(2.5, 4.0))
    files.append(save(change, out / "road_change_4_state.png"))
    files.append(save(figures.offset_figure(one, shaken), out / "perturbed_offset.png"))
    files.append(save(figures.excitation_figure(one), out / "excitation.png"))
    wrong = {
        f"v {p:+d} %": np.asarray(estimates(chosen["adaptive, tuned"], one, speed=1 + p / 100).stiffness)
        for p in (-20, 0, 20)
    }
    files.append(
        save(figures.stiffness_figure(one, wrong, title="vehicle speed wrong", zoom=(4.0, 5.0)), out / "speed.png")
    )
    return Report({}, [], files)


def _robustness(sets, runs, out: Path) -> Report:
    tables = {
        "vehicle speed wrong: error and zero crossings of XBS": speed_rows(sets, runs.select(slice(0, None, 4))),
        "estimate clamped to [-0.9, 35]": clamp_rows(sets, runs),
    }
    return Report(tables, [], [write_json(out / "robustness.json", tables)])


def _trade_off(sets, out: Path) -> Report:
    curves, points = {}, {}
    for kind in ("unknown_road", "adaptive"):
        mine = [gains for gains in sets if gains.kind == kind]
        config = ObserverConfig(observer=kind, iterations=15)
        curve, given = trade_off(config, [gains.parameters for gains in mine], TRADE_OFF_WEIGHTS)
        curves[kind.replace("_", " ")] = curve
        points |= {gains.label: point for gains, point in zip(mine, given)}
    rows = [
        {
            "observer": label,
            "noise weight [s]": p["noise_weight"],
            "mean settling [s]": round(p["mean"], 4),
            "XBS noise": round(p["noise"], 4),
        }
        for label, curve in curves.items()
        for p in curve
    ]
    file = save(figures.trade_off_figure(curves, points), out / "trade_off.png")
    return Report({"settling against noise": rows}, [], [write_json(out / "trade_off.json", curves), file])


def rig_log() -> tuple[BrakeLog, Wheel]:
    """The rig log shipped with the package, and its wheel."""
    with data_folder() as data:
        return read_log(data / "rig_65kmh.csv"), read_car(data / "rig_65kmh.json").wheel


def _rig(sets, out: Path) -> Report:
    log, wheel = rig_log()
    tyre = identify(log, wheel).segments[0].tyre
    found = rig_study(log, wheel, tyre, rig_sets(tyre, sets))
    known = next(gains for gains in rig_sets(tyre, []) if gains.kind == "known_road")
    run = observe(known.observer(wheel), found.signals.samples, log.period, substeps=known.substeps)
    adaptive = [gains for gains in sets if gains.kind == "adaptive"]
    observed = {
        gains.label: observe(gains.observer(wheel), found.signals.samples, log.period, substeps=gains.substeps)
        for gains in adaptive
    }
    states = rig_states(found, wheel, tyre)
    files = [
        save(figures.rig_slip_figure(found, float(tyre.peak().slip)), out / "rig_slip.png"),
        save(figures.rig_adaptive_figure(found, states, observed), out / "rig_adaptive.png"),
        save(figures.rig_figure(found), out / "rig_xbs.png"),
        save(figures.rig_states_figure(found, known.label, np.asarray(run.state[0])), out / "rig_3_state.png"),
    ]
    title = f"XBS on {log.name} against the slope of the curve fitted to force"
    tables = {
        title: found.rows,
        "adaptive observer on that log, second half": rig_adaptive_rows(found, states, observed),
    }
    return Report(tables, [], [write_json(out / "rig.json", {"rows": found.rows}), *files])


def _tracking(sets, out: Path) -> Report:
    rides = [drive(label, loop) for label, loop in loops().items()]
    shifted = loops(shift=0.01 * np.arange(24))
    rows = [{**summary(ride), "locked of 24": round(24 * share_locked(shifted[ride.label]))} for ride in rides]
    file = save(tracking_figure(rides), out / "tracking.png")
    title = "dry, wet at 3 s, snow at 4 s: five phases without feedback, and tracking"
    return Report({title: rows}, [], [write_json(out / "tracking.json", {"rows": rows}), file])
