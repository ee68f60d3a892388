"""What systems that read their own past have in common: nodes at grid points and events, pieces, readers."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from absjax.delay.history import History
from absjax.parameters import concrete
from absjax.results import UNDEFINED

SMOOTH = 4
"""Delays after which what began with a jump is smooth enough for the scheme: each makes it smoother by a rate."""


class ReadsItsPast:
    """Mixin of a hybrid system of one mode that reads signals of `delay` ago.

    Its state has a `past` and the `piece` of it that is read; it defines `flow`, `kept(time, state)`, the signals as an
    array, and may define `ticked(time, state)`, what a grid point changes.
    """

    delay: Any
    nodes: int
    tick_every: int = 1

    def flow(self, time, state: Any, mode) -> Any:
        """d(state)/dt."""
        raise NotImplementedError

    def kept(self, time, state: Any) -> Any:
        """What is kept of an instant, an array (signals,)."""
        raise NotImplementedError

    def require_step(self, step: float) -> None:
        """Check the grid step [s] of a rollout.

        Raises:
            ValueError: if it is longer than the delay, or the past not kept for that long.
        """
        if not concrete(self.delay):
            return
        if np.any(np.less(self.delay, step * (1 - 1e-9))):
            raise ValueError(f"step = {step:g} s is longer than the delay of {np.min(self.delay):g} s")
        if np.any(np.greater(self.delay, 0.5 * step * (self.nodes - 12))):
            raise ValueError(f"nodes = {self.nodes} of {step:g} s do not reach back {np.max(self.delay):g} s")

    def past_of(self, time, state: Any) -> History:
        """The past of a state that begins now, all signals having been zero."""
        row, slope = self.node(time, state)
        return state.past.pushed(time, row, slope, 1.0)

    def node(self, time, state: Any):
        """What is kept at an instant, and its rate along the flow."""
        slope = self.flow(time, state, jnp.int32(0))
        motion = jax.tree.map(lambda x, d: jnp.zeros_like(x) if d is None else d, state, slope)
        return jax.jvp(self.kept, (time, state), (jnp.ones_like(time), motion))

    def turned(self, time, state: Any, following: Any, begins: Any = 0.0) -> Any:
        """The state that follows at the same time, with the nodes on both sides of the instant."""
        both = jax.tree.map(lambda *leaves: jnp.stack(jnp.broadcast_arrays(*leaves)), state, following)
        row, slope = jax.vmap(self.node, (None, 0))(time, both)
        past = state.past.pushed(time, row[0], slope[0]).pushed(time, row[1], slope[1], begins)
        return following._replace(past=past)

    def ticked(self, time, state: Any) -> Any:
        """The state after a grid point."""
        return state

    def guards(self, time, state: Any, mode):
        """What begins a piece arrives."""
        return (state.past.overdue(time - self.delay, state.piece),)

    def jump(self, time, state: Any, mode, slot):
        """It has arrived, and makes a piece begin one delay later."""
        begins = jnp.where(state.piece < SMOOTH, 1.0, 0.0)
        return self.turned(time, state, state._replace(piece=state.piece + 1), begins), mode

    def tick(self, time, state: Any, mode):
        """Nodes of a grid point."""
        lost = state.past.forgets(time - self.delay)
        return self.turned(time, state, self.ticked(time, state)), jnp.where(lost, UNDEFINED, mode)
