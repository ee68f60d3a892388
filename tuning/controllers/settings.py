"""Settings a controller is judged in: switchings located on the truth, sampled, or told by an encoder's edges.

located: every switching at its own instant, told the truth. sampled: guards tested every period, told the truth.
chain: sampled every millisecond, wheel speed and acceleration told by the encoder chain: an encoder of 60 teeth without
errors, time-stamping over n = 12 edges (Aguado-Rojas 2019, chapter 5).
"""

from typing import Any, NamedTuple

from absjax.encoder.encoder import Encoder
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.sensors.encoder import EncoderSensor
from tuning.controllers.setup import Setup
from tuning.encoder.chains import measured_chain

TEETH, EVENTS = 60, 12
ROLLING = 200
"""Samples of free rolling before the pedal, enough to fill the window."""


class Setting(NamedTuple):
    """How a loop is run."""

    name: str
    period: float | None = None
    """of the ticks, s; None where switchings are located"""

    @property
    def label(self) -> str:
        """For figures and tables."""
        return self.name if self.period is None or self.name != "sampled" else f"sampled, {1e3 * self.period:g} ms"

    def applied(self, setup: Setup, loop: ClosedLoop | VehicleLoop) -> tuple[Any, float]:
        """The system to roll out, and its grid step [s]."""
        if self.period is None:
            return loop, setup.step
        sensor = None
        if self.name == "chain":
            chain = measured_chain(TEETH, EVENTS)
            sensor = EncoderSensor(Encoder.ideal(TEETH), chain, rolling=ROLLING, period=self.period)
        return setup.sampled(loop, self.period, sensor)


LOCATED, SAMPLED, COARSE, CHAIN = (
    Setting("located"),
    Setting("sampled", 1e-3),
    Setting("sampled", 5e-3),
    Setting("chain", 1e-3),
)
SETTINGS = (LOCATED, SAMPLED, COARSE, CHAIN)
