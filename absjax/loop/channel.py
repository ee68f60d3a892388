"""What belongs to one wheel of a loop: its brake, its controller, and the observer that tells the controller XBS."""

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax.controllers.base import Controller
from absjax.observers.base import Observer
from absjax.observers.load import at_load
from absjax.parameters import model, part
from absjax.plant.base import Actuator
from absjax.signals import Signals


class ChannelState(NamedTuple):
    """State of a channel."""

    brake: Any
    observer: Any
    """None without one"""
    controller: Any
    """what the controller keeps"""


@model
class Channel:
    """Brake, controller and observer of one wheel."""

    brake: Actuator = part("the actuator")
    controller: Controller = part("the controller")
    observer: Observer | None = part("estimates XBS for the controller; None tells it the true one", default=None)

    def at_load(self, share) -> "Channel":
        """The channel whose controller and observer know that the load is `share` of the one their gain a is for."""
        observer = None if self.observer is None else at_load(self.observer, share)
        return dataclasses.replace(self, controller=at_load(self.controller, share), observer=observer)

    def begun(self, state: ChannelState, measured: Signals) -> ChannelState:
        """The state with observer and controller at their start."""
        if self.observer is not None:
            state = state._replace(observer=self.observer.initial_state(measured.acceleration_offset))
        return state._replace(controller=self.controller.initial_state(self.with_estimate(measured, state)))

    def with_estimate(self, measured: Signals, state: ChannelState) -> Signals:
        """What the controller is told: XBS as the observer estimates it."""
        if self.observer is None:
            return measured
        return measured._replace(stiffness=self.observer.stiffness(state.observer, measured.acceleration_offset))

    def scales(self, state: ChannelState) -> ChannelState:
        """Those of the brake, if it has any; of all else every share counts."""
        brake_scales = getattr(self.brake, "scales", None)
        every = jax.tree.map(lambda leaf: 0.0 * leaf, state)
        return every if brake_scales is None else every._replace(brake=brake_scales(state.brake))

    def switch(self, told: Signals, state: ChannelState, phase, slot) -> tuple[ChannelState, Any, Any]:
        """State, phase, and whether a cycle begins, after the controller's guard `slot` has fired."""
        kept, following = self.controller.switch(told, state.controller, phase, slot)
        cycle_phase = self.controller.cycle_phase
        cycles = jnp.zeros((), bool) if cycle_phase is None else following == cycle_phase
        return state._replace(controller=kept), following, cycles
