"""A Kalman filter for the vehicle's speed and the bias of its accelerometer.

    v' = a - b + noise,  b' = noise        a: as the accelerometer tells it
    z_i = (1 - c_i a^) R w_i = v + noise   for each wheel i, a^ = a - b, 0 <= c_i <= b_i c

Between samples, with P the covariance and T the period,

    v <- v + T (a - b)         P <- F P F' + T diag(q_v^2, q_b^2),  F = [[1, -T], [0, 1]]

and at a sample one scalar update for each wheel, the innovation e_i = z_i - v, its variance P_vv + R_i:

    R_i = r^2 (1 + x_i)^2,     x_i = s_i e_i^2 / (k^2 (P_vv + r^2)) + ((R w_i' - a^) / A)^2
    s_i = (1 + (u / a^)^4)^-2 b_i,     b_i = (1 + (p / P_i)^4)^-2, P_i: pressure of the brake; 1 where it is not told

x_i says that a wheel slips: by its innovation, in standard deviations k of those below and of those above the estimate,
and by its own acceleration. A wheel that rolls has x_i near zero; one that slips is hardly counted, and the estimate
coasts on the accelerometer. While it coasts P_vv grows, and with it what is taken for rolling, so that the wheels are
found again. s_i is near zero where the car hardly brakes, or the wheel's brake is released: a wheel that turns steadily
there rolls, however far it is from the estimate. Without it an estimate that has come to lie above the speed, by more
than the slip that control aims at, stays there: the wheels are let go of, roll, and count as slipping.

Rims lie below the speed while a car brakes: what lies above tells more. c is the slip of a braked wheel over the
deceleration, zero where it is neglected. A wheel that control has let go of rolls without that slip: z_i is nearest to
v between R w_i and (1 - b_i c a^) R w_i, so that a slip it may not have lifts no estimate above its rim.

Source: Aguado-Rojas 2019, section 3.6, for signals and bias, who takes the filter from Daiss and Kiencke 1995; how a
wheel is told to slip, and c_i, are ours.
"""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp

from absjax.parameters import model, parameter
from absjax.speed.base import LEAST, rim_acceleration, told

TUNED: dict[str, Any] = {"low": 0.0, "open_low": True, "trainable": True}


class KalmanState(NamedTuple):
    """State of the filter; scalars per lane."""

    speed: Any
    """v^ [m/s]"""
    bias: Any
    """b^ [m/s^2]"""
    speed_variance: Any
    """P_vv [m^2/s^2]"""
    covariance: Any
    """P_vb [m^2/s^3]"""
    bias_variance: Any
    """P_bb [m^2/s^4]"""
    lagged: tuple[Any, ...]
    """rim speeds behind a lag, for their accelerations [m/s]"""


