"""What distance is paid for less yaw rate on split friction: for each limit the shortest stop that keeps it.

    minimise  s / s0 + K max(0, r / r_max - 1) + C (max(0, t_lock - 0.2 s) + max(0, t_slide - 0.5 s)) + F [lost]

over the thresholds and rates of both axles, s the distance, s0 that of the start, r the largest yaw rate on the way,
r_max its limit; a stop is lost that does not end, or in which the car spins. Sets that fill the box are screened, the
best few for each limit descended from by the gradient through every switching of every channel, and evolution goes on
around the best. All that is judged on the way is kept (`tuning.vehicle.archive`): each limit has the best of all of it,
at the worse of both semantics, located and sampled.
"""

import math
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.controllers.base import Controller
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.parameters import bounds_of
from absjax.plant.steering import YawDriver
from absjax.tyres.surfaces import surface
from tuning.cars.entry import AXLES
from tuning.controllers.loops import with_parameters
from tuning.core.box import Box, box_of, joined
from tuning.core.descent import Descent
from tuning.core.evolution import Evolution
from tuning.core.problem import in_chunks
from tuning.vehicle.archive import Archive, Turned
from tuning.vehicle.regulation.screening import LONGEST_LOCK, LONGEST_SLIDE
from tuning.vehicle.split_mu import WIRINGS, longest_stop, split_car, split_loop, split_stop, tuned

TRADED = "independent", "select-low behind"
"""Wirings that are tuned; select-low in front leaves no yaw to trade."""
LIMITS = 5
STRICTNESS = 10.0
"""K: one percent above the limit is worth as much as a tenth of the distance."""
SLIDING = 2.0
"""C, 1/s"""
FAILED = 10.0
"""F"""
FLOOR = 10.0
"""Smallest threshold, m/s^2."""
SWITCHINGS = 1500
"""Most of a stop: of 512 sets that fill the box the twenty with the shortest sound stops make 500 at most."""
TOGETHER = 64
"""Sets that are rolled out together."""
WIDEST = 0.1
"""Standard deviation of the first generation of an evolution, on the scales of the box."""
BEYOND = 1.25
"""Factor by which the search goes beyond the ends of the front it has so far."""
ELSEWHERE = 0.8
"""Speed at which sets are judged, over the one they are tuned at."""
TICKS = 2
"""Of the control unit in a grid step."""
LOCATED, SAMPLED = "as tuned", "sampled 1 ms"


class Effort(NamedTuple):
    """How long is searched."""

    screened: int = 512
    """sets that fill the box"""
    starts: int = 2
    """of descents, for each limit"""
    iterations: int = 8
    """of each"""
    learning_rate: float = 0.06
    generations: int = 3
    """of evolution, for each limit"""


USUAL = Effort()


class Traded(NamedTuple):
    """The shortest stop under one limit."""

    wiring: str
    limit: float
    """of the yaw rate [rad/s]"""
    parameters: dict[str, float]
    """of both axles, those that are not tuned too"""
    row: dict[str, Any]


class Front(NamedTuple):
    """What was found of one wiring."""

    wiring: str
    box: Box
    archive: Archive
    chosen: np.ndarray
    """indices of the sets that the limits have, in the archive"""
    judged: dict[str, Turned]
    """of these, by where they were judged"""
    traded: list[Traded]


def other_road(right: str) -> str:
    """Where sets are judged that were tuned on another surface."""
    return "wet_cobblestones" if right == "snow" else "snow"


def latin_hypercube(points: int, dimensions: int) -> np.ndarray:
    """Points (points, dimensions) of the unit cube that fill it: one in each of so many slices of every edge."""
    rng = np.random.default_rng(0)
    slices = rng.permuted(np.tile(np.arange(points), (dimensions, 1)), axis=1).T
    return (slices + rng.uniform(size=slices.shape)) / points


