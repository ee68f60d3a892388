"""A braked wheel.

    J w' = -R Fx - gamma_b Pb,    Fx = Fz mu(lambda),    lambda = (R w - v) / v

Source: Aguado-Rojas 2019, section 2.1; Hoang et al. 2014, eq. 1-4.
"""

from typing import Any

from absjax.parameters import model, parameter

GRAVITY = 9.81
"""Gravitational acceleration [m/s^2]."""


@model
class Wheel:
    """A braked wheel and the load it carries."""

    inertia: Any = parameter("J, kg m^2", default=1.2, low=0.0, high=100.0, open_low=True)
    radius: Any = parameter("R, m", default=0.3, low=0.0, high=1.5, open_low=True)
    load: Any = parameter("Fz, vertical load, N", default=2500.0, low=0.0, high=2e5, open_low=True)
    brake_efficiency: Any = parameter("gamma_b, N m/bar", default=17.5, low=0.0, high=1e4, open_low=True)

    @property
    def mass(self):
        """m = Fz / g [kg]."""
        return self.load / GRAVITY

    @property
    def slip_gain(self):
        """a = R^2 Fz / J [m/s^2], of x2' = -(a mu' / v) x2 - b Pb'."""
        return self.radius**2 * self.load / self.inertia

    @property
    def pressure_gain(self):
        """b = R gamma_b / J [m/(s^2 bar)], likewise."""
        return self.radius * self.brake_efficiency / self.inertia

    def acceleration(self, force, pressure):
        """w' = (-R Fx - gamma_b Pb) / J [rad/s^2] from tyre force [N] and brake pressure [bar]."""
        return -(self.radius * force + self.brake_efficiency * pressure) * (1 / self.inertia)

    def slip(self, wheel_speed, speed):
        """lambda = (R w - v) / v."""
        return self.radius * wheel_speed / speed - 1
