"""What a log and a stream ask of an estimator of side-slip."""

from typing import Any, ClassVar, NamedTuple, Protocol

import jax.numpy as jnp

from absjax.sideslip.car import Car, CarSample


class Estimate(NamedTuple):
    """What an estimator says at an instant, before it has seen the sample of that instant; scalars, or (samples,)."""

    longitudinal_speed: Any
    """vx [m/s]"""
    lateral_speed: Any
    """vy [m/s]"""
    yaw_rate: Any
    """r [rad/s]"""
    friction: Any
    """theta; 1 where it is not estimated"""

    @property
    def side_slip(self):
        """beta = -atan2(vy, vx) [rad], the sign of the source."""
        return -jnp.arctan2(self.lateral_speed, self.longitudinal_speed)


class Insight(NamedTuple):
    """What the adaptive observer bases a step on; scalars, or arrays (samples,)."""

    lateral_force: Any
    """f_y* [N]"""
    slope: Any
    """df_y*/dvy [N s/m]"""
    xi: Any
    """N s/m"""
    scaling: Any
    """Lambda"""
    residual: Any
    """ay~ [m/s^2]"""
    low: Any
    """whether the monitor says that excitation is low"""
    offsets: Any
    """`absjax.sideslip.offsets.Offsets`, None where they are not adapted"""


class Estimator(Protocol):
    """An estimator of side-slip: a class made by `absjax.parameters.model`. Scalars per lane."""

    title: ClassVar[str]
    """for tables and figures"""

    def initial_state(self, car: Car, sample: CarSample) -> Any:
        """State at the first sample."""
        ...

    def step(self, car: Car, state: Any, sample: CarSample, period: Any) -> tuple[Any, Estimate, Any]:
        """State after a period [s], the estimate at the sample, and what it is based on (`Insight` or nothing)."""
        ...
