"""Road bank and accelerometer biases as further adapted states; beyond the source, which names the bank as open.

On a bank phi (positive: the left side is the higher one) an accelerometer sees the tyres' forces only:

    vy' = (ay - b_y) - r vx - g sin phi        m (ay - b_y) = theta f_y*

so that the bank is what the injection of the lateral velocity pushes against all the time, and what ay - r vx is in
the mean. Its integral, and its mean:

    phi' = -K_phi / g  Kvy Lambda xi (m ay~) + K_m ((ay - r vx) / g - phi) - phi / T_phi
    b_y' = G_y ay~        b_x' = -G_x sum K_i (v_x,i - vx)

Excitation that each needs. Bank: tyres that are not saturated, |k f'| > `unsaturated` |[k f', f]|, or else the
injection tells of theta, and manoeuvres that are short against 1 / K_m, so that vy' has no mean. Lateral bias: a road
that is level in the mean, since while driving straight the bank and the bias are seen in their sum alone; it is adapted
much slower. Longitudinal bias: wheels that roll freely. A bias of the yaw rate gives r vx and is taken for bank. What
biases explain, a bank up to `unexplained`, is not taken off: the observer bears it.

The default values are the best of a random search over five logs of a multi-body car, one of them on a bank.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

from absjax.parameters import model, parameter
from absjax.plant.wheel import GRAVITY


class Offsets(NamedTuple):
    """Adapted offsets."""

    bank: Any
    """phi [rad]"""
    lateral_bias: Any
    """b_y [m/s^2]"""
    longitudinal_bias: Any
    """b_x [m/s^2]"""


@model
class OffsetAdaptation:
    """Gains of the offsets; a gain of 0 leaves one at 0."""

    bank_gain: Any = parameter("K_phi, 1/s", default=0.4, low=0.0, trainable=True, span=(0.05, 5.0))
    bank_memory: Any = parameter("T_phi, s", default=300.0, low=0.1, trainable=True, span=(5.0, 1000.0))
    mean_gain: Any = parameter("K_m, 1/s", default=0.07, low=0.0, trainable=True, span=(0.01, 1.0))
    unexplained: Any = parameter(
        "bank up to which it is taken for biases, rad", default=0.022, low=0.0, trainable=True, span=(0.002, 0.1)
    )
    lateral_gain: Any = parameter("G_y, 1/s", default=0.015, low=0.0, trainable=True, span=(1e-3, 0.5))
    longitudinal_gain: Any = parameter("G_x, 1/s", default=0.0015, low=0.0, trainable=True, span=(1e-4, 0.5))
    unsaturated: Any = parameter("share of the slope from which tyres count as not saturated", default=0.15, low=0.0)
    steepest: Any = parameter("largest bank, rad", default=0.2, low=0.0)
    largest_bias: Any = parameter("largest bias, m/s^2", default=0.5, low=0.0)

    def initial_state(self, like) -> Offsets:
        """A level road and no biases."""
        zero = 0.0 * like
        return Offsets(zero, zero, zero)

    def applied(self, state: Offsets):
        """The bank that is taken off: what biases do not explain, softly [rad]."""
        beyond = jnp.maximum(jnp.abs(state.bank) - self.unexplained, 0.0)
        return jnp.sign(state.bank) * beyond

    def step(self, state: Offsets, injection, excess, residual, rolling, share, period) -> Offsets:
        """State after a period.

        Args:
            injection: Kvy Lambda xi (m ay~) [m/s^2].
            excess: ay - r vx, which in the mean is g sin phi [m/s^2].
            residual: ay~ [m/s^2].
            rolling: sum K_i (v_x,i - vx) [m/s^2].
            share: sN of the scaled monitor.
            period: s.
        """
        told = jnp.where(jnp.abs(share) > self.unsaturated, 1.0, 0.0)
        bank = state.bank - period * (told * self.bank_gain / GRAVITY * injection + state.bank / self.bank_memory)
        bank = bank + period * self.mean_gain * (excess / GRAVITY - state.bank)
        lateral = state.lateral_bias + period * told * self.lateral_gain * residual
        longitudinal = state.longitudinal_bias - period * self.longitudinal_gain * rolling
        return Offsets(
            jnp.clip(bank, -self.steepest, self.steepest),
            jnp.clip(lateral, -self.largest_bias, self.largest_bias),
            jnp.clip(longitudinal, -self.largest_bias, self.largest_bias),
        )
