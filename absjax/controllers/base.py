"""What a loop asks of an anti-lock controller."""

from typing import Any, Protocol

import jax

from absjax.signals import Signals


class Controller(Protocol):
    """An anti-lock controller: an automaton on signals that commands a pressure rate.

    Phase 0 is the driver's: there it asks for an open valve. It begins to act while `Signals.pedal` says that the
    pedal is pressed, and begins anew, in phase 0, when a lifted pedal is back at zero.

    `kept` is what it keeps from one switching to the next, a pytree of float scalars; () for nothing.
    `cycle_phase` is the phase whose entry counts a cycle; None for a controller that does not cycle.
    A phase of `absjax.results.UNDEFINED` ends the lane: the law is not defined any more.
    """

    phases: tuple[str, ...]
    slots: int
    cycle_phase: int | None

    def at(self, signals: Signals) -> Any:
        """What it keeps at the start."""
        ...

    def rate(self, signals: Signals, kept: Any, mode) -> jax.Array:
        """Commanded dPb/dt [bar/s]."""
        ...

    def guards(self, signals: Signals, kept: Any, mode) -> tuple[jax.Array, ...]:
        """One value per slot; a slot fires when its value rises through zero."""
        ...

    def switch(self, signals: Signals, kept: Any, mode, slot) -> tuple[Any, jax.Array]:
        """What it keeps, and the phase, after the guard of `slot` has fired."""
        ...
