"""What a loop and a log ask of an observer of XBS."""

from typing import Any, NamedTuple, Protocol

import jax

from absjax.signals import Signals


class Observer(Protocol):
    """An observer of XBS. Scalars per lane."""

    def at(self, y) -> Any:
        """State before anything is known but the measured y [m/s^2]."""
        ...

    def flow(self, state, y, speed, rate) -> Any:
        """d(state)/dt from y = x2 [m/s^2], v [m/s] and dPb/dt [bar/s]."""
        ...

    def stiffness(self, state, y) -> jax.Array:
        """Estimated XBS."""
        ...

    def fastest_rate(self, state, y, speed) -> jax.Array:
        """Fastest rate of the error dynamics [1/s]; arrays broadcast."""
        ...


class Sample(NamedTuple):
    """What an observer is told at an instant; scalars, or arrays (samples,) of a log."""

    y: jax.Array
    """wheel acceleration offset x2 = R w' - v' [m/s^2]"""
    speed: jax.Array
    """v [m/s]"""
    pressure: jax.Array
    """Pb [bar]"""

    @classmethod
    def of(cls, signals: Signals) -> "Sample":
        """The sample a control unit takes of its signals."""
        return cls(signals.acceleration_offset, signals.vehicle_speed, signals.pressure)
