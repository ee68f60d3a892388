"""Tyre curves from a log without measured force: output error by multiple shooting, the car's own quantities with them.

The log is cut into short intervals. In each, the wheel is rolled out from its own initial state under the logged
pressure, and the coefficients of all surfaces, the car's quantities and all initial states are fitted to the measured
wheel speed, vehicle speed and acceleration. Short intervals keep the oscillations of an anti-lock cycle from running
out of phase, and errors of the pressure from piling up.

    J w' = -R Fz mu(lambda) - gamma_b (P_l - P_0),     tau P_l' = P - P_l
    v' = g (mu(lambda) + s),  measured at t + d;        a = g mu(lambda) + b

with zero P_0 and lag tau of the pressure, delay d of the vehicle speed, bias b of the accelerometer and slope s of the
road, downhill > 0. A load Fz that the acceleration moves may follow it through a first-order lag too, the pitching of
the body. That the vehicle decelerates with the friction of this one wheel is the quarter car; where its load
is known to change, or on a rig, the vehicle's speed is taken as it was measured, and the second line is left out.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from tuning.logs.brake_log import BrakeLog
from tuning.logs.tables import LogError
from tuning.road.curve import Curve
from tuning.road.noise import noise_of
from tuning.road.samples import rate_of
from tuning.road.sampling import interval_of, measured
from tuning.road.sensitivities import OF_CAR, linearised
from tuning.road.vehicle_speed import ERRORS

INTERVAL, FEWEST = 0.05, 12
"""Length of a shooting interval [s]; samples it has at least."""
LONGEST_STEP = 5e-4
"""Of the Runge-Kutta steps [s]: a light wheel that rolls freely at walking pace asks for it."""
BUCKET = 32
"""Intervals are filled up to a multiple of it, so that logs of many lengths share a program."""
LOCKED = 0.05
"""R w / v below which an interval is left out: what a wheel does that stands is not in the equations."""
FEWEST_MEASURED = 4
"""Measurements of the wheel speed that an interval needs."""
LONGEST_SILENCE = 0.4
"""Share of an interval that may pass without a measurement of the wheel speed, as while its sensor is clipped."""
SMOOTHING = 0.06
"""Window over which the vehicle's deceleration is taken, to move its speed by a delay [s]."""
CAR = (*OF_CAR, "acceleration_bias", "speed_delay")
"""The car's quantities, in the order of the shared parameters after the coefficients."""
NUISANCE = tuple(f"speed_error_{k}" for k in range(1, ERRORS + 1))
"""What a speed taken from the acceleration is off, in standard deviations; after the car's quantities."""
SMALL = 1e-7
"""Difference of lags for the derivative by them [s]."""
SHARED = len(CAR) + len(NUISANCE)
OUTPUTS = ("wheel_speed", "vehicle_speed", "acceleration")


def lagged(signal: np.ndarray, period: float, lag: float) -> np.ndarray:
    """A signal behind a first-order lag [s], linear between samples; at rest in the beginning."""
    if lag < 1e-9:
        return signal
    z = period / lag
    decay = math.exp(-z)
    late = (1 - decay) / z
    head, tail = late - decay, 1 - late
    rest = lfilter([tail, head], [1.0, -decay], signal - signal[0])
    return signal[0] + np.asarray(rest)


def _and_slope(signal: np.ndarray, period: float, lag: float) -> tuple[np.ndarray, np.ndarray]:
    """A signal behind a lag, and its derivative by it."""
    now = lagged(signal, period, lag)
    return now, (lagged(signal, period, lag + SMALL) - now) / SMALL


