"""What estimators of the vehicle's speed are worth before and after tuning, and what makes the published error."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import root_scalar

from absjax.speed.base import SpeedEstimator
from absjax.speed.kalman import KalmanSpeed
from tuning.speed.bench import Bench, errors_of
from tuning.speed.estimators import title_of, with_values
from tuning.speed.stops import Told

PUBLISHED_ERROR = 0.18
"""Mean error of the speed, underestimated. Source: Aguado-Rojas 2019, section 3.6."""
WIDEST = 1e4
"""Factor by which the gates of a filter are opened so that a wheel is trusted while it slips."""
GATES = ("below", "above", "deviation")
ROLLS = 0.25
"""Of the published scenario, before the pedal is touched [s]."""


def rounded(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row with numbers of four digits."""
    return {key: float(f"{value:.4g}") if isinstance(value, float) else value for key, value in row.items()}


def error_row(bench: Bench, estimator: SpeedEstimator, suffix: str = "") -> dict[str, float]:
    """Errors over all stops: means, and the largest."""
    errors = errors_of(bench, estimator)
    return {
        f"mean error{suffix} [%]": 100 * float(errors.relative.mean()),
        f"rms{suffix} [m/s]": float(errors.rms.mean()),
        f"largest{suffix} [m/s]": float(errors.largest.max()),
    }


def error_rows(bench: Bench, sets: Mapping[str, tuple[SpeedEstimator, SpeedEstimator]]) -> list[dict[str, Any]]:
    """A row an estimator, before and after tuning; `sets` by name."""
    return [
        rounded(
            {"estimator": title_of(name)} | error_row(bench, before, ", before") | error_row(bench, after, ", after")
        )
        for name, (before, after) in sets.items()
    ]


def road_rows(
    bench: Bench, groups: Sequence[str], sets: Mapping[str, tuple[SpeedEstimator, SpeedEstimator]]
) -> list[dict[str, Any]]:
    """Mean error [%] of the tuned estimators, a row a group of stops; `groups` (stops,)."""
    errors = {title_of(name): errors_of(bench, after).relative for name, (_, after) in sets.items()}
    every = np.array(groups)
    return [
        rounded({"road": group} | {title: 100 * float(of[every == group].mean()) for title, of in errors.items()})
        for group in dict.fromkeys(groups)
    ]


def rolling_rows(
    told: Told, sets: Mapping[str, tuple[SpeedEstimator, SpeedEstimator]], seconds: Sequence[float]
) -> list[dict[str, Any]]:
    """Mean error [%] of the tuned estimators over how long the wheels roll before a stop begins.

    The filter finds the bias while they do, and coasts on it later.
    """
    rows = []
    for more in seconds:
        bench = Bench.of(told.after_rolling(more))
        errors = {title_of(n): 100 * float(errors_of(bench, after).relative.mean()) for n, (_, after) in sets.items()}
        rows.append(rounded({"rolls before [s]": more + ROLLS} | errors))
    return rows


def opened(estimator: KalmanSpeed, factor: float) -> KalmanSpeed:
    """The filter with its gates wider by a factor, and its slip per braking smaller: the larger, the more a wheel is
    trusted while it slips, as if it rolled."""
    wider = {gate: getattr(estimator, gate) * factor for gate in GATES}
    return with_values(estimator, wider | {"slip": estimator.slip / factor})


def gates_for(bench: Bench, estimator: KalmanSpeed, error: float = PUBLISHED_ERROR) -> float | None:
    """The factor on the gates that gives a mean relative error; None where even `WIDEST` does not."""

    def beyond(logarithm):
        return float(errors_of(bench, opened(estimator, math.exp(logarithm))).relative.mean()) - error

    if beyond(0.0) >= 0 or beyond(math.log(WIDEST)) <= 0:
        return None
    return math.exp(root_scalar(beyond, bracket=(0.0, math.log(WIDEST)), xtol=1e-4).root)


def gate_rows(bench: Bench, estimator: KalmanSpeed, error: float = PUBLISHED_ERROR) -> list[dict[str, Any]]:
    """What trusting a wheel while it slips costs: errors over the factor on the gates, that of `error` among them."""
    factor = gates_for(bench, estimator, error)
    rows, factors = [], [1.0, 2.0, 5.0, 20.0, WIDEST] + ([] if factor is None else [factor])
    for wide in sorted(factors):
        given = opened(estimator, wide)
        under = -100 * float(errors_of(bench, given).signed.mean())
        said = "the published error" if wide == factor else "as tuned" if wide == 1 else ""
        values = {gate: float(getattr(given, gate)) for gate in GATES}
        rows.append(rounded({"gates wider by": wide, **error_row(bench, given), "too low by [%]": under, **values}))
        rows[-1]["setting"] = said
    return rows


def parameter_rows(sets: Mapping[str, tuple[Any, Any]], tuned: Mapping[str, Sequence[str]]) -> list[dict[str, Any]]:
    """Tuned parameters before and after; `tuned`: names by estimator, with a `*` where they lie on a limit."""
    rows = []
    for name, parameters in tuned.items():
        before, after = sets[name]
        for parameter in parameters:
            plain = parameter.rstrip("*")
            pair = {"before": float(getattr(before, plain)), "after": float(getattr(after, plain))}
            rows.append(rounded({"estimator": title_of(name), "parameter": parameter, **pair}))
    return rows


@dataclasses.dataclass(frozen=True)
class Traces:
    """A stop to be drawn; arrays (samples,)."""

    time: np.ndarray
    speed: np.ndarray
    rims: np.ndarray
    """(samples, wheels)"""
    estimates: dict[str, np.ndarray]
    """by title"""


def traces(bench: Bench, time: np.ndarray, estimators: Mapping[str, SpeedEstimator]) -> Traces:
    """The first stop of a bench, up to its end."""
    last = int(np.flatnonzero(np.asarray(bench.active[0]))[-1]) + 1
    found = {title: np.asarray(bench.estimates(estimator))[0, :last] for title, estimator in estimators.items()}
    rims = np.asarray(bench.samples.rims)[0, :last]
    return Traces(time[:last], np.asarray(bench.speed)[0, :last], rims, found)
