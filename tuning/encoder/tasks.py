"""The encoder's commands: a log of edges, tuning of the chain, and the study."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from absjax.encoder.encoder import Encoder
from absjax.encoder.wheel_speed import WheelSpeedChain, estimate
from absjax.loop.ideal import ideal_distance
from absjax.observers.designs import UnknownRoad
from tuning.core.descent import Progress
from tuning.core.figures import save
from tuning.core.files import read_json, write_json
from tuning.core.fit import unmoved
from tuning.core.journal import Journal
from tuning.core.report import Report
from tuning.encoder import figures, imperfections, notching, sticking
from tuning.encoder.analysis import LogStudy, periodic_part, study_log
from tuning.encoder.bench import PERIOD, bench_of
from tuning.encoder.chains import (
    SIGNALS,
    all_harmonics,
    edge_chain,
    enough_harmonics,
    filtered_chain,
    measured_chain,
    notch_chain,
)
from tuning.encoder.config import EncoderConfig
from tuning.encoder.loop import HORIZON, SPEED, braking_loop, course, loop_row, sensors
from tuning.encoder.study import (
    TEETH,
    encoder_rows,
    endurance_cases,
    endurance_rows,
    stiffness_rows,
    table_chains,
    table_rows,
)
from tuning.encoder.tune import EncoderResult, losses, training_benches, tune_encoder
from tuning.logs.edge_speed import EdgeStudy
from tuning.logs.edges import EdgeLog
from tuning.logs.tables import LogError

LEAST_VALID = 1.0
"""s of a log that the spectra and the comparison with the measured signals need"""
LONG_LOG = 300_000
"""Edges from which on only so many harmonics are compensated as the residual needs, if nobody says how many."""
LOOP_EVENTS = 12
LOOP_TOLERANCE, LOOP_ECCENTRICITY = 0.004, 2.5e-4
"""Of the encoders in the loop, cycles and m; the source does not tell its own. At 0.16 mm 4 of 20 raw stops stick."""
LOOP_TITLE = "dry concrete from 130 to 20 km/h; slip and x2 above 60 km/h"


def study_edges(edges: EdgeStudy, out: Path, chain: WheelSpeedChain, period: float) -> Report:
    """Wheel speed and acceleration from a log of edges, and the encoder's errors: tables, CSV, JSON, figures."""
    log, notes, errors = edges.log, list(edges.notes), edges.errors
    teeth = edges.passings.pattern.slots
    study = study_log(edges.filled, chain, period).within(edges.turning.valid)
    if chain.speed is not None and chain.speed.harmonics < all_harmonics(teeth):
        notes.append(f"compensated as in a control unit: {chain.speed.harmonics} harmonics of {all_harmonics(teeth)}")
    rows, files = [], []
    if study.valid.sum() * period >= LEAST_VALID:
        for signal in SIGNALS:
            before, after = (periodic_part(study, signal, compensated, teeth) for compensated in (False, True))
            if after > before:
                notes.append(f"compensation of the {signal} made it worse, {after:.3g} for {before:.3g}: switched off")
                study = study.without(signal)
                after = before
            rows.append(
                {
                    "signal": signal,
                    "periodic part, measured": float(f"{before:.4g}"),
                    "compensated": float(f"{after:.4g}"),
                    "ratio": round(before / after, 2) if after else 1.0,
                }
            )
        files = [
            save(figures.signals_figure(study, edges.turning), out / "signals.png"),
            save(figures.spectrum_figure(study), out / "spectrum.png"),
        ]
    verdict, reasons = edges.verdict, list(edges.reasons)
    if not rows and verdict != "refuted":
        verdict = "doubtful"
        reasons.append(f"{study.valid.sum() * period:.3g} s of the log can be trusted, {LEAST_VALID:g} s needed")
    encoder = [
        {
            "wheel": edges.passings.pattern.name,
            "edges": log.stamps.size,
            "left out": edges.passings.doubled,
            "missing": edges.passings.missed,
            "gaps": edges.passings.cuts,
            "trusted [%]": round(100 * float(edges.turning.valid.mean()), 1),
            "revolutions": round(float(edges.passings.tooth[-1] - edges.passings.tooth[0]) / teeth, 1),
            "e / r": float(f"{errors.eccentricity:.4g}"),
            "teeth within [cycles]": float(f"{errors.tolerance:.4g}"),
            "jitter [cycles]": float(f"{edges.noise:.2g}"),
        }
    ]
    tables = {"the encoder": encoder}
    if rows:
        tables = {"rms at multiples of the wheel's frequency [rad/s, rad/s^2]": rows, **tables}
    result = {
        "log": log.name,
        "verdict": verdict,
        "reasons": reasons,
        "notes": notes,
        "coefficients": {signal: values.tolist() for signal, values in study.coefficients.items()},
        "tooth_errors": errors.mean.tolist(),
        "tables": tables,
    }
    files = [_write_signals(study, edges, out / "wheel_speed.csv"), *files]
    if errors.tooth.size:
        files.append(save(figures.tooth_figure(errors), out / "teeth.png"))
    if study.coefficients and rows:
        files.append(save(figures.coefficients_figure(study), out / "coefficients.png"))
    results = {out / "result.json": result}
    return Report(tables, notes, files, verdict=verdict, reasons=reasons, results=results)


