"""From a brake log to the road's friction curve, surface by surface, with its uncertainty."""

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

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
from tuning.logs.car import Car
from tuning.logs.quantities import KINDS, Z95, Quantity
from tuning.logs.tables import LogError
from tuning.road import conditions, verdict
from tuning.road.curve import Curve
from tuning.road.fitted import Fitted, FittedStretch, anyones_guess, samples_as_fitted
from tuning.road.fitting import fitted_of
from tuning.road.fitting_by_curve import fitted_by_curve
from tuning.road.samples import FrictionSamples
from tuning.road.settling import SMALLEST_PEAK_SLIP, settled

STEEPEST = 2.1875
"""Steepest slope of the blend of `ChangingRoad`, times its length."""
LARGEST_RELATIVE_WIDTH = 0.5
"""A parameter whose 95 % half-width exceeds this share of it is not identifiable."""
PEAK = ("peak_friction", "peak_slip")
LOPSIDED = 1.5
"""Ratio of the profile to the covariance from which an interval is called lopsided."""
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
        residual_rms: of the residuals, over the noise that the channels have by themselves; near 1 when noise is all
            that is left.
        samples: used.
        kind: name of the tyre curve, in `absjax.tyres.TYRES`, or `package.module:Class`.
        side: 'braking' or 'driving': on which side of zero the slip of the samples is.
        profile: by coefficient, how the sum of squares rises at the ends of its interval, all else fitted anew: root of
            it over what the covariance says, below and above. Near 1 the interval is as good as its likelihood's.
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
    side: str = "braking"
    profile: dict[str, tuple[float, float]] = dataclasses.field(default_factory=dict)

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
        pairs = {n: {k: tuple(v) for k, v in data.get(n, {}).items()} for n in ("ci95", "profile")}
        return cls(**{**known, **pairs})


@dataclasses.dataclass(frozen=True)
class Identification:
    """What a log says of the road. `to_json` and `from_json` are each other's inverse."""

    log: str
    segments: list[Segment]
    blends: list[float]
    """length of the blend at each change, taken as linear [s]"""
    wheel: dict[str, float]
    """as the log has it"""
    quantities: dict[str, Quantity] = dataclasses.field(default_factory=dict)
    """the car's own quantities that were estimated with the road"""
    verdict: str = "sound"
    """'sound', 'doubtful' or 'refuted': whether the log goes with what the fit takes for true"""
    reasons: list[str] = dataclasses.field(default_factory=list)
    """sentences: why it is not sound"""
    notes: list[str] = dataclasses.field(default_factory=list)
    """sentences: what was done with the log"""
    misfit: dict[str, float] = dataclasses.field(default_factory=dict)
    """by channel, what is left of it over its own noise"""
    version: str = VERSION

    @property
    def changes(self) -> list[float]:
        """Instants at which the surface changes [s]."""
        return [segment.start for segment in self.segments[1:] if segment.side == "braking"]

    def samples(self, log: BrakeLog, car: Car | Wheel | None = None) -> tuple[BrakeLog, FrictionSamples]:
        """The log as the fit sees it, zeros, delays and lag taken out, and its points of the friction curve."""
        known = Car.of(car)
        start = conditions.begin(log, known)
        values = {name: prior.value for name, prior in known.priors.items()}
        values |= {name: found.value for name, found in self.quantities.items()} | self.wheel
        return samples_as_fitted(start, known, values)

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
        quantities = {name: Quantity(**found) for name, found in data.get("quantities", {}).items()}
        segments = [Segment.from_json(segment) for segment in data["segments"]]
        return cls(**{**data, "segments": segments, "quantities": quantities})


class Case(NamedTuple):
    """A log that was found fit to identify a road from, and what is known of its car."""

    log: BrakeLog
    car: Car
    kind: str
    """of the tyre curve"""
    curve: Curve
    start: conditions.Start

    @classmethod
    def of(cls, log: BrakeLog, car: Car, kind: str) -> "Case":
        """Check a log, and see what it says before any fit; errors are those of `identify`."""
        curve = Curve(component("tyre", kind, TYRES, Tyre))
        _check_uniform(log)
        conditions.require_braking(log, car)
        return cls(log, car, kind, curve, conditions.begin(log, car))

    @property
    def by_curve(self) -> bool:
        """Whether the friction is measured, sample by sample."""
        return self.log.force is not None or self.log.brake_pressure is None

    def concluded(self, fitted: Fitted) -> Identification:
        """What the fit says of the road, with a verdict."""
        log, car = self.log, self.car
        segments = [_segment(self.kind, self.curve, stretch, fitted.method) for stretch in fitted.stretches]
        wheel = {f.name: float(getattr(car.wheel, f.name)) for f in dataclasses.fields(car.wheel)}
        wheel |= {name: found.value for name, found in fitted.quantities.items() if KINDS[name].wheel}
        word, reasons = verdict.judged(log, car, self.start, fitted)
        if word == "refuted":
            segments = [_withheld(segment) for segment in segments]
        return Identification(
            log.name,
            segments,
            fitted.blends,
            wheel,
            fitted.quantities,
            word,
            reasons,
            [*log.notes, *self.start.notes, *fitted.notes],
            fitted.misfit,
        )


