"""Errors of an encoder by tooth: what the harmonics stand for, and stops told without learning on."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.controllers.five_phase import FivePhase
from absjax.encoder.encoder import Encoder
from absjax.encoder.harmonics import HarmonicCompensation
from absjax.encoder.known_errors import KnownErrors, errors_of, lowest
from absjax.encoder.time_stamping import TimeStamping
from absjax.encoder.wheel_speed import WheelSpeedChain
from absjax.lanes import lane_axes, mapped
from absjax.loop.closed_loop import ClosedLoop
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.sensors.encoder import EncoderSensor
from absjax.tyres.surfaces import surface

TEETH, HARMONICS = 13, 6
CHAIN = WheelSpeedChain(
    TimeStamping(TEETH, 5),
    *(HarmonicCompensation(s, HARMONICS, through_edges=True, forgetting=2.0) for s in ("speed", "acceleration")),
)
LOOP = ClosedLoop(
    QuarterCar(Wheel(), UniformRoad(surface("dry_concrete"))), Brake(750.0, 5e-3), FivePhase(), stop_speed=8.0
)
SPEED = np.array([12.0, 13.0])


@pytest.fixture(scope="module")
def sensor():
    encoder = Encoder.random([1, 2], TEETH, tolerance=0.01)
    return EncoderSensor(encoder, CHAIN, rolling=1500).rolled(SPEED / 0.3)


def test_errors_of_the_teeth_are_the_sum_of_the_harmonics():
    coefficients = np.random.default_rng(0).normal(size=(2, 2 * HARMONICS))
    found = errors_of(coefficients, TEETH)
    for lane in range(2):
        for tooth in range(TEETH):
            angle, a = 2 * np.pi * tooth / TEETH, coefficients[lane]
            plain = sum(
                a[2 * k - 2] * np.sin(k * angle) + a[2 * k - 1] * np.cos(k * angle) for k in range(1, HARMONICS + 1)
            )
            assert found[lane, tooth] == pytest.approx(plain, abs=1e-12)
    few = errors_of(coefficients[:, :4], TEETH)
    np.testing.assert_allclose(lowest(found, np.array([2, 6]))[0], few[0], atol=1e-5)
    np.testing.assert_allclose(lowest(found, np.array([2, 6]))[1], found[1], atol=1e-5)


def rolled_on(sensor, speed, samples=200):
    """Speed and acceleration told of wheels that roll at a speed, (samples, lanes) each."""
    first = LOOP.measured(0.0, LOOP.initial_state(speed * 0.3), 0)

    def tick(state, k):
        state = dataclasses.replace(state, angle=state.angle + speed * 1e-3)
        told, state = jax.vmap(type(sensor).measure, (mapped(lane_axes(sensor)), 0, 0))(
            sensor, jax.tree.map(lambda x: jnp.broadcast_to(x, speed.shape), first._replace(time=k * 1e-3)), state
        )
        return state, (told.wheel_speed, told.acceleration_offset)

    state = sensor.rolled(speed).begun.state if sensor.begun is None else sensor.begun.state
    return jax.lax.scan(tick, state, jnp.arange(1, samples + 1))[1]


def test_what_was_learned_is_taken_off_and_nothing_more_is_learned(sensor):
    raw = dataclasses.replace(sensor, chain=WheelSpeedChain(CHAIN.stamping), begun=None)
    settled, speed = sensor.settled(), SPEED / 0.3
    for (with_errors, without), order in zip(zip(rolled_on(raw, speed), rolled_on(settled, speed)), (1, 2)):
        assert np.all(np.std(without, axis=0) < 0.1 * np.std(with_errors, axis=0)), order
    for name in ("speed", "acceleration"):
        table = getattr(settled.chain, name)
        assert isinstance(table, KnownErrors) and table.harmonics == HARMONICS
        learned = getattr(sensor.begun.state.chain, name)
        np.testing.assert_allclose(
            table.errors, errors_of(getattr(CHAIN, name).coefficients(learned), TEETH), rtol=1e-5, atol=1e-9
        )


def test_many_stops_begin_as_one_that_rolls_anew(sensor):
    signals = LOOP.measured(0.0, LOOP.initial_state(SPEED), 0)
    kept, anew = sensor.begin(signals), dataclasses.replace(sensor, begun=None).begin(signals)
    jax.tree.map(np.testing.assert_array_equal, kept, anew)


def test_what_cannot_settle_is_refused(sensor):
    with pytest.raises(ValueError, match="known after `rolled`"):
        dataclasses.replace(sensor, begun=None).settled()
    blind = dataclasses.replace(sensor, chain=WheelSpeedChain(CHAIN.stamping))
    with pytest.raises(ValueError, match="through the edges"):
        blind.settled()
    leaves = jax.tree.leaves(sensor.settled().begun)
    assert all(np.shape(leaf)[0] == 2 for leaf in leaves)
