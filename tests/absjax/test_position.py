"""The position model: against batch least squares on the true angle, and an encoder whose error is known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.encoder.edges import edges_of
from absjax.encoder.encoder import Encoder
from absjax.encoder.position import PositionLeastSquares, learn_position
from absjax.encoder.rotation import Rotation
from absjax.encoder.time_stamping import TimeStamping
from absjax.encoder.wheel_speed import WheelSpeedChain, estimate

PERIOD, SAMPLES, SPEED = 1e-3, 6000, 107.0


def angles(encoder, events):
    """Angle as measured, how far it is off the true one but for a constant, and whether it is valid."""
    rotation = Rotation.of_speed(np.full(SAMPLES, SPEED), np.zeros(SAMPLES), PERIOD)
    chain = WheelSpeedChain(TimeStamping(encoder.teeth, events))
    measured = estimate(chain, edges_of(encoder, rotation, PERIOD), PERIOD)[0].measured
    off = np.asarray(measured.rotation.angle) - np.asarray(rotation.angle)
    return measured.rotation.angle, np.unwrap(off), measured.valid


def test_it_learns_what_batch_least_squares_find_with_the_true_angle():
    angle, off, valid = angles(Encoder.random(3), 15)
    squares = PositionLeastSquares()
    known, corrected = learn_position(squares, angle, valid, PERIOD)
    late = slice(SAMPLES // 2, None)
    rows = np.column_stack([np.asarray(jax.vmap(squares.regressor)(angle)), np.ones(SAMPLES)])[late]
    batch = np.linalg.lstsq(rows, off[late], rcond=None)[0][:-1]
    assert np.abs(batch).max() > 3e-3
    np.testing.assert_allclose(known[-1], batch, atol=1e-5)
    left = np.asarray(corrected - angle) + off
    assert left[late].std() < 0.05 * off[late].std()


def test_an_eccentric_encoder_is_off_by_e_over_r():
    encoder = Encoder.ideal(60, eccentricity=1.6e-4, phase=0.7)
    angle, _, valid = angles(encoder, 6)
    known, _ = learn_position(PositionLeastSquares(harmonics=2), angle, valid, PERIOD)
    assert np.hypot(*known[-1, :2]) == pytest.approx(1.6e-4 / 0.05, rel=0.03)
    assert np.abs(known[-1, 2:]).max() < 2e-5


def test_gradient_against_differences_and_single_precision():
    time = PERIOD * jnp.arange(2500)
    true = 90.0 * time
    angle = jnp.mod(true + 0.003 * jnp.sin(true + 0.4), 2 * jnp.pi)

    def last(cutoff, angle=angle):
        return learn_position(PositionLeastSquares(harmonics=1, cutoff=cutoff), angle, angle >= 0, PERIOD)[0][-1, 0]

    exact, h = float(jax.grad(last)(5.0)), 1e-4
    assert exact == pytest.approx(float(last(5.0 + h) - last(5.0 - h)) / (2 * h), rel=1e-4, abs=1e-12)
    single = last(jnp.float32(5.0), angle.astype(jnp.float32))
    assert single.dtype == jnp.float32 and float(single) == pytest.approx(0.003 * np.cos(0.4), rel=0.01)


def test_a_model_without_harmonics_is_refused():
    with pytest.raises(ValueError, match=r"PositionLeastSquares\.harmonics = 0"):
        PositionLeastSquares(harmonics=0)
