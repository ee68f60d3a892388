"""The loop whose delay margin `absjax.delay.margins` gives, to be simulated: feedback of x2 through a notch filter.

    v x2' = -theta x2 + u(t - h),   u = -K y,   y = x2 + z2
    z1' = wn z2,   z2' = wn (-z1 - 2 zd z2 + 2 (zn - zd) x2)

at constant speed and XBS. Source: Hoang 2014 (thesis), eq. 8.18 to 8.20 and 8.43.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax.delay.history import History
from absjax.delay.located import ReadsItsPast
from absjax.lanes import of_each_lane
from absjax.parameters import model, parameter


class LoopState(NamedTuple):
    """State; scalars per lane but for the past."""

    offset: Any
    """x2, m/s^2"""
    notch: tuple[Any, Any]
    past: History
    """of u"""
    piece: Any


@model
class AccelerationLoop(ReadsItsPast):
    """Acceleration feedback under a delay."""

    gain: Any = parameter("K, m/s^2", low=0.0, open_low=True)
    speed: Any = parameter("v, m/s", low=0.0, open_low=True)
    theta: Any = parameter("a mu', m/s^2")
    delay: Any = parameter("h, s", low=0.0, open_low=True)
    notch: Any = parameter("wn, rad/s", default=1.0, low=0.0, open_low=True)
    zn: Any = parameter("damping of the filter's numerator", default=1.0, low=0.0)
    zd: Any = parameter("damping of its denominator", default=1.0, low=0.0, open_low=True)
    nodes: int = 96

    def initial_state(self, offset: Any) -> LoopState:
        """x2 at time 0, nothing commanded before."""

        def begun(loop, offset):
            zero = 0.0 * offset
            state = LoopState(offset, (zero, zero), History.constant(self.nodes, jnp.reshape(zero, 1)), zero)
            return state._replace(past=loop.past_of(zero, state))

        return of_each_lane(begun, self, jnp.asarray(offset, jnp.result_type(float, offset)))

    def kept(self, time, state: LoopState):
        """u."""
        return jnp.reshape(-self.gain * (state.offset + state.notch[1]), 1)

    def flow(self, time, state: LoopState, mode):
        """d(state)/dt."""
        arrived = state.past.read(time - self.delay, state.piece)[0]
        z1, z2 = state.notch
        pull = -z1 - 2 * self.zd * z2 + 2 * (self.zn - self.zd) * state.offset
        held = jax.tree.map(lambda _: None, state.past)
        return LoopState(
            (arrived - self.theta * state.offset) / self.speed, (self.notch * z2, self.notch * pull), held, None
        )
