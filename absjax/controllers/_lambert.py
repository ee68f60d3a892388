"""The principal branch of the Lambert W function on [-1/e, 0], W exp(W) = x with W >= -1.

Source: Aguado-Rojas 2019, appendix B.
"""

import math

import jax
import jax.numpy as jnp
from jax import lax

ITERATIONS = 12
BRANCH_POINT = -math.exp(-1.0)


@jax.jit
def lambert_w0(x):
    """W0(x) for x in [-1/e, 0]; x below -1/e, by rounding, counts as -1/e.

    Halley's iteration from the series at the branch point, W = -1 + p - p^2/3 + ..., p = sqrt(2 (1 + e x)).
    The derivative is the implicit one, W' = 1 / (exp(W) (1 + W)), and 0 at the branch point, where it has none.
    """
    x = jnp.asarray(x, jnp.promote_types(jnp.asarray(x).dtype, jnp.float32))
    fixed = lax.stop_gradient(x)
    room = jnp.maximum(1 + math.e * fixed, 0.0)
    p = jnp.sqrt(2 * room)
    w = -1 + p * (1 - p * (1 / 3 - p * 11 / 72))
    regular = room > 4 * jnp.finfo(x.dtype).eps

    def halley(_, w):
        e = jnp.exp(w)
        f, above = w * e - fixed, jnp.where(regular, w + 1, 1.0)
        return w - jnp.where(regular, f / (e * above - (w + 2) * f / (2 * above)), 0.0)

    w = lax.stop_gradient(lax.fori_loop(0, ITERATIONS, halley, w))
    slope = jnp.where(regular, 1 / (jnp.exp(w) * jnp.where(regular, 1 + w, 1.0)), 0.0)
    return w + slope * (x - fixed)
