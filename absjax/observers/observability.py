"""Observability of systems dz/dt = s(y) A z + B u, y = C z, whose time scale vanishes: s(0) = 0.

With u known the rows C, C s A, ..., C (s A)^(n-1) span all directions wherever s(y) != 0 if (A, C) is observable, and
one alone where y = 0: no such system is uniformly observable, and u = 0 leaves any two states with y = 0 apart from
each other without a trace in y. A system dx/dt = f(x) + g(x) u, y = h(x) can be of that form only if h divides f,

    f = h f^,    f^ smooth,

and (f^, h) is observable. h divides f where dh != 0 if, and only if, f vanishes wherever h does (*erratum*: [H]
prints the inclusion of the zeros the other way round; 1 has no zeros, and is no multiple of h). Along the gradient of
h from the nearest zero x0 of h to x, by Hadamard's lemma,

    f^(x) = int_0^1 Df(x0 + q (x - x0)) n dq / int_0^1 Dh(x0 + q (x - x0)) n dq,    n = grad h(x)

which divides nothing by zero, and can be differentiated.
Source: Hoang 2014 (thesis), section 2.2.3, Lemma 4.1, Proposition 4.1, Proposition 4.2 and Theorem 4.3 (i).
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from absjax.observers.certificate import Checked, Condition

NODES = 8
"""Of the Gauss rule along the gradient: exact for polynomials of degree 15."""
NEWTON = 8
"""Steps to the nearest zero."""
RELATIVE = 1e-6
"""Of what f is elsewhere, below which it vanishes on the zeros of h."""


def observability_rows(A, C, scale) -> jax.Array:
    """C (s A)^k, k = 0 ... n - 1, (n, n), at the time scale s(y)."""
    rows = [jnp.asarray(C)]
    for _ in range(len(A) - 1):
        rows.append(scale * rows[-1] @ jnp.asarray(A))
    return jnp.stack(rows)


def quotient(f: Callable, h: Callable) -> Callable:
    """f^ with f = h f^, which goes through the zeros of h; means something only if f vanishes there.

    Args:
        f: (n,) -> array.
        h: (n,) -> scalar, with a gradient that does not vanish.
    """
    nodes, weights = np.polynomial.legendre.leggauss(NODES)

    def divided(x):
        x = jnp.asarray(x)
        n = jax.grad(h)(x)

        def along(function, shift):
            return jax.jvp(function, (x + shift * n,), (n,))

        def closer(_, shift):
            value, slope = along(h, shift)
            return shift - value / slope

        shift = lax.fori_loop(0, NEWTON, closer, 0.0 * h(x))
        above, below = jax.vmap(lambda q: (along(f, q * shift)[1], along(h, q * shift)[1]))(0.5 * (1 + nodes))
        return weights @ above / (weights @ below)

    return divided


def lie_derivatives(f: Callable, h: Callable, order: int) -> list[Callable]:
    """h, L_f h, ..., L_f^order h, functions of x (n,)."""
    found = [h]
    for _ in range(order):
        found.append(lambda x, last=found[-1]: jax.jvp(last, (x,), (f(x),))[1])
    return found


def singular_linearisability(f: Callable, h: Callable, x0: Any, reach: float = 1.0, points: int = 64) -> Checked:
    """What a system dx/dt = f(x) + g(x) u, y = h(x) must fulfil to be s(y) (A z + d(y)) + b(y) u in other coordinates.

    These conditions are necessary (Proposition 4.2 and Theorem 4.3 (i)), at points around x0; those on brackets of the
    vector fields, (ii) to (iv) of the theorem, are not looked at.

    Args:
        f: drift, (n,) -> (n,).
        h: output, (n,) -> scalar.
        x0: (n,), the point around which the form is asked for.
        reach: of the neighbourhood: points are drawn from a cube of half that edge around x0.
        points: how many.

    Raises:
        ValueError: if dh vanishes at x0, where the lemma says nothing.
    """
    x0 = jnp.asarray(x0, jnp.result_type(float))
    n = x0.size
    if not float(jnp.linalg.norm(jax.grad(h)(x0))) > 0:
        raise ValueError(f"dh vanishes at x0 = {x0}: Lemma 4.1 needs an output with a slope")
    around = x0 + reach * np.random.default_rng(0).uniform(-1.0, 1.0, (points, n))

    def zero_near(x):
        def closer(_, x):
            gradient = jax.grad(h)(x)
            return x - h(x) * gradient / jnp.sum(gradient**2)

        return lax.fori_loop(0, NEWTON, closer, x)

    size = np.abs(np.asarray(jax.vmap(f)(around))).max(axis=0)
    left = np.abs(np.asarray(jax.vmap(lambda x: f(zero_near(x)))(around))).max(axis=0)
    share = np.where(size > 0, left / np.where(size > 0, size, 1.0), 0.0)
    conditions = [
        Condition(f"Lemma 4.1: |f_{i + 1}| on the zeros of h, relative", float(each), -1.0, RELATIVE)
        for i, each in enumerate(share)
    ]
    divided = quotient(f, h)
    rows = jnp.stack([jax.jacfwd(lie)(x0) for lie in lie_derivatives(divided, h, n - 1)])
    norms = jnp.linalg.norm(rows, axis=1, keepdims=True)
    singular = jnp.linalg.svd(rows / jnp.where(norms > 0, norms, 1.0), compute_uv=False)
    conditions.append(
        Condition("Theorem 4.3 (i): least singular value of dh, dL_f^ h, ...", float(singular[-1]), RELATIVE, np.inf)
    )
    return Checked("linear up to a time scale that vanishes", tuple(conditions))
