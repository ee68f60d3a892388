"""The anti-lock controllers that can be tuned, by name."""

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from absjax.controllers.base import Controller
from absjax.controllers.bosch import BoschLogic
from absjax.controllers.five_phase import FivePhase
from absjax.controllers.slip import SlipControl
from absjax.controllers.stiffness import StiffnessControl
from absjax.controllers.tracking import AccelerationTracking
from absjax.controllers.two_phase import TwoPhase
from absjax.parameters import bounds_of
from absjax.plant.wheel import Wheel


class Kind(NamedTuple):
    """A controller that can be tuned."""

    model: Any
    """its class"""
    step: float
    """grid step that does for the default parameters, s"""
    ranges: Mapping[str, tuple[float, float]] = MappingProxyType({})
    """limits of the parameters that are not on a logarithmic scale around their default"""

    def build(self, wheel: Wheel, values: Mapping[str, Any]) -> Controller:
        """The controller of parameters, that knows the wheel if it has to know one; the others as by default."""
        knows = any(field.name == "wheel" for field in dataclasses.fields(self.model))
        return self.model(**values, **({"wheel": wheel} if knows else {}))

    @property
    def ordered(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of parameters that have to keep an order: (lower, higher, by how much at least)."""
        return getattr(self.model, "ordered", ())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parameters."""
        return tuple(bounds_of(self.model))


GROWTH = {"eps0_growth": (0.0, 4.0)}
CONTROLLERS: dict[str, Kind] = {
    "five_phase": Kind(FivePhase, 2e-3, GROWTH),
    "tracking": Kind(AccelerationTracking, 1e-3, GROWTH),
    "two_phase": Kind(
        TwoPhase, 1e-3, {**GROWTH, "chi_a": (-0.5, 0.0), "chi_b": (0.02, 5.0), "slip_limit": (-1.0, -0.05)}
    ),
    "stiffness": Kind(StiffnessControl, 1e-3, GROWTH),
    "slip": Kind(SlipControl, 1e-3, {**GROWTH, "slip": (-0.5, -0.02)}),
    "bosch": Kind(BoschLogic, 2e-3),
}
