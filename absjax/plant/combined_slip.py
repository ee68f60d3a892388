"""Friction of a tyre that slips along and across the wheel at once.

    s = |(lx, ly)|,    Fx = Fz mu_x(s) lx / s,    Fy = Fz mu_y(s) ly / s

The friction curve holds along the direction of slip; a road may have a part `across`, the road a tyre with another
curve across the wheel feels. Around s = 0 both are linear, mu(s) / s being taken at `SMALLEST`. Source: Pacejka 2012,
section 3.3 (the isotropic tyre).
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

from absjax._numerics import safe_divide
from absjax.plant.base import Road

SMALLEST = 1e-6
"""Slip up to which a curve is as straight as its numbers can tell."""


class Used(NamedTuple):
    """Forces over the load, in the axes of the wheel."""

    along: Any
    across: Any
    stiffness: Any
    """d(along)/d(lx): XBS, mu'(lx) where ly = 0"""


def used(road: Road, along, across, time, distance) -> Used:
    """Of the slips lx and ly."""
    squared = along**2 + across**2
    slips = squared > SMALLEST**2
    slip = jnp.sqrt(jnp.where(slips, squared, SMALLEST**2))
    longitudinal = road.friction(slip, time, distance) / slip
    other = getattr(road, "across", None)
    lateral = longitudinal if other is None else other.friction(slip, time, distance) / slip
    share = safe_divide(along**2, squared, slips, 1.0)
    stiffness = longitudinal + share * (road.stiffness(slip, time, distance) - longitudinal)
    return Used(longitudinal * along, lateral * across, stiffness)
