"""A tyre curve from a log without measured force: output error by multiple shooting.

The log is cut into short intervals. In each, the car (or the wheel on a rig) is rolled out from its own
initial state under the logged pressure, and the coefficients and all initial states are fitted to the
measured wheel speed, vehicle speed and acceleration. Short intervals keep the oscillations of an
anti-lock cycle from running out of phase, and errors of the pressure from piling up.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from absjax.hybrid.rollout import rollout
from absjax.hybrid.system import Smooth
from absjax.parameters import model, parameter, part
from absjax.plant.quarter_car import CarState, QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.test_rig import RigState, TestRig
from absjax.plant.wheel import Wheel
from tuning.logs.brake_log import BrakeLog
from tuning.road.arrow_fit import Fit, arrow_fit
from tuning.road.curve import Curve
from tuning.road.curve_fit import white_noise
from tuning.road.samples import is_rig

INTERVAL = 0.05
"""Length of a shooting interval [s]."""


@model
class DrivenPlant(Smooth):
    """A plant under a logged brake pressure, linear between samples."""

    plant: Any = part("quarter car or test rig")
    pressure: Any = parameter("brake pressure at 0, period, 2 period, ..., bar, shape (samples,)", ndim=1)
    period: Any = parameter("sampling period, s", low=0.0, open_low=True)

    def flow(self, time, state, mode):
        """d(state)/dt."""
        position = time / self.period
        index = jnp.clip(jnp.floor(position).astype(jnp.int32), 0, self.pressure.shape[0] - 2)
        share = position - index
        pressure = (1 - share) * self.pressure[index] + share * self.pressure[index + 1]
        return self.plant.flow(time, state, pressure)


def fit_output_error(curve: Curve, log: BrakeLog, wheel: Wheel, inside: np.ndarray, start) -> Fit:
    """Fit the coefficients of a curve to the stretch of the log where `inside` holds.

    Args:
        curve: the kind of curve.
        log: the log, uniformly sampled.
        wheel: wheel, load and brake.
        inside: samples that may be used, bool (samples,), one stretch.
        start: coefficients.
    """
    period, length = log.period, max(8, round(INTERVAL / log.period))
    used = np.flatnonzero(inside)
    lanes = (len(used) - 1) // length
    first = used[0] + np.arange(lanes) * length
    index = first[:, None] + np.arange(length + 1)
    rig = is_rig(log)
    channels = [("wheel_speed", 0)] if rig else [("wheel_speed", 0), ("vehicle_speed", 1)]
    if not rig and log.acceleration is not None:
        channels.append(("acceleration", 2))
    weights = [1 / white_noise(getattr(log, name)[inside]) for name, _ in channels]
    measured = np.stack([getattr(log, name)[index] for name, _ in channels], axis=-1)
    speeds = log.vehicle_speed[index]
    clock = np.arange(length + 1) * period
    trend = np.polyfit(clock, speeds.T, 1)
    pressure = jnp.asarray(log.brake_pressure[index])

    def outputs(coefficients, own):
        road = UniformRoad(curve.tyre(coefficients))
        if rig:
            plant = TestRig(wheel, road, jnp.asarray(trend[1]), jnp.asarray(trend[0]))
            state = RigState(own[:, 0])
        else:
            plant = QuarterCar(wheel, road)
            state = CarState(own[:, 1], own[:, 0], jnp.zeros(lanes))
        driven = DrivenPlant(plant, pressure, period)
        path = rollout(driven, state, step=period, steps=length, save_every=1).path.state
        if rig:
            return path.wheel_speed[..., None]
        slip = wheel.slip(path.wheel_speed, path.speed)
        acceleration = curve.tyre(c[:, None] for c in coefficients).friction(slip) * (wheel.load / wheel.mass)
        return jnp.stack([path.wheel_speed, path.speed, acceleration], axis=-1)[..., : len(channels)]

    states, size = 1 if rig else 2, len(curve.names)

    @jax.jit
    def linearised(shared, own):
        spread = [jnp.full(lanes, c) for c in shared]
        directions = jnp.eye(size + states)

        def along(direction):
            along_shared = [jnp.full(lanes, direction[i]) for i in range(size)]
            tangent = (along_shared, jnp.broadcast_to(direction[size:], own.shape))
            return jax.jvp(outputs, (spread, own), tangent)

        values, slopes = jax.vmap(along, out_axes=(None, -1))(directions)
        return values, slopes

    scale = np.asarray(weights)

    def evaluate(shared, own):
        values, slopes = map(np.asarray, linearised(jnp.asarray(shared), jnp.asarray(own)))
        residual = ((values - measured) * scale).reshape(lanes, -1)
        slopes = (slopes * scale[:, None]).reshape(lanes, residual.shape[1], -1)
        return residual, slopes[..., :size], slopes[..., size:]

    fitted = np.polyfit(clock, log.wheel_speed[index].T, 3)[-1]
    own = fitted[:, None] if rig else np.stack([fitted, trend[1]], axis=1)
    return arrow_fit(evaluate, np.asarray(start, float), own, lower=curve.lower + 1e-6)
