"""What a fit of a log comes to, whichever way it was fitted."""

import dataclasses
from collections.abc import Callable

import numpy as np

from tuning.logs.brake_log import BrakeLog
from tuning.logs.car import Car
from tuning.logs.quantities import KINDS, Quantity
from tuning.road.changes import Stretch, refine_change
from tuning.road.conditions import Start
from tuning.road.corrected import corrected
from tuning.road.curve import Curve
from tuning.road.samples import FrictionSamples, friction_samples

GUARD = 0.03
"""Time kept clear of the middle of a change [s]."""
Say = Callable[[str], None]


@dataclasses.dataclass(frozen=True)
class FittedStretch:
    """The curve of one surface."""

    start: float
    """s"""
    end: float
    """s"""
    coefficients: np.ndarray
    """(coefficients,)"""
    covariance: np.ndarray
    """(coefficients, coefficients)"""
    peak_friction: float
    largest_slip: float
    residual_rms: float
    """over the noise of the channels themselves"""
    samples: int
    side: str = "braking"
    profile: dict[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    """by coefficient, how far the sum of squares rises where its interval ends, below and above, over what the
    covariance says: the root of it, 1 where the sum is a parabola; empty where it was not looked for"""


@dataclasses.dataclass(frozen=True)
class Fitted:
    """All of it."""

    stretches: list[FittedStretch]
    blends: list[float]
    """length of each change [s]"""
    quantities: dict[str, Quantity]
    misfit: dict[str, float]
    """by channel, root mean square of the residuals over the channel's own noise"""
    method: str
    imposed: bool
    """whether the vehicle's speed was taken as measured"""
    notes: list[str]


def samples_as_fitted(start: Start, car: Car, values: dict[str, float]) -> tuple[BrakeLog, FrictionSamples]:
    """The log and its points of the friction curve with quantities as they are known by now.

    The delay of the vehicle's speed is out of the log already.
    """
    wheel = {name: values[name] for name in KINDS if KINDS[name].wheel}
    log = corrected(start.log, {**values, "speed_delay": values["speed_delay"] - start.values["speed_delay"]})
    return log, friction_samples(log, dataclasses.replace(car.wheel, **wheel), start.load_behind(values["load_lag"]))


def clear_of_changes(time: np.ndarray, stretches: list[Stretch]) -> list[np.ndarray]:
    """Samples of each stretch that are `GUARD` clear of every change, bool (samples,)."""
    clear = np.ones(len(time), bool)
    for stretch in stretches[1:]:
        clear &= np.abs(time - time[stretch.first]) > GUARD
    at = np.arange(len(time))
    return [clear & (at >= stretch.first) & (at < stretch.last) for stretch in stretches]


def changes_of(curve: Curve, samples: FrictionSamples, stretches, coefficients) -> list[tuple[float, float]]:
    """Beginning and length of every change [s], between curves of coefficients (surfaces, coefficients)."""
    tyres = [curve.tyre(map(float, c)) for c in coefficients]
    return [refine_change(samples, tyres[i], tyres[i + 1], stretches[i + 1].first) for i in range(len(stretches) - 1)]


def peak_of(curve: Curve, coefficients: np.ndarray) -> float:
    """Peak friction."""
    return float(curve.tyre(map(float, coefficients)).peak().friction)


def peak_slip_of(curve: Curve, coefficients: np.ndarray) -> float:
    """Slip of the peak, a magnitude."""
    return float(curve.tyre(map(float, coefficients)).peak().slip)


def anyones_guess(coefficients: np.ndarray, widths: np.ndarray) -> bool:
    """Whether a log says nothing of a curve: its largest coefficient is not known to within itself."""
    most = int(np.argmax(np.abs(coefficients)))
    return not widths[most] < abs(coefficients[most])


def largest_slip(slip: np.ndarray) -> float:
    """Largest magnitude, but for one in a thousand; 0 of none."""
    return float(np.quantile(np.abs(slip), 0.999)) if len(slip) else 0.0


def told_of(curve: Curve, coefficients: np.ndarray) -> str:
    """Coefficients (surfaces, coefficients) in words."""
    return "; ".join(", ".join(f"{name} {value:.4g}" for name, value in zip(curve.names, c)) for c in coefficients)
