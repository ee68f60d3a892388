"""The mode of a loop of several channels: what each of them, each wheel and the foot do, in one integer.

Bits from the lowest: for each channel its phase, as many as it takes, two for its pressure, and one for which of two
wheels it goes by; two for each wheel; two for the foot. 0 is how a manoeuvre begins. Modes below zero are ends.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

WIDEST = 31
"""Bits of an integer without its sign."""


class Layout(NamedTuple):
    """How many bits the parts take."""

    phases: tuple[int, ...]
    """of each channel: of its phase"""
    choices: tuple[int, ...]
    """of each channel: 1 if it goes by one of two wheels, else 0"""
    wheels: int

    @property
    def width(self) -> int:
        """All of them."""
        return sum(self.phases) + 2 * len(self.phases) + sum(self.choices) + 2 * self.wheels + 2


class VehicleMode(NamedTuple):
    """The parts of a mode; int arrays."""

    phases: tuple[Any, ...]
    pressures: tuple[Any, ...]
    """ON_PEDAL, FREE or AT_ZERO of `absjax.loop._modes`"""
    chosen: tuple[Any, ...]
    """0 or 1: which of its wheels a channel goes by"""
    wheels: tuple[Any, ...]
    """TURNING, SLIDING or LOCKED of `absjax.loop.wheel_lock`"""
    foot: Any

    def encoded(self, layout: Layout):
        """The integer; where a phase is below zero, which is an end, the first such phase."""
        number, place = 0, 0
        for phase, pressure, chosen, bits, choice in zip(
            self.phases, self.pressures, self.chosen, layout.phases, layout.choices
        ):
            number = number + (jnp.maximum(phase, 0) << place) + (pressure << (place + bits))
            place += bits + 2
            if choice:
                number = number + (chosen << place)
            place += choice
        for wheel in self.wheels:
            number = number + (wheel << place)
            place += 2
        number = number + (self.foot << place)
        for phase in reversed(self.phases):
            number = jnp.where(jnp.asarray(phase) < 0, phase, number)
        return number


def decoded(mode, layout: Layout) -> VehicleMode:
    """The parts of an integer."""
    rest = jnp.asarray(mode)

    def take(bits: int):
        nonlocal rest
        low, rest = rest & ((1 << bits) - 1), rest >> bits
        return low

    channels = [(take(bits), take(2), take(choice)) for bits, choice in zip(layout.phases, layout.choices)]
    wheels = tuple(take(2) for _ in range(layout.wheels))
    phases, pressures, chosen = zip(*channels)
    return VehicleMode(phases, pressures, chosen, wheels, take(2))
