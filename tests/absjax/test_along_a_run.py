"""Certificates of a run, admissible controllers, and what makes a system linear up to a time scale that vanishes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.observers.along_a_run import admissible, certify_run, zero_slopes
from absjax.observers.base import Sample
from absjax.observers.excitation import dwell_times, excitation
from absjax.observers.observability import observability_rows, quotient, singular_linearisability
from absjax.observers.switched import known_road
from absjax.plant.wheel import Wheel

WHEEL = Wheel()
A_GAIN, B_GAIN = 187.5, 4.375
PERIOD, SPEED = 1e-3, 20.0


def test_a_run_is_held_to_the_assumptions():
    """y = 10 sin(w t + 0.3), the integral of its square over a second 50 m^2/s^3, its slope at zeros 10 w."""
    time, w = PERIOD * np.arange(3000), 2 * np.pi * 4
    pressure = 5 * np.sin(w * time)
    samples = Sample(10 * np.sin(w * time + 0.3), np.full(3000, SPEED), pressure)
    found = certify_run(samples, PERIOD, WHEEL)
    assert found.holds and found.value("(2.3)") == SPEED
    assert found.value("(3.17)") == pytest.approx(50.0, rel=1e-3)
    assert found.value("(3.18)") == pytest.approx(10 * w, rel=1e-3)
    assert found.value("(3.19)") == pytest.approx(0.125, rel=1e-5)
    assert found.value("(3.7)") == excitation(samples, PERIOD, WHEEL, 1.0).min()
    asked = certify_run(samples, PERIOD, WHEEL, energy=60.0, dwell=0.2)
    assert [c.name[:6] for c in asked.failed] == ["(3.17)", "(3.19)"] and "FAILS by 10" in str(asked)
    quiet = samples._replace(y=np.where(time < 1.5, samples.y, 0.0))
    assert [c.name[:6] for c in certify_run(quiet, PERIOD, WHEEL).failed] == ["(3.17)", "(3.18)", "(3.7):"]


def test_a_zero_that_is_touched_is_not_crossed():
    time = PERIOD * np.arange(400)

    def slopes(y):
        return zero_slopes(Sample(y, y + SPEED, y), PERIOD)

    np.testing.assert_allclose(slopes(30 * (time - 0.2003)), [30.0], rtol=1e-9)
    np.testing.assert_allclose(slopes(30 * (time - 0.2)), [30.0], rtol=1e-9)
    assert slopes((time - 0.2003) ** 2).tolist() == [0.0]
    assert slopes((time - 0.2003) ** 2 + 1e-6).size == 0
    assert np.all(slopes(np.maximum(time - 0.2, 0.0))[:-1] == 0.0)


def relay(strength, turn, stiffness=2.0, samples=2000):
    """y' = -(a/v) XBS y - b u, u of constant size, turned at |y| = turn; exact from sample to sample."""
    rate, y, u = A_GAIN / SPEED * stiffness, 0.0, strength
    found, pressure = [], [0.0]
    for _ in range(samples):
        found.append(y)
        u = -strength if y < -turn else strength if y > turn else u
        settled = -B_GAIN * u / rate
        y = settled + (y - settled) * np.exp(-rate * PERIOD)
        pressure.append(pressure[-1] + u * PERIOD)
    return Sample(np.array(found), np.full(samples, SPEED), np.array(pressure[:-1])), np.full(samples, stiffness)


def test_an_admissible_controller_bounds_the_dwell_time():
    samples, stiffness = relay(400.0, 20.0)
    alpha = 5.0 * A_GAIN * 2.0 / (B_GAIN * SPEED)
    found = admissible(samples, stiffness, PERIOD, WHEEL, band=5.0)
    assert found.holds and found.value("(ii): visits of the band") > 20
    assert found.value("(ii): least |u| / alpha") == pytest.approx(400.0 / alpha, rel=1e-9)
    bound = found.conditions[-1].low
    assert bound == pytest.approx(2 * 5.0 / (B_GAIN * 400.0 + 5.0 * A_GAIN * 2.0 / SPEED), rel=1e-9)
    assert bound < dwell_times(samples, PERIOD).length.min()
    failing = {
        "sign": admissible(samples, stiffness, PERIOD, WHEEL, band=25.0),
        "weak": admissible(*relay(15.0, 2.0), PERIOD, WHEEL, band=5.0),
        "held": admissible(samples._replace(pressure=0.0 * samples.pressure), stiffness, PERIOD, WHEEL),
    }
    names = {name: " ".join(c.name for c in each.failed) for name, each in failing.items()}
    assert "changes its sign" in names["sign"] and "least |u| / alpha" in names["weak"]
    assert "least |u| / alpha" in names["held"]
    with pytest.raises(ValueError, match="band = 0 m/s"):
        admissible(samples, stiffness, PERIOD, WHEEL, band=0.0)


