"""The automaton of the five-phase algorithm: thresholds on the wheel acceleration offset x2.

| phase | leaves when |
|---|---|
| 0 driver braking | x2 <= -(eps0 + eps0_growth R w) -> 1; the wheel stands, above 15 km/h -> 1 |
| 1 release | x2 >= eps1 -> 2; after longest_release, once the slip is back -> 4 |
| 2 hold | x2 >= eps2, once the slip is back -> 3; x2 falls back through fallback eps1 -> 4, or in deep slip -> 1 |
| 3 fast apply | x2 <= eps3 -> 4; the wheel stands, after 20 ms -> 1 |
| 4 slow apply | x2 <= -eps4 -> 5; the wheel stands, after 20 ms -> 1 |
| 5 hold | x2 <= -eps5 -> 1; x2 rises back through -fallback eps4 -> 4 |

Ours, and not met in the published stops (`ways_back` off: the automaton as published):

* the growth of eps0, 0 as published: on the stable branch a pedal of rate p' takes the wheel to x2 = -b p' v / (a mu'),
  deeper the faster the car, before the road's peak is anywhere near;
* the end of a release without x2 >= eps1, which no wheel reaches on ice: the brake would stay released;
* no pressure before the slip is back, R w >= (1 + recovered_slip) v: a wheel in deep slip, let go of, has the
  acceleration of one that comes back over the peak while it is at walking pace still; with pressure applied then it
  goes to and fro between standstill and walking pace until the road is better. It takes a rough speed of the vehicle;
* the way back from the hold of phase 5, where the road has become better: the pressure would stay where it is;
* the release of a wheel that stands: it decelerates no more, and pressure would be applied to it for ever. Under all
  that the driver gives it may have come there slowly, without ever decelerating by eps0.

A threshold that is not beyond the one before leaves its phase no time: the five phases are five only if
eps2 >= eps1 + 2, eps2 >= eps3 + 2 and eps5 >= eps4 + 2 m/s^2, the least that noise lets apart.
Source: Pasillas-Lepine 2006; Hoang et al. 2014, Fig. 5; Aguado-Rojas 2019, Fig. 6.6.
"""

from typing import Any, ClassVar

import jax.numpy as jnp

from absjax._numerics import pick
from absjax.controllers.base import Controller
from absjax.controllers.phases import TUNED, Entered, onset_threshold, while_pressed
from absjax.parameters import model, parameter
from absjax.signals import Signals

STANDS = 0.1
"""Speed of the rim, m/s, below which a wheel stands."""
STOPPING = 100.0
"""Deceleration, m/s^2, at which a rim comes to stand, or nearly, and acceleration of one let go of: over it the speed
is a time, both parts of the guard rise about alike, and an interpolant over the corner between them does not
overshoot."""
JERK = 1000.0
"""m/s^3, of a wheel let go of: times it a time is an acceleration, for the same reason."""
SHORTEST_APPLY = 0.02
"""s, to a wheel that stands: at walking pace any wheel comes to stand, and would let phases follow without end."""
WALKING = 15 / 3.6
"""Vehicle speed, m/s, below which a wheel that stands under the driver's pressure is left to him."""


