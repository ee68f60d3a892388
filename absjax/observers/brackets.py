"""Brackets that vanish where a system is linear up to a time scale that vanishes: Theorem 4.3, (ii) to (iv).

A system dx/dt = h f^ + g u, y = h(x) whose (f^, h) is observable (`absjax.observers.observability`) has a dummy input
g^, the field with

    L_g^ L_f^^j h = 0 for j < n - 1,    1 for j = n - 1.

It is s(y) (A z + d(y)) + b(y) u in some coordinates z if, and only if, near x0

    (ii)   d L_g^ L_f^^n h = l_n lambda dL_f^ h  modulo dh,    l_n = n (n - 1) / 2 + 1
    (iii)  [ad_f-^i g-, ad_f-^j g-] = 0,  0 <= i < j <= n - 1,    f- = f^ / s-,  g- = s-^(n-1) g^
    (iv)   [g, ad_f-^j g-] = 0,  0 <= j <= n - 2

where s- = exp theta is the regular part of the time scale, s = y s-, and d theta = lambda dh, which asks that lambda
depends on y alone. A constant factor of s- changes nothing here: at each point theta counts from there, by its first n
derivatives by y, which is as many as the brackets see.
Source: Hoang 2014 (thesis), Theorem 4.3, eq. 4.11 and Remarks 4.1 and 4.2.
"""

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from absjax.observers.certificate import Checked, Condition
from absjax.observers.observability import RELATIVE, lie_derivatives

Field = Callable[[Any], Any]
"""(n,) -> (n,)"""


def along(field: Field, function: Callable) -> Callable:
    """Derivative of a function, or of every component of a field, along a field."""
    return lambda x: jax.jvp(function, (x,), (field(x),))[1]


def bracket(a: Field, b: Field) -> Field:
    """[a, b] = Db a - Da b."""
    return lambda x: along(a, b)(x) - along(b, a)(x)


def adjoints(a: Field, b: Field, order: int) -> list[Field]:
    """b, [a, b], ..., ad_a^order b."""
    found = [b]
    for _ in range(order):
        found.append(bracket(a, found[-1]))
    return found


def dummy_input(divided: Field, h: Callable, n: int) -> Field:
    """g^ of eq. 4.11; means something where (f^, h) is observable."""
    last = jnp.eye(n)[n - 1]
    return lambda x: jnp.linalg.solve(_coframe(divided, h, n)(x), last.astype(x.dtype))


def _coframe(divided: Field, h: Callable, n: int) -> Callable:
    """Rows dh, dL_f^ h, ..., dL_f^^(n-1) h."""
    lies = lie_derivatives(divided, h, n - 1)
    return lambda x: jnp.stack([jax.jacfwd(lie)(x) for lie in lies])


def coefficients(divided: Field, h: Callable, n: int) -> Callable:
    """d L_g^ L_f^^n h as a combination of dh, dL_f^ h, ..., (n,); the second is l_n lambda."""
    changed = along(dummy_input(divided, h, n), lie_derivatives(divided, h, n)[-1])
    return lambda x: jnp.linalg.solve(_coframe(divided, h, n)(x).T, jax.jacfwd(changed)(x))


def rate_of_scale(divided: Field, h: Callable, n: int) -> Callable:
    """lambda, (n,) -> scalar: d theta / dy of the regular part exp theta of the time scale."""
    found = coefficients(divided, h, n)
    return lambda x: found(x)[1] / (n * (n - 1) / 2 + 1)


def regular_parts(divided: Field, h: Callable, n: int, point: Any) -> tuple[Field, Field]:
    """f- and g-, near a point at which s- = 1."""

    def up(x):
        slope = jax.grad(h)(x)
        return slope / (slope @ slope)

    rates = [rate_of_scale(divided, h, n)]
    for _ in range(n - 1):
        rates.append(along(up, rates[-1]))
    here, known, g = h(point), [rate(point) for rate in rates], dummy_input(divided, h, n)

    def theta(x):
        rise = h(x) - here
        return sum(rate * rise ** (k + 1) / math.factorial(k + 1) for k, rate in enumerate(known))

    return (lambda x: jnp.exp(-theta(x)) * divided(x)), (lambda x: jnp.exp((n - 1) * theta(x)) * g(x))


def bracket_conditions(
    divided: Field, g: Field, h: Callable, x0: Any, *, reach: float = 0.1, points: int = 8
) -> Checked:
    """Theorem 4.3 (ii) to (iv), at points around x0. With `singular_linearisability` they are necessary and sufficient.

    Args:
        divided: f^, the drift divided by h, (n,) -> (n,): a closed form. That of `quotient` may be as well, but its
            derivatives of up to the order 2 n + 2 take minutes to compile.
        g: what the input does, (n,) -> (n,).
        h: output, (n,) -> scalar.
        x0: (n,), n >= 2, around which the form is asked for; (f^, h) is observable there.
        reach: of the neighbourhood: points are drawn from a cube of half that edge around x0.
        points: how many.

    Returns:
        Conditions on shares: of what vanishes in what it is a sum of, the largest over all points.

    Raises:
        ValueError: if n < 2.
    """
    x0 = jnp.asarray(x0, jnp.result_type(float))
    n = x0.size
    if n < 2:
        raise ValueError(f"x0 has {n} component; the theorem is of n >= 2")
    around = x0 + reach * np.random.default_rng(0).uniform(-1.0, 1.0, (points, n))

    def size(x):
        return jnp.linalg.norm(x)

    def vanishing(a, b, x):
        """|[a, b]| and what it would be if nothing cancelled."""
        first, second = along(a, b)(x), along(b, a)(x)
        return jnp.stack([size(first - second), size(first) + size(second) + size(a(x)) * size(b(x)) / reach])

    def shares(x):
        rows, combined = _coframe(divided, h, n)(x), coefficients(divided, h, n)(x)
        g_hat, rate = dummy_input(divided, h, n), rate_of_scale(divided, h, n)
        last = jax.jacfwd(lie_derivatives(divided, h, n)[-1])(x)
        parts = jnp.abs(combined) * jnp.linalg.norm(rows, axis=1)
        whole = parts.sum() + size(last) * size(g_hat(x)) / reach
        d_rate, dh = jax.jacfwd(rate)(x), rows[0]
        across = d_rate - (d_rate @ dh) / (dh @ dh) * dh
        f_bar, g_bar = regular_parts(divided, h, n, x)
        ads = adjoints(f_bar, g_bar, n - 1)
        pairs = [(i, j) for j in range(n) for i in range(j)]
        return {
            "(ii): parts beyond dL_f^ h": jnp.stack([parts[2:].sum(), whole]),
            "(iii): change of lambda where y does not change": jnp.stack(
                [size(across), size(d_rate) + jnp.abs(rate(x)) / reach + whole / size(rows[1])]
            ),
            **{f"(iii): [ad^{i} g-, ad^{j} g-]": vanishing(ads[i], ads[j], x) for i, j in pairs},
            **{f"(iv): [g, ad^{j} g-]": vanishing(g, ads[j], x) for j in range(n - 1)},
        }

    found = jax.jit(jax.vmap(shares))(around)
    conditions = []
    for name, pair in found.items():
        left, whole = np.asarray(pair).max(axis=0)
        share = left / whole if whole > 0 else 0.0
        conditions.append(Condition(f"Theorem 4.3 {name}, relative", float(share), -1.0, RELATIVE))
    return Checked("linear up to a time scale that vanishes, by brackets", tuple(conditions))
