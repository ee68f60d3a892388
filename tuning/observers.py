"""The observers that can be tuned: their parameters, published values, and how they are built.

Every parameter is positive, and every positive value gives a stable observer: poles enter as coefficients
of s + p or s^2 + p s + q, the ratio of the common Lyapunov function and the adaptation gains as they are.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp

from absjax.observe.adaptive import AdaptiveObserver
from absjax.observe.switched import SwitchedObserver, constant_stiffness, known_road, unknown_road
from absjax.vehicle import Wheel


class Kind(NamedTuple):
    """An observer that can be tuned."""

    published: dict[str, float]
    """parameters before tuning, by name"""
    low: dict[str, float]
    high: dict[str, float]
    build: Callable[[Wheel, Mapping[str, Any]], Any]
    """the observer of a wheel and parameters; traceable"""
    substeps: int
    """Runge-Kutta steps per sample of 1 ms that the published parameters need"""


def _constant(wheel: Wheel, x: Mapping[str, Any]) -> SwitchedObserver:
    return SwitchedObserver.placed(constant_stiffness(wheel), [(x["p"], x["q"])], x["ratio"])


def _known_road(wheel: Wheel, x: Mapping[str, Any]) -> SwitchedObserver:
    return SwitchedObserver.placed(known_road(wheel, x["c2"]), [(x["pole"],), (x["p"], x["q"])], x["ratio"])


def _unknown_road(wheel: Wheel, x: Mapping[str, Any]) -> SwitchedObserver:
    linear = unknown_road(wheel, x["rate1"], x["rate1"] + x["spread"])
    return SwitchedObserver.placed(linear, [(x["p1"], x["q1"]), (x["p2"], x["q2"])], x["ratio"])


def _adaptive(wheel: Wheel, x: Mapping[str, Any]) -> AdaptiveObserver:
    return AdaptiveObserver.placed(wheel, (x["p"], x["q"]), jnp.stack([x["gain_c"], x["gain_d"]]), x["ratio"])


_POLES_LOW = {"p": 5.0, "q": 10.0, "ratio": 0.1}
_POLES_HIGH = {"p": 4000.0, "q": 4e6, "ratio": 10.0}

KINDS: dict[str, Kind] = {
    "constant": Kind({"p": 120.0, "q": 3600.0, "ratio": 1.0}, _POLES_LOW, _POLES_HIGH, _constant, 1),
    "known_road": Kind(
        {"pole": 60.0, "p": 120.0, "q": 3600.0, "ratio": 1.0, "c2": 24.0},
        {"pole": 5.0, "c2": 4.0, **_POLES_LOW},
        {"pole": 2000.0, "c2": 120.0, **_POLES_HIGH},
        _known_road,
        1,
    ),
    "unknown_road": Kind(
        {"p1": 120.0, "q1": 3600.0, "p2": 120.0, "q2": 3600.0, "ratio": 1.0, "rate1": 22.0, "spread": 30.0},
        {"p1": 5.0, "q1": 10.0, "p2": 5.0, "q2": 10.0, "ratio": 0.1, "rate1": 3.0, "spread": 1.0},
        {"p1": 4000.0, "q1": 4e6, "p2": 4000.0, "q2": 4e6, "ratio": 10.0, "rate1": 60.0, "spread": 150.0},
        _unknown_road,
        1,
    ),
    "adaptive": Kind(
        {"p": 160.0, "q": 6400.0, "gain_c": 4e4, "gain_d": 1e4, "ratio": 1.0},
        {"gain_c": 10.0, "gain_d": 10.0, **_POLES_LOW},
        {"gain_c": 1e7, "gain_d": 1e7, **_POLES_HIGH},
        _adaptive,
        4,
    ),
}
"""By name: XBS constant (2 states), road of known c2 (3), exponential basis (4), adaptive. The published
values are poles -60 for the switched ones, and the gains of Aguado-Rojas 2019 for the adaptive one."""
