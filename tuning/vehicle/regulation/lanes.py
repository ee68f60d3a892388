"""Loops of a car under a screening's stops as lanes of one program."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp

from absjax.lanes import stacked
from absjax.loop.driver import Driver
from absjax.loop.stop import Stop, stop
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.plant.base import Road
from absjax.plant.four_wheel import FourWheel
from absjax.plant.steering import YawDriver
from tuning.vehicle.regulation.manoeuvres import END, Manoeuvre, manoeuvres
from tuning.vehicle.regulation.quantities import KMH
from tuning.vehicle.regulation.surfaces import roads

HORIZON = 16.0
"""Longest time of a stop, s: 120 km/h at a braking rate of 0.19."""
SAVED = 5e-3
"""Time between two points that are kept, s; speed is straight in between to 1e-3 m/s."""
MAX_EVENTS = 2500
DRIVER = YawDriver(yaw_gain=0.5, heading_gain=1.0, lag=0.1, largest=0.26)
"""A practised one, who keeps a car that pulls to a side straight; the steering wheel is turned by 240 deg at most."""
TILE = 14
"""Lanes that run together."""
SETS_TILE = 56
"""The same where there are several sets."""

Clocked = Callable[[VehicleLoop], tuple[Any, float]]
"""Makes the system that is rolled out of a loop, under a control unit's clock say, and its grid step [s]."""


class Lane(NamedTuple):
    """A stop of a car."""

    laden: bool
    stop: Manoeuvre


def lanes_of(driver: Driver) -> list[Lane]:
    """All stops of a car, the longest last."""
    return [Lane(laden, stop) for stop in manoeuvres(driver) for laden in (False, True)]


def loops_of(loops: Mapping[bool, VehicleLoop], lanes: Sequence[Lane]) -> VehicleLoop:
    """The loops of lanes as one; `loops` are those of a four-wheel car, unladen (False) and laden (True)."""
    return stacked([on_roads(loops[laden], roads(s.left, s.right, s.change)) for laden, s in lanes])


def on_roads(loop: VehicleLoop, under: Sequence[Road]) -> VehicleLoop:
    """A loop on other roads, driven and ended as a screening is."""
    assert isinstance(loop.vehicle, FourWheel)
    vehicle = dataclasses.replace(loop.vehicle, roads=tuple(under), steering=DRIVER)
    return dataclasses.replace(loop, vehicle=vehicle, stop_speed=END * KMH)


def run(
    loops: VehicleLoop, lanes: Sequence[Lane], clocked: Clocked, horizon: float = HORIZON, *, sets: int = 1
) -> Stop:
    """The stops of lanes, points of their course kept; of each lane `sets` in a row, as the loops have them."""
    system, step = clocked(loops)
    return stop(
        system,
        jnp.repeat(KMH * jnp.array([lane.stop.speed for lane in lanes]), sets),
        horizon=horizon,
        step=step,
        max_events=MAX_EVENTS,
        save_every=max(1, round(SAVED / step)),
        tile=TILE if sets == 1 else SETS_TILE,
    )
