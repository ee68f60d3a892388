"""The past in a control unit: signals of the last ticks, of a fixed number."""

from typing import Any

import jax.numpy as jnp

from absjax.parameters import model, parameter


@model
class Ring:
    """Rows of the last ticks, the newest first."""

    rows: Any = parameter("shape (ticks, signals)", ndim=2)
    known: Any = parameter("1 for a row that was made, shape (ticks,)", ndim=1)

    @classmethod
    def empty(cls, ticks: int, width: int, zero: Any) -> "Ring":
        """Rows of zeros; a `zero` with an axis is of lanes."""
        zero = jnp.asarray(zero)
        return cls(
            jnp.zeros((ticks, width), zero.dtype) + zero[..., None, None],
            jnp.zeros(ticks, zero.dtype) + zero[..., None],
        )

    def pushed(self, row: Any) -> "Ring":
        """With the row of this tick, the oldest dropped."""
        known = jnp.ones_like(self.known[:1])
        return Ring(jnp.concatenate([row[None], self.rows[:-1]]), jnp.concatenate([known, self.known[:-1]]))
