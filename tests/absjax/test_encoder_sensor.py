"""The chain in the loop: the stop replayed tick by tick; one lane against many; arrays in the state of a rollout."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.controllers.five_phase import FivePhase
from absjax.encoder.edges import edges_of
from absjax.encoder.encoder import Encoder
from absjax.encoder.harmonics import HarmonicCompensation
from absjax.encoder.rotation import Rotation
from absjax.encoder.time_stamping import TimeStamping
from absjax.encoder.wheel_speed import WheelSpeedChain, estimate
from absjax.hybrid.rollout import rollout
from absjax.hybrid.system import Smooth
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.sampled_loop import SampledLoop
from absjax.parameters import model, parameter
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.sensors.encoder import EncoderSensor
from absjax.tyres.surfaces import surface

T = 1e-3
CAR = QuarterCar(Wheel(), UniformRoad(surface("dry_concrete")))
LOOP = ClosedLoop(CAR, Brake(), FivePhase(), stop_speed=2.5)
CHAIN = WheelSpeedChain(
    TimeStamping(events=12), HarmonicCompensation("speed", 3), HarmonicCompensation("acceleration", 3)
)
ENCODERS = Encoder.random(range(2), eccentricity=2.5e-4)
SPEED, ROLLING, STEPS = 30.0, 300, 800


@pytest.fixture(scope="module")
def stops():
    loop = SampledLoop(LOOP, EncoderSensor(ENCODERS, CHAIN, rolling=ROLLING))
    return rollout(loop, loop.initial_state(SPEED), step=T, steps=STEPS, save_every=1)


@pytest.mark.parametrize("lane", [0, 1])
def test_the_loop_is_told_what_the_edges_tell(stops, lane):
    """The recorded motion gives the edges; edges, chain and automaton, run apart from the loop, give its phases."""
    path = jax.tree.map(lambda x: np.asarray(x)[lane], stops.trajectory)
    state = path.state.loop
    true = jax.vmap(LOOP.measured)(path.time, state, path.mode)
    acceleration = np.asarray((true.acceleration_offset + true.vehicle_acceleration) / true.radius)
    speed = np.concatenate([np.full(ROLLING, SPEED / 0.3), np.asarray(true.wheel_speed)])
    motion = Rotation.of_speed(speed, np.concatenate([np.zeros(ROLLING), acceleration]), T)
    encoder = jax.tree.map(lambda x: x[lane] if np.ndim(x) else x, ENCODERS)
    found, _ = estimate(CHAIN, edges_of(encoder, motion, T), T)
    told = true._replace(
        wheel_speed=found.speed[ROLLING:],
        acceleration_offset=true.radius * found.acceleration[ROLLING:] - true.vehicle_acceleration,
    )
    phases, phase, controller = [0], 0, LOOP.controller
    kept = controller.initial_state(jax.tree.map(lambda x: np.asarray(x)[0], told))
    for k in range(1, STEPS + 1):
        now = jax.tree.map(lambda x, k=k: np.asarray(x)[k], told)
        for slot, guard in enumerate(controller.guards(now, kept, phase)):
            if guard >= 0:
                kept, phase = controller.switch(now, kept, phase, slot)
                phase = int(phase)
                break
        phases.append(phase)
    np.testing.assert_array_equal(LOOP.phase(path.mode), phases)
    assert set(phases) == set(range(6))


def test_free_rolling_of_one_lane_against_many():
    encoder = jax.tree.map(lambda x: x[1] if np.ndim(x) else x, ENCODERS)
    many, alone = (
        SampledLoop(LOOP, EncoderSensor(e, CHAIN, rolling=ROLLING)).initial_state(SPEED) for e in (ENCODERS, encoder)
    )
    for a, b in zip(jax.tree.leaves(many.sensor), jax.tree.leaves(alone.sensor)):
        np.testing.assert_allclose(a[1], b, rtol=1e-9, atol=1e-12)
    assert float(alone.sensor.chain.speed.begun) == 1.0


def test_errors_name_the_thing():
    with pytest.raises(ValueError, match="encoder has 48 teeth, its chain counts 60"):
        EncoderSensor(Encoder.ideal(48), CHAIN)
    with pytest.raises(ValueError, match=r"EncoderSensor\.rolling = 0"):
        EncoderSensor(Encoder.ideal(60), CHAIN, rolling=0)
    with pytest.raises(ValueError, match=r"EncoderSensor\.period = 0"):
        EncoderSensor(Encoder.ideal(60), CHAIN, period=0.0)
    slow = SampledLoop(LOOP, EncoderSensor(Encoder.ideal(60), CHAIN), tick_every=5)
    with pytest.raises(ValueError, match=r"a tick every 0\.005 s; the sensor's period is 0\.001 s"):
        rollout(slow, None, step=T, steps=10)
    fast = SampledLoop(LOOP, EncoderSensor(Encoder.ideal(60), CHAIN, capacity=2))
    with pytest.raises(
        ValueError, match=r"capacity = 2 edges between two samples; 3 are needed, 1.91 teeth pass at 200"
    ):
        fast.initial_state(60.0)


@model
class Last:
    """The last three samples of x."""

    values: Any = parameter("newest first, shape (3,)", ndim=1)


@model
class Decay(Smooth):
    """x' = -rate mean(last samples): a flow that depends on an array only ticks change."""

    rate: Any = parameter("1/s")
    tick_every: int = 2

    def flow(self, time, state, mode):
        return -self.rate * jnp.mean(state[1].values), Last(None)

    def tick(self, time, state, mode):
        x, last = state
        return (x, Last(jnp.concatenate([x[None], last.values[:-1]]))), mode


def plain(rate, x, steps, step):
    last = [x, x, x]
    for k in range(1, steps + 1):
        x = x - step * rate * np.mean(last)
        if k % 2 == 0:
            last = [x, *last[:-1]]
    return x, last


@pytest.mark.parametrize("checkpoint", [False, True])
def test_arrays_in_the_state(checkpoint):
    rates = np.array([0.5, 2.0, 3.0])

    def end(rate, x=1.0):
        return rollout(Decay(rate), (x, Last(x * jnp.ones(3))), step=0.1, steps=9, save_every=3, checkpoint=checkpoint)

    many = end(jnp.asarray(rates))
    for i, rate in enumerate(rates):
        x, last = plain(rate, 1.0, 9, 0.1)
        assert float(many.state[0][i]) == pytest.approx(x, rel=1e-13)
        np.testing.assert_allclose(many.state[1].values[i], last, rtol=1e-13)
        alone = end(float(rate))
        np.testing.assert_allclose(alone.trajectory.state[1].values, many.trajectory.state[1].values[i], rtol=1e-13)
        gradient = jax.grad(lambda r: end(r).state[1].values[1])(float(rate))
        difference = (plain(rate + 1e-5, 1.0, 9, 0.1)[1][1] - plain(rate - 1e-5, 1.0, 9, 0.1)[1][1]) / 2e-5
        assert float(gradient) == pytest.approx(difference, rel=1e-8)
