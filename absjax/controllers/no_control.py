"""No anti-lock control: the brake is the driver's from beginning to end.

The baseline of every comparison, and how a regulation's tests of adhesion are braked.
"""

from typing import Any, ClassVar

from absjax.controllers.base import Controller
from absjax.controllers.phases import OPEN_VALVE
from absjax.parameters import model, parameter
from absjax.signals import Signals


@model
class NoControl(Controller):
    """An open valve: pedal or actuator set the pace."""

    title: ClassVar[str] = "without control"
    grid_step: ClassVar[float] = 2e-3
    phases: ClassVar[tuple[str, ...]] = ("driver braking",)
    slots: ClassVar[int] = 1
    cycle_phase: ClassVar[int | None] = None

    valve: Any = parameter("rate that the valve lets through, bar/s", default=OPEN_VALVE, low=0.0, open_low=True)

    def initial_state(self, signals: Signals):
        """Nothing is kept."""
        return ()

    def rate(self, signals: Signals, state, phase):
        """dPb/dt [bar/s]."""
        return self.valve + 0.0 * signals.pressure

    def guards(self, signals: Signals, state, phase):
        """One that never fires."""
        return (-1.0 + 0.0 * signals.pressure,)

    def switch(self, signals: Signals, state, phase, slot):
        """It does not."""
        return state, phase
