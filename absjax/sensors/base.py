"""What a sampled loop asks of its sensors."""

from typing import Any, Protocol

from absjax.signals import Signals


class Sensor(Protocol):
    """The sensors of `absjax.loop.sampled_loop.SampledLoop`. Scalars per lane.

    One that has a `period` [s] is for loops that tick as often; others refuse to roll out.
    """

    def at(self, signals: Signals) -> tuple[Signals, Any]:
        """The signals as measured when the manoeuvre begins, the wheel having rolled as it does then, and the state.

        Of one lane, or of many: arrays with a leading axis.
        """
        ...

    def flow(self, state, signals: Signals) -> Any:
        """d(state)/dt, with None in the place of what only samples change."""
        ...

    def measure(self, signals: Signals, state) -> tuple[Signals, Any]:
        """The signals as measured at a sample, and the state after it."""
        ...
