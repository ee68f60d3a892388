"""How long wheels slide all but locked: what the locks of a controller that lets go of a standing wheel do not tell.

A wheel that is let go of for a moment whenever it stands, and locks again, has no long lock; it slides all the same,
and neither steers in front nor keeps the car straight behind.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from absjax.loop.stop import stop
from tuning.controllers.batch import batch_of, on_every_row
from tuning.controllers.config import TuningConfig
from tuning.controllers.loops import in_control_unit, loop_of_lanes
from tuning.controllers.rows import rows_of
from tuning.controllers.setup import Setup
from tuning.vehicle.distances import MOST_EVENTS, TO_STOP_KMH, sets_of

DEEP = -0.8
"""Slip below which a wheel slides."""
MUCH = 0.5
"""Time in all from which on a stop is counted, s."""
SAVED = 0.02
"""Between two instants that are looked at, s."""
AXLES = "front", "rear"


def slides(cars: Sequence[str], roads: Sequence[Any], speeds_kmh: tuple[float, ...]) -> list[dict[str, Any]]:
    """Five phases on cars, unladen and laden, in a control unit that estimates the speed: of every set and vehicle how
    long the wheels of an axle slide while the car is faster than 15 km/h."""
    config = TuningConfig(
        roads=tuple(roads),
        speeds_kmh=speeds_kmh,
        stop_speed_kmh=TO_STOP_KMH,
        max_events=MOST_EVENTS,
        vehicle={"car": list(cars), "laden": [False, True], "sets": "own", "speed": "kalman"},
    )
    sets, which = sets_of(config.controller, axles=True), np.array([row.which for row in rows_of(config)])
    times = sliding_times(config, sets)
    return [
        {
            "vehicle": one.name,
            "set": name,
            "axle": axle,
            "stops": int(np.sum(which == i)),
            f"slide over {MUCH:g} s": int(np.sum(times[axle][which == i, k] > MUCH)),
            "longest [s]": round(float(times[axle][which == i, k].max()), 2),
        }
        for i, one in enumerate(config.vehicle.each)
        for k, name in enumerate(sets)
        for axle in AXLES
    ]


def sliding_times(config: TuningConfig, sets: Mapping[str, Mapping[str, float]]) -> dict[str, np.ndarray]:
    """Time in all that the wheels of an axle slide above 15 km/h [s], (rows, sets) by axle, sampled."""
    setup = Setup.of(config)
    batch, (step, ticks) = batch_of(setup), setup.sampled_grid()
    names, count = tuple(next(iter(sets.values()))), len(sets)
    own = {name: jnp.array([float(values[name]) for values in sets.values()]) for name in names}
    loop: Any = loop_of_lanes(batch.loop, on_every_row(own, batch.rows), batch.rows)
    how = ticks, batch.substeps, ticks * step, None, batch.estimator, batch.accelerometer
    every = max(1, round(SAVED / step))
    path = stop(
        in_control_unit(loop, *how),
        jnp.repeat(batch.speed, count),
        horizon=batch.horizon,
        step=step,
        max_events=batch.max_events,
        save_every=every,
        tile=64,
    ).rollout.path
    state, speed = path.state.loop.vehicle, np.asarray(path.state.loop.vehicle.speed)
    found = {}
    for axle, wheel, turning in zip(AXLES, loop.vehicle.wheels, state.wheel_speeds):
        rims = np.broadcast_to(wheel.radius, len(speed))[:, None] * np.asarray(turning)
        found[axle] = (step * every * slid(np.asarray(path.valid), speed, rims)).reshape(batch.rows, count)
    return found


def slid(valid: np.ndarray, speed: np.ndarray, rims: np.ndarray) -> np.ndarray:
    """How many of the instants (lanes, instants) a wheel slides while the vehicle is faster than 15 km/h, (lanes,).

    Args:
        valid: bool, whether the vehicle has not stopped yet.
        speed: v [m/s].
        rims: R w [m/s].
    """
    counts = valid & (speed > TO_STOP_KMH / 3.6)
    return np.sum(counts & (rims < (1 + DEEP) * speed), axis=1)