class Shooting(NamedTuple):
    """Shooting intervals of a log; arrays with a leading axis of lanes, filled up to a multiple of `BUCKET`."""

    log: BrakeLog
    curve: Curve
    imposed: bool
    """whether the vehicle's speed is taken as measured"""
    index: np.ndarray
    """samples, (lanes, samples)"""
    surface: np.ndarray
    """which stretch it belongs to, (lanes,)"""
    weight: np.ndarray
    """of the outputs, 1 / noise where measured and 0 where not, (lanes, samples, 3)"""
    share: np.ndarray
    """load over its nominal value, (samples of the log,)"""
    radius: float
    """about that of the wheel, m"""
    errors: np.ndarray
    """what the vehicle's speed may be off, m/s, (samples of the log, `NUISANCE`)"""

    @property
    def used(self) -> np.ndarray:
        """Samples of the log that count, bool."""
        inside = np.zeros(len(self.log.time), bool)
        inside[self.index[np.any(self.weight > 0, axis=(1, 2))]] = True
        return inside

    def evaluate(self, surfaces: int, free: np.ndarray):
        """`(shared, own) -> residual, by shared, by own` for `arrow_fit`; of the shared those alone that are `free`,
        bool (parameters,)."""
        log, size, period = self.log, len(self.curve.names), self.log.period
        substeps = max(1, math.ceil(period / LONGEST_STEP - 1e-9))
        assert log.brake_pressure is not None
        pressure, rate = log.brake_pressure, rate_of(log, log.vehicle_speed, smoothing=SMOOTHING)
        zeros, errors = np.zeros(len(log.time)), self.errors[self.index].mean(axis=1)
        acceleration = (zeros if log.acceleration is None else log.acceleration)[self.index]
        wheel_speed, rate_there = log.wheel_speed[self.index], rate[self.index]
        first, states = surfaces * size, 1 if self.imposed else 2
        fitted, n = np.flatnonzero(free), 3 * self.index.shape[1]

        def evaluate(shared, own):
            car = dict(zip(CAR, shared[first:]))
            coefficients = shared[:first].reshape(surfaces, size)[self.surface]
            acting, by_lag = _and_slope(pressure, period, car["pressure_lag"])
            share, by_load_lag = _and_slope(self.share, period, car["load_lag"])
            # Interpolated between samples, noise would average out, and that would look like a better delay.
            speed = (log.vehicle_speed + car["speed_delay"] * rate)[self.index]
            speed = speed + (errors @ shared[first + len(CAR) :])[:, None]
            given = (*(x[self.index.T] for x in (acting, by_lag, share, by_load_lag)), speed.T)
            of_car = np.array([car[name] for name in OF_CAR])
            found = linearised(self.curve, self.imposed, substeps, period, coefficients.T, of_car, own.T, *given)
            values, slopes = (np.stack([np.asarray(x).T for x in some], axis=-1) for some in found)
            slopes = slopes.swapaxes(0, 1)
            measurements = np.stack([wheel_speed, speed, acceleration], axis=-1)
            bias = np.array([0.0, 0.0, car["acceleration_bias"]])
            with np.errstate(over="ignore", invalid="ignore"):
                residual = np.where(self.weight > 0, (values + bias - measurements) * self.weight, 0.0)
            by_offset = slopes[size + len(OF_CAR)] if self.imposed else -np.array([0.0, 1.0, 0.0])
            # The derivatives by one parameter lie together: what follows takes them by columns.
            by_shared = np.zeros((len(fitted), *residual.shape))
            for k, at in enumerate(fitted):
                if at < first:
                    there = self.surface == at // size
                    by_shared[k, there] = slopes[at % size, there]
                elif at < first + len(OF_CAR):
                    by_shared[k] = slopes[size + at - first]
                elif at == first + CAR.index("acceleration_bias"):
                    by_shared[k, ..., 2] = 1.0
                elif at == first + CAR.index("speed_delay"):
                    by_shared[k, ..., 1] = -rate_there
                else:
                    by_shared[k] = by_offset * errors[:, at - first - len(CAR), None, None]
            lanes = len(residual)
            by_shared, by_own = (
                (x * self.weight).reshape(-1, lanes, n).transpose(1, 2, 0) for x in (by_shared, slopes[-states:])
            )
            return residual.reshape(lanes, n), by_shared, by_own

        return evaluate

    def start(self) -> np.ndarray:
        """Own states (lanes, states) by which the fit begins: smooth curves through each interval's speeds."""
        clock = np.arange(self.index.shape[1]) * self.log.period
        spin = np.polyfit(clock, self.log.wheel_speed[self.index].T, 3)[-1]
        if self.imposed:
            return spin[:, None]
        return np.stack([spin, np.polyfit(clock, self.log.vehicle_speed[self.index].T, 1)[-1]], axis=1)

    def with_noise(self, noise: dict[str, float]) -> "Shooting":
        """With other standard deviations of the outputs."""
        level = np.array([noise.get(name, 1.0) for name in OUTPUTS])
        return self._replace(weight=(self.weight > 0) / level)

    def levels(self, residual: np.ndarray) -> dict[str, float]:
        """Root mean square of each output's residuals, in its unit, from whitened ones (lanes, residuals)."""
        whitened = residual.reshape(self.weight.shape)
        found = {}
        for i, name in enumerate(OUTPUTS):
            on = self.weight[..., i] > 0
            if on.any():
                lanes = np.any(on, axis=1).sum()
                spare = max(int(on.sum() - lanes * (2 if i == 0 else 1)), 1)
                found[name] = float(np.sqrt(np.sum(whitened[..., i][on] ** 2) / spare) / self.weight[..., i][on][0])
        return found


