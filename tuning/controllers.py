"""The anti-lock controllers that can be tuned, by name."""

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from absjax.closed_loop import Controller
from absjax.control.bosch import BoschLogic
from absjax.control.five_phase import FivePhase
from absjax.control.slip import SlipControl
from absjax.control.stiffness import StiffnessControl
from absjax.control.tracking import AccelerationTracking
from absjax.control.two_phase import TwoPhase
from absjax.parameters import bounds_of
from absjax.vehicle import Wheel


class Kind(NamedTuple):
    """A controller that can be tuned."""

    model: Any
    """its class"""
    step: float
    """grid step that does for the default parameters, s"""
    ranges: Mapping[str, tuple[float, float]] = MappingProxyType({})
    """limits of the parameters that are not on a logarithmic scale around their default"""
    ordered: tuple[tuple[str, str], ...] = ()
    """pairs of parameters of which the first has to be the lower one"""

    def build(self, wheel: Wheel, values: Mapping[str, Any]) -> Controller:
        """The controller of parameters, that knows the wheel if it has to know one; the others as by default."""
        knows = any(field.name == "wheel" for field in dataclasses.fields(self.model))
        return self.model(**values, **({"wheel": wheel} if knows else {}))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parameters."""
        return tuple(bounds_of(self.model))


CONTROLLERS: dict[str, Kind] = {
    "five_phase": Kind(FivePhase, 2e-3),
    "tracking": Kind(AccelerationTracking, 1e-3),
    "two_phase": Kind(
        TwoPhase,
        1e-3,
        {"chi_a": (-0.1, 0.5), "chi_b": (0.02, 5.0), "slip_limit": (-1.0, -0.05)},
        ordered=(("chi_a", "chi_b"),),
    ),
    "stiffness": Kind(StiffnessControl, 1e-3),
    "slip": Kind(SlipControl, 1e-3, {"slip": (-0.5, -0.02)}),
    "bosch": Kind(BoschLogic, 2e-3, ordered=(("plus_a", "plus_A"),)),
}
