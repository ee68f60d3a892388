"""The past of signals, of a fixed number of nodes: read between them to fourth order, in pieces that begin at events.

A node is a time, values and slopes; between two nodes the past is their cubic Hermite interpolant, so that a signal
tau ago can be read at any stage of a Runge-Kutta step. Where a signal jumps, or has a corner, a new piece begins with
a node of its own at that instant: a reader stays within the piece it is in, and goes on to the next one at an event,
tau after the piece began. What interpolates across no jump keeps the order of the scheme, and the derivative of the
instant.
"""

from typing import Any

import jax.numpy as jnp

from absjax._numerics import safe_divide
from absjax.parameters import model, parameter

LONG_AGO = -1e3
"""Time of the nodes before any is known, s: the past is constant there."""

TIGHT = 1e-6
"""Nodes nearer to each other than this, s, are the two sides of an instant: nothing is interpolated between them."""


@model
class History:
    """Nodes of signals, the newest first."""

    time: Any = parameter("of the nodes, s, shape (nodes,)", ndim=1)
    piece: Any = parameter("number of the piece a node belongs to, shape (nodes,)", ndim=1)
    value: Any = parameter("signals, shape (nodes, signals)", ndim=2)
    slope: Any = parameter("their rates, shape (nodes, signals)", ndim=2)

    @classmethod
    def constant(cls, nodes: int, row: Any) -> "History":
        """A past in which the signals (..., signals) have always been the same; leading axes are lanes."""
        value = jnp.broadcast_to(jnp.asarray(row)[..., None, :], (*row.shape[:-1], nodes, row.shape[-1]))
        flat = 0.0 * value[..., 0]
        return cls(flat + LONG_AGO, flat, value, 0.0 * value)

    def pushed(self, time, row, slope, begins: Any = 0.0) -> "History":
        """With a node more, the oldest dropped; `begins`: 1 where a piece begins with it."""
        new = time + 0.0 * self.time[0], self.piece[0] + begins, row, slope
        old = self.time, self.piece, self.value, self.slope
        return History(*(jnp.concatenate([node[None], nodes[:-1]]) for node, nodes in zip(map(jnp.asarray, new), old)))

    def read(self, time, piece):
        """Signals (signals,) at a time of a piece; beyond its nodes the nearest interpolant goes on."""
        inside = self.piece == piece
        wide = inside[1:] & inside[:-1] & (self.time[:-1] - self.time[1:] > TIGHT)
        before, last = wide & (self.time[1:] <= time), wide.shape[0] - 1
        left = jnp.where(jnp.any(before), jnp.argmax(before), last - jnp.argmax(wide[::-1])) + 1
        # A piece of a single instant is constant.
        alone, only = ~jnp.any(wide), jnp.argmax(inside)
        left, right = jnp.where(alone, only, left), jnp.where(alone, only, left - 1)
        span = self.time[right] - self.time[left]
        s = safe_divide(time - self.time[left], span, span > 0)
        rise = self.value[right] - self.value[left]
        d0, d1 = span * self.slope[left], span * self.slope[right]
        return self.value[left] + s * (d0 + s * (3 * rise - 2 * d0 - d1 + s * (d0 + d1 - 2 * rise)))

    def began(self, piece):
        """When a piece began, s; `LONG_AGO` where none of its nodes is kept."""
        inside = self.piece == piece
        oldest = self.time.shape[0] - 1 - jnp.argmax(inside[::-1])
        return jnp.where(jnp.any(inside), self.time[oldest], LONG_AGO)

    def overdue(self, time, piece):
        """By how much a reader in `piece` is beyond the beginning of the next one, s; negative without one."""
        following = jnp.any(self.piece == piece + 1)
        return jnp.where(following, time - self.began(piece + 1), -1.0)

    def forgets(self, time):
        """Whether what was at `time` is no longer kept."""
        return self.time[-1] > time
