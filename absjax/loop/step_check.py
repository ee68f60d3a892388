"""Whether a stop depends on its grid step: braked again at half of it.

Where a guard all but reaches zero, or an oscillation grows out of what rounding leaves of it, no figure of one rollout
tells on which side the error of its steps has put it. A second rollout, with other errors, does.
"""

import dataclasses
from typing import Any

import jax.numpy as jnp

from absjax.loop.delayed_loop import DelayedLoop
from absjax.loop.stop import Outcome, Stop, stop

LARGEST_DIFFERENCE = 1e-3
"""Of the distance, relative, beyond which a stop at half the step is another although it switches as often."""


def checked_stop(loop: Any, speed: Any, *, step: float = 2e-3, **options: Any) -> Stop:
    """A stop that is the same at half its grid step, or says that it is not.

    Args:
        loop: as in `absjax.loop.stop.stop`; one in a control unit ticks as often at half the step.
        speed: likewise, scalar or (lanes,).
        step: grid step [s], of the stop that is returned.
        options: likewise.

    Returns:
        The stop at `step`, with `Outcome.STEP_TOO_LARGE` where it is another at half of it (see `differs`). It takes
        three times as long as `absjax.loop.stop.stop`.

    Raises:
        ValueError: as `absjax.loop.stop.stop` does.
    """
    found = stop(loop, speed, step=step, **options)
    other = stop(for_half_step(loop), speed, step=step / 2, **options)
    return found._replace(outcome=jnp.where(differs(found, other), Outcome.STEP_TOO_LARGE, found.outcome))


def for_half_step(loop: Any) -> Any:
    """A loop as it is at half the grid step: it keeps its past for as long, its control unit ticks as often."""
    if isinstance(loop, DelayedLoop):
        return dataclasses.replace(loop, nodes=2 * loop.nodes)
    if hasattr(loop, "tick_every"):
        return dataclasses.replace(loop, tick_every=2 * loop.tick_every)
    return loop


def differs(found: Stop, other: Stop):
    """Whether stops of the same lanes end otherwise, switch another number of times, or come to distances that are
    apart by more than `LARGEST_DIFFERENCE`; bool, (lanes,) or a scalar."""
    apart = jnp.abs(found.distance - other.distance) > LARGEST_DIFFERENCE * jnp.abs(other.distance)
    return (found.outcome != other.outcome) | (found.events != other.events) | apart
