"""The smooth stand-in of an encoder's chain against the chain: delay and gain over wheel speed, and stops.

Delay and gain are measured: a wheel whose acceleration swings slowly, told by the edges of an encoder without errors,
and what of that swing comes through, and how late.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from absjax.encoder.edges import edges_of
from absjax.encoder.encoder import Encoder
from absjax.encoder.rotation import Rotation
from absjax.encoder.wheel_speed import WheelSpeedChain, estimate
from absjax.sensors.delayed import DelayedSensor
from absjax.signals import Signals
from tuning.encoder.chains import measured_chain

PERIOD, SECONDS, FREQUENCY, SWING = 1e-3, 2.0, 2.0, 20.0
"""s, s, Hz, rad/s^2"""
SPEEDS = (10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 80.0, 110.0, 150.0)
"""rad/s"""


class Response(NamedTuple):
    """What of a slow swing of the wheel's acceleration is told."""

    delay: float
    """s"""
    gain: float


def _response(time, told) -> Response:
    """From the second half of what is told, by least squares on the swing's frequency."""
    late = time > SECONDS / 2
    turning = 2 * np.pi * FREQUENCY
    basis = np.stack([np.sin(turning * time), np.cos(turning * time), np.ones_like(time)], axis=1)[late]
    sine, cosine, _ = np.linalg.lstsq(basis, np.asarray(told)[late], rcond=None)[0]
    return Response(float(np.arctan2(-cosine, sine) / turning), float(np.hypot(sine, cosine) / SWING))


def chain_response(chain: WheelSpeedChain, speed: float) -> Response:
    """Of a chain, at a wheel speed [rad/s]."""
    turning, time = 2 * np.pi * FREQUENCY, PERIOD * np.arange(1, round(SECONDS / PERIOD) + 1)
    angle = speed * time + SWING / turning * time - SWING / turning**2 * np.sin(turning * time)
    wheel = speed + SWING / turning * (1 - np.cos(turning * time))
    rotation = Rotation(*(jnp.asarray(x) for x in (angle, wheel, SWING * np.sin(turning * time))))
    edges = edges_of(Encoder.ideal(chain.stamping.teeth), rotation, PERIOD)
    found, _ = estimate(chain, edges, PERIOD)
    return _response(time, found.acceleration)


def stand_in_response(sensor: DelayedSensor, speed: float) -> Response:
    """Of the stand-in."""
    turning, time = 2 * np.pi * FREQUENCY, PERIOD * jnp.arange(1, round(SECONDS / PERIOD) + 1)

    def signals(t):
        wheel = speed + SWING / turning * (1 - jnp.cos(turning * t))
        return Signals(0.0 * t, 0.0 * t, wheel, SWING * jnp.sin(turning * t), 1.0 + 0.0 * t, 0.0 * t, 0.0 * t, t)

    def sample(state, t):
        told, state = sensor.measure(signals(t), state)
        return state, told.acceleration_offset

    _, told = jax.lax.scan(sample, sensor.begin(signals(jnp.zeros(())))[1], time)
    return _response(np.asarray(time), told)


def responses() -> list[dict[str, Any]]:
    """Delay and gain of time-stamping over 12 edges and of its stand-in, by wheel speed."""
    rows = []
    for speed in SPEEDS:
        chain = chain_response(measured_chain(60, 12), speed)
        stand_in = stand_in_response(DelayedSensor(60.0, 12.0), speed)
        rows.append(
            {
                "w [rad/s]": speed,
                "chain: delay [ms]": round(1e3 * chain.delay, 2),
                "stand-in: delay [ms]": round(1e3 * stand_in.delay, 2),
                "chain: gain": round(chain.gain, 3),
                "stand-in: gain": round(stand_in.gain, 3),
            }
        )
    return rows


def figure(rows: list[dict[str, Any]]):
    """Delay and gain over wheel speed."""
    drawn, axes = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    speed = [row["w [rad/s]"] for row in rows]
    for panel, what in zip(axes, ("delay [ms]", "gain")):
        panel.plot(speed, [row[f"chain: {what}"] for row in rows], "o-", label="time-stamping, n = 12")
        panel.plot(speed, [row[f"stand-in: {what}"] for row in rows], "k--", label="stand-in")
        panel.set(xlabel="wheel speed [rad/s]", ylabel=what)
        panel.legend()
    axes[0].set_ylim(0.0)
    axes[1].set_ylim(0.0, 1.1)
    return drawn
