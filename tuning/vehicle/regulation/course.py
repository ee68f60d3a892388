"""What is read off the course of a stop: braking rates, locks, steerability, a passage, what the driver steered."""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import safe_divide
from absjax.lanes import over_lanes
from absjax.loop.sampled_loop import loop_state
from absjax.loop.stop import Outcome, Stop
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.plant.combined_slip import used
from absjax.plant.four_wheel import FourWheel
from absjax.plant.road import ChangingRoad
from absjax.plant.wheel import GRAVITY
from tuning.vehicle.regulation.quantities import KMH, braking_rate

FRONT = 2
"""Wheels of an axle; of the front axle the first two."""
SIDE_SLIP = math.sin(math.radians(4.0))
"""ly at which steerability is told."""
SOON = 2.0
"""Time in which little may be steered, s (5.3.6)."""
WINDOW = 20
"""Points over which a deceleration is taken: 0.1 s, not the jolt of wheels that spin up."""
HELD = 0.5
"""Over which the steerability of a moment is taken, s; ours: a car answers to the steering wheel within it."""
ROUNDING = 1e-4
"""s, by which points that are `HELD` apart may be off."""
SHARE = 0.9
"""Of the mean deceleration on the high surface: what counts as a high one."""
TOLD = Outcome.STOPPED, Outcome.STILL_MOVING, Outcome.STEP_TOO_LARGE
"""Ends of a stop up to which its locks and slides are known."""


class Course(NamedTuple):
    """Of stops, (lanes,)."""

    utilised: Any
    """z from 45 to 15 km/h"""
    rate: Any
    """z from 40 to 20 km/h"""
    lock: Any
    """longest lock above 15 km/h [s]; infinite for a stop that is not told to its end"""
    slide: Any
    """how long the wheel that slides most has a slip below -0.8 above 15 km/h, in all [s]; infinite likewise"""
    steerability: Any
    """lateral force at a side-slip of 4 deg over that of a rolling wheel, mean from 45 to 15 km/h, of the axle that has
    less left: without it in front a car does not steer, without it behind it does not keep its direction"""
    held: Any
    """the same over the half second between these speeds that has least of it, 0 where none lies whole between them: a
    mean can be bought by wheels that roll now and then"""
    passed: Any
    """speed where the surface changes [m/s]"""
    steered_soon: Any
    """largest angle of the front wheels in the first two seconds [rad]"""
    steered: Any
    """in all [rad]"""
    clearance: Any
    """least distance of the middle of a tyre from the line between its two sides [m]; negative beyond it"""
    yaw: Any
    """largest yaw angle [rad]"""
    yaw_rate: Any
    """largest yaw rate [rad/s]"""
    side_slip: Any
    """largest side-slip of the car [rad]"""
    outcome: Any
    """an `Outcome` code"""


def courses(loops: VehicleLoop, stops: Stop) -> Course:
    """Of the stops of loops, lanes."""
    path = stops.rollout.path
    told = jnp.isin(stops.outcome, jnp.array(TOLD))
    slid = stops.longest_lock[0], jnp.stack(stops.slide_time).max(axis=0)
    lock, slide = (jnp.where(told, time, jnp.inf) for time in slid)
    return over_lanes(_course, loops, path.time, loop_state(path.state).vehicle, lock, slide, stops.outcome)


def _course(loop: VehicleLoop, time, state, lock, slide, outcome) -> Course:
    car, motion = loop.vehicle, state.motion
    assert isinstance(car, FourWheel)
    road, speed = car.roads[0], motion.longitudinal
    assert isinstance(road, ChangingRoad)
    angle = jnp.abs(jax.vmap(car.steering.angle)(time, state.steering))
    aside = speed * jnp.sin(motion.yaw) + motion.lateral * jnp.cos(motion.yaw)
    strayed = jnp.cumsum((aside[1:] + aside[:-1]) / 2 * jnp.diff(time))
    sine, cosine = jnp.sin(motion.yaw[1:]), jnp.cos(motion.yaw[1:])
    mean, least = steerability(car, time, state)
    places = [jnp.sign(y) * (strayed + x * sine + y * cosine) for x, y in zip(car.ahead, car.left)]
    return Course(
        utilised=braking_rate(time, speed, 45 * KMH, 15 * KMH),
        rate=braking_rate(time, speed, 40 * KMH, 20 * KMH),
        lock=lock,
        slide=slide,
        steerability=mean,
        held=least,
        passed=jnp.interp(road.changes[0], motion.distance, speed),
        steered_soon=jnp.where(time <= loop.driver.delay + SOON, angle, 0.0).max(),
        steered=angle.max(),
        clearance=jnp.stack(places).min(),
        yaw=jnp.abs(motion.yaw).max(),
        yaw_rate=jnp.abs(motion.yaw_rate).max(),
        side_slip=jnp.abs(motion.side_slip).max(),
        outcome=outcome,
    )


def steerability(car: FourWheel, time, state, held: float = HELD):
    """(mu(s) ly / s) / mu(ly) with s = |(lx, ly)|, ly = sin 4 deg, from 45 to 15 km/h, the lesser of both axles: the
    mean, and the least mean over a time `held` [s]."""
    speed = state.motion.longitudinal
    counts = (speed <= 45 * KMH) & (speed >= 15 * KMH)

    def shares(time, state):
        slips, place = car.slips(time, state), state.motion.distance
        left = [lateral_share(road, along, time, place) for road, (along, _) in zip(car.roads, slips)]
        return jnp.stack([sum(left[:FRONT]), sum(left[FRONT:])]) / FRONT

    of_axles = jnp.where(counts[:, None], jax.vmap(shares)(time, state), 0.0)
    passed, whole = jnp.cumsum(of_axles, axis=0), jnp.cumsum(counts)
    # Of the moment that ends at each point: the last point before it, and how many it has.
    before = jnp.searchsorted(time, time - held + ROUNDING) - 1
    points = jnp.arange(len(time)) - before
    moments = (passed - passed[before]).min(axis=1) / points
    within = (before >= 0) & (whole - whole[before] == points)
    least = jnp.where(within, moments, jnp.inf).min()
    return safe_divide(passed[-1].min(), whole[-1], counts.any()), jnp.where(within.any(), least, 0.0)


def lateral_share(road, along, time, place):
    """Lateral force of a wheel with slip lx at a side-slip of 4 deg, over that of a wheel that rolls freely."""
    return used(road, along, SIDE_SLIP, time, place).across / used(road, 0.0 * along, SIDE_SLIP, time, place).across


def rise_time(time, speed, distance, change, rate):
    """From the passage of the front axle to a deceleration of `SHARE` times a braking rate [s]; infinite if never."""
    passes = jnp.interp(change, distance, time)
    over, lost = time[WINDOW:] - time[:-WINDOW], speed[:-WINDOW] - speed[WINDOW:]
    reached = (time[:-WINDOW] >= passes) & (over > 0) & (lost >= SHARE * rate * GRAVITY * over)
    return jnp.where(reached.any(), time[WINDOW:][jnp.argmax(reached)] - passes, jnp.inf)
