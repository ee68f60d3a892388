"""The sampled loop with a derivative: switchings are decided at ticks, and move with the crossings behind them.

Under sampled semantics a threshold moves nothing until it moves a switching to another tick: the derivative of
`absjax.loop.sampled_loop` with respect to it is zero. Here every value is that of the sampled loop, and the derivative
is another: a guard that is open at a tick has crossed zero at some t* since the tick before, and the switching acts
d = -(t* - phase) mod T later, at the tick. In the derivative d is held: where t* moves, the switching moves with it,
and so does the clock from there on,

    x <- x + f(x) (t* - const(t*)),    t* = t - T g / (g - g'),    g, g' the guard at the tick and at the one before

with f the flow before the switching. If d is spread uniformly over the period this is the derivative of the mean over
the phases of the clock. A guard whose crossing lies less than T after that of the switching before has no choice, it
acts one tick after it, and moves with it: a control unit makes one switching a tick.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import first_open, per_lane, pick, safe_divide
from absjax.loop.sampled_loop import SampledLoop, SampledState
from absjax.parameters import model

LONG_AGO = -1e6


class Clock(NamedTuple):
    """What is kept of the last tick; scalars per lane."""

    ticked: Any
    """when it was, s"""
    guards: tuple[Any, ...]
    """the controller's after it"""
    crossed: Any
    """when the guard of the last switching did, or had to act as if it had, s"""
    shift: Any
    """by which the clock has moved, s: zero, but for its derivative"""


@jax.custom_jvp
def _moved(x, rate, shift):
    """`x` in value; its derivative is that of x + rate shift."""
    return x


@_moved.defjvp
def _moved_rule(primals, tangents):
    x, rate, _ = primals
    return x, tangents[0] + per_lane(tangents[2], rate) * rate


def _along(slope, state, shift):
    """A state moved along its flow by a shift that is zero but for its derivative."""
    return jax.tree.map(lambda x, rate: x if rate is None else _moved(x, rate, shift), state, slope)


@model
class TickingLoop(SampledLoop):
    """A sampled loop whose switchings move with the crossings behind them: the same stops, with a gradient.

    The mean over the phases of the clock has to be part of what is differentiated: lanes that begin at other instants
    between two ticks (`absjax.loop.driver.Driver.delay`), and at other speeds.
    """

    def initial_state(self, speed) -> SampledState:
        """State of free rolling at `speed` [m/s], the first command given at once."""
        state, zero = super().initial_state(speed), 0.0 * speed
        mode = jnp.int32(0)
        signals = self.loop.with_estimate(self.loop.measured(zero, state.loop, mode), state.loop)
        return state._replace(clock=Clock(zero, self.own_guards(signals, state, mode), zero + LONG_AGO, zero))

    def importance(self, time, state: SampledState, mode):
        """That of the loop."""
        return super().importance(time + state.clock.shift, state, mode)

    def flow(self, time, state: SampledState, mode) -> SampledState:
        """d(state)/dt under the rate that acts."""
        return super().flow(time + state.clock.shift, state, mode)

    def guards(self, time, state: SampledState, mode):
        """The limits."""
        return super().guards(time + state.clock.shift, state, mode)

    def jump(self, time, state: SampledState, mode, slot):
        """One of the limits is met."""
        return super().jump(time + state.clock.shift, state, mode, slot)

    def tick(self, time, state: SampledState, mode):
        """One pass of the control unit."""
        clock = state.clock
        now = time + clock.shift
        signals, heard = self.hear(now, state, mode)
        guards = self.own_guards(signals, heard, mode)
        fires, slot = first_open(guards)
        value, before = pick(slot, guards), pick(slot, clock.guards)
        period = time - clock.ticked
        crossed = time - period * safe_divide(value, value - before, fires & (before < 0))
        moves = fires & (before < 0) & (crossed >= clock.crossed + period)
        crossed = jnp.where(moves, crossed, jnp.where(fires, clock.crossed + period, clock.crossed))
        shift = jnp.where(moves, crossed - jax.lax.stop_gradient(crossed), 0.0)
        state = _along(self.flow(time, state, mode), state, shift)
        total = clock.shift + shift
        signals, heard = self.hear(time + total, state, mode)
        state, mode = self.act(signals, heard, mode)
        clock = Clock(time, self.own_guards(signals, state, mode), crossed, total)
        return state._replace(clock=clock), mode
