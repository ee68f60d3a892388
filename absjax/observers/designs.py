"""Observers as a tuner sees them: a few positive parameters, every value of which gives a stable observer.

Poles enter as natural frequency and damping of s^2 + 2 damping frequency s + frequency^2 (damping 1 is a double real
pole), in the units of the scaled time; the ratio of the common Lyapunov function and the adaptation gains as they are.
The default values are ours, the sources print none: double poles at -60 for the switched observers; at -80,
G = diag(4e4, 1e4), for the adaptive one.
"""

from typing import Any, ClassVar

import jax.numpy as jnp

from absjax.observers.adaptive import AdaptiveObserver
from absjax.observers.switched import SwitchedObserver, constant_stiffness, known_road, unknown_road
from absjax.parameters import model, parameter
from absjax.plant.wheel import Wheel


def _tuned(doc: str, default: float, low: float, high: float) -> Any:
    return parameter(doc, default=default, low=0.0, open_low=True, trainable=True, span=(low, high))


def _frequency(default: float = 60.0) -> Any:
    return _tuned("natural frequency of a pair of poles, 1/(scaled time)", default, 5.0, 1000.0)


def _damping() -> Any:
    return _tuned("damping of a pair of poles", 1.0, 0.3, 5.0)


def _ratio() -> Any:
    return _tuned("rho, decrease of the common Lyapunov function for y < 0 over that for y > 0", 1.0, 0.1, 10.0)


def _factor(frequency, damping):
    return 2 * damping * frequency, frequency**2


@model
class ConstantStiffness:
    """XBS constant, 2 states."""

    title: ClassVar[str] = "2 states, XBS constant"
    substeps: ClassVar[int] = 2

    frequency: Any = _frequency()
    damping: Any = _damping()
    ratio: Any = _ratio()

    def observer(self, wheel: Wheel) -> SwitchedObserver:
        """The observer on a wheel."""
        return SwitchedObserver.placed(constant_stiffness(wheel), [_factor(self.frequency, self.damping)], self.ratio)


@model
class KnownRoad:
    """A road of known c2, 3 states."""

    title: ClassVar[str] = "3 states, c2 known"
    substeps: ClassVar[int] = 2

    pole: Any = _tuned("magnitude of the single pole, 1/(scaled time)", 60.0, 5.0, 1000.0)
    frequency: Any = _frequency()
    damping: Any = _damping()
    ratio: Any = _ratio()
    c2: Any = _tuned("c2 of the road", 24.0, 4.0, 120.0)

    def observer(self, wheel: Wheel) -> SwitchedObserver:
        """The observer on a wheel."""
        factors = [(self.pole,), _factor(self.frequency, self.damping)]
        return SwitchedObserver.placed(known_road(wheel, self.c2), factors, self.ratio)


@model
class UnknownRoad:
    """A road of the exponential basis, 4 states."""

    title: ClassVar[str] = "4 states, exponential basis"
    substeps: ClassVar[int] = 2

    frequency1: Any = _frequency()
    damping1: Any = _damping()
    frequency2: Any = _frequency()
    damping2: Any = _damping()
    ratio: Any = _ratio()
    rate1: Any = _tuned("d1, slow rate of the basis", 22.0, 3.0, 60.0)
    spread: Any = _tuned("d2 - d1, by which the fast rate exceeds it", 30.0, 1.0, 150.0)

    def observer(self, wheel: Wheel) -> SwitchedObserver:
        """The observer on a wheel."""
        linear = unknown_road(wheel, self.rate1, self.rate1 + self.spread)
        factors = [_factor(self.frequency1, self.damping1), _factor(self.frequency2, self.damping2)]
        return SwitchedObserver.placed(linear, factors, self.ratio)


@model
class Adaptive:
    """A road of which nothing is known; c2 and c2 c3 are estimated along."""

    title: ClassVar[str] = "adaptive"
    substeps: ClassVar[int] = 8

    frequency: Any = _frequency(80.0)
    damping: Any = _damping()
    ratio: Any = _ratio()
    gain_c: Any = _tuned("adaptation gain of c", 4e4, 10.0, 1e7)
    gain_d: Any = _tuned("adaptation gain of d", 1e4, 10.0, 1e7)

    def observer(self, wheel: Wheel) -> AdaptiveObserver:
        """The observer on a wheel."""
        gains = jnp.stack([self.gain_c, self.gain_d])
        return AdaptiveObserver.placed(wheel, _factor(self.frequency, self.damping), gains, self.ratio)
