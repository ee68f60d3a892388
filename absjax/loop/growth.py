"""How much a stop makes of a small change: whether its gradient says anything."""

from typing import Any

import jax
import jax.numpy as jnp

from absjax.loop.stop import Stop, stop

REGULAR = 2.0
"""Growth of a stop whose mean deceleration does not depend on the speed it starts from: distance goes with v0^2."""
LARGEST_APART = 1.0
"""Growth further from `REGULAR` than this is that of an unstable stop."""


def growth(loop: Any, speed: Any, **options: Any):
    """Relative change of the distance per relative change of the initial speed, d ln(distance) / d ln(v0).

    A perturbation of the initial speed moves every switching that follows. Where the cycles of a stop are stable it
    dies out, and the growth is near `REGULAR`. Where they are not it grows from cycle to cycle: the derivative is that
    of the rollout, exactly, but holds over a range that shrinks as it grows, and a finite change gives something else.

    Args:
        loop: as in `absjax.loop.stop.stop`.
        speed: likewise, scalar or (lanes,).
        options: likewise.

    Returns:
        The growth, scalar or (lanes,). See `is_unstable`.
    """
    return stop_and_growth(loop, speed, **options)[1]


def stop_and_growth(loop: Any, speed: Any, **options: Any) -> tuple[Stop, jax.Array]:
    """A stop and its growth in one; arguments as of `growth`."""

    def braked(speed):
        found = stop(loop, speed, **options)
        return found.distance, found

    speed = jnp.asarray(speed, jnp.result_type(float) if not hasattr(speed, "dtype") else speed.dtype)
    distance, change, found = jax.jvp(braked, (speed,), (speed,), has_aux=True)
    return found, change / distance


def is_unstable(growth):
    """Whether stops of a growth are unstable, bool of its shape; one that is not finite is."""
    return ~(jnp.abs(growth - REGULAR) <= LARGEST_APART)
