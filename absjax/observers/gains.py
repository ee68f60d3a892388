"""Gains of switched observers: pole placement, the partner of a gain, and the Lyapunov matrix they share.

A system dz/dt = s(y) A z + B u, y = C z, with a scalar s(y) that changes sign, is observed by a copy of
itself with the injection s(y) K (y - C z^), K = K+ where s > 0 and K- where s < 0. In the scaled time
with rate |s| the error obeys de = A+ e or A- e, with A+ = A - K+ C and A- = -A + K- C.

From any K+ that makes A+ Hurwitz, with P the solution of A+' P + P A+ = -C' C,

    K- = K+ - (1 + rho) / 2 P^-1 C',    A-' P + P A- = -rho C' C,    rho > 0

so that e' P e decreases whichever sign s has. At rho = 1 both matrices have the same spectrum.
Source: Hoang 2014 (thesis), Theorem 4.1; Hespanha 2004, Theorem 4.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.parameters import concrete


class GainPair(NamedTuple):
    """Gains of either sign of s(y), arrays (n,), and the Lyapunov matrix (n, n) they share."""

    plus: Any
    minus: Any
    lyapunov: Any


@jax.jit
def characteristic(*factors: Sequence[Any]):
    """Monic polynomial, highest power first, as the product of monic factors.

    Args:
        factors: of each factor the coefficients below the leading one: (p,) for s + p, (p, q) for
            s^2 + p s + q. Positive coefficients make every root stable.

    Returns:
        Array (n + 1,).
    """
    product = jnp.ones(1)
    for factor in factors:
        product = jnp.convolve(product, jnp.stack([jnp.ones_like(jnp.asarray(factor[0])), *map(jnp.asarray, factor)]))
    return product


def from_poles(*decay: Any):
    """Characteristic polynomial with the real roots -decay."""
    return characteristic(*((rate,) for rate in decay))


def normal_form(A, C):
    """Observer normal form of an observable pair.

    With the characteristic polynomial s^n + alpha_1 s^(n-1) + ... of A, the coordinates T z have

        t_1 = C,  t_(k+1) = t_k A + alpha_k C,    so that  (T z)_k' = -alpha_k y + (T z)_(k+1)

    Returns:
        (alpha, T): arrays (n,) and (n, n).

    Raises:
        ValueError: if shapes do not fit, or the pair is not observable.
    """
    A, C = jnp.asarray(A), jnp.asarray(C)
    n = A.shape[0]
    if A.shape != (n, n) or C.shape != (n,):
        raise ValueError(f"A {A.shape} must be square and C {C.shape} a row of it")
    alpha, T = _normal_form(A, C)
    if concrete(T) and np.linalg.matrix_rank(_rows_scaled(np.asarray(T))) < n:
        raise ValueError("the pair (A, C) is not observable")
    return alpha, T


@jax.jit
def _normal_form(A, C):
    alpha, rows = characteristic_of(A)[1:], [C]
    for k in range(A.shape[0] - 1):
        rows.append(rows[-1] @ A + alpha[k] * C)
    return alpha, jnp.stack(rows)


def place(A, C, polynomial):
    """The gain K, array (n,), that gives A - K C the characteristic polynomial: T K = polynomial - alpha.

    Args:
        A: with C an observable pair, (n, n).
        C: the output, (n,).
        polynomial: monic, highest power first, array (n + 1,).

    Raises:
        ValueError: if shapes do not fit, or the pair is not observable.
    """
    alpha, T = normal_form(A, C)
    polynomial = jnp.asarray(polynomial)
    if polynomial.shape != (T.shape[0] + 1,):
        raise ValueError(
            f"a polynomial of degree {T.shape[0]} has {T.shape[0] + 1} coefficients, not {polynomial.size}"
        )
    return _placed(alpha, T, polynomial)


@jax.jit
def _placed(alpha, T, polynomial):
    return jnp.linalg.solve(T, polynomial[1:] - alpha)


def _rows_scaled(matrix: np.ndarray) -> np.ndarray:
    norms = np.linalg.norm(matrix, axis=1, keepdims=True)
    return matrix / np.where(norms > 0, norms, 1.0)


@jax.jit
def lyapunov(A, Q):
    """P with A' P + P A = -Q, for a stable A (n, n) and symmetric Q (n, n)."""
    A, n = jnp.asarray(A), A.shape[0]
    eye = jnp.eye(n)
    operator = jnp.kron(eye, A.T) + jnp.kron(A.T, eye)
    solution = jnp.linalg.solve(operator, -jnp.asarray(Q).reshape(-1))
    # One step of iterative refinement takes the error to the rounding of the residual.
    residual = -jnp.asarray(Q).reshape(-1) - operator @ solution
    P = (solution + jnp.linalg.solve(operator, residual)).reshape(n, n)
    return 0.5 * (P + P.T)


