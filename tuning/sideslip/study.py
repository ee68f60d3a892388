"""One log studied: the estimates, what they are based on, and where the log tells the friction."""

import dataclasses
from typing import Any

import jax
import numpy as np

from absjax.sideslip.base import Estimate, Estimator, Insight
from absjax.sideslip.car import Car
from absjax.sideslip.excitation import PATTERNS, Excitation, excitation, intervals
from absjax.sideslip.observer import SideSlipObserver
from absjax.sideslip.run import estimate
from tuning.logs.vehicle_log import VehicleLog
from tuning.sideslip.bench import SETTLE

WITHIN = 0.1
"""Error of theta up to which it counts as right."""


@dataclasses.dataclass(frozen=True)
class LogStudy:
    """An estimator on a log; arrays (samples,)."""

    log: VehicleLog
    estimator: Estimator
    estimate: Estimate
    insight: Insight | None
    """None of an estimator that tells nothing"""
    excitation: Excitation | None
    """None without an insight"""
    implied: np.ndarray | None
    """theta by (2) at the true velocities; None without an insight or the truth"""

    @property
    def offsets(self):
        """Adapted offsets; None where they are not adapted."""
        return None if self.insight is None else self.insight.offsets

    @property
    def applied_bank(self) -> np.ndarray:
        """The bank that is taken off [rad]; only where offsets are adapted."""
        offsets = self.offsets
        assert (
            isinstance(self.estimator, SideSlipObserver) and self.estimator.offsets is not None and offsets is not None
        )
        return np.asarray(self.estimator.offsets.applied(offsets))

    def columns(self) -> dict[str, np.ndarray]:
        """The estimates as a table: a column a signal, with its unit."""
        found: dict[str, Any] = {
            "time_s": self.log.time,
            "vx_m_s": self.estimate.longitudinal_speed,
            "vy_m_s": self.estimate.lateral_speed,
            "yaw_rate_rad_s": self.estimate.yaw_rate,
            "side_slip_rad": self.estimate.side_slip,
            "friction": self.estimate.friction,
        }
        if self.offsets is not None:
            found["bank_rad"] = self.offsets.bank
            found["bank_beyond_biases_rad"] = self.applied_bank
            found["lateral_bias_m_s2"] = self.offsets.lateral_bias
            found["longitudinal_bias_m_s2"] = self.offsets.longitudinal_bias
        if self.insight is not None and self.excitation is not None:
            found |= {
                "xi_n_s_m": self.insight.xi,
                "lambda": self.insight.scaling,
                "force_slope_n_s_m": self.insight.slope,
                "low_excitation": np.asarray(self.insight.low).astype(int),
                "excitation_determinant_m2_s4": self.excitation.determinant,
                "excitation_eigenvalue_m2_s3": self.excitation.eigenvalue,
                "friction_deviation": self.excitation.deviation,
                "pattern": self.excitation.pattern,
                "identifiable": self.excitation.identifiable.astype(int),
            }
        return {name: np.asarray(column) for name, column in found.items()}

    def errors(self) -> dict[str, float]:
        """Errors against the truth, from `SETTLE` on; empty where the log has none."""
        if "lateral_speed" not in self.log.truth or "longitudinal_speed" not in self.log.truth:
            return {}
        counts = np.arange(len(self.log.time)) >= round(SETTLE / self.log.period)
        slip = np.degrees(np.asarray(self.estimate.side_slip) - self.log.true_side_slip)[counts]
        truth, vx, vy = self.log.truth, self.estimate.longitudinal_speed, self.estimate.lateral_speed
        found = {
            "vx rms [m/s]": _rms((np.asarray(vx) - truth["longitudinal_speed"])[counts]),
            "vy rms [m/s]": _rms((np.asarray(vy) - truth["lateral_speed"])[counts]),
            "side-slip rms [deg]": _rms(slip),
            "side-slip, largest [deg]": float(np.abs(slip).max()),
        }
        if self.excitation is not None and "friction" in truth:
            told = self.excitation.identifiable & counts
            against = {"friction of the road": truth["friction"]}
            if self.implied is not None:
                against["theta of (2)"] = self.implied
            for name, real in against.items():
                off = np.abs(np.asarray(self.estimate.friction) - real)[told & np.isfinite(real)]
                if off.size:
                    found[f"theta off {name}, median"] = float(np.median(off))
                    found[f"share within 0.1 of {name}"] = float(np.mean(off < WITHIN))
        return found

    def verdicts(self) -> dict[str, list[dict[str, Any]]]:
        """Intervals of time: the driving pattern, whether theta can be told, and whether the monitor says low."""
        if self.excitation is None or self.insight is None:
            return {}
        time, low = self.log.time, np.asarray(self.insight.low).astype(int)
        patterns = intervals(self.excitation.pattern, time)
        told = intervals(self.excitation.identifiable.astype(int), time)
        monitor = intervals(low, time)
        return {
            "pattern": [{"from": a, "to": b, "pattern": PATTERNS[code]} for a, b, code in patterns],
            "friction": [{"from": a, "to": b, "identifiable": bool(code)} for a, b, code in told],
            "monitor": [{"from": a, "to": b, "excited": not code} for a, b, code in monitor],
        }

    def signs(self) -> dict[str, float]:
        """Whether the assumptions on the run hold: the largest df_y*/dvy, the smallest and largest xi and Lambda."""
        if self.insight is None:
            return {}
        xi, scale, slope = (np.asarray(x) for x in (self.insight.xi, self.insight.scaling, self.insight.slope))
        return {
            "largest df_y*/dvy [N s/m]": float(slope.max()),
            "share of samples where it is positive": float(np.mean(slope > 0)),
            "smallest xi [N s/m]": float(xi.min()),
            "largest xi [N s/m]": float(xi.max()),
            "smallest Lambda": float(scale.min()),
            "largest Lambda": float(scale.max()),
        }


def implied_friction(log: VehicleLog, car: Car, observer: SideSlipObserver) -> np.ndarray:
    """m ay / f_y* at the true velocities, (samples,); NaN where the tyres hardly carry anything to the side."""

    def one(sample, vx, vy, r):
        level = observer.accelerometer.level(sample)
        return car.mass * level.lateral_acceleration, observer.forces(car, (vx, vy, r), level).lateral

    truth = (log.truth["longitudinal_speed"], log.truth["lateral_speed"], log.truth["yaw_rate"])
    measured, force = map(np.asarray, jax.vmap(one)(log.samples, *truth))
    carries = np.abs(force) > 0.1 * float(car.mass) * 9.81
    return np.where(carries, measured / np.where(carries, force, 1.0), np.nan)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def study_log(log: VehicleLog, car: Car, estimator: Estimator) -> LogStudy:
    """Run an estimator over a log.

    Raises:
        RolloutError: if the estimates leave the finite numbers.
    """
    found = estimate(estimator, car, log.samples, log.period).raise_if_failed()
    told = jax.tree.map(np.asarray, found.estimate)
    if not isinstance(estimator, SideSlipObserver):
        return LogStudy(log, estimator, told, None, None, None)
    told_by = excitation(estimator, car, log.samples, found.estimate, log.period, within=WITHIN)
    known = {"longitudinal_speed", "lateral_speed", "yaw_rate"} <= set(log.truth)
    implied = implied_friction(log, car, estimator) if known else None
    return LogStudy(log, estimator, told, jax.tree.map(np.asarray, found.insight), told_by, implied)
