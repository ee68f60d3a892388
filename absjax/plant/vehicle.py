"""What a loop of several wheels asks of the vehicle they carry."""

from typing import Any, ClassVar, Protocol

from absjax.plant.base import Road
from absjax.plant.wheel import Wheel
from absjax.signals import Signals


class Vehicle(Protocol):
    """A vehicle on several braked wheels, or axles of two that turn as one: a class made by `absjax.parameters.model`.

    Its state is a pytree of float scalars. It has fields `wheels` and `roads`, tuples of one length: what holds for
    each wheel is a tuple in their order.
    """

    title: ClassVar[str]
    """for tables and figures"""
    places: ClassVar[tuple[str, ...]]
    """what the wheels are called, "front left" say"""

    @property
    def mass(self) -> Any:
        """m [kg]."""
        ...

    @property
    def wheels(self) -> tuple[Wheel, ...]:
        """The wheels that are braked; their `load` is that at rest."""
        ...

    @property
    def roads(self) -> tuple[Road, ...]:
        """The road under each."""
        ...

    def initial_state(self, speed: Any) -> Any:
        """State of free rolling straight ahead at `speed` [m/s]."""
        ...

    def flow(self, time: Any, state: Any, pressures: tuple[Any, ...]) -> Any:
        """d(state)/dt under the brake pressure at each wheel [bar]."""
        ...

    def scales(self, state: Any) -> Any:
        """Magnitudes below which errors of the state are shares of these, of its structure; 0 where any counts."""
        ...

    def speed_of(self, time: Any, state: Any) -> Any:
        """v, along the vehicle [m/s]."""
        ...

    def position(self, time: Any, state: Any) -> Any:
        """Distance travelled since time 0, along the path [m]."""
        ...

    def wheel_speeds_of(self, state: Any) -> tuple[Any, ...]:
        """w [rad/s]; of a d(state)/dt they are w'."""
        ...

    def with_wheel_speeds(self, state: Any, wheel_speeds: tuple[Any, ...]) -> Any:
        """The state with other w [rad/s]; a d(state)/dt with other w'."""
        ...

    def accelerations(self, time: Any, state: Any, slope: Any) -> tuple[Any, Any]:
        """What accelerometers on the body tell, of a state and its d(state)/dt [m/s^2]: along it and across it."""
        ...

    def signals(self, time: Any, state: Any, slope: Any, pressures: tuple[Any, ...]) -> tuple[Signals, ...]:
        """What sensors without error see at each wheel, of a state and its d(state)/dt.

        v and v' are those over the wheel's centre, along the wheel.
        """
        ...

    def known_loads(self, longitudinal: Any, lateral: Any) -> tuple[Any, ...]:
        """Vertical loads [N] as a control unit has them, of the accelerations [m/s^2] its accelerometer tells."""
        ...
