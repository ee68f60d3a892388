"""Friction models of the observer: the share of the largest friction that is used, over the magnitude of slip.

Monotone, so that df_y*/dvy <= 0 holds (section 6 of the source), with its derivative in closed form; 1 is the largest
value, so that the friction parameter theta is the friction at large slips. Source: Grip et al. 2008, 3.1 and 8.1.1;
the curves are ours.
"""

from typing import Any, ClassVar, Protocol

import jax.numpy as jnp

from absjax.parameters import model, parameter


class MonotoneFriction(Protocol):
    """What the observer asks of a friction model; arrays broadcast.

    A class made by `absjax.parameters.model`, its coefficients scalars made by `parameter`.
    """

    title: ClassVar[str]
    """for tables and figures"""

    def friction(self, slip: Any) -> Any:
        """mu(s) for s >= 0: from 0, never falling, to 1."""
        ...

    def stiffness(self, slip: Any) -> Any:
        """mu'(s) >= 0."""
        ...


@model
class TanhFriction:
    """mu = tanh(C s)."""

    title: ClassVar[str] = "tanh"

    stiffness_at_rest: Any = parameter("C = mu'(0)", default=26.0, low=1.0, trainable=True, span=(8.0, 80.0))

    def friction(self, slip):
        """mu(s)."""
        return jnp.tanh(self.stiffness_at_rest * slip)

    def stiffness(self, slip):
        """mu' = C (1 - mu^2)."""
        return self.stiffness_at_rest * (1 - self.friction(slip) ** 2)


@model
class ExponentialFriction:
    """mu = p (1 - exp(-d1 s)) + (1 - p) (1 - exp(-d2 s)), 0 <= p <= 1: a slow and a fast exponential."""

    title: ClassVar[str] = "exponential basis"
    ordered: ClassVar[tuple[tuple[str, str, float], ...]] = (("rate1", "rate2", 0.0),)

    share: Any = parameter("p, of the slow one", default=0.5, low=0.0, high=1.0, trainable=True, span=(0.0, 1.0))
    rate1: Any = parameter("d1, slow rate", default=22.0, low=1.0, trainable=True, span=(5.0, 40.0))
    rate2: Any = parameter("d2, fast rate", default=52.0, low=1.0, trainable=True, span=(40.0, 150.0))

    def friction(self, slip):
        """mu(s)."""
        return -self.share * jnp.expm1(-self.rate1 * slip) - (1 - self.share) * jnp.expm1(-self.rate2 * slip)

    def stiffness(self, slip):
        """mu'."""
        slow, fast = self.rate1 * jnp.exp(-self.rate1 * slip), self.rate2 * jnp.exp(-self.rate2 * slip)
        return self.share * slow + (1 - self.share) * fast


@model
class LevelBurckhardt:
    """Burckhardt's curve over its peak, level beyond it: mu = (1 - exp(-c2 s) - q s) / peak for s < s*, then 1.

    q = c3 / c1, s* = ln(c2 / q) / c2. The slope is zero at the peak, so that it stays continuous.
    """

    title: ClassVar[str] = "Burckhardt, level beyond its peak"
    ordered: ClassVar[tuple[tuple[str, str, float], ...]] = (("loss", "c2", 1.0),)

    c2: Any = parameter("c2, how fast it saturates with slip", default=24.0, low=2.0, trainable=True, span=(8.0, 80.0))
    loss: Any = parameter(
        "q = c3 / c1, loss with slip", default=0.4, low=0.0, open_low=True, trainable=True, span=(0.02, 4.0)
    )

    def peak_slip(self):
        """s*."""
        return jnp.log(self.c2 / self.loss) / self.c2

    def _rising(self, slip):
        return -jnp.expm1(-self.c2 * slip) - self.loss * slip

    def friction(self, slip):
        """mu(s)."""
        peak = self.peak_slip()
        return self._rising(jnp.minimum(slip, peak)) / self._rising(peak)

    def stiffness(self, slip):
        """mu'."""
        slope = self.c2 * jnp.exp(-self.c2 * slip) - self.loss
        return jnp.maximum(slope, 0.0) / self._rising(self.peak_slip())
