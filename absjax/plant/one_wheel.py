"""A plant of one wheel as a vehicle of one."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from absjax.parameters import model, part
from absjax.plant.base import Plant


@model
class OneWheel:
    """A plant of one wheel, a quarter car say, in a loop of vehicles."""

    title: ClassVar[str] = "one wheel"
    places: ClassVar[tuple[str, ...]] = ("wheel",)

    plant: Plant = part("what is braked")

    @property
    def mass(self):
        """That the wheel carries [kg]."""
        return self.plant.wheel.mass

    @property
    def wheels(self):
        """The wheel."""
        return (self.plant.wheel,)

    @property
    def roads(self):
        """The road under it."""
        return (self.plant.road,)

    def initial_state(self, speed) -> Any:
        """That of the plant."""
        return self.plant.initial_state(speed)

    def flow(self, time, state, pressures):
        """That of the plant."""
        return self.plant.flow(time, state, pressures[0])

    def scales(self, state):
        """None."""
        return jax.tree.map(lambda leaf: 0.0 * leaf, state)

    def speed_of(self, time, state):
        """v [m/s]."""
        return self.plant.speed_of(time, state)

    def position(self, time, state):
        """Distance travelled [m]."""
        return self.plant.position(time, state)

    def wheel_speeds_of(self, state):
        """(w,) [rad/s]."""
        return (self.plant.wheel_speed_of(state),)

    def with_wheel_speeds(self, state, wheel_speeds):
        """The state with another w [rad/s]."""
        return self.plant.with_wheel_speed(state, wheel_speeds[0])

    def accelerations(self, time, state, slope):
        """v', and nothing across [m/s^2]."""
        along = jax.jvp(self.plant.speed_of, (time, state), (jnp.ones_like(time), slope))[1]
        return along, 0.0 * along

    def signals(self, time, state, slope, pressures):
        """Signals of the true state."""
        return (self.plant.signals(time, state, pressures[0]),)

    def known_loads(self, longitudinal, lateral):
        """The load of the wheel: nothing is transferred."""
        return (self.plant.wheel.load + 0.0 * longitudinal,)
