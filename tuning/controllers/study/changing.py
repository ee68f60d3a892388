"""Roads that change under the wheel: a patch of snow on dry asphalt, ice to dry asphalt.

What counts is the way from the pedal, and how soon the car brakes again: the time from the end of the slippery part
until the deceleration has risen to 90 % of what the road offers.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from absjax.loop.stop import Stop, stop
from absjax.plant.wheel import GRAVITY
from tuning.controllers.batch import batch_of
from tuning.controllers.config import TuningConfig
from tuning.controllers.recipes import tuned_sets
from tuning.controllers.rows import rows_of
from tuning.controllers.settings import SAMPLED
from tuning.controllers.setup import Setup
from tuning.controllers.study.distances import HORIZON, NAMES, Entry, cell, stops_of, untuned_and_tuned
from tuning.controllers.study.ride import signals_along
from tuning.core.roads import BLEND, Surfaces, name_of, surfaces_of

PATCH = Surfaces(("dry_asphalt", "snow", "dry_asphalt"), (25.0, 55.0))
ICE = Surfaces(("ice", "dry_asphalt"), (20.0,))
CASES: tuple[tuple[Surfaces, tuple[float, ...]], ...] = ((PATCH, (150.0, 120.0)), (ICE, (60.0, 80.0)))
"""Roads, and the speeds from which they are braked [km/h]; the last of each is among what the sets are tuned on."""
REGAINED = 0.9
"""Share of the friction offered at which the car brakes again."""


def configured(config: TuningConfig, road: Any, speeds_kmh: tuple[float, ...]) -> TuningConfig:
    """A configuration on a road that changes."""
    return dataclasses.replace(config, roads=(road,), speeds_kmh=speeds_kmh)


def changing_rows() -> tuple[list[dict[str, Any]], list[Entry]]:
    """Stops of every controller, untuned and tuned, sampled at 1 ms, and how soon they brake again."""
    rows, entries = [], []
    for road, speeds in CASES:
        for base in tuned_sets().values():
            config = configured(base, road, speeds)
            found = stops_of(config, untuned_and_tuned(config), SAMPLED)
            entries += found
            again = {name: brakes_again(config, values) for name, values in untuned_and_tuned(config).items()}
            place = {row.speed_kmh: i for i, row in enumerate(rows_of(config))}
            rows += [
                {
                    "road": name_of(road),
                    "km/h": e.row.speed_kmh,
                    "controller": NAMES[e.controller],
                    "set": e.set,
                    "distance": cell(e),
                    "ideal": f"{e.ideal:.2f}",
                    "brakes again after [s]": _seconds(again[e.set][place[e.row.speed_kmh]]),
                    "longest cycle [s]": round(e.stop.longest_cycle, 2),
                    "lock > 15 km/h [s]": round(e.stop.lock_s_above_15 or 0.0, 3),
                }
                for e in found
            ]
    return rows, entries


def _seconds(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else "never"


def recorded(config: TuningConfig, values: dict[str, float]) -> tuple[Any, Stop]:
    """The stops of one set, sampled, with their trajectory."""
    setup = Setup.of(config)
    batch = batch_of(setup)
    loop = dataclasses.replace(batch.loop, controller=setup.controller(values))
    system, step = SAMPLED.applied(setup, loop)
    horizon = HORIZON * max(row.longest_ideal for row in rows_of(config)) + 1.0
    every = max(1, round(1e-3 / step))
    return loop, stop(system, batch.speed, horizon=min(horizon, 40.0), step=step, max_events=1500, save_every=every)


def brakes_again(config: TuningConfig, values: dict[str, float]) -> np.ndarray:
    """Time from the end of the last change of the road until 90 % of its friction are used, (rows,), or infinite."""
    loop, stopped = recorded(config, values)
    path = stopped.rollout.path
    signals = signals_along(loop, path)
    offered = float(surfaces_of(config.roads[0])[0][-1].peak().friction)
    used = -np.asarray(signals.vehicle_acceleration) / GRAVITY
    changed = config.roads[0].changes[-1] + BLEND
    on_it = np.asarray(path.state.loop.plant.distance) >= changed
    time, valid = np.asarray(path.time), np.asarray(path.valid)
    found = []
    for t, here, good in zip(time, on_it & valid, (used >= REGAINED * offered) & on_it & valid):
        found.append(t[good.argmax()] - t[here.argmax()] if good.any() else np.inf)
    return np.array(found)


def changing_figure(road: Surfaces, speed_kmh: float, controllers: Sequence[str] = ("five_phase", "two_phase")):
    """Speeds and pressure of some controllers on a road that changes, untuned and tuned."""
    figure, grid = plt.subplots(
        2, 2 * len(controllers), figsize=(4.2 * 2 * len(controllers), 6), sharey="row", layout="constrained"
    )
    columns = iter(grid.T)
    for name in controllers:
        config = configured(tuned_sets()[name], road, (speed_kmh,))
        for which, values in untuned_and_tuned(config).items():
            loop, stopped = recorded(config, values)
            path = stopped.rollout.path
            valid, state = np.asarray(path.valid)[0], path.state.loop
            time = np.asarray(path.time)[0][valid]
            top, bottom = next(columns)
            top.plot(time, np.asarray(state.plant.speed)[0][valid], "k", label="vehicle")
            rim = float(loop.plant.wheel.radius) * np.asarray(state.plant.wheel_speed)[0][valid]
            top.plot(time, rim, "C0", lw=0.8, label="wheel rim")
            bottom.plot(time, np.asarray(loop.wheel_pressure(state))[0][valid], "C3", lw=0.9)
            top.set_title(f"{NAMES[name]}, {which}: {float(stopped.distance[0]):.1f} m", fontsize=10)
            bottom.set_xlabel("time [s]")
            for axes in (top, bottom):
                axes.grid(alpha=0.3)
    grid[0, 0].set_ylabel("speed [m/s]")
    grid[0, 0].legend(fontsize="small")
    grid[1, 0].set_ylabel("pressure at the wheel [bar]")
    figure.suptitle(f"{name_of(road).replace('_', ' ')}, {speed_kmh:g} km/h")
    return figure
