"""Small numerical tools."""

import jax
import jax.numpy as jnp
import numpy as np

from absjax._numerics import computed_once


def test_what_is_computed_once_is_the_same_and_so_is_its_derivative():
    values = jnp.array([0.0, -0.0, 1.5, 1e-300, jnp.inf, -jnp.inf, jnp.nan])
    same, mode = computed_once((values, jnp.arange(3)))
    np.testing.assert_array_equal(same, values)
    np.testing.assert_array_equal(jnp.signbit(same), jnp.signbit(values))
    np.testing.assert_array_equal(mode, jnp.arange(3))
    assert computed_once(jnp.float32(0.1)).dtype == jnp.float32
    for x in (0.0, 3.0):
        assert jax.grad(computed_once)(x) == jax.jvp(computed_once, (x,), (1.0,))[1] == 1.0
        assert jax.grad(jax.grad(lambda x: computed_once(x) ** 3))(x) == 6 * x


def test_it_is_computed_once():
    """Ten consumers of a chain of sixty operations: the program has about as many, not ten times as many."""

    def program(shared):
        def consumers(x):
            y = x
            for _ in range(30):
                y = 1.01 * y + jnp.maximum(x, y - 0.3)
            y = shared(y)
            return [jnp.maximum(i * y, x) for i in range(10)]

        return jax.jit(consumers).lower(jnp.ones(64)).compile().as_text().count(" = ")

    assert program(computed_once) < 0.4 * program(lambda y: y)
