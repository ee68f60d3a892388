"""Tyre curves against published numbers, finite differences and each other."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.tyres.burckhardt import Burckhardt
from absjax.tyres.exponential_basis import ExponentialBasis, fit_exponential_basis
from absjax.tyres.surfaces import SURFACES

SLIPS = np.array([-1.0, -0.3, -0.05, -1e-9, 0.0, 1e-9, 0.02, 0.7])
CURVES = [SURFACES["dry_asphalt"], SURFACES["ice"], SURFACES["snow"], ExponentialBasis(-0.527, 25.222, 7.204)]


@pytest.mark.parametrize("curve", CURVES, ids=["dry", "ice", "snow", "exponential"])
def test_slope_and_curvature_against_automatic_differentiation(curve):
    slope = jax.vmap(jax.grad(curve.friction))(jnp.asarray(SLIPS))
    np.testing.assert_allclose(curve.stiffness(SLIPS), slope, rtol=1e-12)
    away = SLIPS[np.abs(SLIPS) > 1e-6]
    np.testing.assert_allclose(
        curve.curvature(away), jax.vmap(jax.grad(curve.stiffness))(jnp.asarray(away)), rtol=1e-11
    )
    np.testing.assert_allclose(curve.friction(-SLIPS), -curve.friction(SLIPS), atol=1e-18)


def test_braking_identity_of_burckhardt():
    dry = SURFACES["dry_asphalt"]
    slip = np.linspace(-1, -0.01, 50)
    np.testing.assert_allclose(
        dry.curvature(slip), dry.c2 * dry.stiffness(slip) + dry.c2 * dry.c3, rtol=1e-12, atol=1e-13
    )


def test_third_order_identity_of_the_exponential_basis():
    curve = CURVES[3]
    a0, a1, a2 = curve.jerk_coefficients()
    slip = jnp.linspace(-0.9, -0.02, 30)
    jerk = jax.vmap(jax.grad(curve.curvature))(slip)
    np.testing.assert_allclose(
        jerk, a0 + a1 * curve.stiffness(slip) + a2 * curve.curvature(slip), rtol=1e-9, atol=1e-12
    )


@pytest.mark.parametrize(
    "coefficients, theta",
    [
        ((1.28, 24.0, 0.52), (-0.527, 25.222, 7.204)),
        ((0.28, 50.0, 0.05), (-0.050, 0.241, 14.006)),
        ((0.857, 34.0, 0.35), (-0.360, 8.858, 24.000)),
    ],
    ids=["dry", "snow", "wet"],
)
def test_least_squares_reproduces_the_published_table(coefficients, theta):
    slip = np.linspace(-1, 0, 101)
    fit = fit_exponential_basis(slip, Burckhardt(*coefficients).friction(slip))
    np.testing.assert_allclose([fit.theta0, fit.theta1, fit.theta2], theta, atol=5.1e-4)


@pytest.mark.parametrize("name", SURFACES)
def test_peak_against_a_fine_grid(name):
    slip = np.linspace(0, 1, 200_001)
    friction = -np.asarray(SURFACES[name].friction(-slip))
    peak = SURFACES[name].peak()
    assert float(peak.friction) == pytest.approx(friction.max(), rel=1e-9)
    if name != "ice":  # flat up to full slip
        assert float(peak.slip) == pytest.approx(slip[friction.argmax()], abs=2e-5)


def test_peak_of_the_exponential_basis_against_a_fine_grid():
    slip = np.linspace(0, 1, 200_001)
    friction = -np.asarray(CURVES[3].friction(-slip))
    assert float(CURVES[3].peak().friction) == pytest.approx(friction.max(), rel=1e-9)
    assert float(CURVES[3].peak().slip) == pytest.approx(slip[friction.argmax()], abs=2e-5)


@pytest.mark.parametrize(
    "coefficients", [(1.28, 24.0, 0.52), (0.05, 306.0, 0.0), (0.0, 0.0, 0.0), (0.1, 2.0, 0.5), (1, 3.0, 0.2)]
)
def test_peak_and_its_gradient_are_finite_without_an_interior_peak(coefficients):
    c = jnp.array(coefficients, dtype=float)
    for value in (lambda c: Burckhardt(*c).peak().slip, lambda c: Burckhardt(*c).peak().friction):
        assert np.isfinite(value(c)) and np.all(np.isfinite(jax.grad(value)(c)))


@pytest.mark.parametrize(
    "bad", [(-1.0, 24.0, 0.5), (1.0, float("nan"), 0.5), (1.0, 24.0, float("inf")), ("x", 1.0, 1.0)]
)
def test_bad_coefficients_are_refused_by_name(bad):
    with pytest.raises(ValueError, match=r"Burckhardt\.c[123] = "):
        Burckhardt(*bad)


def test_fit_needs_three_points_of_one_shape():
    with pytest.raises(ValueError, match="points >= 3"):
        fit_exponential_basis(np.zeros(2), np.zeros(2))
    with pytest.raises(ValueError, match=r"\(4,\)"):
        fit_exponential_basis(np.zeros(4), np.zeros(5))
