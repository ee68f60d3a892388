"""From a brake log to the road's friction curve, surface by surface, with its uncertainty."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from absjax.plant.road import ChangingRoad
from absjax.plant.wheel import Wheel
from absjax.tyres import TYRES
from absjax.tyres.base import Tyre
from tuning.core.components import component
from tuning.core.version import VERSION
from tuning.logs.brake_log import BrakeLog
from tuning.logs.tables import LogError
from tuning.road.arrow_fit import Fit
from tuning.road.changes import Stretch, find_stretches
from tuning.road.curve import Curve
from tuning.road.curve_fit import fit_curve, white_noise
from tuning.road.output_error import fit_output_error
from tuning.road.samples import FrictionSamples, friction_samples

Z95 = 1.959963984540054
STEEPEST = 2.1875
"""Steepest slope of the blend of `ChangingRoad`, times its length."""
GUARD = 0.03
"""Time kept clear of the middle of a change [s]."""
LARGEST_RELATIVE_WIDTH = 0.5
"""A parameter whose 95 % half-width exceeds this share of it is not identifiable."""
BLENDS = (0.001, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.04, 0.06)
PEAK = ("peak_friction", "peak_slip")
NEGLIGIBLE, ABSOLUTE_WIDTH = 1e-4, 0.1
"""A coefficient below the first is known if its half-width is below the second."""


@dataclasses.dataclass(frozen=True)
class Segment:
    """The friction curve of one stretch of the log.

    Attributes:
        start, end: of the stretch [s].
        parameters: the coefficients that were fitted, by name.
        peak_friction, peak_slip: of the fitted curve; `peak_slip` is a magnitude.
        ci95: 95 % interval (low, high) of each coefficient, and of the peak.
        correlation, covariance: of the coefficients.
        identifiable: whether the log says what each of them, and the peak, is.
        statements: in words, what it does not say, and why.
        method: 'curve fit' or 'output error'.
        largest_slip: largest magnitude of slip reached.
        residual_rms: of the whitened residuals; near 1 when noise is all that is left.
        samples: used.
        kind: name of the tyre curve, in `absjax.tyres.TYRES`, or `package.module:Class`.
    """

    start: float
    end: float
    parameters: dict[str, float]
    peak_friction: float
    peak_slip: float
    ci95: dict[str, tuple[float, float]]
    correlation: list[list[float]]
    covariance: list[list[float]]
    identifiable: dict[str, bool]
    statements: list[str]
    method: str
    largest_slip: float
    residual_rms: float
    samples: int
    kind: str = "burckhardt"

    @property
    def tyre(self) -> Tyre:
        """The fitted curve."""
        return component("tyre", self.kind, TYRES, Tyre)(**self.parameters)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary, the coefficients entries of their own."""
        plain = dataclasses.asdict(self)
        return {**plain.pop("parameters"), **plain}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "Segment":
        """Read back what `to_json` gave."""
        fields = {field.name for field in dataclasses.fields(cls)}
        known = {name: value for name, value in data.items() if name in fields}
        known["parameters"] = {name: value for name, value in data.items() if name not in fields}
        return cls(**{**known, "ci95": {k: tuple(v) for k, v in data["ci95"].items()}})


