"""Hybrid systems: a flow per mode, guards that fire when they rise through zero, a jump.

This is the only thing the rollout engine knows about. Plants, actuators and controllers are composed
into one such system (see `absjax.loop.closed_loop`).
"""

from typing import Any, Protocol, runtime_checkable

import jax


@runtime_checkable
class HybridSystem(Protocol):
    """What a system offers to the rollout engine. Everything is per lane and scalar; the engine vmaps.

    A system is a pytree whose array leaves are its parameters; `state` is a pytree of float scalars
    (a NamedTuple, as a rule), `mode` an int32 scalar. What only ticks change may be float arrays, in a class
    made by `absjax.parameters.model`, which declares their axes.

    `guards` returns one value per *slot*. A slot fires when its value rises through zero; a slot that
    is not used in the current mode returns a negative constant. The number of slots is the same in
    every mode: the largest number of edges that leave one mode. No slots at all is a smooth system.
    Guards have to be smooth along the flow between switchings.

    It may have `importance(time, state, mode)`, from 1 to 0: how much of an error made now is left in what the rollout
    is for. The local errors that add up to the rollout's strain are weighted with it. And it may have `scales(state)`,
    of the structure of `state`: magnitudes below which errors count as shares of these. A state that rests at zero, as
    the heave of a body or the pressure of a released brake, needs one: else its steps are taken in parts for nothing.
    """

    def flow(self, time: jax.Array, state: Any, mode: jax.Array) -> Any:
        """d(state)/dt, same structure as `state`, with None in the place of what only jumps and ticks change."""
        ...

    def guards(self, time: jax.Array, state: Any, mode: jax.Array) -> tuple[jax.Array, ...]:
        """Value of each slot in `mode`."""
        ...

    def jump(self, time: jax.Array, state: Any, mode: jax.Array, slot: jax.Array) -> tuple[Any, jax.Array]:
        """State and mode after the guard of `slot` has fired in `mode`."""
        ...


class TickingSystem(HybridSystem, Protocol):
    """A hybrid system with a discrete-time part that runs every `tick_every` grid steps.

    It may have `require_step(step)`, which raises a ValueError for a grid step [s] it is not made for.
    """

    tick_every: int

    def tick(self, time: jax.Array, state: Any, mode: jax.Array) -> tuple[Any, jax.Array]:
        """State and mode after the discrete-time part has run at `time`."""
        ...


class Smooth:
    """Mixin for a system that never switches: it has to define `flow` only."""

    def guards(self, time, state, mode):
        return ()

    def jump(self, time, state, mode, slot):
        return state, mode