@model
class AccelerationPhases(Controller):
    """Thresholds eps0..eps5 on x2, and what follows which.

    Raises:
        ValueError: at construction, unless the thresholds are in order.
    """

    phases: ClassVar[tuple[str, ...]] = ("driver braking", "release", "hold", "fast apply", "slow apply", "hold")
    slots: ClassVar[int] = 2
    cycle_phase: ClassVar[int | None] = 1
    """the phase whose entry counts a cycle"""
    thresholds: ClassVar[tuple[str, ...]] = ("eps0", "eps1", "eps2", "eps3", "eps4", "eps5")
    """the fields that are thresholds on a measured acceleration, which noise keeps from being small"""
    ordered: ClassVar[tuple[tuple[str, str, float], ...]] = (
        ("eps1", "eps2", 2.0),
        ("eps3", "eps2", 2.0),
        ("eps4", "eps5", 2.0),
    )
    """(lower, higher, by how much at least)"""

    eps0: Any = parameter("eps0, deceleration that ends driver braking, m/s^2", default=50.0, **TUNED)
    eps1: Any = parameter("eps1, acceleration that ends the release, m/s^2", default=30.0, **TUNED)
    eps2: Any = parameter("eps2, acceleration that starts the fast apply, m/s^2", default=40.0, **TUNED)
    eps3: Any = parameter("eps3, acceleration that ends the fast apply, m/s^2", default=20.0, **TUNED)
    eps4: Any = parameter("eps4, deceleration that ends the slow apply, m/s^2", default=20.0, **TUNED)
    eps5: Any = parameter("eps5, deceleration that starts the release, m/s^2", default=30.0, **TUNED)
    eps0_growth: Any = parameter(
        "by which eps0 grows with the rim's speed, 1/s", default=0.0, low=0.0, trainable=True, span=(0.0, 4.0)
    )
    fallback: Any = parameter("share of a threshold at which it is left again", default=0.9, low=0.0, high=0.999)
    longest_release: Any = parameter("longest release, s", default=0.5, low=0.0, open_low=True)
    recovered_slip: Any = parameter(
        "slip to which a wheel has to come back before pressure is applied again; -1: none is asked for",
        default=-1.0,
        low=-1.0,
        high=0.0,
    )
    ways_back: bool = True
    """whether there is a way out of a release that lasts, of a hold the wheel recovers in, and of pressure applied to a
    wheel that stands or slips deeply; False as published"""

    def initial_state(self, signals: Signals) -> Any:
        """Entered here and now."""
        return Entered(signals.time)

    def guards(self, signals: Signals, state, phase):
        """Slot 0: the threshold that leads on; slot 1: the other way out of a phase."""
        x2 = signals.acceleration_offset
        rising = (phase == 1) | (phase == 2)
        first = onset_threshold(self.eps0, self.eps0_growth, signals)
        threshold = pick(phase, (-first, self.eps1, self.eps2, self.eps3, -self.eps4, -self.eps5))
        onward = jnp.where(rising, x2 - threshold, threshold - x2)
        overdue = signals.time - state.time - self.longest_release
        fallen, recovered = self.fallback * self.eps1 - x2, x2 + self.fallback * self.eps4
        comes_to_stand = (STANDS - signals.radius * signals.wheel_speed) / STOPPING
        stands = jnp.minimum(comes_to_stand, signals.time - state.time - SHORTEST_APPLY)
        slides = while_pressed(jnp.minimum(comes_to_stand, (signals.vehicle_speed - WALKING) / STOPPING), signals)
        if self.ways_back:
            back = self._since_recovered(signals)
            onward = jnp.where(phase == 2, jnp.minimum(onward, JERK * back), onward)
            overdue = jnp.minimum(overdue, back)
        else:
            overdue = recovered = stands = slides = -1.0
        other = pick(phase, (slides, overdue, fallen, stands, stands, recovered))
        return jnp.where(phase == 0, while_pressed(onward, signals), onward), other

    def switch(self, signals: Signals, state, phase, slot):
        """The phase that follows, entered now."""
        onward = jnp.where(phase == 5, 1, phase + 1)
        deep = self.ways_back & (self._since_recovered(signals) < 0)
        again = (phase == 0) | ((phase == 2) & deep) | (phase == 3) | (phase == 4)
        other = jnp.where(again, 1, 4)
        return self.initial_state(signals), jnp.where(slot == 1, other, onward)

    def _since_recovered(self, signals: Signals):
        """Time since the slip is back [s], of a wheel that is let go of; below zero before."""
        ahead = signals.radius * signals.wheel_speed - (1 + self.recovered_slip) * signals.vehicle_speed
        return jnp.where(self.recovered_slip > -1, ahead / STOPPING, jnp.inf)
