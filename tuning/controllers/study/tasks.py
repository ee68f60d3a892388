"""The study of the controllers: limit cycles, distances from the pedal, changing roads, robustness, published table."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from absjax.controllers.two_phase import TwoPhase
from absjax.controllers.two_phase_cycle import poincare_map, two_phase_cycle
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.limit_cycle import limit_cycle
from absjax.plant.brake import Brake
from absjax.plant.road import UniformRoad
from absjax.plant.test_rig import TestRig
from absjax.plant.wheel import Wheel
from absjax.tyres.surfaces import SURFACES
from tuning.controllers.config import TuningConfig
from tuning.controllers.cycles import CycleRow, certify_cycles
from tuning.controllers.published import ROADS, SPEEDS_KMH
from tuning.controllers.recipes import tuned_sets
from tuning.controllers.settings import CHAIN, LOCATED, SAMPLED, SETTINGS
from tuning.controllers.setup import Setup
from tuning.controllers.study import changing as changing_study
from tuning.controllers.study import curves as curve_study
from tuning.controllers.study import distances as distance_study
from tuning.controllers.study import figures, robustness
from tuning.controllers.study import logics as logic_study
from tuning.controllers.study import phase_plane as phase_study
from tuning.controllers.study import published_table as published_study
from tuning.controllers.study.distances import FURTHER_ROADS, FURTHER_SPEEDS_KMH, NAMES, untuned_and_tuned
from tuning.core.figures import save
from tuning.core.files import write_csv, write_json
from tuning.core.report import Report

POINCARE: tuple[dict[str, Any], ...] = (
    {"zref": 20.0, "gain": 200.0, "chi_a": -0.2, "chi_b": 3.0},
    {"zref": 20.0, "gain": 20.0, "chi_a": 0.0, "chi_b": 1.0},
)
RIG_SPEED = 20.0
"""m/s"""
CYCLE_SPEEDS_KMH = (60.0, 180.0)
"""Held constant where limit cycles are looked for; with the observer in the loop that takes minutes."""
STOPS = 2000
SEED = 2024


def run_study(out: Path, stops: int = STOPS) -> Iterator[Report]:
    """Every table and figure of the controllers."""
    yield curves(out)
    yield logics(out)
    yield poincare(out)
    yield failure(out)
    yield distances(out)
    yield further_roads(out)
    yield changing_roads(out)
    yield published(out)
    yield cycles(out)
    yield from scattered(out, stops)


def curves(out: Path) -> Report:
    """Friction and XBS of the published surfaces."""
    return Report({"published surfaces": curve_study.rows()}, [], [save(curve_study.figure(), out / "curves.png")])


def logics(out: Path) -> Report:
    """The cycles of the textbook's logic and of that of production cars."""
    found = [logic_study.run(name) for name in logic_study.SETTINGS]
    title = f"logics on {logic_study.ROAD.replace('_', ' ')} from {logic_study.SPEED_KMH:g} km/h, set by hand"
    return Report({title: logic_study.rows(found)}, [], [save(logic_study.figure(found), out / "logics.png")])


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
    files = [write_json(out / "poincare.json", {"rows": rows}), save(curve_study.lambert_figure(), out / "lambert.png")]
    return Report({title: rows}, [], files)


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


def distances(out: Path) -> Report:
    """Distances from the pedal of all controllers in all settings; `distances.csv` has every figure of every stop."""
    found = distance_study.study(SETTINGS)
    tables = {
        "distances from the pedal, 5 roads at 60, 120 and 180 km/h": distance_study.summary(found),
        "jerk and slip": distance_study.ride_rows(found),
    }
    for setting in (LOCATED, SAMPLED, CHAIN):
        tables[f"tuned, {setting.label}, from the pedal [m]"] = distance_study.wide_rows(found, setting)
    files = [
        write_csv(distance_study.table(found), out / "tables" / "distances.csv"),
        write_csv(distance_study.details(found), out / "tables" / "details.csv"),
        save(figures.distances_figure(found, SETTINGS), out / "distances.png"),
        save(figures.slip_planes_figure(), out / "slip_planes.png"),
    ]
    return Report(tables, [SLIP_LIMIT], files)


SLIP_LIMIT = "S: XBS never falls to chi_a on that road; the slip limit ends every apply"