def partner(A, C, plus, ratio: Any = 1.0) -> GainPair:
    """The gain K- that goes with K+, and their common Lyapunov matrix.

    Both are computed in observer normal form, where A+ is the companion matrix of its polynomial p and
    P^-1 C' = (1 - (-1)^k) p_k: no condition number of P enters.

    Args:
        A: with C an observable pair, (n, n).
        C: the output, (n,).
        plus: K+, array (n,), such that A - K+ C is Hurwitz.
        ratio: rho > 0 of the module's equation.

    Raises:
        ValueError: if A - K+ C is not Hurwitz, ratio is not positive, or the pair is not observable.
    """
    alpha, T = normal_form(A, C)
    n = T.shape[0]
    plus = jnp.asarray(plus)
    if plus.shape != (n,):
        raise ValueError(f"the gain has {plus.size} entries, the system {n} states")
    p = _injected(alpha, T, plus)
    if concrete(p) and not (abscissa := float(np.max(np.roots([1.0, *p]).real))) < 0:
        raise ValueError(f"A - K+ C is not Hurwitz: an eigenvalue has the real part {abscissa:g}")
    if concrete(ratio) and not np.all(np.asarray(ratio) > 0):
        raise ValueError(f"ratio = {ratio} must be positive")
    return _partner(p, T, plus, ratio)


@jax.jit
def _injected(alpha, T, plus):
    """Coefficients of the characteristic polynomial of A - K C, (n,)."""
    return alpha + T @ plus


@jax.jit
def _partner(p, T, plus, ratio) -> GainPair:
    odd = jnp.arange(1, T.shape[0] + 1) % 2 == 1
    change = jnp.linalg.solve(T, jnp.where(odd, 2 * p, 0.0))
    return GainPair(plus, plus - 0.5 * (1 + ratio) * change, T.T @ _companion_lyapunov(p) @ T)


@jax.jit
def _companion_lyapunov(p):
    """P with A' P + P A = -C' C for A the companion matrix [-p | 1], C = (1, 0, ..., 0).

    Time is scaled by the geometric mean of the eigenvalues, which keeps the linear system well posed.
    """
    n = p.shape[0]
    pace = jnp.abs(p[-1]) ** (1 / n)
    powers = pace ** jnp.arange(1, n + 1)
    A = jnp.concatenate([-(p / powers)[:, None], jnp.eye(n)[:, :-1]], axis=1)
    unit = jnp.zeros((n, n)).at[0, 0].set(1.0)
    scale = pace ** -jnp.arange(n)
    return lyapunov(A, unit) * jnp.outer(scale, scale) / pace


@jax.jit
def characteristic_of(A):
    """Characteristic polynomial of A (n, n), highest power first, by Faddeev and LeVerrier's recursion."""
    n = A.shape[0]
    coefficients, M = [jnp.ones(())], jnp.zeros_like(A)
    for k in range(1, n + 1):
        M = A @ M + coefficients[-1] * jnp.eye(n)
        coefficients.append(-jnp.trace(A @ M) / k)
    return jnp.stack(coefficients)


@jax.jit
def spectral_radius(A):
    """Largest magnitude of an eigenvalue of A (n, n): Gelfand's formula at the power 2^8, to a few per cent."""
    logarithm, power = jnp.zeros(()), A
    for i in range(8):
        norm = jnp.maximum(jnp.linalg.norm(power), jnp.finfo(power.dtype).tiny)
        logarithm = logarithm + jnp.log(norm) / 2**i
        power = (power / norm) @ (power / norm)
    norm = jnp.maximum(jnp.linalg.norm(power), jnp.finfo(power.dtype).tiny)
    return jnp.exp(logarithm + jnp.log(norm) / 2**8)
