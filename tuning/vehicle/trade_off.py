"""Thresholds tuned on split friction under a limit of the yaw rate: what distance is paid for less of it.

    minimise  s / s0 + K max(0, r / r_max - 1)

over the thresholds and rates of both axles, s the distance, r the largest yaw rate on the way, s0 the distance of the
start; one descent for each limit r_max, all in one program, by the gradient through every switching of every channel.
"""

import math
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.controllers.base import Controller
from absjax.lanes import stacked
from absjax.loop.stop import Outcome
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.plant.steering import YawDriver
from absjax.tyres.surfaces import surface
from tuning.cars.entry import AXLES
from tuning.controllers.loops import with_parameters
from tuning.core.box import Box, box_of, joined
from tuning.core.descent import Descent, Progress
from tuning.vehicle.split_mu import SPUN, WIRINGS, longest_stop, split_car, split_loop, split_stop, tuned

TRADED = "independent", "select-low behind"
"""Wirings that are tuned; select-low in front leaves no yaw to trade."""
SHARES = 1.0, 0.85, 0.7, 0.55, 0.4
"""Limits, over the largest yaw rate of the start."""
STRICTNESS = 10.0
"""K: one percent above the limit is worth as much as a tenth of the distance."""
KEPT = 1.01
"""Share of a limit up to which it counts as kept."""
FAILED = 10.0
"""Charge of a stop that does not end."""
FLOOR = 10.0
"""Smallest threshold, m/s^2."""
ITERATIONS, RATE = 30, 0.06
ELSEWHERE = 0.8
"""Speed at which sets are judged, over the one they are tuned at."""
WHERES = "", ", sampled 1 ms", f", {ELSEWHERE:g} of the speed"
"""What sets are judged in."""


class Traded(NamedTuple):
    """The best set under one limit."""

    wiring: str
    limit: float
    """of the yaw rate [rad/s]"""
    parameters: dict[str, float]
    row: dict[str, Any]


def trade_off(
    right: str,
    speed_kmh: float,
    wiring: str,
    controller: Controller | None = None,
    *,
    iterations: int = ITERATIONS,
    shares: tuple[float, ...] = SHARES,
    progress: Progress = lambda i, n, cost: None,
) -> list[Traded]:
    """The best sets found under every limit, dry asphalt on the left, a driver who steers against the yaw.

    Args:
        right: surface on the right.
        speed_kmh: initial speed [km/h].
        wiring: of `tuning.vehicle.split_mu.WIRINGS`.
        controller: to start from, in every channel; the shipped five-phase set when None.
        iterations: of the descents.
        shares: the limits, over the largest yaw rate of the start.
        progress: called with iteration, iterations and the best cost so far.
    """
    controller, speed, other = tuned() if controller is None else controller, speed_kmh / 3.6, surface(right)
    own = box_of(type(controller), vars(controller), floor=FLOOR)
    box = joined([own.called(axle) for axle in AXLES])
    loop = split_loop(split_car(surface("dry_asphalt"), other, YawDriver()), controller, WIRINGS[wiring])
    start = box.point({axle + name: getattr(controller, name) for axle in AXLES for name in own.names})
    horizon = longest_stop(other, speed)
    loops, points = stacked([loop] * len(shares)), np.repeat(start[None], len(shares), axis=0)
    turned = partial(_stops, loops, box=box, horizon=horizon)
    begun = turned(points, speed)
    limits = np.array(shares) * float(begun.yaw_rate[0])

    def costs_and_gradients(_, points):
        return _costs(loops, points, speed, float(begun.distance[0]), limits, box=box, horizon=horizon)

    descent = Descent(points).run(
        costs_and_gradients, box, iterations=iterations, learning_rate=RATE, progress=progress
    )
    best = descent.best_points
    settings = (speed, 0), (speed, 2), (ELSEWHERE * speed, 0)
    judged = {where: turned(best, at, ticks=ticks) for where, (at, ticks) in zip(WHERES, settings)}
    values = box.arrays(best)
    return [
        Traded(wiring, limit, {k: float(v[i]) for k, v in values.items()}, _row(wiring, limit, judged, i))
        for i, limit in enumerate(limits)
    ]


def charged(distance, yaw_rate, failed):
    """Costs of stops: distances over that of the start, charged for yaw rates over their limit."""
    return distance + STRICTNESS * jnp.maximum(yaw_rate - 1, 0.0) + FAILED * failed


@partial(jax.jit, static_argnames=("box", "horizon", "ticks"))
def _stops(loops: VehicleLoop, points, speed, *, box: Box, horizon: int, ticks: int = 0):
    points = jnp.asarray(points)
    return split_stop(
        with_parameters(loops, box.values(points)), jnp.full(len(points), speed), horizon=horizon, ticks=ticks
    )


@partial(jax.jit, static_argnames=("box", "horizon"))
def _costs(loops: VehicleLoop, points, speed, distance, limits, *, box: Box, horizon: int):
    def costs_of(points):
        found = _stops(loops, points, speed, box=box, horizon=horizon)
        failed = found.stop.outcome != Outcome.STOPPED
        return charged(found.distance / distance, found.yaw_rate / limits, failed)

    costs, pull = jax.vjp(costs_of, jnp.asarray(points))
    return costs, pull(jnp.ones_like(costs))[0]


def _row(wiring: str, limit: float, judged: dict[str, Any], i: int) -> dict[str, Any]:
    row: dict[str, Any] = {"control": wiring, "limit [deg/s]": round(math.degrees(limit), 2)}
    for where, found in judged.items():
        row[f"distance{where} [m]"] = round(float(found.distance[i]), 2)
        row[f"largest yaw rate{where} [deg/s]"] = round(math.degrees(float(found.yaw_rate[i])), 2)
    turned = judged[""]
    row["largest side-slip [deg]"] = round(math.degrees(float(turned.side_slip[i])), 2)
    row["limit"] = "kept" if float(turned.yaw_rate[i]) <= KEPT * limit else "not reached"
    row["end"] = "spun" if turned.side_slip[i] > SPUN else Outcome(int(turned.stop.outcome[i])).message
    row["locked above 15 km/h [s]"] = round(float(turned.stop.longest_lock[0][i]), 3)
    return row
