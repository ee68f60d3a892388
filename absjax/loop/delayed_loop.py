"""A closed loop whose brake hears every command a delay later, switchings located, those that are on their way too.

The command is a signal of the past (`absjax.delay.history`): smooth between switchings, and read at the stages of the
Runge-Kutta step. Where the controller switches the command jumps, and the jump arrives one delay later as an event of
its own. A controller that predicts (`absjax.delay.prediction`) has its own signals kept along, and reads them over the
delay as it knows it.
"""

import dataclasses
import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax._numerics import tree_where
from absjax.delay.history import History
from absjax.lanes import of_each_lane
from absjax.loop.closed_loop import ClosedLoop, LoopState
from absjax.loop.sampled_loop import SampledLoop
from absjax.parameters import concrete, model, parameter
from absjax.results import UNDEFINED
from absjax.sensors.base import Sensor


class DelayedState(NamedTuple):
    """State of a delayed loop."""

    loop: LoopState
    past: History
    """of the commanded rate [bar/s], and of what a predicting controller keeps"""
    pieces: tuple[Any, ...]
    """of the past that are read: by the brake, and by a controller that predicts"""


@model
class DelayedLoop(ClosedLoop):
    """The same loop with a pure delay between controller and brake. A lane whose past is too short ends `UNDEFINED`.

    Raises:
        ValueError: at construction, if there is no delay, or a part lacks what its contract asks for.
    """

    delay: Any = parameter("h, between controller and brake, s", default=0.01, low=0.0, open_low=True)
    nodes: int = 64
    """kept of the past, one a grid step and two a switching: those of one delay at least"""
    tick_every: int = 1

    @property
    def predicting(self) -> bool:
        """Whether the controller has signals of its own to be kept."""
        return hasattr(self.controller, "remembering")

    @property
    def _delays(self) -> tuple[Any, ...]:
        return (self.delay, self.controller.delay) if self.predicting else (self.delay,)  # pyright: ignore

    def require_step(self, step: float) -> None:
        """Check the grid step [s] of a rollout.

        Raises:
            ValueError: if it is longer than a delay, or the past not kept for that long.
        """
        for delay in self._delays:
            if not concrete(delay):
                continue
            if np.any(np.less(delay, step * (1 - 1e-9))):
                raise ValueError(f"step = {step:g} s is longer than the delay of {np.min(delay):g} s")
            if np.any(np.greater(delay, step * (self.nodes - 20))):
                raise ValueError(f"nodes = {self.nodes} of {step:g} s do not reach back {np.max(delay):g} s")

    def undelayed(self) -> ClosedLoop:
        """The loop without the delay."""
        return ClosedLoop(self.plant, self.brake, self.controller, self.stop_speed, self.observer, self.driver)

    def in_unit(self, ticks: int, sensor: Sensor | None = None, *, known: int | None = None, **how: int) -> SampledLoop:
        """The loop in a control unit.

        Args:
            ticks: of the delay.
            sensor: of the unit.
            known: ticks of the delay as a controller that predicts knows it; None: as it is.
            how: `tick_every` and `substeps` of `absjax.loop.sampled_loop.SampledLoop`.
        """
        loop = self.undelayed()
        if self.predicting:
            controller = self.controller.in_unit(ticks if known is None else known)  # pyright: ignore
            loop = dataclasses.replace(loop, controller=controller)
        return SampledLoop(loop, sensor, delay=ticks, **how)

    def initial_state(self, speed) -> DelayedState:
        """State of free rolling at `speed` [m/s], the first command on its way for ever."""

        def begun(self, speed):
            loop, zero = ClosedLoop.initial_state(self, speed), 0.0 * speed
            mode = jnp.int32(0)
            rate = self.command(self.signals(zero, loop, mode), loop, mode)
            row = jnp.stack(jnp.broadcast_arrays(rate, *(zero,) * (3 * self.predicting)))
            past = History.constant(self.nodes, row).pushed(zero, row, 0.0 * row)
            return DelayedState(loop, past, (zero,) * len(self._delays))

        return of_each_lane(begun, self, jnp.asarray(speed, jnp.result_type(float, speed)))

    def _told(self, time, state: DelayedState) -> tuple[LoopState, Any]:
        """The loop with what its controller reads, and the rate that arrives [bar/s]."""
        arrived = state.past.read(time - self.delay, state.pieces[0])[0]
        if not self.predicting:
            return state.loop, arrived
        piece = state.pieces[1]
        row = state.past.read(time - self.controller.delay, piece)[1:]  # pyright: ignore
        defined = jnp.where(piece == state.past.piece[0], 1.0, 0.0).astype(row.dtype)
        kept = self.controller.remembering(state.loop.controller, row, defined)  # pyright: ignore
        return state.loop._replace(controller=kept), arrived

    def _row(self, time, state: DelayedState, mode):
        """What is kept at an instant."""
        loop, _ = self._told(time, state)
        signals = self.signals(time, loop, mode)
        row = [self.command(signals, loop, mode)]
        if self.predicting:
            row += self.controller.kept(signals, loop.controller, self._parts(mode).phase)  # pyright: ignore
        return jnp.stack(jnp.broadcast_arrays(*row))

    def _node(self, time, state: DelayedState, mode):
        """That, and its rate along the flow."""
        slope = self.flow(time, state, mode)
        motion = jax.tree.map(lambda x, d: jnp.zeros_like(x) if d is None else d, state, slope)
        return jax.jvp(lambda t, x: self._row(t, x, mode), (time, state), (jnp.ones_like(time), motion))

    def importance(self, time, state: DelayedState, mode):
        """That of the loop."""
        return ClosedLoop.importance(self, time, state.loop, mode)

    def scales(self, state: DelayedState) -> DelayedState:
        """Those of the loop."""
        return jax.tree.map(lambda leaf: 0.0 * leaf, state)._replace(loop=ClosedLoop.scales(self, state.loop))

    def flow(self, time, state: DelayedState, mode) -> DelayedState:
        """d(state)/dt."""
        loop, arrived = self._told(time, state)
        signals = self.signals(time, loop, mode)
        slope = self.flow_under(time, loop, mode, signals, arrived)
        if self.predicting:
            rates = self.controller.integral_rates(signals, loop.controller, self._parts(mode).phase)  # pyright: ignore
            slope = slope._replace(controller=slope.controller._replace(integrals=rates))
        return DelayedState(slope, jax.tree.map(lambda _: None, state.past), (None,) * len(state.pieces))

    def guards(self, time, state: DelayedState, mode):
        """The controller's slots, then the limits, then what is on its way."""
        loop, arrived = self._told(time, state)
        signals = self.signals(time, loop, mode)
        own = self.controller.guards(signals, loop.controller, self._parts(mode).phase)
        arriving = (state.past.overdue(time - delay, piece) for delay, piece in zip(self._delays, state.pieces))
        return own + self.limits(time, loop, mode, arrived) + tuple(arriving)

    def jump(self, time, state: DelayedState, mode, slot):
        """The controller switches, one of the limits is met, or a switching arrives."""
        slots, readers = self.controller.slots, len(state.pieces)
        loop, _ = self._told(time, state)
        switched, phase = self.switch(self.signals(time, loop, mode), loop, mode, slot)
        limited, other = self.meet_limit(time, loop, mode, slot - slots)
        own = slot < slots
        count = slots + len(jax.eval_shape(lambda: self.limits(time, loop, mode, 0.0 * time)))
        arrives = slot >= count
        loop = tree_where(own, switched, tree_where(arrives, loop, limited))
        following = jnp.where(own, phase, jnp.where(arrives, mode, other)).astype(jnp.int32)
        pieces = tuple(p + jnp.where(slot == count + i, 1.0, 0.0) for i, p in zip(range(readers), state.pieces))
        after = state._replace(loop=loop, pieces=pieces)
        # Nodes on both sides of the instant. What the brake does at a limit is a corner of the command, no jump.
        begins = jnp.where(own, 1.0, 0.0)
        row = state.past.value[0]
        after = after._replace(past=state.past.pushed(time, row, 0.0 * row, begins))
        both = jax.tree.map(lambda *leaves: jnp.stack(jnp.broadcast_arrays(*leaves)), (state, mode), (after, following))
        rows, slopes = jax.vmap(self._node, (None, 0, 0))(time, *both)
        past = state.past.pushed(time, rows[0], slopes[0]).pushed(time, rows[1], slopes[1], begins)
        return after._replace(past=past), following

    def tick(self, time, state: DelayedState, mode):
        """A node of a grid point."""
        row, slope = self._node(time, state, mode)
        lost = jnp.stack([state.past.forgets(time - delay) for delay in self._delays]).any()
        mode = jnp.where(lost & (mode >= 0), UNDEFINED, mode)
        return state._replace(past=state.past.pushed(time, row, slope)), mode


def nodes_of(delay: float, step: float) -> int:
    """Nodes of the past that do for a delay and a grid step [s], with room for ten switchings within the delay."""
    return math.ceil(delay / step) + 22


def in_unit(loop: ClosedLoop, sensor: Sensor | None, delay: float | None, period: float, **how: int) -> SampledLoop:
    """A loop in a control unit that ticks every `period` [s]; a delayed one with its delay, as whole ticks."""
    if not isinstance(loop, DelayedLoop) or delay is None:
        return SampledLoop(loop, sensor, **how)
    return loop.in_unit(max(1, round(delay / period)), sensor, **how)
