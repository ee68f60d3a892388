"""What a log and a loop ask of an estimator of the vehicle's speed."""

from typing import Any, ClassVar, NamedTuple, Protocol


class SpeedSamples(NamedTuple):
    """A log that a vehicle's speed is estimated from, uniformly sampled."""

    acceleration: Any
    """longitudinal acceleration, as the accelerometer tells it [m/s^2], (samples,)"""
    rims: Any
    """rim speeds R w of the wheels [m/s], (samples, wheels)"""


class SpeedEstimator(Protocol):
    """An estimator of the vehicle's speed from its wheels and an accelerometer. Scalars per lane.

    A class made by `absjax.parameters.model`.
    """

    title: ClassVar[str]
    """for tables and figures"""

    def initial_state(self, speed: Any, wheels: int) -> Any:
        """State when the manoeuvre begins, so many wheels rolling freely at `speed` [m/s].

        Raises:
            ValueError: if it needs more wheels.
        """
        ...

    def update(
        self,
        state: Any,
        acceleration: Any,
        rims: tuple[Any, ...],
        period: Any,
        pressures: tuple[Any, ...] | None = None,
    ) -> Any:
        """State at a sample, `period` [s] after that of the state.

        Args:
            state: at the sample before.
            acceleration: as the accelerometer tells it [m/s^2].
            rims: rim speeds R w of the wheels [m/s].
            period: since the last sample [s].
            pressures: of the brakes, one for each rim [bar]; None where they are not told.
        """
        ...

    def speed_of(self, state: Any) -> Any:
        """v^ [m/s]."""
        ...

    def acceleration_of(self, state: Any, acceleration: Any) -> Any:
        """The acceleration without what has been found to be the accelerometer's bias [m/s^2]."""
        ...


LEAST: dict[str, Any] = {"low": 0.0, "open_low": True}
"""Of the field `least`, which every estimator has: whoever divides by v^ may."""


def told(estimator: Any, rims: tuple[Any, ...], wheels: int) -> tuple[Any, ...]:
    """The first rims, as many as an estimator needs.

    Raises:
        ValueError: if there are fewer.
    """
    if len(rims) < wheels:
        raise ValueError(f"{type(estimator).__name__} needs the rim speeds of {wheels} wheels; {len(rims)} are given")
    return rims[:wheels]


def rim_acceleration(rim, lagged, lag, period):
    """Acceleration of a rim [m/s^2], and its speed behind a first-order lag [m/s].

    A derivative filter s / (lag s + 1) by backward Euler: exact for a rim that accelerates steadily; a lag of zero is
    the plain difference.
    """
    acceleration = (rim - lagged) / (lag + period)
    return acceleration, lagged + period * acceleration
