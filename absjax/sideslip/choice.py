"""Choice functions: xi, the slope of f_y* between the true and the estimated lateral velocity, and the scaling Lambda.

    xi (vy - vy^) = f_y*(vy) - f_y*(vy^)      Lambda = 1 / |[xi, f_y*]|, within [1e-6, 1e6]

Source: Grip et al. 2008, sections 6 and 8.1.1. The rule of 8.1.1 is printed without the mass; |m ay| is meant.
"""

from typing import Any, ClassVar, Protocol

import jax.numpy as jnp

from absjax.parameters import model, parameter

SMALLEST_SCALING, LARGEST_SCALING = 1e-6, 1e6


def scaling(xi, lateral):
    """Lambda, smooth where it saturates for small forces."""
    return jnp.maximum(1 / jnp.sqrt(xi**2 + lateral**2 + LARGEST_SCALING**-2), SMALLEST_SCALING)


class XiRule(Protocol):
    """How xi is approximated: a class made by `absjax.parameters.model`."""

    title: ClassVar[str]
    """for tables and figures"""

    def xi(self, slope: Any, lateral: Any, expected: Any, measured: Any) -> Any:
        """xi [N s/m] from df_y*/dvy, f_y*, theta f_y* and m ay [N]."""
        ...


@model
class PublishedXi:
    """The slope; where |m ay| > |theta f_y*|, min(slope, -5 |f_y*|) [8.1.1]."""

    title: ClassVar[str] = "published rule"

    factor: Any = parameter("5 of the source, s/m", default=5.0, low=0.0, trainable=True, span=(0.05, 20.0))

    def xi(self, slope, lateral, expected, measured):
        """xi."""
        steep = jnp.minimum(slope, -self.factor * jnp.abs(lateral))
        return jnp.where(jnp.abs(measured) > jnp.abs(expected), steep, slope)


@model
class SlopeXi:
    """The slope at the estimate: a Taylor series cut after its first term [6]."""

    title: ClassVar[str] = "slope"

    def xi(self, slope, lateral, expected, measured):
        """xi."""
        return slope


@model
class ConstantXi:
    """A negative constant: crude, safe, and effective [6]."""

    title: ClassVar[str] = "constant"

    value: Any = parameter("-xi, N s/m", default=2e4, low=0.0, open_low=True, trainable=True, span=(1e3, 2e5))

    def xi(self, slope, lateral, expected, measured):
        """xi."""
        return -self.value + 0.0 * slope
