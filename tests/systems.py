"""Small hybrid systems with known solutions, and the five-phase reference case."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from absjax.controllers.five_phase import FivePhase
from absjax.hybrid.system import Smooth
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import FreeRamp
from absjax.parameters import model, parameter
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.tyres.surfaces import SURFACES

NAMES = ("eps0", "eps1", "eps2", "eps3", "eps4", "eps5", "u1", "u3", "u4")
PARAMETERS = jnp.array([50.0, 30.0, 40.0, 20.0, 20.0, 30.0, 6000.0, 4000.0, 2000.0])
SPEED, DURATION = 33.333, 2.5
TRUE_DISTANCE = 52.521154957816
TRUE_GRADIENT = np.array(
    [-0.2175836, 5.9043738, -8.6618343, -0.2528711, -4.8740729, 8.0414958, -0.2185106, 0.3651059, -2.5283919]
)
"""Derivative of the distance with respect to each parameter, times the parameter."""


def five_phase_loop(parameters=None, tyre=None, stop_speed=None, driver=None, **brake) -> ClosedLoop:
    """The automaton as published; without a driver the ramp 3 u4 / (R w) and a free pressure."""
    values = {} if parameters is None else dict(zip(NAMES, parameters))
    controller = FivePhase(**values, ways_back=False)
    car = QuarterCar(Wheel(), UniformRoad(SURFACES["dry_asphalt"] if tyre is None else tyre))
    driver = FreeRamp(3 * controller.u4) if driver is None else driver
    return ClosedLoop(car, Brake(**brake), controller, stop_speed, driver=driver)


def mean_deceleration_distance(result, speed=SPEED, duration=DURATION):
    """v0^2 / (2 (v0 - v(T)) / T)."""
    return speed**2 / (2 * (speed - result.state.plant.speed) / duration)


class Level(NamedTuple):
    x: Any


class Swing(NamedTuple):
    x: Any
    y: Any


@model
class Relay:
    """x' = drive - x in mode 0 until x >= high; x' = -drive - x in mode 1 until x <= -low; and again."""

    drive: Any = parameter("drive", default=2.0)
    high: Any = parameter("upper threshold", default=1.0)
    low: Any = parameter("lower threshold", default=0.7)

    def flow(self, time, state, mode):
        return Level(jnp.where(mode == 0, self.drive, -self.drive) - state.x)

    def guards(self, time, state, mode):
        return (jnp.where(mode == 0, state.x - self.high, -self.low - state.x),)

    def jump(self, time, state, mode, slot):
        return state, 1 - mode


@model
class Oscillator:
    """x'' = -x; the guard x - level ends the lane in mode 1, counted by the mode."""

    level: Any = parameter("threshold", default=1.0)

    def flow(self, time, state, mode):
        return Swing(state.y, -state.x)

    def guards(self, time, state, mode):
        return (jnp.where(mode == 0, state.x - self.level, -1.0),)

    def jump(self, time, state, mode, slot):
        return state, mode + 1


@model
class Race:
    """x' = 1; two guards compete in mode 0; mode 1 is left at once for mode 2, whose guard is open."""

    first: Any = parameter("threshold of slot 0", default=0.55)
    second: Any = parameter("threshold of slot 1", default=0.52)

    def flow(self, time, state, mode):
        return Level(jnp.ones_like(state.x))

    def guards(self, time, state, mode):
        slow = jnp.where(mode == 0, state.x - self.first, jnp.where(mode == 1, 1.0, -1.0))
        return slow, jnp.where(mode == 0, state.x - self.second, -1.0)

    def jump(self, time, state, mode, slot):
        return state, jnp.where(mode == 0, jnp.where(slot == 1, 1, 5), 2)


@model
class Explosion(Smooth):
    """x' = rate x^2, which leaves the finite numbers at 1 / (rate x0)."""

    rate: Any = parameter("rate", default=1.0)

    def flow(self, time, state, mode):
        return Level(self.rate * state.x**2)


@model
class Decay(Smooth):
    """x' = -rate x."""

    rate: Any = parameter("rate", default=1.0)

    def flow(self, time, state, mode):
        return Level(-self.rate * state.x)


@model
class Twins:
    """x' = 1 until x reaches one of two thresholds, both of which set it back; the second at the same level."""

    def flow(self, time, state, mode):
        return Level(jnp.ones_like(state.x))

    def guards(self, time, state, mode):
        return state.x**3 - 1.0, jnp.expm1(state.x - 1.0)

    def jump(self, time, state, mode, slot):
        return Level(jnp.zeros_like(state.x)), mode
