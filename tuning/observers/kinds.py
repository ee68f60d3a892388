"""The observers that can be tuned: their parameters, default values, and how they are built.

Every parameter is positive, and every positive value gives a stable observer: poles enter as natural
frequency and damping of s^2 + 2 damping frequency s + frequency^2 (damping 1 is a double real pole), in
the units of the scaled time; the ratio of the common Lyapunov function and the adaptation gains as they are.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp

from absjax.observers.adaptive import AdaptiveObserver
from absjax.observers.switched import SwitchedObserver, constant_stiffness, known_road, unknown_road
from absjax.plant.wheel import Wheel


class Kind(NamedTuple):
    """An observer that can be tuned."""

    default: dict[str, float]
    """parameters before tuning, by name"""
    low: dict[str, float]
    high: dict[str, float]
    build: Callable[[Wheel, Mapping[str, Any]], Any]
    """the observer of a wheel and parameters; traceable"""
    substeps: int
    """Runge-Kutta steps per sample of 1 ms that the default parameters need"""


def _factor(x: Mapping[str, Any], number: str = ""):
    frequency = x["frequency" + number]
    return 2 * x["damping" + number] * frequency, frequency**2


def _constant(wheel: Wheel, x: Mapping[str, Any]) -> SwitchedObserver:
    return SwitchedObserver.placed(constant_stiffness(wheel), [_factor(x)], x["ratio"])


def _known_road(wheel: Wheel, x: Mapping[str, Any]) -> SwitchedObserver:
    return SwitchedObserver.placed(known_road(wheel, x["c2"]), [(x["pole"],), _factor(x)], x["ratio"])


def _unknown_road(wheel: Wheel, x: Mapping[str, Any]) -> SwitchedObserver:
    linear = unknown_road(wheel, x["rate1"], x["rate1"] + x["spread"])
    return SwitchedObserver.placed(linear, [_factor(x, "1"), _factor(x, "2")], x["ratio"])


def _adaptive(wheel: Wheel, x: Mapping[str, Any]) -> AdaptiveObserver:
    return AdaptiveObserver.placed(wheel, _factor(x), jnp.stack([x["gain_c"], x["gain_d"]]), x["ratio"])


def _kind(build, substeps: int, **ranges: tuple[float, float, float]) -> Kind:
    default, low, high = ({name: r[i] for name, r in ranges.items()} for i in range(3))
    return Kind(default, low, high, build, substeps)


_FREQUENCY, _DAMPING, _RATIO = (60.0, 5.0, 1000.0), (1.0, 0.3, 5.0), (1.0, 0.1, 10.0)
KINDS: dict[str, Kind] = {
    "constant": _kind(_constant, 2, frequency=_FREQUENCY, damping=_DAMPING, ratio=_RATIO),
    "known_road": _kind(
        _known_road, 2, pole=_FREQUENCY, frequency=_FREQUENCY, damping=_DAMPING, ratio=_RATIO, c2=(24.0, 4.0, 120.0)
    ),
    "unknown_road": _kind(
        _unknown_road,
        2,
        frequency1=_FREQUENCY,
        damping1=_DAMPING,
        frequency2=_FREQUENCY,
        damping2=_DAMPING,
        ratio=_RATIO,
        rate1=(22.0, 3.0, 60.0),
        spread=(30.0, 1.0, 150.0),
    ),
    "adaptive": _kind(
        _adaptive,
        8,
        frequency=(80.0, 5.0, 1000.0),
        damping=_DAMPING,
        ratio=_RATIO,
        gain_c=(4e4, 10.0, 1e7),
        gain_d=(1e4, 10.0, 1e7),
    ),
}
"""By name: XBS constant (2 states), road of known c2 (3), exponential basis (4), adaptive. The default values are ours,
the sources print none: double poles at -60 for the switched ones; at -80, G = diag(4e4, 1e4), for the adaptive one."""
