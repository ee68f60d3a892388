"""The encoder and its chain as the sensor of a sampled loop: a controller told what the edges tell.

The wheel's angle is integrated along with the loop; at every tick the edges that have passed since the one before
are stamped and run through the chain. The vehicle's acceleration is taken as known, so x2 = R w'^ - v'.
Source: Aguado-Rojas 2019, section 6.4.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from absjax.encoder.edges import Place, capacity_for, passing_edges
from absjax.encoder.encoder import Encoder
from absjax.encoder.known_errors import settled
from absjax.encoder.rotation import Rotation
from absjax.encoder.wheel_speed import WheelSpeedChain
from absjax.lanes import lane_axes, lane_count, mapped
from absjax.parameters import concrete, model, parameter, part
from absjax.signals import Signals

STANDING = 0.1
"""A wheel slower than this is told to turn so fast, rad/s: controllers divide by its speed."""


@model
class Turning:
    """State of the sensor."""

    angle: Any = parameter("th, from the revolution in which the next tooth passes, rad; the rest is of the last tick")
    speed: Any = parameter("w, rad/s")
    acceleration: Any = parameter("w', rad/s^2")
    begun: Any = parameter("th then, rad")
    tooth: Any = parameter("index of the tooth that passes next")
    passing: Any = parameter("number of that passing since the start")
    time: Any = parameter("s")
    chain: Any = part("state of the chain")


@model
class Begun:
    """A sensor after free rolling."""

    speed: Any = parameter("told, rad/s")
    acceleration: Any = parameter("told, rad/s^2")
    state: Turning = part("its state")


@model
class EncoderSensor:
    """An encoder on the wheel, and the chain in the control unit.

    The manoeuvre begins after the wheel has rolled freely for `rolling` samples of `period`, so that the chain has
    learned what it can.
    """

    encoder: Encoder = part("the encoder")
    chain: WheelSpeedChain = part("what makes speed and acceleration of its edges")
    begun: Begun | None = part("after that rolling, as `rolled` finds it; None: it is rolled anew", default=None)
    rolling: int = 2000
    """samples of free rolling before the manoeuvre"""
    period: float = 1e-3
    """time between those samples, and between the ticks of the loop, s"""
    capacity: int = 3
    """most edges between two samples"""

    def __post_init__(self):
        if self.encoder.teeth != self.chain.stamping.teeth:
            raise ValueError(
                f"EncoderSensor.encoder has {self.encoder.teeth} teeth, its chain counts {self.chain.stamping.teeth}"
            )
        for name in ("rolling", "capacity"):
            if getattr(self, name) < 1:
                raise ValueError(f"EncoderSensor.{name} = {getattr(self, name)} must be >= 1")
        if not 0 < self.period < 1:
            raise ValueError(f"EncoderSensor.period = {self.period} s must lie between 0 and 1")

    def begin(self, signals: Signals) -> tuple[Signals, Turning]:
        """Signals and state after free rolling at the speed the wheel has.

        Raises:
            ValueError: if more teeth pass in a period than the capacity allows for.
        """
        begun = self.begun or self.rolled(signals.wheel_speed).begun
        assert begun is not None
        return self._told(signals, begun.speed, begun.acceleration), begun.state

    def rolled(self, speed) -> "EncoderSensor":
        """The sensor with the rolling at a wheel speed [rad/s] behind it, for many stops from there; lanes as in
        `begin`.

        Raises:
            ValueError: if more teeth pass in a period than the capacity allows for.
        """
        if concrete(speed):
            teeth = float(jnp.max(speed)) * self.period / self.encoder.pitch
            if capacity_for(teeth) > self.capacity:
                raise ValueError(
                    f"EncoderSensor.capacity = {self.capacity} edges between two samples; {capacity_for(teeth)} "
                    f"are needed, {teeth:.3g} teeth pass at {float(jnp.max(speed)):.4g} rad/s"
                )
        start = EncoderSensor._rolled
        if lane_count(self, "sensor") is not None or jnp.ndim(speed):
            start = jax.vmap(start, in_axes=(mapped(lane_axes(self)), 0 if jnp.ndim(speed) else None))
        return dataclasses.replace(self, begun=start(self, jnp.asarray(speed)))

    def settled(self) -> "EncoderSensor":
        """A sensor with its rolling behind it that takes off what it has learned there, and learns no more.

        Raises:
            ValueError: if it has not rolled, or does not learn through the edges.
        """
        if self.begun is None:
            raise ValueError("EncoderSensor.begun is None; what is learned while rolling is known after `rolled`")
        chain, state = settled(self.chain, self.begun.state.chain)
        begun = dataclasses.replace(self.begun, state=dataclasses.replace(self.begun.state, chain=state))
        return dataclasses.replace(self, chain=chain, begun=begun)

    def _rolled(self, speed) -> Begun:
        encoder, chain_ = jax.tree.map(lambda x: jnp.asarray(x, speed.dtype), (self.encoder, self.chain))
        zero = 0.0 * speed
        place = Place.of(encoder, Rotation(zero, speed, zero))

        def roll(carry, _):
            place, chain = carry
            after = place.rotation._replace(angle=place.rotation.angle + self.period * speed)
            edges, place = passing_edges(encoder, place, after, self.period, self.capacity)
            chain, wheel = chain_.absorb(chain, edges, self.period)
            return (place, chain), wheel

        chain = jax.tree.map(lambda x: x + zero, chain_.initial_state(speed.dtype, speed.dtype))
        (place, chain), told = lax.scan(roll, (place, chain), None, length=self.rolling)
        return Begun(told.speed[-1], told.acceleration[-1], _turning(place, zero, chain))

    def flow(self, state: Turning, signals: Signals) -> Turning:
        """The wheel turns."""
        held = jax.tree.map(lambda _: None, state)
        return dataclasses.replace(held, angle=signals.wheel_speed)

    def measure(self, signals: Signals, state: Turning) -> tuple[Signals, Turning]:
        """Wheel speed and acceleration offset as the chain makes them of the edges since the last tick."""
        acceleration = (signals.acceleration_offset + signals.vehicle_acceleration) / signals.radius
        after = Rotation(state.angle, signals.wheel_speed, acceleration)
        before = Rotation(state.begun, state.speed, state.acceleration)
        period = signals.time - state.time
        place = Place(before, state.tooth.astype(jnp.int32), state.passing.astype(jnp.int32))
        edges, place = passing_edges(self.encoder, place, after, period, self.capacity)
        chain, wheel = self.chain.absorb(state.chain, edges, period)
        return self._told(signals, wheel.speed, wheel.acceleration), _turning(place, signals.time, chain)

    def _told(self, signals: Signals, speed, acceleration) -> Signals:
        return signals._replace(
            wheel_speed=jnp.maximum(speed, STANDING),
            acceleration_offset=signals.radius * acceleration - signals.vehicle_acceleration,
        )


def _turning(place: Place, time, chain) -> Turning:
    turning, dtype = place.rotation, place.rotation.speed.dtype
    tooth, passing = place.tooth.astype(dtype), place.passing.astype(dtype)
    return Turning(*turning, turning.angle, tooth, passing, time, chain)