@model
class KalmanSpeed:
    """The filter, on the rims of all wheels, or on the first `wheels`; 1: on one in front alone, as in the source.

    The default values are round ones, for a loop in which wheels go by the estimate. Those that `python -m tuning
    speed-study` finds for given stops come as near on stops held out, and have other gates.

    Raises:
        ValueError: at construction, unless there is a wheel.
    """

    title: ClassVar[str] = "Kalman filter"

    speed_drift: Any = parameter("q_v, density of what drives v, m/s^1.5", default=0.015, span=(1e-3, 5.0), **TUNED)
    bias_drift: Any = parameter("q_b, density of what drives b, m/s^2.5", default=0.0025, span=(1e-4, 1.0), **TUNED)
    bias_deviation: Any = parameter("of b when it begins, m/s^2", default=2.0, span=(0.05, 3.0), **TUNED)
    rim_noise: Any = parameter("r, of a rolling wheel, m/s", default=0.1, span=(5e-3, 3.0), **TUNED)
    below: Any = parameter("k of rims below the estimate, standard deviations", default=0.3, span=(0.05, 50.0), **TUNED)
    above: Any = parameter("k of rims above it, standard deviations", default=15.0, span=(0.05, 50.0), **TUNED)
    deviation: Any = parameter(
        "A, difference of a rim's acceleration from the car's, m/s^2", default=3.0, span=(0.3, 500.0), **TUNED
    )
    unbraked: Any = parameter(
        "u, deceleration below which no wheel slips, m/s^2", default=0.3, span=(0.05, 10.0), **TUNED
    )
    released: Any = parameter("p, pressure below which a brake is released, bar", default=1.0, low=0.01)
    slip: Any = parameter(
        "c, slip over deceleration, s^2/m", default=0.003, low=0.0, high=0.05, trainable=True, span=(0.0, 0.03)
    )
    lag: Any = parameter("of the derivative of the rim speeds, s", default=0.02, low=0.0)
    least: Any = parameter("speed that the estimate is not below, m/s", default=0.1, **LEAST)
    wheels: int | None = None
    """how many of the wheels are listened to, the first of them; None: all"""

    def __post_init__(self):
        if self.wheels is not None and self.wheels < 1:
            raise ValueError(f"KalmanSpeed.wheels = {self.wheels} must be 1 at least")

    def initial_state(self, speed, wheels) -> KalmanState:
        """The speed known as well as a rolling wheel tells it, no bias."""
        zero, listened_to = 0.0 * speed, told(self, (speed,) * wheels, wheels if self.wheels is None else self.wheels)
        variances = self.rim_noise**2 + zero, zero, self.bias_deviation**2 + zero
        return KalmanState(speed, zero, *variances, listened_to)

    def update(self, state: KalmanState, acceleration, rims, period, pressures=None) -> KalmanState:
        """State at a sample."""
        car = acceleration - state.bias
        speed, bias = state.speed + period * car, state.bias
        variance = state.speed_variance - 2 * period * state.covariance + period**2 * state.bias_variance
        variance = variance + period * self.speed_drift**2
        covariance = state.covariance - period * state.bias_variance
        bias_variance = state.bias_variance + period * self.bias_drift**2
        braked = self._braked(pressures, len(rims))
        measured = [
            (z, self.rim_variance(z - speed, change - car, variance, car, share), lagged)
            for z, change, lagged, share in self._measured(state, speed, car, rims, period, braked)
        ]
        for z, noise, _ in measured:
            innovation, total = z - speed, variance + noise
            speed, bias = speed + variance / total * innovation, bias + covariance / total * innovation
            bias_variance = bias_variance - covariance**2 / total
            variance, covariance = variance * noise / total, covariance * noise / total
        lagged = tuple(lagged for *_, lagged in measured)
        return KalmanState(jnp.maximum(speed, self.least), bias, variance, covariance, bias_variance, lagged)

    def _measured(self, state: KalmanState, speed, car, rims, period, braked):
        """Of each wheel the speed it tells, the acceleration of its rim, its speed behind the lag, and b_i."""
        for rim, lagged, share in zip(rims, state.lagged, braked):
            slipping = (1 - share * self.slip * car) * rim
            nearest = jnp.clip(speed, jnp.minimum(rim, slipping), jnp.maximum(rim, slipping))
            yield nearest, *rim_acceleration(rim, lagged, self.lag, period), share

    def _braked(self, pressures, wheels: int):
        """b_i of the pressures [bar] of all wheels."""
        if pressures is None:
            return (1.0,) * wheels
        if len(pressures) != wheels:
            raise ValueError(f"{len(pressures)} pressures are given with the rims of {wheels} wheels")
        return tuple(_beyond(pressure, self.released) for pressure in pressures)

    def rim_variance(self, innovation, change, variance, car, braked):
        """R_i [m^2/s^2] of a wheel.

        Args:
            innovation: e_i [m/s].
            change: acceleration of the rim less that of the car [m/s^2].
            variance: P_vv before the sample [m^2/s^2].
            car: a^, acceleration of the car [m/s^2].
            braked: b_i.
        """
        deviations = jnp.where(innovation < 0, self.below, self.above)
        counts = braked * _beyond(car, self.unbraked)
        outside = innovation**2 / (deviations**2 * (variance + self.rim_noise**2))
        slips = counts * outside + (change / self.deviation) ** 2
        return self.rim_noise**2 * (1 + slips) ** 2

    def speed_of(self, state: KalmanState):
        """v^ [m/s]."""
        return state.speed

    def acceleration_of(self, state: KalmanState, acceleration):
        """a - b^ [m/s^2]."""
        return acceleration - state.bias


def _beyond(value, threshold):
    """(1 + (threshold / value)^4)^-2: near zero below the threshold, near 1 beyond it; 0 at the value 0."""
    return (value**4 / (value**4 + threshold**4)) ** 2
