"""Stability of linear systems with a delay, exactly: the rightmost root of their characteristic equation.

    x' = A x(t) + sum_k B_k x(t - k h):   det(s I - A - sum_k B_k e^{-k s h}) = 0

The roots are found from a Chebyshev discretisation of the delay and made exact by Newton's method; the derivative of
the rightmost is the implicit one. Of a scalar s + alpha e^{-s h} they are those of Lambert's W, s h = W(-alpha h).

The predictor's closed loop falls into two (eq. 6.36 and the one after): errors and biases,

    e' = N e - diag(alpha) e(t - h) + ...,     p' = M p - (diag(beta) + M) p(t - h),    M = df/dx + N

with N the shift of the chain. The first is triangular, its roots those of s + alpha_i e^{-s h}.
Source: Hoang 2014 (thesis), section 6.3.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from absjax.controllers._lambert import lambert_w0
from absjax.delay.chain import Chain, field

POINTS = 24
"""Of the discretisation: roots of magnitude up to 10 / h are told to more than Newton's method needs."""
NEWTON_STEPS = 8


@jax.jit
def integrator_root(alpha, delay):
    """Real part of the rightmost root of s + alpha e^{-s h}, 1/s; negative for 0 < alpha < pi / (2 h).

    Differentiable but at alpha h = 1/e, where two real roots meet.
    """
    z = jnp.asarray(alpha * delay, jnp.result_type(float, alpha, delay))
    real = z * np.e <= 1
    below = lambert_w0(-jnp.where(real, z, 0.1))
    beyond = jnp.where(real, 1.0, z)
    fixed = lax.stop_gradient(beyond)
    # Beyond 1/e a pair: W = x + j y with x = -y cot y, z = y e^x / sin y and y in (0, pi), found by bisection.

    def halved(_, ends):
        y = 0.5 * (ends[0] + ends[1])
        less = _turned(y) < jnp.log(fixed)
        return jnp.where(less, y, ends[0]), jnp.where(less, ends[1], y)

    low, high = lax.fori_loop(0, 60, halved, (jnp.zeros_like(fixed), jnp.full_like(fixed, np.pi)))
    y = 0.5 * (low + high)
    y = y + (jnp.log(beyond) - jnp.log(fixed)) / jax.grad(lambda y: jnp.sum(_turned(y)))(y)
    return jnp.where(real, below, -y / jnp.tan(y)) / delay


def _turned(y):
    """ln z of the pair with imaginary part y."""
    return jnp.log(y / jnp.sin(y)) - y / jnp.tan(y)


@jax.jit
def rightmost_root(A, Bs, delay):
    """The root of det(s I - A - sum_k B_k e^{-k s h}) with the largest real part, complex, its imaginary part >= 0.

    Args:
        A: matrix (n, n).
        Bs: matrices (m, n, n), of the delays h, 2 h, ... m h.
        delay: h > 0, s.
    """
    A, Bs = jnp.asarray(A, jnp.result_type(float)), jnp.asarray(Bs, jnp.result_type(float))
    a, b, h = (lax.stop_gradient(jnp.asarray(x)) for x in (A, Bs, delay))
    values = jnp.linalg.eigvals(_discretised(a, b, h))
    s = values[jnp.argmax(values.real)]
    s = s.real + 1j * jnp.abs(s.imag)

    def newton(_, s):
        slope = jax.jvp(lambda s: _matrix(a, b, h, s), (s,), (jnp.ones_like(s),))[1]
        trace = jnp.trace(jnp.linalg.solve(_matrix(a, b, h, s), slope))
        usable = jnp.isfinite(trace) & (jnp.abs(trace) > 0)
        step = jnp.where(usable, 1 / jnp.where(usable, trace, 1.0), 0.0)
        return s - jnp.where(jnp.abs(step) < 0.1 * jnp.abs(s) + 1.0, step, 0.0)

    s = lax.fori_loop(0, NEWTON_STEPS, newton, s)
    matrix, slope = jax.jvp(lambda s: _matrix(a, b, h, s), (s,), (jnp.ones_like(s),))
    left, _, right = jnp.linalg.svd(matrix)
    left, right = jnp.conj(left[:, -1]), jnp.conj(right[-1])
    rate = left @ (slope @ right)
    sound = jnp.abs(rate) > 0
    return s - jnp.where(sound, left @ (_matrix(A, Bs, delay, s) @ right) / jnp.where(sound, rate, 1.0), 0.0)


def _matrix(A, Bs, delay, s):
    """s I - A - sum_k B_k e^{-k s h}."""
    lags = jnp.exp(-s * delay * jnp.arange(1, Bs.shape[0] + 1))
    return s * jnp.eye(A.shape[0]) - A - jnp.tensordot(lags, Bs.astype(lags.dtype), 1)


def _discretised(A, Bs, h):
    """Generator of the delayed equation on Chebyshev points of [-m h, 0], (n (POINTS + 1), ...)."""
    m, n, k = Bs.shape[0], A.shape[0], np.arange(POINTS + 1)
    x = np.cos(np.pi * k / POINTS)
    weights = np.where((k == 0) | (k == POINTS), 0.5, 1.0) * (-1.0) ** k
    D = np.outer(1 / weights, weights) / (x[:, None] - x[None, :] + np.eye(POINTS + 1))
    D = D - np.diag(D.sum(axis=1))
    inner = jnp.asarray(np.kron(D[1:], np.eye(n))) * (2 / (m * h))
    first = jnp.concatenate([A, jnp.zeros((n, n * POINTS))], axis=1)
    for i in range(m):
        first = first + jnp.kron(jnp.asarray(_at(1 - 2 * (i + 1) / m, x, weights)), Bs[i])
    return jnp.concatenate([first, inner])


def _at(place: float, x: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Row (1, points) that interpolates at a place."""
    away = place - x
    near = np.abs(away) < 1e-12
    row = near.astype(float) if near.any() else weights / away
    return (row / row.sum())[None]


@jax.jit
def predictor_root(chain: Chain, x, alpha, beta, delay):
    """Real part of the rightmost root of the predictor's closed loop, the chain made linear at x (n,), 1/s.

    Args:
        alpha: gains of the law (n,).
        beta: gains of the biases (n,).
        delay: h, s, which the predictor knows.
    """
    M = jax.jacfwd(lambda x: field(chain, x))(jnp.asarray(x, jnp.result_type(float)))
    bias = rightmost_root(M, -(jnp.diag(jnp.asarray(beta)) + M)[None], delay).real
    return jnp.maximum(jnp.max(integrator_root(jnp.asarray(alpha), delay)), bias)


@jax.jit
def unpredicted_root(chain: Chain, x, alpha, delay):
    """The same of the law without prediction: x_i^P is x_i, all else as it is.

    With z = e^{-s h} the rows of x_i* = r_i(z) x follow from r_1 = 0, r_(i+1) = -df_i - alpha_i (1_i - z r_i) + r_i M.
    """
    x = jnp.asarray(x, jnp.result_type(float))
    drift = jax.jacfwd(chain.drift)(x)
    n, identity = x.shape[0], jnp.eye(x.shape[0])
    M, alpha = drift + jnp.eye(n, k=1), jnp.asarray(alpha)
    rows = jnp.zeros((n + 1, n))
    for i in range(n):
        delayed = jnp.concatenate([jnp.zeros((1, n)), rows[:-1]])
        rows = alpha[i] * delayed + rows @ M
        rows = rows.at[0].add(-drift[i] - alpha[i] * identity[i])
    return rightmost_root(M, jnp.zeros((n + 1, n, n)).at[:, n - 1].set(rows), delay).real
