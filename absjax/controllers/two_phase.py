"""The two-phase anti-lock algorithm on XBS.

| phase | z1* | leaves when |
|---|---|---|
| 0 driver braking | | x2 <= -eps0 -> 1 |
| 1 release | +zref | XBS >= chi_b -> 2 |
| 2 apply | -zref | XBS <= chi_a -> 1; slip <= slip_limit -> 3 |
| 3 recovery | +recovery zref | slip >= slip_limit / 2 -> 2 |

    u = (1/b) [-(a/v) z1 z2 + (kp/v) (z1 - z1*)],  hence  z1' = -(kp/v) (z1 - z1*)

with z1 the wheel acceleration offset and z2 = XBS, true or estimated. The algorithm assumes that it begins
with z1 < 0 and z2 < 0, where driver braking ends. The recovery is ours: where the estimate of XBS is off, as under
a brake of unknown efficiency, the apply may never end and the wheel lock. By default, slip_limit = -1, there is none.
Source: Aguado-Rojas 2019, section 4.2.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from absjax._numerics import pick
from absjax.controllers.driver_braking import DriverBraking
from absjax.controllers.phases import OPEN_VALVE
from absjax.parameters import model, parameter, part
from absjax.plant.wheel import Wheel
from absjax.signals import Signals
from absjax.tyres.base import Tyre

LOWEST_APPLY = (-0.5, 0.0)
"""Where a tuner looks for chi_a."""
REACHED = 0.9
"""Share of the least XBS that chi_a stays above in tuning, so that rounding cannot take it there."""


def _least_stiffness(roads: Mapping[str, Sequence[Tyre]]) -> tuple[float, str]:
    """The largest of the least XBS, at a locked wheel, of the tyre curves that have a maximum, and its road."""
    found = ((float(tyre.stiffness(-1.0)), name) for name, tyres in roads.items() for tyre in tyres)
    return max((pair for pair in found if pair[0] < 0), default=(-math.inf, ""), key=lambda pair: pair[0])


@model
class TwoPhase(DriverBraking):
    """Thresholds on XBS, and the acceleration offset followed between them.

    Raises:
        ValueError: at construction, unless chi_a <= 0 < chi_b.
    """

    title: ClassVar[str] = "two-phase"
    grid_step: ClassVar[float] = 1e-3
    phases: ClassVar[tuple[str, ...]] = ("driver braking", "release", "apply", "recovery")
    slots: ClassVar[int] = 2
    cycle_phase: ClassVar[int | None] = 1
    """the phase whose entry counts a cycle"""
    thresholds: ClassVar[tuple[str, ...]] = ("zref", "eps0")
    """the fields that noise of the measured acceleration keeps from being small"""

    wheel: Wheel = part("wheel and brake as the controller knows them", default=Wheel())
    zref: Any = parameter(
        "zref, acceleration offset to follow, m/s^2", default=20.0, low=0.0, open_low=True, trainable=True
    )
    gain: Any = parameter("kp, tracking gain, m/s^2", default=500.0, low=0.0, open_low=True, trainable=True)
    chi_a: Any = parameter(
        "chi_a, XBS that ends the apply; above -c3 of the road, or slip_limit ends it",
        default=-0.1,
        high=0.0,
        trainable=True,
        span=LOWEST_APPLY,
    )
    chi_b: Any = parameter(
        "chi_b, XBS that ends the release", default=1.0, low=0.0, open_low=True, trainable=True, span=(0.02, 5.0)
    )
    slip_limit: Any = parameter(
        "slip that ends the apply whatever XBS is", default=-1.0, low=-1.0, high=0.0, span=(-1.0, -0.05)
    )
    recovery: Any = parameter("zref of the recovery, as a multiple", default=3.0, low=0.0, open_low=True)

    @classmethod
    def spans_on(cls, roads: Mapping[str, Sequence[Tyre]]) -> dict[str, tuple[float, float]]:
        """chi_a stays above the least XBS of every road that has a maximum."""
        low, high = LOWEST_APPLY
        return {"chi_a": (max(low, REACHED * _least_stiffness(roads)[0]), high)}

    def require_roads(self, roads: Mapping[str, Sequence[Tyre]]) -> None:
        """Check that the apply ends on every road.

        Raises:
            ValueError: if XBS never falls to chi_a on a road, and the slip is not limited where it never falls below 0.
        """
        least, road = _least_stiffness(roads)
        if np.min(self.chi_a) <= least:
            raise ValueError(
                f"chi_a = {np.min(self.chi_a):g} must be above {least:g}, the least XBS of road {road}: "
                "the apply would never end there"
            )
        for name, tyres in roads.items():
            if np.min(self.slip_limit) <= -1 and any(float(tyre.stiffness(-1.0)) >= 0 for tyre in tyres):
                raise ValueError(
                    f"slip_limit = {np.min(self.slip_limit):g} must be above -1: on road {name} XBS never falls "
                    "below 0, and only the slip can end the apply"
                )

    def mark_on(self, tyres: Sequence[Tyre]) -> str:
        """S where only the slip limit ends an apply: XBS never falls to chi_a."""
        flattest = max(float(tyre.stiffness(-1.0)) for tyre in tyres)
        return "S" if float(self.chi_a) <= flattest else ""

    def initial_state(self, signals: Signals) -> tuple[()]:
        """Nothing is kept."""
        return ()

    def rate(self, signals: Signals, state, phase):
        """Commanded dPb/dt [bar/s]."""
        offset = signals.acceleration_offset
        target = self.zref * pick(phase, (0.0, 1.0, -1.0, self.recovery))
        pull = self.gain * (offset - target) - self.wheel.slip_gain * offset * signals.stiffness
        follow = pull / (signals.vehicle_speed * self.wheel.pressure_gain)
        return jnp.where(phase == 0, OPEN_VALVE, follow)

    def guards(self, signals: Signals, state, phase):
        """The threshold that leads on; the limit of the slip."""
        slip = self.wheel.slip(signals.wheel_speed, signals.vehicle_speed)
        release, apply = signals.stiffness - self.chi_b, self.chi_a - signals.stiffness
        onward = pick(phase, (self.driver_guard(signals), release, apply, slip - 0.5 * self.slip_limit))
        limited = (phase == 2) & (self.slip_limit > -1)
        return onward, jnp.where(limited, self.slip_limit - slip, -1.0)

    def switch(self, signals: Signals, state, phase, slot):
        """Release after driver braking, then one after the other."""
        return state, jnp.where(slot == 1, 3, pick(phase, (1, 2, 1, 2)))