class Search:
    """A search in which every set that is judged is kept."""

    def __init__(self, right: str, speed_kmh: float, wiring: str, controller: Controller | None, screened: int):
        """Judge the start, and sets that fill the box; dry asphalt on the left, a driver who steers against the yaw.

        Args:
            right: surface on the right.
            speed_kmh: initial speed [km/h].
            wiring: of `tuning.vehicle.split_mu.WIRINGS`.
            controller: to start from, in every channel; the shipped five-phase set when None.
            screened: sets that fill the box.
        """
        controller = tuned() if controller is None else controller
        self.right, self.speed, self.wiring = right, speed_kmh / 3.6, wiring
        own = box_of(type(controller), vars(controller), floor=FLOOR)
        self.box = joined([own.called(axle) for axle in AXLES])
        known = {name: float(getattr(controller, name)) for name in bounds_of(type(controller))}
        self.start = {axle + name: value for axle in AXLES for name, value in known.items()}
        roads = surface(right), surface(other_road(right))
        self.loop, self.other = (
            split_loop(split_car(surface("dry_asphalt"), road, YawDriver()), controller, WIRINGS[wiring])
            for road in roads
        )
        self.horizon = longest_stop(roads[0], self.speed)
        self.longest = max(longest_stop(road, self.speed) for road in roads)
        low, high = self.box.limits
        share = latin_hypercube(screened, len(low))
        self.archive = self._judged(
            self.box.valid(np.concatenate([self.box.point(self.start)[None], low + (high - low) * share]))
        )
        self.unit = float(self.archive.located.distance[0])

    def judge(self, points: np.ndarray) -> Turned:
        """Points (sets, parameters) at the worse of both semantics."""
        found = self._judged(points)
        self.archive = self.archive.joined(found)
        return found.worse

    def turned(self, points: np.ndarray, speed: float, *, other: bool = False, ticks: int = 0) -> Turned:
        """Stops of points (sets, parameters) from a speed [m/s], on the road or on the other one."""
        loop = self.other if other else self.loop
        return in_chunks(lambda x: _turned(loop, x, speed, self.box, self.longest, ticks), points, TOGETHER)

    def descend(self, starts: int, iterations: int, learning_rate: float) -> None:
        """From the best few sets for each limit; every set on the way is judged."""
        limits = self._aims()
        ranked = [np.argsort(self._costs(self.archive.worse, limit)) for limit in limits]
        begun = np.concatenate([self.archive.points[order[:starts]] for order in ranked])
        limit_of, visited = np.repeat(limits, starts), []

        def costs_and_gradients(_, points):
            visited.append(points)
            return _costs(self.loop, points, self.speed, self.unit, limit_of, self.box, self.horizon)

        Descent(begun).run(costs_and_gradients, self.box, iterations=iterations, learning_rate=learning_rate)
        self.judge(np.concatenate(visited))

    def evolve(self, generations: int) -> None:
        """Around the best set for each limit."""
        for seed, limit in enumerate(self._aims()):
            Evolution(self.box, self.archive.points, self._costs(self.archive.worse, limit)).run(
                lambda points, limit=limit: self._costs(self.judge(points), limit),
                rounds=generations,
                count=TOGETHER,
                widest=WIDEST,
                seed=seed,
            )

    def _aims(self) -> np.ndarray:
        """Limits to search under: none for the shortest stop of all, the others down to beyond the least yaw rate."""
        return np.array([math.inf, *self.archive.limits(LIMITS, BEYOND)[1:]])

    def _judged(self, points: np.ndarray) -> Archive:
        located = self.turned(points, self.speed)
        sampled = Turned(*map(np.array, located))
        (sound,) = np.nonzero(located.sound)
        if sound.size:
            for whole, part in zip(sampled, self.turned(points[sound], self.speed, ticks=TICKS)):
                whole[sound] = part
        return Archive(points, located, sampled)

    def _costs(self, turned: Turned, limit: float) -> np.ndarray:
        return np.asarray(charged(turned, self.unit, limit))


