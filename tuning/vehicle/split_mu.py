"""Braking with the left wheels on more friction than the right ones: how far, and how much the car turns.

Independent control brakes best and turns the car most; select-low gives away distance on the side that grips.
"""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.controllers.base import Controller
from absjax.controllers.five_phase import FivePhase
from absjax.lanes import stacked
from absjax.loop.channel import Channel
from absjax.loop.driver import Driver
from absjax.loop.sampled_vehicle import SampledVehicle
from absjax.loop.stop import Outcome, Stop, stop
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.plant.brake import Brake
from absjax.plant.four_wheel import FourWheel
from absjax.plant.road import UniformRoad
from absjax.plant.steering import YawDriver
from absjax.plant.wheel import GRAVITY
from absjax.tyres.base import Tyre
from absjax.tyres.surfaces import SURFACES, surface
from tuning.core.config import ConfigError
from tuning.core.files import shipped

STOP_SPEED = 4.0
"""m/s"""
STEP = 2e-3
SAVE_EVERY = 5
"""Grid steps between the points among which the largest yaw rate is looked for: 10 ms."""
SPUN = math.radians(45.0)
"""Side-slip of a car that has lost its way: its distance is no braking distance."""
SHARPNESS = 200.0
"""Of the smooth maximum, over the largest value."""
BRAKE = Brake(rate_limit=750.0, lag=5e-3)
WIRINGS: dict[str, tuple[tuple[int, ...], ...]] = {
    "independent": ((0,), (1,), (2,), (3,)),
    "select-low behind": ((0,), (1,), (2, 3)),
    "select-low on both axles": ((0, 1), (2, 3)),
}
"""Wheels of each channel."""
HELD = YawDriver(yaw_gain=0.0, heading_gain=0.0)
DRIVERS: dict[str, YawDriver] = {"held": HELD, "yaw driver": YawDriver()}


class SplitStop(NamedTuple):
    """Stops on split mu; arrays (lanes,), or scalars."""

    distance: Any
    """m"""
    yaw_rate: Any
    """largest |r| [rad/s]"""
    side_slip: Any
    """largest |beta| [rad]"""
    yaw: Any
    """at the end [rad]"""
    stop: Stop


def split_car(left: Tyre, right: Tyre, steering: YawDriver = HELD, **fields: Any) -> FourWheel:
    """The mid-size car, its left and right wheels on different surfaces."""
    return FourWheel(tuple(map(UniformRoad, (left, right, left, right))), steering=steering, **fields)


def split_loop(car: FourWheel, controller: Controller, wiring: tuple[tuple[int, ...], ...]) -> VehicleLoop:
    """A panic stop of a car, one controller in every channel."""
    return VehicleLoop(car, (Channel(BRAKE, controller),) * len(wiring), STOP_SPEED, Driver(), wiring=wiring)


def largest(values):
    """Largest magnitude along the last axis, smooth: a mean that weighs the largest ones by far the most.

    At most the largest, less by about its share of log(points) / `SHARPNESS`; its gradient knows all points near it.
    """
    size = jnp.sqrt(values**2 + 1e-12)
    top = jnp.max(size, axis=-1, keepdims=True)
    weights = jax.nn.softmax(SHARPNESS * size / top, axis=-1)
    return jnp.sum(weights * size, axis=-1)


def split_stop(loop: VehicleLoop, speed: Any, *, horizon: float, ticks: int = 0, max_events: int = 4000) -> SplitStop:
    """Brake from `speed` [m/s] and see how much the car turns; differentiable with respect to both.

    Args:
        horizon: longest time allowed [s].
        ticks: where given, the controllers sit in a control unit that ticks so many times in a grid step.
        max_events: switchings a stop may make.
    """
    how = {"horizon": horizon, "max_events": max_events}
    if ticks:
        every = SAVE_EVERY * ticks
        result = stop(SampledVehicle(loop), speed, step=STEP / ticks, save_every=every, **how)
        final, path = (states.loop.vehicle for states in (result.rollout.state, result.rollout.path.state))
    else:
        result = stop(loop, speed, step=STEP, save_every=SAVE_EVERY, **how)
        final, path = result.rollout.state.vehicle, result.rollout.path.state.vehicle
    turned = largest(path.motion.yaw_rate), largest(path.motion.side_slip)
    return SplitStop(result.distance, *turned, final.motion.yaw, result)


def longest_stop(right: Tyre, speed: Any) -> int:
    """Time that the worse side on all wheels would take, and half as much again for control that gives friction away,
    in whole seconds."""
    return math.ceil(1.5 * speed / (GRAVITY * float(right.peak().friction)))


class Case(NamedTuple):
    """A row of the study, and its course for the figure, arrays (points,)."""

    row: dict[str, Any]
    time: np.ndarray
    yaw_rate: np.ndarray
    side_slip: np.ndarray
    """rad"""


def checked(right: str, speed_kmh: float, share: float = 1.0) -> tuple[str, float]:
    """Surface and speed [km/h] of a study.

    Args:
        share: of the speed, from which it also brakes.

    Raises:
        ConfigError: if there is no such surface, or a speed is not above the stop speed and at most 200 km/h.
    """
    slowest = STOP_SPEED * 3.6 / share
    if right not in SURFACES:
        raise ConfigError(f"--right: {right!r} is unknown; there are {', '.join(SURFACES)}")
    if not slowest < speed_kmh <= 200.0:
        raise ConfigError(f"--speed = {speed_kmh:g} must be above {slowest:g} km/h and at most 200")
    return right, speed_kmh


def tuned() -> FivePhase:
    """The shipped five-phase set: untuned thresholds let wheels on little friction lock."""
    return FivePhase(**shipped("controllers.json")["five_phase"])


def study(right: str, speed_kmh: float, controller: Controller | None = None) -> list[Case]:
    """Every wiring with a held steering wheel and with a driver, dry asphalt on the left."""
    speed, controller = speed_kmh / 3.6, tuned() if controller is None else controller
    dry, other = surface("dry_asphalt"), surface(right)
    horizon, cases = longest_stop(other, speed), []
    for wiring, wheels in WIRINGS.items():
        loops = [split_loop(split_car(dry, other, driver), controller, wheels) for driver in DRIVERS.values()]
        result = split_stop(stacked(loops), jnp.full(len(loops), speed), horizon=horizon)
        cases += [_case(wiring, name, result, i) for i, name in enumerate(DRIVERS)]
    return cases


def _case(wiring: str, driver: str, result: SplitStop, lane: int) -> Case:
    path = result.stop.rollout.path
    valid = np.asarray(path.valid[lane])
    motion = path.state.vehicle.motion
    spun = bool(result.side_slip[lane] > SPUN)
    row = {
        "control": wiring,
        "steering": driver,
        "distance [m]": round(float(result.distance[lane]), 2),
        "largest yaw rate [deg/s]": float(f"{math.degrees(float(result.yaw_rate[lane])):.3g}"),
        "largest side-slip [deg]": float(f"{math.degrees(float(result.side_slip[lane])):.3g}"),
        "yaw at the end [deg]": float(f"{math.degrees(float(result.yaw[lane])):.3g}"),
        "locked above 15 km/h [s]": float(f"{float(result.stop.lock_time[0][lane]):.3g}"),
        "end": "spun" if spun else Outcome(int(result.stop.outcome[lane])).message,
    }
    series = (path.time, motion.yaw_rate, motion.side_slip)
    return Case(row, *(np.asarray(x[lane])[valid] for x in series))
