"""What a loop and a log ask of an observer of XBS."""

from typing import Any, ClassVar, NamedTuple, Protocol

from absjax.plant.wheel import Wheel
from absjax.signals import Signals


class Observer(Protocol):
    """An observer of XBS: a class made by `absjax.parameters.model`. Scalars per lane.

    One that knows a proof of its stability has a method `certificate()`, see `absjax.observers.certificate`.
    """

    def initial_state(self, y: Any) -> Any:
        """State before anything is known but the measured y [m/s^2]."""
        ...

    def flow(self, state: Any, y: Any, speed: Any, rate: Any) -> Any:
        """d(state)/dt from y = x2 [m/s^2], v [m/s] and dPb/dt [bar/s]."""
        ...

    def stiffness(self, state: Any, y: Any) -> Any:
        """Estimated XBS."""
        ...

    def fastest_rate(self, state: Any, y: Any, speed: Any) -> Any:
        """Fastest rate of the error dynamics [1/s]; arrays broadcast."""
        ...


class Design(Protocol):
    """What a tuner asks of an observer: its parameters, and the observer they make.

    A class made by `absjax.parameters.model`; its fields are scalars with default values, tuned within their `span`.
    """

    title: ClassVar[str]
    """for tables and figures"""
    substeps: ClassVar[int]
    """Runge-Kutta steps per sample of 1 ms that the default parameters need"""

    def observer(self, wheel: Wheel) -> Observer:
        """The observer on a wheel; traceable."""
        ...


class Sample(NamedTuple):
    """What an observer is told at an instant; scalars, or arrays (samples,) of a log."""

    y: Any
    """wheel acceleration offset x2 = R w' - v' [m/s^2]"""
    speed: Any
    """v [m/s]"""
    pressure: Any
    """Pb [bar]"""

    @classmethod
    def of(cls, signals: Signals) -> "Sample":
        """The sample a control unit takes of its signals."""
        return cls(signals.acceleration_offset, signals.vehicle_speed, signals.pressure)
