"""The chain from edges that a setting tells a controller by, and what of it is tuned with the controller.

Time-stamping over a window of edges, and compensation through the edges of the lowest harmonics of the encoder's errors
(Aguado-Rojas 2019, chapters 5 and 6). A short window tells sooner, a long one tells less of the errors that are left.
Among the parameters of a set they are called chain.window, chain.memory and so on.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, TypeVar

from absjax.encoder.harmonics import HarmonicCompensation
from absjax.encoder.known_errors import KnownErrors, lowest
from absjax.encoder.wheel_speed import WheelSpeedChain
from absjax.parameters import bounds_of, model, parameter
from absjax.sensors.delayed import DelayedSensor
from absjax.sensors.encoder import EncoderSensor
from tuning.encoder.chains import edge_chain

PREFIX = "chain."
TEETH, EVENTS = 60, 12
"""Of the encoder; most edges of the window."""
LEARNING = {"edges": {"harmonics": 12.0, "forgetting": 0.1}, "settled": {"harmonics": 29.0, "forgetting": 1.0}}
"""By kind of chain: most harmonics, of which one that learns on while braking pays for each; and how soon it forgets:
within the two seconds of rolling 1/s leaves a third of the error that 0.1/s does."""
S = TypeVar("S")


@model
class Chain:
    """A chain told through the edges."""

    title: ClassVar[str] = "chain"

    window: Any = parameter("n, edges at most", default=12.0, low=4.0, high=12.0, trainable=True, span=(4.0, 12.0))
    memory: Any = parameter(
        "age beyond which an edge is not used, s",
        default=0.012,
        low=0.0,
        open_low=True,
        trainable=True,
        span=(4e-3, 0.03),
    )
    harmonics: Any = parameter(
        "M, that are taken off, of those that are learned", default=29.0, low=1.0, trainable=True, span=(1.0, 29.0)
    )
    cutoff: Any = parameter(
        "of the high-pass filter, Hz", default=5.0, low=0.0, open_low=True, trainable=True, span=(0.2, 30.0)
    )
    forgetting: Any = parameter("beta, 1/s", default=1.0, low=0.0, open_low=True, trainable=True, span=(0.01, 10.0))

    def chain(self, kind: str) -> WheelSpeedChain:
        """From edges to wheel speed and acceleration, of a kind that learns."""
        return self.put_in(edge_chain(TEETH, EVENTS, round(LEARNING[kind]["harmonics"]), memory=self.memory))

    def put_in(self, chain: WheelSpeedChain) -> WheelSpeedChain:
        """A chain of the same structure with these parameters; one that learns no more has cut-off and forgetting
        behind it."""
        stamping = dataclasses.replace(chain.stamping, window=self.window, memory=self.memory)
        learning = {"active": self.harmonics, "cutoff": self.cutoff, "forgetting": self.forgetting}
        both: dict[str, Any] = {}
        for name in ("speed", "acceleration"):
            part = getattr(chain, name)
            if isinstance(part, KnownErrors):
                both[name] = dataclasses.replace(part, errors=lowest(part.errors, self.harmonics))
            else:
                assert isinstance(part, HarmonicCompensation)
                both[name] = dataclasses.replace(part, **learning)
        return WheelSpeedChain(stamping, **both)

    def stand_in(self, sensor: DelayedSensor) -> DelayedSensor:
        """What is smooth in its place, with these parameters; M of N / 2 harmonics are taken off."""
        taken_off = 2 * self.harmonics / TEETH
        return dataclasses.replace(sensor, events=self.window, memory=self.memory, taken_off=taken_off)


def own_names() -> tuple[str, ...]:
    """Names of its parameters in a set."""
    return tuple(PREFIX + name for name in bounds_of(Chain))


def of_chain(values: Mapping[str, S]) -> dict[str, S]:
    """The chain's parameters of a set, by the names of their fields."""
    return {name.removeprefix(PREFIX): value for name, value in values.items() if name.startswith(PREFIX)}


def of_controller(values: Mapping[str, S]) -> dict[str, S]:
    """The others."""
    return {name: value for name, value in values.items() if not name.startswith(PREFIX)}


def told_through(sensor: Any, values: Mapping[str, Any]) -> Any:
    """A sensor with parameters of the chain in it, if it is one of a chain: an encoder's, or what is smooth in its
    place. One that learns on learns anew while rolling."""
    if not values or not isinstance(sensor, EncoderSensor | DelayedSensor):
        return sensor
    chain = Chain(**values)
    if isinstance(sensor, DelayedSensor):
        return chain.stand_in(sensor)
    begun = sensor.begun if isinstance(sensor.chain.speed, KnownErrors) else None
    return dataclasses.replace(sensor, chain=chain.put_in(sensor.chain), begun=begun)
