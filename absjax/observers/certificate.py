"""Stability certificates of gain sets: every condition, whether it holds, and by how much.

In the scaled time ds = |y|/v dt the error of a switched observer obeys de/ds = A+ e or A- e. It converges
exponentially, for sign changes with a dwell time, when both are Hurwitz and share a P > 0 with
A+' P + P A+ = -q+ C'C and A-' P + P A- = -q- C'C, q+- > 0 (Hespanha 2004, Theorem 4). For the observers
of XBS the published inequalities say the same in terms of the gains; they are listed beside it.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from absjax.observers.gains import lyapunov

EQUAL = 1e-6
"""Relative difference below which two sides of a condition are equal."""


class Condition(NamedTuple):
    """low < value < high, or value = low where both bounds are the same."""

    name: str
    value: float
    low: float
    high: float
    scale: float = 1.0
    """of the difference that is negligible in an equality"""

    @property
    def excess(self) -> float:
        """By how much the condition is missed; 0 where it holds."""
        if self.low == self.high:
            miss = abs(self.value - self.low)
            return miss if miss > EQUAL * self.scale else 0.0
        if self.low < self.value < self.high:
            return 0.0
        return max(self.low - self.value, self.value - self.high, np.finfo(float).tiny)

    @property
    def holds(self) -> bool:
        """Whether it holds."""
        return bool(np.isfinite(self.value)) and self.excess == 0.0

    def __str__(self) -> str:
        if self.low == self.high:
            wanted = f"= {self.low:.6g}"
        elif np.isinf(self.high):
            wanted = f"> {self.low:.6g}"
        elif np.isinf(self.low):
            wanted = f"< {self.high:.6g}"
        else:
            wanted = f"in ({self.low:.6g}, {self.high:.6g})"
        verdict = "holds" if self.holds else f"FAILS by {self.excess:.6g}"
        return f"{self.name}: {self.value:.6g}, must be {wanted}: {verdict}"


class Checked(NamedTuple):
    """What was held to conditions, and the conditions."""

    subject: str
    conditions: tuple[Condition, ...]

    @property
    def holds(self) -> bool:
        """Whether every condition holds."""
        return not self.failed

    @property
    def failed(self) -> tuple[Condition, ...]:
        """The conditions that do not."""
        return tuple(condition for condition in self.conditions if not condition.holds)

    def value(self, name: str) -> float:
        """The value of the condition whose name begins so.

        Raises:
            KeyError: if there is none.
        """
        for condition in self.conditions:
            if condition.name.startswith(name):
                return condition.value
        raise KeyError(name)

    def __str__(self) -> str:
        verdict = "holds" if self.holds else f"does NOT hold: {len(self.failed)} conditions fail"
        return "\n  ".join([f"{self.subject}: {verdict}", *map(str, self.conditions)])


class Certificate(NamedTuple):
    """What is known of a gain set's stability."""

    conditions: tuple[Condition, ...]
    lyapunov: np.ndarray
    """P with A+' P + P A+ = -C'C, (n, n)"""
    plus: np.ndarray
    """eigenvalues of A+, (n,)"""
    minus: np.ndarray
    """eigenvalues of A-, (n,)"""

    @property
    def holds(self) -> bool:
        """Whether every condition holds."""
        return all(condition.holds for condition in self.conditions)

    @property
    def failed(self) -> tuple[Condition, ...]:
        """The conditions that do not."""
        return tuple(condition for condition in self.conditions if not condition.holds)

    @property
    def decay(self) -> float:
        """Slowest rate in scaled time, of either sign; negative where the error grows."""
        return float(-max(np.real(self.plus).max(), np.real(self.minus).max()))

    def __str__(self) -> str:
        verdict = "certified" if self.holds else f"NOT certified: {len(self.failed)} conditions fail"
        lines = [f"{verdict}; slowest rate {self.decay:.4g} in scaled time", *map(str, self.conditions)]
        return "\n  ".join(lines)

    def to_json(self) -> dict:
        """A plain dictionary."""
        conditions = [{**c._asdict(), "holds": c.holds, "excess": c.excess} for c in self.conditions]
        for condition in conditions:
            for bound in ("low", "high"):
                condition[bound] = condition[bound] if np.isfinite(condition[bound]) else None
        return {
            "holds": self.holds,
            "decay": self.decay,
            "conditions": conditions,
            "lyapunov": self.lyapunov.tolist(),
            "poles": {k: [[z.real, z.imag] for z in v] for k, v in (("plus", self.plus), ("minus", self.minus))},
        }


def certify(observer: Any) -> Certificate:
    """The certificate of one gain set.

    Raises:
        ValueError: if the observer offers none, or carries an ensemble of gain sets.
    """
    if not hasattr(observer, "certificate"):
        raise ValueError(f"{type(observer).__name__} offers no certificate: it has no method certificate()")
    return observer.certificate()


