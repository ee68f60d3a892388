"""What is made of the losses of an ensemble: their mean, the worst, a mean of the worst (CVaR), a power mean."""

import math
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp

SHARPNESS = 600.0
"""Of the smooth maximum: larger is nearer to the maximum."""
WORST_SHARE = 0.1
"""Weight of the worst in the balanced objective."""
ORDER = 6
"""Of the power mean: between the mean and the worst, which a single member may make hopeless."""
Name = Literal["mean", "worst", "balanced", "cvar", "mean_and_cvar", "power"]


class Objective(NamedTuple):
    """How losses (members, sets) become costs (sets,). Hashable."""

    name: Name = "mean"
    tail: float = 0.2
    """share of the members that are the worst, for `cvar` and `mean_and_cvar`"""

    def costs(self, losses, smooth: bool = False):
        """Costs (sets,); `smooth`: with a smooth maximum for the worst, to be descended on. Traceable.

        `cvar` is the mean of the worst members, a share `tail` of them, one at least (Rockafellar and Uryasev 2000);
        `mean_and_cvar` half of it and half of the mean.
        """
        members = losses.shape[0]
        if self.name == "power":
            return jnp.mean(losses**ORDER, axis=0) ** (1 / ORDER)
        if self.name in ("cvar", "mean_and_cvar"):
            tail = jnp.sort(losses, axis=0)[-max(1, math.ceil(self.tail * members)) :].mean(axis=0)
            return tail if self.name == "cvar" else 0.5 * (tail + losses.mean(axis=0))
        if smooth:
            worst = (jax.nn.logsumexp(SHARPNESS * losses, axis=0) - math.log(members)) / SHARPNESS
        else:
            worst = losses.max(axis=0)
        share = {"mean": 0.0, "worst": 1.0, "balanced": WORST_SHARE}[self.name]
        return (1 - share) * losses.mean(axis=0) + share * worst
