"""What depends on the phase of an automaton."""

import jax.numpy as jnp


def by_phase(mode, values):
    """The entry of `values` that belongs to phase `mode`."""
    chosen = values[-1]
    for phase, value in reversed(list(enumerate(values[:-1]))):
        chosen = jnp.where(mode == phase, value, chosen)
    return chosen