def shooting(
    curve: Curve,
    log: BrakeLog,
    stretches: list[np.ndarray],
    radius: float,
    share: np.ndarray | None = None,
    errors: np.ndarray | None = None,
) -> Shooting:
    """Cut a log into intervals.

    Args:
        curve: the kind of curve.
        log: the log, uniformly sampled.
        stretches: samples of each surface that may be used, bool (samples,).
        radius: about that of the wheel [m].
        share: load over its nominal value, (samples,), where it changes or the vehicle's speed is imposed; None: the
            quarter car.
        errors: what the vehicle's speed may be off [m/s], (samples, `NUISANCE`); None: nothing.

    Raises:
        LogError: if there is no interval with enough measurements.
    """
    rarely = (FEWEST_MEASURED + 1) * interval_of(log, "wheel_speed")
    length = max(FEWEST, round(max(INTERVAL, rarely) / log.period))
    slipping = radius * log.wheel_speed / log.vehicle_speed > LOCKED
    turning = measured(log, "wheel_speed")
    index, surface = [], []
    for number, inside in enumerate(stretches):
        at = np.flatnonzero(inside)
        if not len(at):
            continue
        for first in range(at[0], at[-1] - length + 1, length):
            lane = np.arange(first, first + length + 1)
            told = np.flatnonzero(turning[lane])
            if len(told) < FEWEST_MEASURED or np.diff(np.r_[-1, told, length + 1]).max() > LONGEST_SILENCE * length:
                continue
            if inside[lane].all() and slipping[lane].all():
                index.append(lane)
                surface.append(number)
    if not index:
        raise LogError(
            f"{log.name}: nowhere {length * log.period:.2g} s with {FEWEST_MEASURED} measurements of the speed of a "
            "turning wheel, on one surface; the output error needs them"
        )
    lanes = max(BUCKET, -(-len(index) // BUCKET) * BUCKET)
    filling = lanes - len(index)
    index += [np.arange(length + 1)] * filling
    surface += [0] * filling
    table = np.array(index)
    inside = np.any(stretches, axis=0)
    weight = np.zeros((*table.shape, 3))
    for i, name in enumerate(OUTPUTS):
        if getattr(log, name) is not None and not (share is not None and i > 0):
            weight[..., i] = measured(log, name)[table] / noise_of(log, name, inside)
    weight[lanes - filling :] = 0.0
    nominal = np.ones(len(log.time)) if share is None else share
    errors = np.zeros((len(log.time), len(NUISANCE))) if errors is None else errors
    return Shooting(log, curve, share is not None, table, np.array(surface), weight, nominal, radius, errors)
