"""A tuned set as something to use: read back from `result.json`, and its stops drawn.

From the file that `tune-abs` wrote:

    controller = load_controller("result.json")
    plot_stop("result.json", "wet_asphalt", 120).savefig("stop.png")
"""

import math
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from absjax.controllers.base import Controller
from absjax.lanes import taken
from absjax.loop.stop import stop
from absjax.plots import stop_panels
from tuning.controllers.result import TuningResult
from tuning.controllers.rows import Row
from tuning.controllers.settings import LOCATED, Setting
from tuning.core.files import read_json
from tuning.core.roads import road_entry, stacked


def load_result(path: str | Path) -> TuningResult:
    """What `tune-abs` wrote.

    Raises:
        ValueError: if there is no such file, or it is not a result of `tune-abs`.
    """
    data = read_json(Path(path))
    if not isinstance(data, dict) or not {"parameters", "config", "rows"} <= set(data):
        raise ValueError(f"{path} is not a result of tune-abs: parameters, config and rows are expected")
    return TuningResult.from_json(data)


def load_controller(path: str | Path) -> Controller:
    """The tuned controller of a `result.json`.

    Raises:
        ValueError: as `load_result`, and `TuningResult.controller`.
    """
    return load_result(path).controller


def plot_stop(
    result: TuningResult | str | Path,
    road: Any,
    speed_kmh: float,
    *,
    setting: Setting = LOCATED,
    untuned: bool = True,
) -> Figure:
    """Speeds, slip, pressure and phases of a stop of a result, beside that of the set the search began with; of several
    vehicles of the first.

    Args:
        result: a result, or its file.
        road: as in a configuration (`tuning.core.roads`), of the result's rows or not.
        speed_kmh: initial speed [km/h].
        setting: how the loop is run.
        untuned: whether the set the search began with is drawn too.
    """
    result = result if isinstance(result, TuningResult) else load_result(result)
    setup = result.setup
    sets: dict[str, dict[str, float]] = {result.config.began: {}} if untuned else {}
    sets["tuned"] = result.parameters
    row = Row(road_entry(road), float(speed_kmh), result.config.pedal_rate)
    figure, grid = plt.subplots(
        4, len(sets), figsize=(6.5 * len(sets), 9), sharex=True, sharey="row", squeeze=False, layout="constrained"
    )
    for axes, (name, parameters) in zip(grid.T, sets.items()):
        loop = setup.loop_of(parameters, taken(stacked([row.road]), 0))
        system, step = setting.applied(setup, loop)
        every = max(1, round(1e-3 / step))
        # A power of two: stops of many roads and speeds, which end long before, are of one program.
        horizon = 2.0 ** math.ceil(math.log2(2 * row.longest_ideal + 1.0))
        stopped = stop(
            system,
            jnp.asarray(row.speed),
            horizon=horizon,
            step=step,
            max_events=result.config.max_events,
            save_every=every,
        )
        car = "" if setup.config.vehicle is None else f", {setup.config.vehicle.each[0].name}"
        label = f"{row.name}, {speed_kmh:g} km/h{car}, {name}: {float(stopped.distance):.2f} m".replace("_", " ")
        stop_panels(axes, loop, stopped.rollout.path, label)
    return figure