def identify(
    log: BrakeLog, car: Car | Wheel | None = None, kind: str = "burckhardt", *, progress=lambda message: None
) -> Identification:
    """Fit a tyre curve to every surface of a log, and the car's own quantities with them.

    With force measured the curve is fitted to the points (slip, force / load); without, by output error of the
    rolled-out car (`tuning.road.output_error`), or, where no pressure was logged either, to the points (slip, a / g).

    Args:
        log: a checked log.
        car: the car, or its wheel alone; the default wheel when None.
        kind: name of the tyre curve, in `absjax.tyres.TYRES`, or `package.module:Class`.
        progress: called with a line of text as the work goes on.

    Returns:
        The road, the quantities, and a verdict on them (`tuning.road.verdict`).

    Raises:
        LogError: if the sampling is not uniform, or the log never brakes.
        ConfigError: if there is no such tyre curve.
    """
    case = Case.of(log, Car.of(car), kind)
    # The fits need double precision whatever the caller works in.
    with jax.enable_x64(True):
        if case.by_curve:
            return case.concluded(fitted_by_curve(case.curve, case.start, case.car, progress))
        return case.concluded(fitted_of(settled(case.curve, case.start, case.car, progress)))


def _check_uniform(log: BrakeLog) -> None:
    steps = np.diff(log.time)
    off = np.abs(steps - log.period) > 0.25 * log.period
    if off.any():
        at = int(np.argmax(off))
        raise LogError(
            f"{log.name}: sampling is not uniform, the step is {steps[at]:g} s at {log.time[at]:g} s and "
            f"{log.period:g} s as a rule; resample the log to a uniform grid first"
        )


def _withheld(segment: Segment) -> Segment:
    """A segment of a log that refutes the fit: no value of it is called known."""
    said = "the log refutes what the fit takes for true: its intervals say nothing of the road"
    return dataclasses.replace(
        segment,
        identifiable=dict.fromkeys(segment.identifiable, False),
        statements=[*segment.statements, said],
    )


@partial(jax.jit, static_argnums=0)
def _with_peak(curve: Curve, coefficients):
    """Coefficients and peak of a curve, (coefficients + 2,), and their slopes by the coefficients."""

    def everything(c):
        peak = curve.tyre(c).peak()
        return jnp.stack([*c, peak.friction, peak.slip])

    return everything(coefficients), jax.jacfwd(everything)(coefficients)


def _segment(kind, curve: Curve, found: FittedStretch, method: str) -> Segment:
    covariance = found.covariance
    values, slopes = map(np.asarray, _with_peak(curve, np.asarray(found.coefficients)))
    widths = Z95 * np.sqrt(np.maximum(np.einsum("ip,pq,iq->i", slopes, covariance, slopes), 0))
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.maximum(np.outer(deviation, deviation), 1e-300)
    largest = found.largest_slip
    names = (*curve.names, *PEAK)
    value, width = dict(zip(names, map(float, values))), dict(zip(names, map(float, widths)))
    identifiable, statements = _identifiability(curve, value, width, largest)
    statements += [
        f"the interval of {name} is lopsided: at its ends the fit is {low:.2g} and {high:.2g} times as far off as it "
        "says"
        for name, (low, high) in found.profile.items()
        if identifiable[name] and not all(1 / LOPSIDED < side < LOPSIDED for side in (low, high))
    ]
    return Segment(
        start=found.start,
        end=found.end,
        parameters={name: value[name] for name in curve.names},
        peak_friction=value["peak_friction"],
        peak_slip=value["peak_slip"],
        ci95={name: (value[name] - width[name], value[name] + width[name]) for name in names},
        correlation=correlation.tolist(),
        covariance=covariance.tolist(),
        identifiable=identifiable,
        statements=statements,
        method=method,
        largest_slip=largest,
        residual_rms=found.residual_rms,
        samples=found.samples,
        kind=kind,
        side=found.side,
        profile=found.profile,
    )


def _identifiability(curve: Curve, value, width, largest: float) -> tuple[dict[str, bool], list[str]]:
    passed = largest > value["peak_slip"]
    guessed = anyones_guess(*(np.array([found[name] for name in curve.names]) for found in (value, width)))
    identifiable, statements = {}, []
    for name in value:
        known = bool(np.isfinite(width[name]) and width[name] <= LARGEST_RELATIVE_WIDTH * abs(value[name]))
        if abs(value[name]) < NEGLIGIBLE:
            known = bool(width[name] < ABSOLUTE_WIDTH)
        if value["peak_slip"] < SMALLEST_PEAK_SLIP:
            known = False
            statements.append(f"{name} is not identifiable: the friction seen does not rise with the slip")
        elif guessed and name in PEAK:
            known = False
            statements.append(f"{name} is not identifiable: the slips seen are those of many curves")
        elif name in (*curve.kind.beyond_peak, *PEAK) and not passed:
            known = False
            statements.append(
                f"{name} is not identifiable: slip reached {largest:.3f} and never passed the peak, "
                f"which the fit places at {value['peak_slip']:.3f}"
            )
        elif not known:
            statements.append(f"{name} is not identifiable: {value[name]:.4g} +- {width[name]:.2g} (95 %)")
        identifiable[name] = known
    return identifiable, statements
