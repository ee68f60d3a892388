"""Theorem 4.3 of the thesis: brackets of systems that are, or are not, linear up to a time scale that vanishes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.observers.brackets import bracket, bracket_conditions, dummy_input, rate_of_scale

KAPPA = 0.4


def scaled(z):
    """f^ of two states, s- = exp(KAPPA y): A z + d(y) under the regular part of the time scale."""
    return jnp.exp(KAPPA * z[0]) * jnp.stack([z[1] + z[0] ** 2, jnp.sin(z[0])])


def three(z):
    return jnp.exp(KAPPA * z[0]) * jnp.stack([z[1], z[2] + z[0] ** 2, 0.5 * z[0]])


def steady(z):
    """The input of the models of XBS: it acts on y alone."""
    return jnp.eye(z.size)[0]


def output(z):
    return z[0]


def test_a_bracket_against_one_by_hand():
    """[(y, 0), (0, x^2)] = (-x^2, 2 x y)."""
    found = bracket(lambda z: jnp.stack([z[1], 0.0 * z[0]]), lambda z: jnp.stack([0.0 * z[0], z[0] ** 2]))
    np.testing.assert_allclose(found(jnp.array([3.0, 2.0])), [-9.0, 12.0])


def test_dummy_input_and_time_scale_against_the_closed_form():
    """Of two states g^ = (0, exp(-KAPPA y)); of both the time scale is told exactly, whatever the coordinates."""
    z = jnp.array([0.3, 0.8])
    np.testing.assert_allclose(dummy_input(scaled, output, 2)(z), [0.0, np.exp(-KAPPA * 0.3)], atol=1e-12)
    assert float(rate_of_scale(scaled, output, 2)(z)) == pytest.approx(KAPPA, rel=1e-9)
    assert float(rate_of_scale(three, output, 3)(jnp.array([0.3, 0.8, -0.2]))) == pytest.approx(KAPPA, rel=1e-9)


def bent(x):
    return jnp.stack([x[0] + 0.1 * x[1] ** 2, x[1] + 0.2 * x[0] * x[1]])


def in_bent(field):
    return lambda x: jnp.linalg.solve(jax.jacfwd(bent)(x), field(bent(x)))


def test_what_is_of_that_form_is_found_to_be_in_any_coordinates():
    found = bracket_conditions(scaled, steady, output, [0.0, 0.5])
    assert found.holds, found.failed
    found = bracket_conditions(in_bent(scaled), in_bent(steady), lambda x: output(bent(x)), [0.0, 0.4], points=2)
    assert found.holds, found.failed


def by_output(z):
    """lambda = y, s- = exp(y^2 / 2): linear in y and z2 / s-, in which an input of y alone is (1, y z2)."""
    return jnp.stack([z[1], z[0] * z[1] ** 2])


@pytest.mark.parametrize(
    ("divided", "g", "failing"),
    [
        (scaled, lambda z: jnp.stack([1.0 + 0.0 * z[0], z[1] ** 2]), ["(iv): [g, ad^0 g-]"]),
        (lambda z: jnp.stack([z[1], z[1] ** 3]), steady, ["(iii): change of lambda"]),
        (by_output, steady, ["(iv): [g, ad^0 g-]"]),
        (by_output, lambda z: jnp.stack([1.0 + 0.0 * z[0], z[0] * z[1]]), []),
    ],
    ids=["input by the state", "time scale by the state", "input across the time scale", "input along it"],
)
def test_conditions_that_fail_are_said(divided, g, failing):
    found = bracket_conditions(divided, g, output, [0.0, 0.5], points=2)
    names = " ".join(c.name for c in found.failed)
    assert found.holds == (not failing) and all(name in names for name in failing), names


def test_the_theorem_asks_for_two_states():
    with pytest.raises(ValueError, match="n >= 2"):
        bracket_conditions(lambda z: z, steady, output, [0.0])
