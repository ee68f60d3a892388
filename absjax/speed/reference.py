"""The reference speed of a control unit for four wheels.

    v <- max(R w, v - T (max(-a, 0) + margin))        R w: the fastest rim, or the second fastest

It follows the rims up, and falls no faster than the accelerometer says, and a margin for its bias: where all wheels
slip at once, as on ice, it does not follow them down. So it comes to lie above the speed, by the margin less the bias,
until a wheel rolls again. A unit sees to that: it brakes one wheel less than it could, and takes the reference to that
wheel while its rim has the acceleration of the car,

    v <- v + (R w_k - v) (1 - exp(-(T / refresh) s n))
    s = 1 / (1 + ((R w_k' - a) / steadiness)^2)^2,   n = 1 / (1 + ((v - R w_k) / (nearness v))^4)

s is 1 while it rolls or turns steadily; n keeps a wheel out that is far below, for one that is locked turns steadily
too.
Source: ours, after what Aguado-Rojas 2019, section 2.2.3, has of reference speeds.
"""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp

from absjax.parameters import model, parameter
from absjax.speed.base import LEAST, rim_acceleration, told


class ReferenceState(NamedTuple):
    """State of the reference; scalars per lane."""

    speed: Any
    """m/s"""
    lagged: Any
    """speed of the rim that refreshes it, behind a lag [m/s]"""


@model
class ReferenceSpeed:
    """The reference: `refreshed_by` is the place of the wheel that is braked less, None for none.

    Raises:
        ValueError: at construction, if there is no such wheel or rank.
    """

    title: ClassVar[str] = "reference speed"

    margin: Any = parameter(
        "by which it may fall faster than the accelerometer says, m/s^2",
        default=1.0,
        low=0.0,
        trainable=True,
        span=(0.0, 10.0),
    )
    refresh: Any = parameter(
        "time constant of a refresh, s", default=0.1, low=0.0, open_low=True, trainable=True, span=(0.01, 5.0)
    )
    steadiness: Any = parameter(
        "difference of the rim's acceleration from the car's, m/s^2",
        default=3.0,
        low=0.0,
        open_low=True,
        trainable=True,
        span=(0.3, 30.0),
    )
    nearness: Any = parameter("slip at which a wheel is too far below", default=0.1, low=0.0, high=1.0, open_low=True)
    lag: Any = parameter("of the derivative of the rim speed, s", default=0.02, low=0.0)
    least: Any = parameter("speed that the estimate is not below, m/s", default=0.1, **LEAST)
    rank: int = 1
    """1: raised to the fastest rim; 2: to the second fastest, so that a wheel that spins does not raise it"""
    refreshed_by: int | None = None

    def __post_init__(self):
        if self.rank < 1:
            raise ValueError(f"ReferenceSpeed.rank = {self.rank} must be 1 at least")
        if self.refreshed_by is not None and self.refreshed_by < 0:
            raise ValueError(f"ReferenceSpeed.refreshed_by = {self.refreshed_by} must be 0 at least")

    def initial_state(self, speed, wheels) -> ReferenceState:
        """The reference is the speed."""
        return ReferenceState(speed, speed)

    def update(self, state: ReferenceState, acceleration, rims, period, pressures=None) -> ReferenceState:
        """State at a sample."""
        told(self, rims, self.rank)
        falls = jnp.maximum(-acceleration, 0.0) + self.margin
        speed = jnp.maximum(jnp.sort(jnp.stack(rims))[-self.rank], state.speed - period * falls)
        speed = jnp.maximum(speed, self.least)
        if self.refreshed_by is None:
            return ReferenceState(speed, state.lagged)
        rim = told(self, rims, self.refreshed_by + 1)[-1]
        change, lagged = rim_acceleration(rim, state.lagged, self.lag, period)
        steady = 1 / (1 + ((change - acceleration) / self.steadiness) ** 2) ** 2
        near = 1 / (1 + ((speed - rim) / (self.nearness * speed)) ** 4)
        share = -jnp.expm1(-period / self.refresh * steady * near)
        return ReferenceState(jnp.maximum(speed + (rim - speed) * share, self.least), lagged)

    def speed_of(self, state: ReferenceState):
        """The reference [m/s]."""
        return state.speed

    def acceleration_of(self, state: ReferenceState, acceleration):
        """As it is told."""
        return acceleration
