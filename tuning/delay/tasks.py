"""The study of delays: chains and their roots, delay margins, the brake; tables and figures."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tuning.controllers.published import ROADS, SPEEDS_KMH
from tuning.core.figures import save
from tuning.core.files import write_json
from tuning.core.report import Report
from tuning.core.terminal import say_step
from tuning.delay import brake, chains, figures, margins
from tuning.delay.sets import tuned_set
from tuning.delay.traces import traces, undelayed_trace
from tuning.delay.tune import tuned_gains

WINDOW = (0.5, 0.9)
"""Of the figures of tracking, s."""
Tables = dict[str, list[dict[str, Any]]]


def study(out: Path, retune: bool = False) -> Report:
    """All of it; with the tuned sets made anew, or the shipped ones."""
    tuned = {name: tuned_set(trust) for name, trust in brake.VERSIONS} if retune else brake.tuned_parameters()
    tables, files = {}, [write_json(out / "delay_gains.json", tuned)]
    parts: dict[str, Callable[[Path], tuple[Tables, list[Path]]]] = {
        "chains and roots": chain_part,
        "delay margins": margin_part,
        "gains": gain_part,
        "tracking through a delay": tracking_part,
        "stops": partial(stop_part, tuned=tuned),
    }
    for name, part in parts.items():
        say_step(f"{name} ...")
        more, drawn = part(out)
        tables |= more
        files += drawn
    return Report(tables, [], files)


def chain_part(out: Path) -> tuple[Tables, list[Path]]:
    """The predictor on chains."""
    courses = chains.wave_courses()
    delays = np.linspace(1e-3, 0.4, 120)
    curves = chains.root_curves(delays)
    tables = {
        "decay [1/s]: measured, and the rightmost root": chains.decay_rows(),
        "pendulum from 0.5: the error": chains.pendulum_rows(),
        "pendulum after a square wave: the error": chains.wave_rows(courses),
        "conditions: sufficient and exact, on the gains of the pendulum [1/s]": chains.condition_rows(),
        "pendulum stable to: by the rightmost root": chains.limit_rows(delays, curves),
    }
    files = [
        save(figures.wave_figure(courses), out / "pendulum.png"),
        save(figures.root_figure(delays, curves), out / "roots.png"),
    ]
    return tables, files


def margin_part(out: Path) -> tuple[Tables, list[Path]]:
    """Delay margins."""
    speeds = np.linspace(3, 50, 95)
    curves = {slope.label: margins.curves(slope, speeds) for slope in margins.SLOPES}
    w = np.geomspace(0.05, 3e3, 2000)
    plots = {
        "mu' < 0, 33 km/h, K = 800": margins.nyquist((800.0, 33 * margins.KMH, -375.0), w),
        "mu' > 0, 70 km/h, K = 1723": margins.nyquist((1723.37, 70 * margins.KMH, 1875.0), w),
    }
    tables = {
        "margins of the source: single loops": margins.published_rows(),
        "margins [ms]: by speed": margins.margin_rows(),
        "margins simulated: growth in a second": margins.simulated_rows(),
        "margin derivatives [ms per percent]: at 20 m/s": margins.gradient_rows(),
    }
    files = [
        save(figures.margin_figure(speeds, curves), out / "margins.png"),
        save(figures.nyquist_figure(plots), out / "nyquist.png"),
    ]
    return tables, files


def gain_part(out: Path) -> tuple[Tables, list[Path]]:
    """Gains by gradient."""
    return {"gains tuned: by the rightmost root and by the margin": tuned_gains()}, []


def tracking_part(out: Path) -> tuple[Tables, list[Path]]:
    """Five phases through 10 ms, side by side."""
    cases = {name: brake.Case(trust=trust) for name, trust in brake.VERSIONS}
    found = [*traces(cases), undelayed_trace("without delay", brake.Case())]
    rows = [
        {"version": trace.label, "off [m/s2]": round(trace.rms, 2), "time [s]": round(float(trace.time[-1]), 3)}
        for trace in found
    ]
    files = [
        save(figures.tracking_figure(found, WINDOW), out / "tracking.png"),
        save(figures.cycle_figure(found, WINDOW), out / "cycle.png"),
        save(figures.pressure_figure(found, WINDOW), out / "pressure.png"),
        save(figures.observer_figure(found[1]), out / "observer.png"),
    ]
    return {"tracking: through 10 ms, XBS by the observer of three states": rows}, files


def stop_part(out: Path, tuned: dict[str, dict[str, float]]) -> tuple[Tables, list[Path]]:
    """Stops: over the delay, with errors, the published table, two phases."""
    undelayed = brake.stops([brake.Case()], delayed=False)
    found = brake.stops(brake.sweep_cases() + brake.robustness_cases())
    swept = len(brake.sweep_cases())
    sweep = brake.sweep_rows(brake.taken(found, slice(0, swept)))
    tables = {
        "sweep of the delay: dry asphalt from 120 km/h": sweep,
        "robustness: delay of 10 ms, dry asphalt from 120 km/h": brake.robustness_rows(
            brake.taken(found, slice(swept, None))
        ),
        "robustness in a control unit: XBS told, and estimated": brake.estimated_rows(),
        "distances through 10 ms [m]: to 10 km/h, located": table_rows(tuned, sampled=False),
        "distances in a control unit [m]: to 10 km/h, 1 ms": table_rows(tuned, sampled=True),
        "two phases through 10 ms: dry asphalt": two_phase_rows(),
    }
    return tables, [save(figures.sweep_figure(sweep, float(undelayed.distance[0])), out / "sweep.png")]


def table_rows(tuned: dict[str, dict[str, float]], sampled: bool) -> list[dict[str, Any]]:
    """Distances of the roads and speeds of the published table, without and with prediction, as published and tuned."""
    versions = {
        "not predicted": {"trust": 0.0},
        "predicted": {"trust": 1.0},
        "not predicted, tuned": {"trust": 0.0, "parameters": tuned["not predicted"]},
        "predicted, tuned": {"trust": 1.0, "parameters": tuned["predicted"]},
    }
    places = [(road, speed) for road in ROADS for speed in SPEEDS_KMH]
    cases = [brake.Case(road=road, speed_kmh=speed, **of) for of in versions.values() for road, speed in places]
    found = brake.stops(cases, sampled)
    plain = brake.stops([brake.Case(road=road, speed_kmh=speed) for road, speed in places], sampled, delayed=False)
    rows = []
    for i, (road, speed) in enumerate(places):
        row: dict[str, Any] = {"road": road, "km/h": speed, "no delay": _told(plain, i)}
        row |= {name: _told(found, k * len(places) + i) for k, name in enumerate(versions)}
        rows.append(row)
    return rows


def _told(found: brake.Stops, i: int) -> str:
    """A distance; marked where the stop does not cycle."""
    return f"{found.distance[i]:.2f}{'' if found.cycling[i] else ' *'}"


def two_phase_rows() -> list[dict[str, Any]]:
    """Two phases on the same brake."""
    named = [(name, speed) for name, _ in brake.VERSIONS for speed in SPEEDS_KMH]
    trusts = dict(brake.VERSIONS)
    found = brake.stops([brake.Case(two_phase=True, trust=trusts[name], speed_kmh=v) for name, v in named])
    plain = brake.stops([brake.Case(two_phase=True, speed_kmh=v) for v in SPEEDS_KMH], delayed=False)
    rows = [{"law": name, "km/h": v, **found.of(i)} for i, (name, v) in enumerate(named)]
    return rows + [{"law": "without delay", "km/h": v, **plain.of(i)} for i, v in enumerate(SPEEDS_KMH)]