def _write_signals(study: LogStudy, edges: EdgeStudy, path: Path) -> Path:
    turning, size = edges.turning, study.time.size
    columns = {
        "time_s": turning.time[:size],
        "wheel_speed_rad_s": turning.speed[:size],
        "wheel_acceleration_rad_s2": turning.acceleration[:size],
        "compensated_wheel_speed_rad_s": study.speed,
        "compensated_wheel_acceleration_rad_s2": study.acceleration,
        "measured_wheel_speed_rad_s": study.measured.speed,
        "measured_wheel_acceleration_rad_s2": study.measured.acceleration,
        "valid": turning.valid[:size],
    }
    # Logs of an hour are written in one go: row by row takes longer than all else.
    line = "%.9f" + ",%.9g" * (len(columns) - 2) + ",%d"
    rows = zip(*(values.tolist() for values in columns.values()))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([",".join(columns), *(line % row for row in rows)]) + "\n")
    return path


def chain_for(log: EdgeLog, events: int, harmonics: int | None, tuned: Path | None) -> WheelSpeedChain:
    """The chain for a log: with regressors made of the edges, or as `tune-encoder` has left it.

    All harmonics are compensated unless told otherwise; in logs of more than `LONG_LOG` edges ceil(1.5 N / n).

    Raises:
        LogError: if the tuned chain is for another number of teeth, or the file is not a result of `tune-encoder`.
    """
    if tuned is None:
        if not 3 <= events <= 10 * log.teeth:
            raise LogError(f"events = {events} must lie between 3 and {10 * log.teeth}")
        if harmonics is not None and not 1 <= harmonics <= all_harmonics(log.teeth):
            raise LogError(f"harmonics = {harmonics} must lie between 1 and {all_harmonics(log.teeth)}")
        if harmonics is None and log.stamps.size > LONG_LOG:
            harmonics = enough_harmonics(log.teeth, events)
        return edge_chain(log.teeth, events, harmonics)
    try:
        result = EncoderResult.from_json(read_json(tuned))
    except (KeyError, TypeError):
        raise LogError(f"{tuned}: not a result of tune-encoder") from None
    if result.config.teeth != log.teeth:
        raise LogError(f"{tuned}: tuned for {result.config.teeth} teeth, the log is of {log.teeth}")
    return result.chain()


def tune(config: EncoderConfig, out: Path, progress: Progress, journal: Journal) -> Report:
    """Tune the chain, and judge it on encoders that were not tuned on."""
    result = tune_encoder(config, progress=progress, journal=journal)
    parameters = ", ".join(f"{name} {value:.4g}" for name, value in result.parameters.items())
    measured = _measured_costs(config)
    grid = [
        {
            "n": row["events"],
            "M": row["harmonics"],
            "ratio": round(float(np.exp(measured[int(row["events"])] - row["cost"])), 2),
        }
        for row in result.grid
    ]
    tables = {"held-out encoders [rad/s, rad/s^2]": result.held_out}
    files = [
        write_json(out / "grid.json", {"rows": grid}),
        save(figures.grid_figure(result.grid, measured), out / "events_and_harmonics.png"),
        save(figures.descent_figure(result.history), out / "history.png"),
    ]
    lines = [f"n = {result.events}, M = {result.harmonics} of {len(result.grid)} pairs", f"parameters: {parameters}"]
    warnings = [f"warning: {said}" for said in unmoved(config.initial(), result.parameters)]
    results = {out / "result.json": result.to_json()}
    return Report(tables, lines, files, result.interrupted, warnings=warnings, results=results)


def _measured_costs(config: EncoderConfig) -> dict[int, float]:
    """Cost of the measured signals by number of events."""
    benches = training_benches(config)
    return {n: float(losses(benches, measured_chain(config.teeth, n)).mean()) for n in config.events}