def further_roads(out: Path) -> Report:
    """Snow, ice, and roads whose curve has no maximum, on none of which was tuned."""
    found = distance_study.study((SAMPLED,), FURTHER_ROADS, FURTHER_SPEEDS_KMH)
    tables = {
        f"further roads, {which}, sampled at 1 ms, from the pedal [m]": distance_study.wide_rows(found, SAMPLED, which)
        for which in distance_study.SETS
    }
    files = [write_csv(distance_study.table(found), out / "tables" / "further_roads.csv")]
    return Report(tables, [SLIP_LIMIT], files)


def changing_roads(out: Path) -> Report:
    """A patch of snow, and ice to dry asphalt: the way, and when the car brakes again."""
    rows, entries = changing_study.changing_rows()
    files = [write_csv(distance_study.table(entries), out / "tables" / "changing_roads.csv")]
    for name, (road, speeds) in zip(("patch_of_snow", "ice_to_dry"), changing_study.CASES):
        files.append(save(changing_study.changing_figure(road, speeds[-1]), out / f"{name}.png"))
    return Report({"roads that change, sampled at 1 ms": rows}, [], files)


def published(out: Path) -> Report:
    """The published quantity under a given pedal, with and without limits, against the published table."""
    found = published_study.entries()
    tables = {
        "published table, entries reached": published_study.counts(found),
        "published table, what it leaves out": published_study.onset_rows(found),
        "published table, every entry [m]": published_study.rows(found),
    }
    above = published_study.above(found)
    if above:
        tables["published table, entries above"] = above
    return Report(tables, ["+: above the published distance"], [])


def cycles(out: Path) -> Report:
    """Certificates of the limit cycles of all controllers that cycle."""
    where = {"roads": ROADS, "speeds_kmh": SPEEDS_KMH, "cycle_speeds_kmh": CYCLE_SPEEDS_KMH}
    everywhere = {name: dataclasses.replace(config, **where) for name, config in tuned_sets().items()}
    found = {name: certify_cycles(Setup.of(config), config.start) for name, config in everywhere.items()}
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
    shown = {name: rows for name, rows in found.items() if name in ("five_phase", "two_phase")}
    data = {name: [dataclasses.asdict(row) for row in rows] for name, rows in found.items()}
    files = [write_json(out / "cycles.json", data), save(figures.contraction_figure(shown), out / "contraction.png")]
    speeds = ", ".join(f"{speed:g}" for speed in CYCLE_SPEEDS_KMH)
    return Report({f"limit cycles at {speeds} km/h": table}, [], files)


def _largest(rows: list[CycleRow], field: str) -> str:
    values = [value for row in rows if (value := getattr(row, field)) is not None]
    return f"{max(values):.5f}" if values else "-"


def scattered(out: Path, stops: int) -> Iterator[Report]:
    """Tuned sets against untuned ones on scattered roads, wheels, brakes and noise; then with a scattered pedal."""
    for pedal, scatter in (
        ("pedal 400 bar/s", robustness.SCATTER),
        ("pedal 200 to 1000 bar/s", robustness.SCATTERED_PEDAL),
    ):
        draws, rows, excess = robustness.draw(stops, SEED, scatter), [], {}
        for label, (config, values) in _contestants().items():
            stopped, ideal = robustness.stops(config, Setup.of(config).controller(values), draws)
            found = robustness.summarise(stopped, ideal)
            excess[label] = robustness.excess(stopped, ideal)
            rows.append(
                {
                    "controller": label,
                    "mean above ideal [%]": round(100 * (found.mean - 1), 2),
                    "spread over scatter [%]": round(100 * found.spread, 2),
                    "worst 5 % [%]": round(100 * (found.worst - 1), 2),
                    "do not end [%]": round(100 * found.unfinished, 2),
                    "lock > 15 km/h for > 50 ms [%]": round(100 * found.locked, 2),
                    "stuck > 1 s [%]": round(100 * found.stuck, 2),
                }
            )
        title = f"{stops} scattered stops, {pedal}"
        name = "robustness" if scatter is robustness.SCATTER else "robustness_pedal"
        file = save(figures.robustness_figure(excess), out / f"{name}.png")
        yield Report({title: rows}, [], [file], seeds={title: SEED})


def _contestants() -> dict[str, tuple[TuningConfig, dict[str, float]]]:
    return {
        f"{NAMES[name]}, {which}": (config, values)
        for name, config in tuned_sets().items()
        for which, values in untuned_and_tuned(config).items()
    }
