"""The sampled loop with a derivative: the stops of the sampled one, and the slope of their mean over the clock."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.controllers.five_phase import FivePhase
from absjax.controllers.slip import SlipControl
from absjax.controllers.two_phase import TwoPhase
from absjax.hybrid.rollout import rollout
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import Driver
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.stop import stop
from absjax.loop.ticking_loop import TickingLoop
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.sensors.delayed import DelayedSensor
from absjax.signals import Signals
from absjax.tyres.surfaces import surface

SPEED = 20.0
FIVE = FivePhase(eps1=22.0, eps2=27.0, u1=25000.0, u3=3000.0)
CONTROLLERS = {"five_phase": FIVE, "two_phase": TwoPhase()}
STEP = 1e-3


BRAKE = Brake(750.0, 5e-3)


def loop_of(controller, delay, brake=BRAKE) -> ClosedLoop:
    car = QuarterCar(Wheel(), UniformRoad(surface("dry_asphalt")))
    return ClosedLoop(car, brake, controller, driver=Driver(400.0, delay))


def rolled(kind, controller, delay, speed, ticks, brake=BRAKE):
    system = kind(loop_of(controller, delay, brake), tick_every=ticks)
    return rollout(system, system.initial_state(speed), step=STEP, steps=600, max_events=30)


@pytest.mark.parametrize(("name", "ticks"), [("five_phase", 1), ("five_phase", 5), ("two_phase", 5)])
def test_stops_are_those_of_the_sampled_loop(name, ticks):
    rng = np.random.default_rng(ticks)
    delay, speed = ticks * STEP * rng.uniform(size=32), SPEED + rng.uniform(size=32)
    sampled, ticking = (rolled(kind, CONTROLLERS[name], delay, speed, ticks) for kind in (SampledLoop, TickingLoop))
    np.testing.assert_array_equal(sampled.mode, ticking.mode)
    for ours, theirs in zip(jax.tree.leaves(ticking.state.loop), jax.tree.leaves(sampled.state.loop)):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)
    assert float(sampled.state.loop.memory.control.onset_time.min()) > 0


@partial(jax.jit, static_argnums=0)
def stops(kind, eps0, ticks=5, phases=128):
    """Distance and duration over the phases of the clock."""
    period = ticks * STEP
    delay = period * (np.arange(phases) + 0.5) / phases
    loop = dataclasses.replace(loop_of(SlipControl(eps0=eps0, slip=-0.3), delay), stop_speed=17.0)
    system, speed = kind(loop, tick_every=ticks), np.full(phases, SPEED)
    stopped = stop(system, speed, horizon=0.8, step=STEP, max_events=30, tile=phases)
    return jnp.stack([stopped.distance, stopped.duration])


def test_slope_of_one_switching_is_that_of_the_mean_over_phases():
    """And every stop is that of the sampled loop."""
    change = 4.0
    found, slope = jax.jit(lambda eps0: jax.jvp(partial(stops, TickingLoop), (eps0,), (1.0,)))(40.0)
    less, same, more = (np.asarray(stops(SampledLoop, 40.0 + move)) for move in (-change, 0.0, change))
    np.testing.assert_allclose(found, same, rtol=0, atol=1e-9)
    np.testing.assert_allclose(slope.mean(axis=1), (more - less).mean(axis=1) / (2 * change), rtol=0.03)


def test_forward_and_reverse_agree_and_float32_follows():
    """Of a brake without limits: those are the other tests'."""

    def speed_at_end(eps1, delay, speed):
        controller = FivePhase(eps1=eps1, eps2=27.0, u1=25000.0, u3=3000.0)
        end = rolled(TickingLoop, controller, delay, speed, 5, Brake())
        return jnp.mean(end.state.loop.plant.speed)

    at = (np.linspace(0, 4e-3, 8), np.full(8, SPEED))

    @jax.jit
    def slopes(eps1):
        _, forward = jax.linearize(lambda eps1: speed_at_end(eps1, *at), eps1)
        return forward(1.0), *jax.linear_transpose(forward, eps1)(1.0)

    forward, reverse = slopes(22.0)
    assert reverse != 0
    assert reverse == pytest.approx(float(forward), rel=1e-9)
    single = jax.jit(jax.grad(speed_at_end))(np.float32(22.0), *(x.astype(np.float32) for x in at))
    assert np.isfinite(single) and single.dtype == np.float32
    assert np.sign(single) == np.sign(reverse)


def test_stand_in_lags_a_ramp_by_its_delay():
    sensor, period, speed, ramp = DelayedSensor(events=12.0, memory=0.012), 1e-3, 80.0, 500.0

    def signals(time):
        turning = ramp * time
        return Signals(25.0, -8.0, speed, 0.3 * turning + 8.0, 0.3, 0.0, 0.0, time)

    _, state = sensor.begin(signals(0.0))
    for k in range(1, 200):
        told, state = sensor.measure(signals(k * period), state)
    turning = (told.acceleration_offset + told.vehicle_acceleration) / 0.3
    lag = 199 * period - float(turning) / ramp
    tooth = 2 * np.pi / 60 / speed
    assert float(sensor.delay(speed)) == pytest.approx(0.5 * (min(11 * tooth, 0.012) + tooth))
    assert lag == pytest.approx(float(sensor.delay(speed)), rel=0.03)
    assert float(sensor.delay(10.0)) == pytest.approx(0.5 * 4 * 2 * np.pi / 60 / 10.0)


def test_error_of_the_stand_in_is_that_of_a_parabola():
    rng, sensor, speed = np.random.default_rng(0), DelayedSensor(events=12.0, left=0.003), 60.0
    pitch = 2 * np.pi / 60
    times = np.arange(12) * pitch / speed
    found = [2 * np.polyfit(times, 0.003 * pitch * rng.normal(size=12), 2)[0] for _ in range(4000)]
    assert float(sensor.error(speed)) == pytest.approx(np.std(found), rel=0.05)
