"""Pacejka's Magic Formula: the curve measured tyres come with."""

from typing import Any, ClassVar, Optional

import jax.numpy as jnp

from absjax._numerics import safe_divide
from absjax.parameters import model, parameter, part
from absjax.tyres.base import Peak

NEWTON_STEPS = 12


@model
class MagicFormula:
    """mu = D sin(C atan(B s - E (B s - atan(B s)))), odd in s = lambda.

    With C > 1 it rises to D where B s - E (B s - atan(B s)) = tan(pi / (2 C)), and falls beyond; E <= 1 keeps it from
    rising again, C <= 2 from changing its sign. Source: Pacejka 2012, section 4.3.1, without shifts.
    """

    title: ClassVar[str] = "Magic Formula"
    beyond_peak: ClassVar[tuple[str, ...]] = ("shape_factor",)

    stiffness_factor: Any = parameter("B, no unit", low=0.0, open_low=True, high=1e3, trainable=True, span=(2.0, 100.0))
    shape_factor: Any = parameter("C, no unit", low=0.0, open_low=True, high=2.0, trainable=True, span=(1.02, 1.98))
    peak_value: Any = parameter("D, friction at the peak, no unit", low=0.0, trainable=True, span=(0.02, 2.0))
    curvature_factor: Any = parameter("E, no unit", low=-1e2, high=1.0, trainable=True, span=(-5.0, 0.99))
    lateral: Optional["MagicFormula"] = part("across the wheel; None: as along it", default=None)

    def _argument(self, slip):
        """B s - E (B s - atan(B s)), and B s."""
        scaled = self.stiffness_factor * slip
        return scaled - self.curvature_factor * (scaled - jnp.arctan(scaled)), scaled

    def friction(self, slip):
        """mu(lambda)."""
        argument, _ = self._argument(slip)
        return self.peak_value * jnp.sin(self.shape_factor * jnp.arctan(argument))

    def stiffness(self, slip):
        """XBS: mu' = B C D cos(C atan(phi)) / (1 + phi^2) (1 - E + E / (1 + (B s)^2)), phi = B s - E (...)."""
        argument, scaled = self._argument(slip)
        outer = self.shape_factor * jnp.cos(self.shape_factor * jnp.arctan(argument)) / (1 + argument**2)
        inner = 1 - self.curvature_factor + self.curvature_factor / (1 + scaled**2)
        return self.peak_value * self.stiffness_factor * outer * inner

    def peak(self) -> Peak:
        """Peak by Newton's method; without one inside (0, 1) the end of the interval is the peak.

        From B s = tan(pi / (2 C)) on, the steps approach the peak from one side: the equation is concave for E > 0,
        convex for E < 0.
        """
        falls = self.shape_factor > 1
        wanted = jnp.tan(jnp.pi / (2 * jnp.where(falls, self.shape_factor, 1.5)))
        end = self.stiffness_factor
        scaled = jnp.minimum(wanted, end)
        for _ in range(NEWTON_STEPS):
            slope = 1 - self.curvature_factor + self.curvature_factor / (1 + scaled**2)
            missing = wanted - scaled + self.curvature_factor * (scaled - jnp.arctan(scaled))
            scaled = jnp.clip(scaled + safe_divide(missing, slope, slope > 0, end), 0.0, end)
        slip = jnp.where(falls & (self._argument(1.0)[0] > wanted), scaled / end, 1.0)
        return Peak(slip, self.friction(slip))
