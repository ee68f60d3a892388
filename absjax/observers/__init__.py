"""Observers of the extended braking stiffness, their gains and certificates."""

from absjax.observers.base import Design
from absjax.observers.designs import Adaptive, ConstantStiffness, KnownRoad, UnknownRoad

OBSERVERS: dict[str, type[Design]] = {
    "constant": ConstantStiffness,
    "known_road": KnownRoad,
    "unknown_road": UnknownRoad,
    "adaptive": Adaptive,
}
"""By name, as a tuner sees them."""
