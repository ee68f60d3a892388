"""Gains of switched observers: published numbers and formulas, random pairs, gradients, certificates."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from absjax.observers.adaptive import AdaptiveObserver
from absjax.observers.certificate import certify
from absjax.observers.gains import (
    characteristic,
    characteristic_of,
    from_poles,
    lyapunov,
    normal_form,
    partner,
    place,
    spectral_radius,
)
from absjax.observers.switched import SwitchedObserver, constant_stiffness, known_road, unknown_road
from absjax.plant.wheel import Wheel

WHEEL = Wheel()
SLIP_GAIN = 187.5


def test_reference_value_of_the_thesis():
    """Hoang 2014, section 4.4: a = 187.5, c = 24, triple pole 0.1, observer normal coordinates."""
    A = jnp.array([[-24 / SLIP_GAIN, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    C = jnp.array([1.0, 0.0, 0.0])
    gains = partner(A, C, place(A, C, from_poles(0.1, 0.1, 0.1)))
    np.testing.assert_allclose(gains.plus, [0.172, 0.03, 0.001], rtol=1e-12)
    np.testing.assert_allclose(gains.minus, [-0.428, 0.03, -0.001], rtol=1e-12)
    P = [[1.875, 0.0, -62.5], [0.0, 62.5, 0.0], [-62.5, 0.0, 18750.0]]
    np.testing.assert_allclose(gains.lyapunov, P, rtol=1e-12, atol=1e-12)


def random_pair(n, seed):
    rng = np.random.default_rng(seed)
    A, C = rng.normal(size=(n, n)), rng.normal(size=n)
    return A, C, np.asarray(place(A, C, from_poles(*rng.uniform(0.3, 3.0, n))))


@pytest.mark.parametrize("n", range(2, 7))
def test_random_observable_pairs(n):
    for seed in range(8):
        A, C, plus = random_pair(n, seed)
        for ratio in (1.0, 2.5):
            gains = partner(A, C, plus, ratio)
            A_plus, A_minus = A - np.outer(plus, C), -A + np.outer(gains.minus, C)
            P = np.asarray(gains.lyapunov)
            for matrix, q in ((A_plus, 1.0), (A_minus, ratio)):
                size = np.abs(P).max() * np.abs(matrix).max()
                np.testing.assert_allclose(matrix.T @ P + P @ matrix, -q * np.outer(C, C), atol=1e-9 * size)
            assert np.linalg.eigvalsh(P).min() > 0
            if ratio == 1.0:
                # Spectra are compared by their polynomials in normal form, which are well conditioned.
                alpha, T = normal_form(A, C)
                ours = (-1.0) ** np.arange(1, n + 1) * np.asarray(alpha + T @ gains.minus)
                np.testing.assert_allclose(ours, alpha + T @ plus, rtol=1e-9)
            # K- = K+ - (1 + rho)/2 P^-1 C', from P by a library.
            P_library = solve_continuous_lyapunov(A_plus.T, -np.outer(C, C))
            direct = plus - 0.5 * (1 + ratio) * np.linalg.solve(P_library, C)
            tolerance = 1e-13 * max(np.linalg.cond(P), 1e4)
            assert np.linalg.norm(direct - gains.minus) <= tolerance * np.linalg.norm(gains.minus)


def test_gradient_through_the_gains_against_differences():
    def entry(x):
        linear = unknown_road(WHEEL, x[0], x[1])
        gains = linear.gains([(x[2], x[3]), (x[4], x[5])], x[6])
        return jnp.sum(jnp.sin(gains.minus / 1e3)) + jnp.log(gains.lyapunov[3, 3])

    x = jnp.array([22.0, 52.0, 120.0, 3600.0, 90.0, 2500.0, 1.3])
    gradient = np.asarray(jax.grad(entry)(x))
    for i in range(x.size):
        h = 1e-5 * float(x[i])
        difference = float(entry(x.at[i].add(h)) - entry(x.at[i].add(-h))) / (2 * h)
        assert gradient[i] == pytest.approx(difference, rel=2e-6)


def test_published_gains_of_three_and_four_states():
    a, c, b1, b2 = SLIP_GAIN, 24.0, 40.0, 70.0
    three = SwitchedObserver.placed(known_road(WHEEL, c), [(b1,), (2 * b2, b2**2)])
    a1, a2 = -22.0 * 52.0, 74.0
    four = SwitchedObserver.placed(unknown_road(WHEEL), [(2 * b1, b1**2), (2 * b2, b2**2)])
    for sign, got3, got4 in ((1, three.plus, four.plus), (-1, three.minus, four.minus)):
        k1 = c + sign * (b1 + 2 * b2)
        np.testing.assert_allclose(got3, [k1, -(b2**2 + 2 * b1 * b2 + c * k1) / a, -sign * b1 * b2**2 / a], rtol=1e-12)
        k1 = a2 + sign * 2 * (b1 + b2)
        k2 = (-a1 - k1 * a2 - (b1**2 + b2**2 + 4 * b1 * b2)) / a
        k3 = (-k1 * a1 + a * k2 * a2 - sign * 2 * b1 * b2 * (b1 + b2)) / a
        np.testing.assert_allclose(got4, [k1, k2, k3, -(b1**2) * b2**2 / a], rtol=1e-11)


def test_published_gains_of_two_states():
    """Hoang 2014, eq. 2.9, k1- corrected to -a/2; and Aguado-Rojas 2019, eq. 3.20."""
    linear = constant_stiffness(WHEEL)
    gains = partner(linear.A, linear.C, jnp.array([SLIP_GAIN / 2, -1.0]))
    np.testing.assert_allclose(gains.minus, [-SLIP_GAIN / 2, -1.0], rtol=1e-13)
    np.testing.assert_allclose(gains.lyapunov, np.diag([1 / SLIP_GAIN, 1.0]), atol=1e-15)
    adaptive = AdaptiveObserver.placed(WHEEL, (160.0, 6400.0), (4e4, 1e4))
    np.testing.assert_allclose(adaptive.plus, [160.0, -6400 / SLIP_GAIN], rtol=1e-13)
    np.testing.assert_allclose(adaptive.minus, [-160.0, -6400 / SLIP_GAIN], rtol=1e-13)


def test_small_tools():
    A = np.random.default_rng(0).normal(size=(4, 4))
    np.testing.assert_allclose(characteristic_of(jnp.asarray(A)), np.poly(A), rtol=1e-12)
    np.testing.assert_allclose(characteristic((3.0,), (2.0, 5.0)), np.polymul([1, 3], [1, 2, 5]), rtol=1e-15)
    assert float(spectral_radius(jnp.asarray(A))) == pytest.approx(np.abs(np.linalg.eigvals(A)).max(), rel=0.03)
    stable = A - 5 * np.eye(4)
    P = np.asarray(lyapunov(jnp.asarray(stable), jnp.eye(4)))
    np.testing.assert_allclose(P, solve_continuous_lyapunov(stable.T, -np.eye(4)), rtol=1e-11)


def test_what_cannot_be_observed_or_stabilised_is_refused_by_name():
    A, C = np.diag([1.0, 2.0]), np.array([1.0, 0.0])
    with pytest.raises(ValueError, match="not observable"):
        place(A, C, from_poles(1.0, 2.0))
    A = np.array([[0.0, 1.0], [0.0, 0.0]])
    with pytest.raises(ValueError, match=r"not Hurwitz: an eigenvalue has the real part"):
        partner(A, C, [-1.0, 1.0])
    with pytest.raises(ValueError, match="ratio = -1"):
        partner(A, C, [1.0, 1.0], -1.0)
    with pytest.raises(ValueError, match="degree 2 has 3 coefficients, not 4"):
        place(A, C, from_poles(1.0, 2.0, 3.0))


OBSERVERS = {
    "2 states": SwitchedObserver.placed(constant_stiffness(WHEEL), [(100.0, 3000.0)]),
    "3 states": SwitchedObserver.placed(known_road(WHEEL, 24.0), [(60.0,), (120.0, 3600.0)], 2.0),
    "4 states": SwitchedObserver.placed(unknown_road(WHEEL), [(120.0, 3600.0), (90.0, 5000.0)], 0.5),
    "adaptive": AdaptiveObserver.placed(WHEEL, (160.0, 6400.0), (4e4, 1e4)),
}


@pytest.mark.parametrize("name", OBSERVERS)
def test_certificates_of_sound_sets_hold(name):
    certificate = certify(OBSERVERS[name])
    assert certificate.holds and certificate.failed == ()
    assert certificate.decay > 0 and "certified" in str(certificate)
    assert all(condition["holds"] for condition in certificate.to_json()["conditions"])


@pytest.mark.parametrize(
    "name, change, failing",
    [
        ("2 states", {"minus": [100.0, -16.0]}, "Aguado-Rojas 3.20: k1-"),
        ("2 states", {"minus": [-100.0, -17.0]}, "k2- = k2+"),
        ("3 states", {"plus": [20.0, -83.0, -1000.0]}, "Hoang (15): k1+"),
        ("3 states", {"minus": [-336.0, -14.592, 30000.0]}, "Hoang (16): k3-"),
        ("4 states", {"plus": [314.0, -233.0, -19936.0, 5.0]}, "Hoang (5.32): k4+"),
        ("adaptive", {"adaptation": [4e4, 0.0]}, "G: adaptation of d"),
    ],
)
def test_a_certificate_that_fails_names_the_condition_and_by_how_much(name, change, failing):
    certificate = certify(dataclasses.replace(OBSERVERS[name], **{k: jnp.array(v) for k, v in change.items()}))
    assert not certificate.holds
    missed = [condition for condition in certificate.failed if failing in condition.name]
    assert len(missed) == 1 and missed[0].excess > 0
    assert "FAILS by" in str(missed[0]) and str(missed[0]) in str(certificate)


def test_published_inequalities_agree_with_the_eigenvalues():
    """Random gains around the border: the inequalities of (5.32) hold where A+ is Hurwitz."""
    rng, linear = np.random.default_rng(1), unknown_road(WHEEL)
    verdicts = []
    for _ in range(200):
        plus = np.asarray(OBSERVERS["4 states"].plus) * rng.uniform(0.2, 2.0, 4)
        certificate = certify(SwitchedObserver(linear.A, linear.B, plus, OBSERVERS["4 states"].minus))
        hurwitz = certificate.conditions[0].holds
        inequalities = all(c.holds for c in certificate.conditions if "(5.32)" in c.name)
        assert hurwitz == inequalities
        verdicts.append(hurwitz)
    assert 20 < sum(verdicts) < 180
