"""Logs side by side, and the errors of an estimator on them.

Errors count from `SETTLE` on: root mean square of the longitudinal and lateral velocity and of side-slip, and the
largest error of side-slip.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.lanes import stacked
from absjax.sideslip.base import Estimate, Estimator
from absjax.sideslip.car import Car
from absjax.sideslip.run import Estimates, PaddedLogs, estimate_logs, padded
from tuning.logs.recording import LogError
from tuning.logs.vehicle_log import VehicleLog

SETTLE = 1.0
"""s"""
SMALLEST = 1e-5
"""Error below which none is told from another: rad, and m/s."""


class Errors(NamedTuple):
    """Of an estimator on logs, arrays (logs,)."""

    longitudinal_speed: Any
    """rms [m/s]"""
    lateral_speed: Any
    """rms [m/s]"""
    side_slip: Any
    """rms [rad]"""
    largest_side_slip: Any
    """rad"""


class LogSet(NamedTuple):
    """Logs side by side with their cars and their truth."""

    names: tuple[str, ...]
    cars: Car
    logs: PaddedLogs
    truth: Any
    """(vx, vy, side-slip), arrays (logs, samples)"""
    counts: Any
    """bool (logs, samples): whether errors count"""
    period: float
    lengths: tuple[int, ...]

    @classmethod
    def of(cls, logs: Sequence[VehicleLog], cars: Sequence[Car]) -> "LogSet":
        """Logs with a truth, of one sampling period.

        Raises:
            LogError: if there are none, one has no true velocities, periods differ, or a log ends before it counts.
        """
        if not logs:
            raise LogError("no logs are given")
        period = logs[0].period
        for log in logs:
            if abs(log.period - period) > 1e-3 * period:
                raise LogError(
                    f"{log.name}: sampled every {log.period:g} s, {logs[0].name} every {period:g} s; "
                    "one period is needed"
                )
            if log.time[-1] - log.time[0] <= SETTLE:
                raise LogError(f"{log.name}: {log.time[-1] - log.time[0]:.3g} s, more than {SETTLE:g} s are needed")
        beside = padded([log.samples for log in logs])
        longest = beside.valid.shape[1]
        columns = [(log.truth["longitudinal_speed"], log.truth["lateral_speed"], log.true_side_slip) for log in logs]
        truth = tuple(
            np.stack([np.pad(column, (0, longest - len(column)), mode="edge") for column in of_all])
            for of_all in zip(*columns)
        )
        counts = beside.valid & (np.arange(longest) >= round(SETTLE / period))
        names = tuple(log.name for log in logs)
        return cls(names, stacked(cars), beside, truth, counts, period, tuple(len(log.time) for log in logs))

    def nameless(self) -> "LogSet":
        """As programs take it: without what is no number."""
        return self._replace(names=(), lengths=())

    def of_members(self, members) -> "LogSet":
        """Some of the logs, by their indices; traceable."""
        cars, logs, truth, counts = jax.tree.map(
            lambda leaf: jnp.asarray(leaf)[members], (self.cars, self.logs, self.truth, self.counts)
        )
        return self._replace(cars=cars, logs=logs, truth=truth, counts=counts)

    def run(self, estimator: Estimator) -> Estimates:
        """The estimator on all logs at once; traceable."""
        return estimate_logs(estimator, self.cars, self.logs, self.period)

    def errors(self, estimate: Estimate) -> Errors:
        """Errors of estimates (logs, samples); traceable."""
        vx, vy, beta = self.truth
        n = jnp.sum(self.counts, axis=1)

        def rms(difference):
            return jnp.sqrt(jnp.sum(jnp.where(self.counts, difference, 0.0) ** 2, axis=1) / n + SMALLEST**2)

        slip = estimate.side_slip - beta
        slip = jnp.arctan2(jnp.sin(slip), jnp.cos(slip))
        return Errors(
            rms(estimate.longitudinal_speed - vx),
            rms(estimate.lateral_speed - vy),
            rms(slip),
            jnp.max(jnp.where(self.counts, jnp.abs(slip), 0.0), axis=1),
        )

    def losses(self, estimator: Estimator):
        """Mean logarithm of the rms errors of side-slip [deg] and of the lateral velocity [m/s], (logs,); traceable."""
        errors = self.errors(self.run(estimator).estimate)
        return (jnp.log(jnp.rad2deg(errors.side_slip)) + jnp.log(errors.lateral_speed)) / 2


@jax.jit
def _errors(logs, estimator):
    return logs.errors(logs.run(estimator).estimate)


def errors_of(logs: LogSet, estimator: Estimator) -> Errors:
    """Errors of an estimator on logs, arrays of NumPy (logs,)."""
    return Errors(*map(np.asarray, _errors(*jax.tree.map(jnp.asarray, (logs.nameless(), estimator)))))
