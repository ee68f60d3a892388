"""Five-phase braking with acceleration tracking on an estimated XBS, through dry, wet and snow.

Source: Hoang et al. 2014, section V and Fig. 4, with the roads of their Table I.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from absjax.controllers.five_phase import FivePhase
from absjax.controllers.tracking import AccelerationTracking
from absjax.hybrid.rollout import Rollout, rollout
from absjax.loop.closed_loop import ClosedLoop
from absjax.observers import OBSERVERS
from absjax.observers.run import require_stable
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import ChangingRoad
from absjax.plant.wheel import Wheel
from absjax.signals import Signals
from absjax.tyres.burckhardt import Burckhardt

ROADS = (Burckhardt(1.28, 24.0, 0.52), Burckhardt(0.86, 34.0, 0.35), Burckhardt(0.28, 50.0, 0.05))
CHANGES = (3.0, 4.0)
SPEED, STOP_SPEED = 50.0, 3.0
"""m/s"""
DURATION = 6.0
STEP = 2.5e-4
"""Small enough for the default gains of the adaptive observer, s."""
FIVE = FivePhase(eps5=25.0, ways_back=False)
QUICK = FivePhase(eps5=25.0, u1=12000.0, u3=8000.0, u4=4000.0, ways_back=False)
"""Rates that keep up with the tracking on dry asphalt."""


class Ride(NamedTuple):
    """One ride under one controller."""

    label: str
    loop: ClosedLoop
    result: Rollout
    signals: Signals
    """told to the controller, arrays (samples,)"""
    true_stiffness: np.ndarray


def loops(shift: Any = 0.0) -> dict[str, ClosedLoop]:
    """The loops that are compared: two without feedback, tracking on the true and on two estimated XBS
    (default gains).

    Args:
        shift: added to the instants of the changes, s, scalar or (lanes,).
    """
    wheel = Wheel()
    car = QuarterCar(wheel, ChangingRoad(ROADS, tuple(change + shift for change in CHANGES)))
    brake = Brake(rate_limit=750.0)

    def observer(kind):
        return OBSERVERS[kind]().observer(wheel)

    tracking = AccelerationTracking(eps5=FIVE.eps5, wheel=wheel)
    return {
        "open loop, slow rates": ClosedLoop(car, brake, FIVE, STOP_SPEED),
        "open loop, quick rates": ClosedLoop(car, brake, QUICK, STOP_SPEED),
        "tracking, true XBS": ClosedLoop(car, brake, tracking, STOP_SPEED),
        "tracking, 4-state observer": ClosedLoop(car, brake, tracking, STOP_SPEED, observer("unknown_road")),
        "tracking, adaptive observer": ClosedLoop(car, brake, tracking, STOP_SPEED, observer("adaptive")),
    }


def drive(label: str, loop: ClosedLoop) -> Ride:
    """Drive one loop, recorded every millisecond.

    Raises:
        RolloutError: if the step is too large for the observer, or the ride fails otherwise.
    """
    result = rollout(
        loop,
        loop.initial_state(jnp.asarray(SPEED)),
        step=STEP,
        steps=round(DURATION / STEP),
        max_events=800,
        save_every=round(1e-3 / STEP),
        save_switches=True,
    )
    path = result.path
    told = jax.vmap(loop.signals)(path.time, path.state, path.mode)
    if loop.observer is not None:
        require_stable(loop.observer, path.state.observer, told.acceleration_offset, told.vehicle_speed, STEP)
    result.raise_if_failed()
    true = jax.vmap(loop.measured)(path.time, path.state, path.mode).stiffness
    return Ride(label, loop, result, jax.tree.map(np.asarray, told), np.asarray(true))


def summary(ride: Ride) -> dict[str, Any]:
    """Whether the ride kept cycling: cycles on each road, and how it ended."""
    log, memory = ride.result.log, ride.result.state.memory
    source, target = (np.asarray(ride.loop.phase(np.asarray(x))) for x in (log.source, log.target))
    entered = np.asarray(log.time)[(target == ride.loop.controller.cycle_phase) & (source != target)]
    cycles = np.histogram(entered, [0.0, *CHANGES, DURATION + 1.0])[0]
    locks = ride.loop.sliding(ride.result.time, ride.result.state).locks
    end = float(ride.result.time)
    return {
        "controller": ride.label,
        "cycles on dry": int(cycles[0]),
        "on wet": int(cycles[1]),
        "on snow": int(cycles[2]),
        "longest cycle [s]": round(
            float(jnp.maximum(memory.control.longest_cycle, end - memory.control.cycle_time)), 3
        ),
        "locked above 15 km/h [s]": round(float(locks.time[0]), 3),
        "ends [s]": round(end, 2),
        "speed then [m/s]": round(float(ride.result.state.plant.speed), 2),
    }


def share_locked(loop: ClosedLoop) -> float:
    """Share of the lanes of an ensemble whose wheel locks above 15 km/h."""
    result = rollout(
        loop, loop.initial_state(jnp.asarray(SPEED)), step=STEP, steps=round(DURATION / STEP), max_events=800
    )
    return float(np.mean(np.asarray(loop.sliding(result.time, result.state).locks.time[0]) > 0))


def tracking_figure(rides: list[Ride]):
    """Speeds, acceleration offset, XBS and pressure of every ride, a column each."""
    figure, grid = plt.subplots(4, len(rides), figsize=(4.2 * len(rides), 9), sharex=True, sharey="row", squeeze=False)
    for column, ride in zip(grid.T, rides):
        time = np.asarray(ride.result.path.time)
        valid = np.asarray(ride.result.path.valid)
        s = jax.tree.map(lambda x, v=valid: x[v], ride.signals)
        column[0].plot(time[valid], s.vehicle_speed, label="vehicle")
        column[0].plot(time[valid], s.radius * s.wheel_speed, lw=0.7, label="wheel rim")
        column[1].plot(time[valid], s.acceleration_offset, lw=0.6)
        column[2].plot(time[valid], ride.true_stiffness[valid], lw=0.8, label="true")
        if ride.loop.observer is not None:
            column[2].plot(time[valid], s.stiffness, lw=0.6, label="estimated")
        column[3].plot(time[valid], s.pressure, lw=0.8)
        for axes in column:
            axes.grid(alpha=0.3)
            for change in CHANGES:
                axes.axvline(change, color="k", ls=":", lw=0.7)
        column[0].set_title(ride.label, fontsize=10)
        column[2].set_ylim(-2, 8)
        column[3].set_xlabel("time [s]")
    for axes, label in zip(grid[:, 0], ("speed [m/s]", "x2 [m/s²]", "XBS", "pressure [bar]")):
        axes.set_ylabel(label)
    grid[0, 0].legend(fontsize="small")
    grid[2, -1].legend(fontsize="small")
    figure.tight_layout()
    return figure
