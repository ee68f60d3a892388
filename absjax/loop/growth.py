"""How much a stop makes of a small change: whether its gradient says anything."""

from typing import Any

import jax
import jax.numpy as jnp

from absjax.loop.stop import stop

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
    speed = jnp.asarray(speed, jnp.result_type(float) if not hasattr(speed, "dtype") else speed.dtype)
    distance, change = jax.jvp(lambda v: stop(loop, v, **options).distance, (speed,), (speed,))
    return change / distance


def is_unstable(growth):
    """Whether stops of a growth are unstable, bool of its shape; one that is not finite is."""
    return ~(jnp.abs(growth - REGULAR) <= LARGEST_APART)
