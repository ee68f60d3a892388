"""Noise and a wrong radius in what a control unit measures."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.sensors.noisy import NoisySensor
from absjax.signals import Signals


def signals(x2=-20.0, ax=-8.0, time=0.1):
    return Signals(*(jnp.asarray(x) for x in (20.0, ax, 60.0, x2, 0.3, 40.0, 0.5, time)))


def measured(sensor, of):
    return sensor.measure(of, sensor.begin(of)[1])[0]


def test_noise_is_white_normal_and_reproducible():
    sensor = NoisySensor(noise=0.5, seed=3)
    times = jnp.arange(4000) * 1e-3
    drawn = np.asarray(jax.vmap(lambda t: measured(sensor, signals(time=t)).acceleration_offset)(times)) + 20.0
    assert abs(drawn.mean()) < 0.03 and drawn.std() == pytest.approx(0.5, rel=0.05)
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 0.05
    again = measured(NoisySensor(noise=0.5, seed=3), signals(time=times[7])).acceleration_offset
    other = measured(NoisySensor(noise=0.5, seed=4), signals(time=times[7])).acceleration_offset
    assert float(again) + 20.0 == pytest.approx(drawn[7], rel=1e-12) and float(other) != float(again)


def test_a_wrong_radius_scales_the_acceleration_of_the_rim():
    seen = measured(NoisySensor(radius=0.33), signals())
    assert float(seen.acceleration_offset) == pytest.approx(0.33 / 0.3 * -28.0 + 8.0, rel=1e-12)
    assert float(seen.radius) == 0.33
    assert float(measured(NoisySensor(), signals()).acceleration_offset) == -20.0


def test_lanes_have_noise_of_their_own():
    many = Signals(*(jnp.full(3, x) for x in signals()))
    drawn = measured(NoisySensor(noise=jnp.ones(3), seed=jnp.arange(3)), many).acceleration_offset
    assert len(set(np.asarray(drawn).tolist())) == 3
    with pytest.raises(ValueError, match=r"NoisySensor\.noise = -1"):
        NoisySensor(noise=-1.0)
