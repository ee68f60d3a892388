"""The study of the controllers: limit cycles, distances, robustness, and where control of XBS fails."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from absjax.actuator import Brake
from absjax.closed_loop import ClosedLoop
from absjax.control.two_phase import TwoPhase
from absjax.cycles.rollout import limit_cycle
from absjax.cycles.two_phase import poincare_map, two_phase_cycle
from absjax.road import SURFACES, UniformRoad
from absjax.vehicle import TestRig, Wheel
from tuning import abs_figures as figures
from tuning import phase_study, robustness
from tuning.config import TuningConfig
from tuning.cycles import CycleRow, certify_cycles
from tuning.distance_study import (
    DEFAULTS,
    FURTHER_ROADS,
    FURTHER_SPEEDS_KMH,
    LEGEND,
    NAMES,
    best_rows,
    distance_rows,
    reached,
    study,
    tuned_sets,
)
from tuning.figures import save
from tuning.files import write_json
from tuning.report import Report

POINCARE = (
    {"zref": 20.0, "gain": 200.0, "chi_a": -0.2, "chi_b": 3.0},
    {"zref": 20.0, "gain": 20.0, "chi_a": 0.0, "chi_b": 1.0},
)
RIG_SPEED = 20.0
"""m/s"""
STOPS = 2000
SEED = 2024


def run_study(out: Path, stops: int = STOPS) -> Iterator[Report]:
    """Every table and figure of the controllers."""
    yield poincare(out)
    yield failure(out)
    yield distance(out)
    yield further_roads(out)
    yield cycles(out)
    yield scattered(out, stops)


def poincare(out: Path) -> Report:
    """The two-phase cycle in closed form, by Lambert's W, and by rollout."""
    tyre, rows = SURFACES["dry_asphalt"], []
    c, d = float(tyre.c2), float(tyre.c2 * tyre.c3)
    for settings in POINCARE:
        closed = two_phase_cycle(c, d, **settings)
        zeta = closed.offset / settings["zref"]
        rig = TestRig(Wheel(), UniformRoad(tyre), RIG_SPEED)
        rolled = limit_cycle(ClosedLoop(rig, Brake(), TwoPhase(**settings)), step=2.5e-4)
        rows.append(
            {
                "kp": settings["gain"],
                "kappa": f"{float(closed.kappa):.8f}",
                "x2 [m/s²]": f"{float(closed.offset):.6f}",
                "P'": f"{float(closed.contraction):.8f}",
                "period in s": f"{float(closed.period):.6f}",
                "sufficient kp": f"{float(closed.sufficient_gain):.2f}",
                "Lambert form off": f"{abs(float(poincare_map(zeta, settings['gain'], closed.kappa) - zeta)):.1e}",
                "rollout off: x2": f"{abs(float(rolled.offset - closed.offset)):.1e}",
                "rollout off: P'": f"{abs(float(rolled.contraction - closed.contraction)):.1e}",
            }
        )
    title = "limit cycle of two phases on dry asphalt"
    return Report({title: rows}, [], [write_json(out / "poincare.json", {"rows": rows})])


def failure(out: Path) -> Report:
    """Continuous and two-phase control of XBS in the phase plane, on the true and on an estimated XBS."""
    rows, files = [], []
    for name, controller in (("continuous", phase_study.CONTINUOUS), ("two_phase", phase_study.TWO_PHASE)):
        studied = phase_study.runs(controller)
        rows += phase_study.rows(name, studied)
        for inside, feedback in ((False, "state_feedback"), (True, "output_feedback")):
            title = f"{name}, {feedback}".replace("_", " ")
            files.append(save(phase_study.figure(studied, inside, title), out / f"{name}_{feedback}.png"))
    title = f"control of XBS from {phase_study.SPEED:g} m/s on dry asphalt"
    return Report({title: rows}, [], [write_json(out / "failure.json", {"rows": rows}), *files])