def trade_off(
    right: str, speed_kmh: float, wiring: str, controller: Controller | None = None, effort: Effort = USUAL
) -> Front:
    """Search, and what came of it; where no set that fills the box is sound, that is the end.

    Args:
        right: as for `Search`, and so `speed_kmh`, `wiring`, `controller`.
        effort: how long is searched.
    """
    search = Search(right, speed_kmh, wiring, controller, effort.screened)
    if search.archive.front().size:
        search.descend(effort.starts, effort.iterations, effort.learning_rate)
        search.evolve(effort.generations)
    return front_of(search)


def front_of(search: Search) -> Front:
    """Under each of `LIMITS` limits of the yaw rate the shortest stop that was found, also judged elsewhere."""
    archive, limits = search.archive, search.archive.limits(LIMITS)
    chosen = np.array([archive.shortest(limit) for limit in limits], int)
    judged = {LOCATED: archive.located.taken(chosen), SAMPLED: archive.sampled.taken(chosen)}
    points = archive.points[chosen]
    if chosen.size:
        judged[f"{ELSEWHERE:g} of the speed"] = search.turned(points, ELSEWHERE * search.speed)
        judged[f"{other_road(search.right).replace('_', ' ')} right"] = search.turned(points, search.speed, other=True)
    values, wiring = search.box.arrays(points), search.wiring
    sets = [search.start | {name: float(value[i]) for name, value in values.items()} for i in range(len(limits))]
    traded = [
        Traded(wiring, float(limit), own, _row(wiring, limit, judged, i))
        for i, (limit, own) in enumerate(zip(limits, sets))
    ]
    return Front(wiring, search.box, archive, chosen, judged, traded)


def charged(turned: Turned, unit: Any, limit: Any):
    """Costs of stops: distances over `unit` [m], charged for yaw rates over their limit [rad/s], wheels that lock or
    slide, and cars that spin or do not stop. Traceable."""
    turning = jnp.maximum(turned.yaw_rate / limit - 1, 0.0)
    sliding = jnp.maximum(turned.lock - LONGEST_LOCK, 0.0) + jnp.maximum(turned.slide - LONGEST_SLIDE, 0.0)
    lost = ~turned.ended | turned.spun
    return turned.distance / unit + STRICTNESS * turning + SLIDING * sliding + FAILED * lost


@partial(jax.jit, static_argnames=("box", "horizon", "ticks"))
def _turned(loop: VehicleLoop, points, speed, box: Box, horizon: int, ticks: int) -> Turned:
    points = jnp.asarray(points)
    loops, speeds = with_parameters(loop, box.values(points)), jnp.full(len(points), speed)
    return Turned.of(split_stop(loops, speeds, horizon=horizon, ticks=ticks, max_events=SWITCHINGS))


@partial(jax.jit, static_argnames=("box", "horizon"))
def _costs(loop: VehicleLoop, points, speed, unit, limits, box: Box, horizon: int):
    def costs_of(points):
        return charged(_turned(loop, points, speed, box, horizon, 0), unit, limits)

    costs, pull = jax.vjp(costs_of, jnp.asarray(points))
    return costs, pull(jnp.ones_like(costs))[0]


def _row(wiring: str, limit: float, judged: dict[str, Turned], i: int) -> dict[str, Any]:
    row: dict[str, Any] = {"control": wiring, "limit [deg/s]": round(math.degrees(limit), 2)}
    for where, found in judged.items():
        lost = "spun" if found.spun[i] else None if found.ended[i] else "no stop"
        row[f"{where} [m]"] = lost or round(float(found.distance[i]), 2)
        row[f"{where} [deg/s]"] = round(math.degrees(float(found.yaw_rate[i])), 2)
    worse = judged[LOCATED].worse(judged[SAMPLED])
    row["side-slip [deg]"] = round(math.degrees(float(worse.side_slip[i])), 2)
    row["lock [s]"], row["slide [s]"] = round(float(worse.lock[i]), 3), round(float(worse.slide[i]), 3)
    return row
