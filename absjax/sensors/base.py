"""What a sampled loop asks of its sensors."""

from typing import Any, Protocol

from absjax.signals import Signals


class Sensor(Protocol):
    """The sensors of `absjax.loop.sampled_loop.SampledLoop`. Scalars per lane.

    A class made by `absjax.parameters.model`.
    """

    @property
    def period(self) -> float | None:
        """Between the ticks it is made for [s]: loops that tick at another pace refuse to roll out. None: any."""
        ...

    def begin(self, signals: Signals) -> tuple[Signals, Any]:
        """The signals as measured when the manoeuvre begins, the wheel having rolled as it does then, and the state.

        Of one lane, or of many: arrays with a leading axis.
        """
        ...

    def flow(self, state: Any, signals: Signals) -> Any:
        """d(state)/dt, with None in the place of what only samples change."""
        ...

    def measure(self, signals: Signals, state: Any) -> tuple[Signals, Any]:
        """The signals as measured at a sample, and the state after it."""
        ...