def switched_certificate(A, plus, minus, extra: Iterable[Condition] = ()) -> Certificate:
    """The certificate of A+ = A - K+ C and A- = -A + K- C, by the number of states with the published inequalities.

    Args:
        A: (n, n), in scaled time.
        plus: K+, (n,).
        minus: K-, (n,).
        extra: further conditions.

    Raises:
        ValueError: if the gains are those of an ensemble.
    """
    A, plus, minus = (np.asarray(x, float) for x in (A, plus, minus))
    if plus.ndim != 1 or A.ndim != 2:
        raise ValueError(f"one gain set at a time: the gain has shape {plus.shape}")
    C = np.eye(len(plus))[0]
    A_plus, A_minus = A - np.outer(plus, C), -A + np.outer(minus, C)
    published = {2: _two_states, 3: _three_states, 4: _four_states}.get(len(plus), lambda *_: ())
    P = np.asarray(lyapunov(A_plus, np.outer(C, C)))
    eigenvalues = np.linalg.eigvals(A_plus), np.linalg.eigvals(A_minus)
    conditions = (
        *_hurwitz(*eigenvalues),
        *_common(P, A_minus),
        *published(A, plus, minus),
        *extra,
    )
    return Certificate(conditions, P, *eigenvalues)


def _hurwitz(plus, minus) -> Iterable[Condition]:
    for sign, values in (("+", plus), ("-", minus)):
        yield Condition(f"Hurwitz: largest real part of A{sign}", float(values.real.max()), -np.inf, 0.0)


def _common(P, A_minus) -> Iterable[Condition]:
    # Scaled coordinates: a definite P stays definite, and its entries become comparable.
    scale = np.sqrt(np.abs(np.diag(P)))
    definite = float(np.linalg.eigvalsh(P / np.outer(scale, scale)).min())
    yield Condition("P positive definite: least eigenvalue, diagonal scaled to 1", definite, 0.0, np.inf)
    decrease = -(A_minus.T @ P + P @ A_minus)
    yield Condition("common P: q- of A-'P + P A- = -q- C'C", float(decrease[0, 0]), 0.0, np.inf)
    size = np.abs(A_minus.T) @ np.abs(P) + np.abs(P) @ np.abs(A_minus)
    rest = np.abs(decrease) / np.outer(scale, scale) / (size / np.outer(scale, scale)).max()
    rest[0, 0] = 0.0
    yield Condition("common P: what is left beside q- C'C, relative", float(rest.max()), 0.0, 0.0)


def _two_states(A, plus, minus) -> Iterable[Condition]:
    source = "Aguado-Rojas 3.20"
    yield Condition(f"{source}: k1+", plus[0], 0.0, np.inf)
    yield Condition(f"{source}: k2+", plus[1], -np.inf, 0.0)
    yield Condition(f"{source}: k1-", minus[0], -np.inf, 0.0)
    yield Condition(f"{source}: k2- = k2+", minus[1], plus[1], plus[1], abs(plus[1]))


def _three_states(A, plus, minus) -> Iterable[Condition]:
    """(15)-(17) of Hoang et al. 2014."""
    a, c = -A[0, 1], A[1, 1]
    for sign, (k1, k2, k3) in ((1, plus), (-1, minus)):
        name, which = ("+", "(15)") if sign > 0 else ("-", "(16)")
        bound = -(c * k1 + a * k2) * (c - k1) / a
        low, high = (c, np.inf) if sign > 0 else (-np.inf, c)
        yield Condition(f"Hoang {which}: k1{name}", k1, low, high)
        yield Condition(f"Hoang {which}: k2{name}", k2, -np.inf, -c * k1 / a)
        yield Condition(f"Hoang {which}: k3{name}", k3, min(bound, 0.0), max(bound, 0.0))
    ratio, sums = [(c - k[0]) / (a * k[2]) for k in (plus, minus)], [c * k[0] + a * k[1] for k in (plus, minus)]
    yield Condition("Hoang (17): (c - k1)/(a k3) > 0", ratio[0], 0.0, np.inf)
    yield Condition("Hoang (17): the same for K-", ratio[1], ratio[0], ratio[0], abs(ratio[0]))
    yield Condition("Hoang (17): c k1 + a k2 < 0", sums[0], -np.inf, 0.0)
    yield Condition("Hoang (17): the same for K-", sums[1], sums[0], sums[0], abs(c * plus[0]) + abs(a * plus[1]))


def _four_states(A, plus, minus) -> Iterable[Condition]:
    """(5.32), (5.33) and (5.41) of Hoang 2014, with the first denominator of the k4- bound to the first power."""
    a, a1, a2 = -A[0, 1], A[2, 1], A[2, 2]
    shared = []
    for sign, (k1, k2, k3, k4) in ((1, plus), (-1, minus)):
        name, which = ("+", "(5.32)") if sign > 0 else ("-", "(5.33)")
        middle, last, gap = -a1 - k1 * a2 - a * k2, -k1 * a1 + a * k2 * a2 - a * k3, k1 - a2
        edge = (-k1 * a1 + a * k2 * a2) / a
        low, high = (a2, np.inf) if sign > 0 else (-np.inf, a2)
        yield Condition(f"Hoang {which}: k1{name}", k1, low, high)
        yield Condition(f"Hoang {which}: k2{name}", k2, -np.inf, (-a1 - k1 * a2) / a)
        other = edge - middle * gap / a
        yield Condition(f"Hoang {which}: k3{name}", k3, min(edge, other), max(edge, other))
        xi = last / gap
        yield Condition(f"Hoang {which}: k4{name}", k4, xi * (xi - middle) / a, 0.0)
        shared.append((xi, xi / a * middle + k4, (middle - xi) / (a * k4)))
    names = "xi", "(xi/a)(-a1 - a k2 - a2 k1) + k4", "(-a1 - a2 k1 - a k2 - xi)/(a k4)"
    for name, value, reference in zip(names, shared[1], shared[0]):
        yield Condition(f"Hoang (5.41): {name} of K- as of K+", value, reference, reference, abs(reference))