def study(out: Path, encoders: int = 20, hours: float = 1.0) -> Iterator[Report]:
    """The published table, other encoders, endurance, and the chain in the loop, one report each."""
    tables: dict[str, Any] = {}

    def report(title: str, rows, *files: Path) -> Report:
        tables[title] = rows
        return Report({title: rows}, [], list(files))

    for title, rows, files in _imperfections(out):
        yield report(title, rows, *files)
    yield report("rms errors, 16 encoders; ratio to measured [rad/s, rad/s^2]", table_rows(), _convergence(out))
    yield report("other encoders and clocks, 1020 rpm", encoder_rows())
    yield report("endurance: rms of differences and errors [rad/s, rad/s^2]", endurance_rows(endurance_cases(hours)))
    told = {"the truth": None, **sensors(loop_encoders(encoders), loop_chains())}
    free = [loop_row(label, course(sensor, free=True), None) for label, sensor in told.items()]
    yield report(f"{LOOP_TITLE}, pressure free as in the source", free)
    courses = {label: course(sensor) for label, sensor in told.items()}
    ideal = float(ideal_distance(braking_loop(), SPEED, horizon=HORIZON))
    rows = [loop_row(label, found, ideal) for label, found in courses.items()]
    shown = int(np.argsort(np.asarray(courses["as measured"].stop.longest_cycle))[-1])
    yield report(
        f"{LOOP_TITLE}, pedal 400 bar per s",
        rows,
        save(figures.cycles_figure(courses, shown), out / "cycles.png"),
        save(figures.loop_figure(courses, shown), out / "stops.png"),
    )
    yield report("XBS in the loop, 4-state observer", stiffness_rows(observed_courses(told)))
    for title, rows, files in _notch_filter(out, encoders):
        yield report(title, rows, *files)
    seeds = {"errors of the edges, time-stamping, models": imperfections.SEED, "all other encoders": "0, 1, 2, ..."}
    yield Report({}, [], [write_json(out / "tables.json", tables)], seeds=seeds)


def _imperfections(out: Path) -> Iterator[tuple[str, list[dict[str, Any]], list[Path]]]:
    """What imperfections do to edges and to time-stamping, and the three models they can be learned with."""
    found = imperfections.transitions()
    file = save(imperfections.transitions_figure(found), out / "transitions.png")
    yield "errors of the edges, told by 100 revolutions at 1020 rpm", imperfections.transition_rows(found), [file]
    file = save(imperfections.stamped_figure(), out / "time_stamping.png")
    yield "time-stamping over n events: rms errors [rad/s, rad/s^2]", imperfections.stamped_rows(), [file]
    learned = imperfections.learned()
    file = save(imperfections.models_figure(learned), out / "models.png")
    yield "errors learned with the models of position, speed and acceleration, M = 5", learned.rows, [file]


def _notch_filter(out: Path, encoders: int) -> Iterator[tuple[str, list[dict[str, Any]], list[Path]]]:
    """Where the notch filter helps, as published, and why five phases stick behind it in stops to 20 km/h."""
    slip, cycles = notching.slip_runs(), notching.cycle_runs()
    yield (
        "wheel-slip control, 150 to 80 km/h, x2 with an oscillation",
        notching.slip_rows(slip),
        [save(notching.bode_figure(), out / "notch.png"), save(notching.slip_figure(slip), out / "notch_slip.png")],
    )
    file = save(notching.cycles_figure(cycles), out / "notch_cycles.png")
    yield "five phases at 130 km/h, x2 with an oscillation", notching.cycle_rows(cycles), [file]
    frequencies = sticking.frequency_rows()
    courses = sticking.sticking_courses(loop_encoders(encoders), LOOP_EVENTS)
    yield "five phases at constant speed, nothing to filter", frequencies, []
    file = save(sticking.sticking_figure(frequencies, courses), out / "notch_sticks.png")
    yield "five phases behind notch filters, 130 to 20 km/h", sticking.sticking_rows(courses), [file]


def loop_encoders(count: int) -> Encoder:
    """The encoders in the loop."""
    return Encoder.random(range(count), TEETH, LOOP_TOLERANCE, LOOP_ECCENTRICITY)


def loop_chains() -> dict[str, WheelSpeedChain]:
    """What the controller may be told, by name."""
    return {
        "as measured": measured_chain(TEETH, LOOP_EVENTS),
        "notch filter": notch_chain(TEETH, LOOP_EVENTS),
        "RLS": filtered_chain(TEETH, LOOP_EVENTS, 6),
        "RLS through the edges, 12 ms": edge_chain(TEETH, LOOP_EVENTS, 12, memory=0.012),
    }


def observed_courses(told: Mapping[str, Any]):
    """The same stops with the 4-state observer of XBS in the loop."""
    observer = UnknownRoad().observer(braking_loop().plant.wheel)
    return {label: course(sensor, observer, UnknownRoad.substeps) for label, sensor in told.items()}


def _convergence(out: Path) -> Path:
    """Rms error over a tenth of a second against time since the first edge, mean over encoders."""
    bench = bench_of(Encoder.random(range(16), TEETH), "constant", 10.0, 0.0)
    width, errors = 100, {}
    for label, chain in table_chains().items():
        found, _ = estimate(chain, bench.edges, PERIOD)
        errors[label] = tuple(
            np.sqrt(
                np.mean(
                    np.square(np.asarray(getattr(found, s) - getattr(bench.truth, s))).reshape(16, -1, width), (0, 2)
                )
            )
            for s in SIGNALS
        )
    time = PERIOD * width * (np.arange(len(errors["measured"][0])) + 0.5)
    return save(figures.convergence_figure(time, errors), out / "convergence.png")