@dataclasses.dataclass(frozen=True)
class Identification:
    """What a log says of the road. `to_json` and `from_json` are each other's inverse."""

    log: str
    segments: list[Segment]
    blends: list[float]
    """length of the blend at each change, taken as linear [s]"""
    wheel: dict[str, float]
    version: str = VERSION

    def road(self) -> ChangingRoad:
        """The road as a function of time, for simulation; its smooth blends are as steep as the linear ones."""
        linear = float(np.mean(self.blends)) if self.blends else 0.025
        smooth = STEEPEST * linear
        starts = tuple(segment.start - (smooth - linear) / 2 for segment in self.segments[1:])
        return ChangingRoad(tuple(segment.tyre for segment in self.segments), starts, smooth)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary."""
        return {**dataclasses.asdict(self), "segments": [segment.to_json() for segment in self.segments]}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "Identification":
        """Read back what `to_json` gave."""
        return cls(**{**data, "segments": [Segment.from_json(segment) for segment in data["segments"]]})


def identify(
    log: BrakeLog, wheel: Wheel | None = None, kind: str = "burckhardt", *, progress=lambda message: None
) -> Identification:
    """Fit a tyre curve to every surface of a log.

    With force measured the curve is fitted to the points (slip, force / load); without, by output error
    of the rolled-out car (`tuning.road.output_error`).

    Args:
        log: a checked log.
        wheel: wheel, load and brake of the car; the default wheel when None.
        kind: name of the tyre curve, in `absjax.tyres.TYRES`, or `package.module:Class`.
        progress: called with a line of text as the work goes on.

    Raises:
        LogError: if the sampling is not uniform, or the log never brakes.
        ConfigError: if there is no such tyre curve.
    """
    wheel, curve = Wheel() if wheel is None else wheel, Curve(component("tyre", kind, TYRES, Tyre))
    _check_uniform(log)
    samples = friction_samples(log, wheel)
    largest = float(np.quantile(np.abs(samples.slip), 0.999))
    if largest < 0.01:
        raise LogError(f"{log.name}: largest slip {largest:.4f}; the log holds no braking to identify a road from")
    progress(f"friction points from {samples.source}, slip up to {largest:.2f}")
    stretches = find_stretches(samples)
    progress(f"{len(stretches)} surface{'s' if len(stretches) > 1 else ''} found")
    # The fits need double precision whatever the caller works in.
    with jax.enable_x64(True):
        fits = [_fit(curve, log, wheel, samples, stretch, stretches, progress) for stretch in stretches]
    tyres = [curve.tyre(map(float, fit.shared)) for fit, _, _ in fits]
    changes = [_refine_change(samples, tyres[i], tyres[i + 1], stretches[i + 1].first) for i in range(len(tyres) - 1)]
    starts = [float(log.time[0])] + [start for start, _ in changes]
    ends = starts[1:] + [float(log.time[-1])]
    segments = [
        _segment(kind, curve, fit, method, samples, used, start, end)
        for (fit, method, used), start, end in zip(fits, starts, ends)
    ]
    described = {f.name: float(getattr(wheel, f.name)) for f in dataclasses.fields(wheel)}
    return Identification(log.name, segments, [blend for _, blend in changes], described)


def _check_uniform(log: BrakeLog) -> None:
    steps = np.diff(log.time)
    off = np.abs(steps - log.period) > 0.25 * log.period
    if off.any():
        at = int(np.argmax(off))
        raise LogError(
            f"{log.name}: sampling is not uniform, the step is {steps[at]:g} s at {log.time[at]:g} s and "
            f"{log.period:g} s as a rule; resample the log to a uniform grid first"
        )


def _fit(curve: Curve, log, wheel, samples: FrictionSamples, stretch: Stretch, stretches: list[Stretch], progress):
    inside = np.zeros(len(log.time), bool)
    inside[stretch.first : stretch.last] = True
    for other in stretches[1:]:
        inside &= np.abs(log.time - log.time[other.first]) > GUARD
    start = curve.near(np.maximum(stretch.coefficients, 1e-3))
    if samples.source == "force":
        rim_noise = float(wheel.radius) * white_noise(log.wheel_speed)
        noise = np.hypot(rim_noise, (1 + samples.slip) * white_noise(log.vehicle_speed)) / log.vehicle_speed
        fit, method = (
            fit_curve(curve, samples.slip[inside], samples.friction[inside], noise[inside], start),
            "curve fit",
        )
    else:
        fit, method = fit_output_error(curve, log, wheel, inside, start), "output error"
    found = ", ".join(f"{name} {value:.4g}" for name, value in zip(curve.names, fit.shared))
    progress(f"{method}: {found} after {fit.iterations} iterations")
    return fit, method, inside


def _refine_change(samples: FrictionSamples, before: Tyre, after: Tyre, near: int) -> tuple[float, float]:
    """Beginning and length [s] of the linear blend that fits the points around a change best."""
    window = np.abs(samples.time - samples.time[near]) < 0.15
    time, friction = samples.time[window], samples.friction[window]
    slip = jnp.asarray(samples.slip[window])
    old, new = np.asarray(before.friction(slip)), np.asarray(after.friction(slip))
    best = (np.inf, 0.0, 0.0)
    for blend in BLENDS:
        for start in samples.time[near] - blend / 2 + np.arange(-0.05, 0.05, 5e-4):
            share = np.clip((time - start) / blend, 0, 1)
            cost = float(np.sum((friction - old - share * (new - old)) ** 2))
            best = min(best, (cost, float(start), blend))
    return best[1], best[2]


def _segment(kind, curve: Curve, fit: Fit, method: str, samples: FrictionSamples, used, start, end) -> Segment:
    with jax.enable_x64(True):

        def everything(c):
            peak = curve.tyre(c).peak()
            return jnp.stack([*c, peak.friction, peak.slip])

        shared = jnp.asarray(fit.shared)
        values, slopes = np.asarray(everything(shared)), np.asarray(jax.jacfwd(everything)(shared))
    widths = Z95 * np.sqrt(np.maximum(np.einsum("ip,pq,iq->i", slopes, fit.covariance, slopes), 0))
    deviation = np.sqrt(np.diag(fit.covariance))
    correlation = fit.covariance / np.maximum(np.outer(deviation, deviation), 1e-300)
    largest = float(np.quantile(np.abs(samples.slip[used]), 0.999))
    names = (*curve.names, *PEAK)
    value, width = dict(zip(names, map(float, values))), dict(zip(names, map(float, widths)))
    identifiable, statements = _identifiability(curve, value, width, largest)
    return Segment(
        start=start,
        end=end,
        parameters={name: value[name] for name in curve.names},
        peak_friction=value["peak_friction"],
        peak_slip=value["peak_slip"],
        ci95={name: (value[name] - width[name], value[name] + width[name]) for name in names},
        correlation=correlation.tolist(),
        covariance=fit.covariance.tolist(),
        identifiable=identifiable,
        statements=statements,
        method=method,
        largest_slip=largest,
        residual_rms=float(np.sqrt(np.mean(fit.residual**2))),
        samples=int(np.sum(used)),
        kind=kind,
    )


def _identifiability(curve: Curve, value, width, largest: float) -> tuple[dict[str, bool], list[str]]:
    passed = largest > value["peak_slip"]
    identifiable, statements = {}, []
    for name in value:
        known = bool(np.isfinite(width[name]) and width[name] <= LARGEST_RELATIVE_WIDTH * abs(value[name]))
        if abs(value[name]) < NEGLIGIBLE:
            known = bool(width[name] < ABSOLUTE_WIDTH)
        if name in (*curve.kind.beyond_peak, *PEAK) and not passed:
            known = False
            statements.append(
                f"{name} is not identifiable: slip reached {largest:.3f} and never passed the peak, "
                f"which the fit places at {value['peak_slip']:.3f}"
            )
        elif not known:
            statements.append(f"{name} is not identifiable: {value[name]:.4g} +- {width[name]:.2g} (95 %)")
        identifiable[name] = known
    return identifiable, statements