def distance(out: Path) -> Report:
    """The published table, both columns, and the best of all controllers."""
    done = study()
    tables = {f"{NAMES[name]}: distances [m]": distance_rows(done, name) for name in DEFAULTS}
    tables["tuned and sampled at 1 ms: distances [m]"] = best_rows(done)
    lines = [f"{NAMES[n]}: {sum(reached(done, n))} of {len(done.rows)} rows at or below published" for n in DEFAULTS]
    ideal = np.array([distance for *_, distance in done.rows])
    best = np.array([done.sampled[name].distance[i] if (name := done.best(i)) else np.inf for i in range(len(ideal))])
    over = 100 * (best / ideal - 1)
    lines += [f"the best is {over.mean():.2f} % above ideal in the mean, {over.max():.2f} % at worst", LEGEND]
    files = [
        write_json(out / "distances.json", tables),
        save(figures.distances_figure(done), out / "distances.png"),
        save(figures.slip_planes_figure(), out / "slip_planes.png"),
    ]
    return Report(tables, lines, files)


def further_roads(out: Path) -> Report:
    """Snow, ice, and roads whose curve has no maximum."""
    done = study(FURTHER_ROADS, FURTHER_SPEEDS_KMH)
    tables = {f"{NAMES[name]}, further roads": distance_rows(done, name) for name in DEFAULTS}
    tables["further roads, tuned and sampled at 1 ms"] = best_rows(done)
    return Report(tables, [LEGEND], [write_json(out / "further_roads.json", tables)])


def cycles(out: Path) -> Report:
    """Certificates of the limit cycles of all controllers that cycle."""
    found = {name: certify_cycles(config, config.start) for name, config in tuned_sets().items()}
    found = {name: rows for name, rows in found.items() if rows}
    table = [
        {
            "controller": NAMES[name],
            "road": road,
            "cycles found": f"{sum(row.contraction is not None for row in mine)} of {len(mine)}",
            "largest contraction": _largest(mine, "contraction"),
            "with the observer": _largest(mine, "with_observer"),
            "attractive": "yes" if all(row.certified for row in mine) else "no",
        }
        for name, rows in found.items()
        for road in dict.fromkeys(row.road for row in rows)
        for mine in [[row for row in rows if row.road == road]]
    ]
    shown = {name: rows for name, rows in found.items() if name in DEFAULTS}
    data = {name: [dataclasses.asdict(row) for row in rows] for name, rows in found.items()}
    files = [write_json(out / "cycles.json", data), save(figures.contraction_figure(shown), out / "contraction.png")]
    speeds = ", ".join(f"{speed:g}" for speed in TuningConfig().cycle_speeds_kmh)
    return Report({f"limit cycles at {speeds} km/h": table}, [], files)


def _largest(rows: list[CycleRow], field: str) -> str:
    values = [value for row in rows if (value := getattr(row, field)) is not None]
    return f"{max(values):.5f}" if values else "-"


def scattered(out: Path, stops: int) -> Report:
    """Tuned sets against the default ones, on scattered roads, wheels, brakes and noise."""
    draws, rows, excess = robustness.draw(stops, SEED), [], {}
    for label, config in _contestants().items():
        stopped = robustness.stops(config, config.base_controller(), draws)
        found = robustness.summarise(stopped)
        excess[label] = robustness.excess(stopped)
        rows.append(
            {
                "controller": label,
                "locks or fails [%]": round(100 * found.locked, 2),
                "mean above ideal [%]": round(100 * (found.mean - 1), 2),
                "worst 5 % [%]": round(100 * (found.worst - 1), 2),
            }
        )
    title = f"{stops} stops: road, load, radius, brake, lag, noise and speed scattered"
    file = save(figures.robustness_figure(excess), out / "robustness.png")
    return Report({title: rows}, [], [write_json(out / "robustness.json", {"rows": rows}), file])


def _contestants() -> dict[str, TuningConfig]:
    tuned = tuned_sets()
    default = {name: dataclasses.replace(tuned[name], start={}) for name in DEFAULTS}
    unlimited = dataclasses.replace(tuned["two_phase"], start={**tuned["two_phase"].start, "slip_limit": -1.0})
    return {
        **{f"{NAMES[name]}, default": config for name, config in default.items()},
        **{f"{NAMES[name]}, tuned": config for name, config in tuned.items()},
        f"{NAMES['two_phase']}, without slip limit": unlimited,
    }