def test_the_bound_of_the_dwell_time_holds_for_every_admissible_relay():
    rng = np.random.default_rng(3)
    held = 0
    for strength, turn, band in rng.uniform([50.0, 2.0, 0.5], [600.0, 30.0, 15.0], (60, 3)):
        found = admissible(*relay(strength, turn, samples=600), PERIOD, WHEEL, band)
        if not any(c.name.startswith("(ii)") for c in found.failed):
            assert found.holds, found
            held += 1
    assert held > 20


def test_where_y_is_zero_one_direction_is_observable():
    linear = known_road(WHEEL, 24.0)
    rank = [int(np.linalg.matrix_rank(observability_rows(linear.A, linear.C, y / SPEED))) for y in (0.0, 0.1, -30.0)]
    assert rank == [1, 3, 3]


def drift(z):
    """Of the 3-state model, times v: f = y (A z)."""
    return z[0] * jnp.stack([-A_GAIN * z[1], 24.0 * z[1] + z[2], 0.0 * z[2]])


def output(z):
    return z[0]


def bent(x):
    """Other coordinates of the 2-state model: z as a function of x, one to one near 0."""
    return jnp.stack([x[0] + 0.1 * x[1] ** 2, x[1] + 0.2 * x[0] * x[1]])


def test_the_quotient_goes_through_the_zeros():
    divided = quotient(drift, output)
    for z in ([0.0, 0.3, 2.0], [3.0, -0.4, 1.0]):
        np.testing.assert_allclose(divided(jnp.array(z)), [-A_GAIN * z[1], 24.0 * z[1] + z[2], 0.0], rtol=1e-12)
    sine = quotient(lambda x: jnp.sin(x) + 0.0 * x, lambda x: x[0])
    for x in (0.0, 0.7):
        slope = jax.jacfwd(sine)(jnp.array([x]))[0, 0]
        np.testing.assert_allclose(sine(jnp.array([x]))[0], np.sinc(x / np.pi), rtol=1e-12)
        np.testing.assert_allclose(slope, 0.0 if x == 0 else (np.cos(x) - np.sin(x) / x) / x, rtol=1e-10, atol=1e-14)


def test_the_models_of_xbs_may_be_linear_up_to_their_time_scale_in_any_coordinates():
    def curved(x):
        z = bent(x)
        return jnp.linalg.solve(jax.jacfwd(bent)(x), z[0] * jnp.stack([-A_GAIN * z[1], 0.0 * z[1]]))

    assert singular_linearisability(drift, output, [0.0, 0.5, 12.0]).holds
    assert singular_linearisability(curved, lambda x: output(bent(x)), [0.0, 0.1], reach=0.3).holds
    with pytest.raises(ValueError, match="dh vanishes at x0"):
        singular_linearisability(drift, lambda z: z[0] ** 2, [0.0, 0.5, 12.0])


@pytest.mark.parametrize(
    ("f", "h", "failing"),
    [
        (
            lambda z: jnp.stack([z[0] * z[1], z[1] * z[2] + z[0], 0.0 * z[0]]),
            output,
            ["Lemma 4.1: |f_2|", "Theorem 4.3 (i)"],
        ),
        (lambda z: jnp.stack([1.0 + 0.0 * z[0], z[0] * z[2], z[0]]), output, ["Lemma 4.1: |f_1|", "Theorem 4.3 (i)"]),
        (lambda z: z[0] * jnp.stack([z[1], z[0], z[2]]), output, ["Theorem 4.3 (i)"]),
    ],
    ids=["drift where y = 0", "no zeros at all", "a state not seen"],
)
def test_what_is_not_of_that_form_is_said(f, h, failing):
    found = singular_linearisability(f, h, [0.0, 0.5, 12.0])
    assert [c.name.split(" on the")[0].split(": least")[0] for c in found.failed] == failing
