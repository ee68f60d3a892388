"""Edges of simulated encoders on wheels that turn in known ways, and the errors a chain makes on them.

The two references of Aguado-Rojas 2019, Table 6.1: constant speed, 1020 rpm, and a varying one, of which the source
does not say how; here levels between 30 and 107 rad/s, held for 1 s and joined in 1.5 s, at up to 96 rad/s^2. A third
one rolls freely at 130 km/h, then brakes under five phases on dry concrete.
"""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.encoder.edges import Edges, edges_of
from absjax.encoder.encoder import Encoder
from absjax.encoder.rotation import Rotation
from absjax.encoder.wheel_speed import WheelSpeedChain, estimate
from tuning.encoder.chains import SIGNALS
from tuning.encoder.loop import PERIOD, braked_wheel

SPEED = 1020 * 2 * np.pi / 60
"""Of the constant reference, rad/s."""
LEVELS = (107.0, 40.0, 80.0, 30.0, 107.0, 60.0, 90.0, 50.0)
"""Speeds of the varying reference, rad/s."""
HELD, JOINED = 1.0, 1.5
"""Time for which a level is held, and from one to the next, s."""
BRAKED = 2.5
"""Longest braking of that reference, s."""
REFERENCES = ("constant", "varying", "braking")
Reference = Literal["constant", "varying", "braking"]


def reference(name: str, duration: float) -> Rotation:
    """How the wheel turns, arrays (samples,), under one of `REFERENCES`; half of `braking` is before the brake.

    Raises:
        ValueError: if there is no such reference.
    """
    time = PERIOD * np.arange(round(duration / PERIOD))
    if name == "constant":
        return Rotation.of_speed(np.full(time.size, SPEED), np.zeros(time.size), PERIOD)
    if name == "varying":
        turns = int(duration // (HELD + JOINED)) + 1
        begins = (HELD + JOINED) * np.arange(turns + 1)
        knots = np.stack([begins, begins + HELD], axis=1).ravel()
        return joined(knots, np.repeat(np.resize(LEVELS, turns + 1), 2), duration)
    if name == "braking":
        rolling = time.size // 2
        speed, acceleration = braked_wheel(time.size - rolling)
        speed = np.concatenate([np.full(rolling, speed[0]), speed])
        return Rotation.of_speed(speed, np.concatenate([np.zeros(rolling), acceleration]), PERIOD)
    raise ValueError(f"reference {name!r} is unknown; there are {', '.join(REFERENCES)}")


def joined(instants, speeds, duration: float) -> Rotation:
    """Speeds [rad/s] at instants [s], joined by quintic polynomials without acceleration at either end; held after."""
    time = PERIOD * np.arange(round(duration / PERIOD))
    instants, speeds = np.append(instants, np.inf), np.append(speeds, speeds[-1])
    part = np.searchsorted(instants, time, side="right") - 1
    length, rise = np.diff(instants)[part], np.diff(speeds)[part]
    share = (time - instants[part]) / length
    speed = speeds[part] + rise * share**3 * (10 + share * (-15 + 6 * share))
    return Rotation.of_speed(speed, rise * 30 * share**2 * (1 - share) ** 2 / length, PERIOD)


class Bench(NamedTuple):
    """Edges of encoders under a reference, and the truth."""

    edges: Edges
    """(encoders, samples, capacity), ages in s"""
    truth: Rotation
    """(samples,)"""
    counts: jax.Array
    """samples on which errors count, bool (samples,)"""

    def of(self, members: Any) -> "Bench":
        """Some of the encoders, (members,); traceable."""
        return self._replace(edges=jax.tree.map(lambda x: jnp.take(x, members, axis=0), self.edges))

    def errors(self, chain: WheelSpeedChain) -> tuple[jax.Array, jax.Array]:
        """Rms error of speed [rad/s] and acceleration [rad/s^2] of each encoder, (encoders,); traceable."""
        found, _ = estimate(chain, self.edges, PERIOD)
        speed, acceleration = (
            jnp.sqrt(jnp.mean((getattr(found, s) - getattr(self.truth, s)) ** 2, axis=-1, where=self.counts))
            for s in SIGNALS
        )
        return speed, acceleration


def bench_of(encoder: Encoder, name: str, duration: float, settle: float) -> Bench:
    """Encoders (lanes) under a reference; errors count from `settle` [s] on."""
    rotation = reference(name, duration)
    time = PERIOD * np.arange(rotation.speed.size)
    return Bench(edges_of(encoder, rotation, PERIOD), rotation, jnp.asarray(time >= settle))


@jax.jit
def _errors(bench: Bench, chain: WheelSpeedChain):
    return bench.errors(chain)


def mean_errors(bench: Bench, chain: WheelSpeedChain) -> tuple[float, float]:
    """Rms error of speed [rad/s] and acceleration [rad/s^2], mean over the encoders."""
    speed, acceleration = _errors(bench, chain)
    return float(speed.mean()), float(acceleration.mean())


def ratio_rows(bench: Bench, chains: Mapping[str, WheelSpeedChain], **about: Any) -> list[dict[str, Any]]:
    """Rms errors of the chains, mean over encoders, and how many times smaller than those of the first chain.

    Args:
        about: columns that stand before, the same in every row.
    """
    rows, measured = [], None
    for label, chain in chains.items():
        errors = mean_errors(bench, chain)
        measured = measured or errors
        row = {**about, "signals": label}
        for signal, error, before in zip(SIGNALS, errors, measured):
            row |= {f"{signal} rms": round(error, 4), f"{signal} ratio": round(before / error, 2)}
        rows.append(row)
    return rows
