"""What tuned observers are worth: settling, noise, wrong speed, a clamp, a rig log; default gains against tuned.

Each function returns rows, a list of dictionaries with one key a column.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np

from absjax.observers import OBSERVERS, rls
from absjax.observers.base import Design, Sample
from absjax.observers.clamped import Clamped
from absjax.observers.designs import Adaptive, KnownRoad, UnknownRoad
from absjax.observers.run import Observation, ObserverStatus, observe
from absjax.parameters import defaults_of
from absjax.plant.wheel import Wheel
from absjax.tyres.surfaces import surface
from tuning.core.components import component
from tuning.core.files import shipped
from tuning.logs.brake_log import BrakeLog
from tuning.observers.metrics import crossings, rms, settling, within
from tuning.observers.scenarios import Excitation, Scenarios, simulate
from tuning.observers.signals import LogSignals, force_stiffness, observer_signals

TABLE_ROADS = ("dry_asphalt", "wet_asphalt", "dry_concrete")
TABLE_CHANGES = (3.0, 6.0)
"""Where the roads of the settling table change, s; 24 instants of either, 10 ms apart."""
INSTANTS = 24
HELD_OUT_ROADS = (*TABLE_ROADS, "dry_cobblestones", "wet_cobblestones", "snow")
HELD_OUT_SPEEDS = (14.0, 20.0, 27.0)
NOISE, NOISE_SEED = 0.5, 0
"""Standard deviation of the noise on y, m/s^2, at 1 kHz; what it is drawn from."""
SETTLED = 1.0
"""Time after the beginning of a road from which noise is measured, s."""


class GainSet(NamedTuple):
    """An observer under a name."""

    label: str
    kind: str
    parameters: Mapping[str, float]

    @property
    def design(self) -> type[Design]:
        """Its class."""
        return component("observer", self.kind, OBSERVERS, Design)

    def observer(self, wheel: Wheel):
        """The observer."""
        return self.design(**self.parameters).observer(wheel)

    @property
    def substeps(self) -> int:
        """Runge-Kutta steps per millisecond."""
        return self.design.substeps


def gain_sets() -> list[GainSet]:
    """Published and tuned gains of the 4-state and the adaptive observer, and the quicker 4-state ones of the table."""
    tuned, four = shipped("observer_gains.json"), defaults_of(UnknownRoad)
    quick = {**four, "frequency1": 100.0, "frequency2": 100.0}
    return [
        GainSet("adaptive, default", "adaptive", defaults_of(Adaptive)),
        GainSet("adaptive, tuned", "adaptive", tuned["adaptive"]),
        GainSet("4-state, poles -60", "unknown_road", four),
        GainSet("4-state, poles -100", "unknown_road", quick),
        GainSet("4-state, tuned", "unknown_road", tuned["unknown_road"]),
    ]


@partial(jax.jit, static_argnames="substeps")
def _observe_all(observer, samples: Sample, period, substeps: int) -> Observation:
    return jax.vmap(lambda s: observe(observer, s, period, substeps=substeps))(samples)


def estimates(
    gains: GainSet, runs: Scenarios, noise: Any = 0.0, speed: float = 1.0, clamp: bool = False
) -> Observation:
    """The estimates of a gain set over runs, arrays (runs, samples).

    Args:
        noise: added to y, m/s^2.
        speed: factor by which the observer's v is wrong.
        clamp: whether the estimate is kept to the physical range.
    """
    observer = gains.observer(runs.wheel)
    samples = runs.samples._replace(y=runs.samples.y + noise, speed=runs.samples.speed * speed)
    result = _observe_all(Clamped(observer) if clamp else observer, samples, runs.period, gains.substeps)
    return jax.tree.map(np.asarray, result)


def table_runs(excitation: Excitation) -> Scenarios:
    """Dry asphalt, wet asphalt, dry concrete from 25 m/s at 1.96 m/s^2 with 24 instants of the changes.

    Source: Aguado-Rojas 2019, section 3.4.
    """
    shift = 0.01 * np.arange(INSTANTS)[:, None]
    roads = [surface(name) for name in TABLE_ROADS]
    return simulate([roads] * INSTANTS, np.array(TABLE_CHANGES) + shift, excitation=excitation)


class HeldOut(NamedTuple):
    """Runs that were not tuned on."""

    runs: Scenarios
    changed_to: np.ndarray
    """name of the road changed to, (runs,)"""


def held_out_runs(excitation: Excitation, instants: int = 3) -> HeldOut:
    """Every change between six published roads, at several instants, from three speeds; none was tuned on.

    Runs on which the controller stops cycling are left out.
    """
    pairs = [(a, b) for a in HELD_OUT_ROADS for b in HELD_OUT_ROADS if a != b]
    cases = [(pair, i, v) for pair in pairs for i in range(instants) for v in HELD_OUT_SPEEDS]
    runs = simulate(
        [[surface(a), surface(b)] for (a, b), _, _ in cases],
        [1.5 + 0.07 * i for _, i, _ in cases],
        speed=[v for *_, v in cases],
        excitation=excitation,
        duration=3.5,
    )
    cycling = np.flatnonzero(runs.cycling)
    return HeldOut(runs.select(cycling), np.array([after for (_, after), _, _ in cases])[cycling])


def settling_rows(sets: Sequence[GainSet], runs: Scenarios, excitation: str) -> list[dict[str, Any]]:
    """Worst settling time on each road of the table, s; the first counts from the touch of the pedal."""
    rows = []
    for gains in sets:
        result = estimates(gains, runs)
        worst = settling(runs.time, result.stiffness - runs.stiffness, runs.begins, runs.ends).max(axis=0)
        rows.append({"observer": gains.label, "cycle": excitation, **dict(zip(TABLE_ROADS, worst.round(3).tolist()))})
    return rows


def held_out_rows(sets: Sequence[GainSet], held_out: HeldOut, excitation: str) -> list[dict[str, Any]]:
    """Settling over changes that were not tuned on; by the road changed to, the worst, s."""
    rows, runs, second = [], held_out.runs, held_out.changed_to
    for gains in sets:
        result = estimates(gains, runs)
        times = settling(runs.time, result.stiffness - runs.stiffness, runs.begins, runs.ends)
        row = {"observer": gains.label, "cycle": excitation, "worst": times.max(), "mean": times.mean()}
        row |= {name: times[second == name, 1].max() for name in HELD_OUT_ROADS}
        row["step too large"] = int((result.status != ObserverStatus.SOUND).sum())
        rows.append({k: round(v, 3) if isinstance(v, float) else v for k, v in row.items()})
    return rows


def noise_rows(sets: Sequence[GainSet], runs: Scenarios, excitation: str) -> list[dict[str, Any]]:
    """XBS rms that noise on y causes, once settled, by road of the table."""
    noise = NOISE * np.random.default_rng(NOISE_SEED).normal(size=runs.stiffness.shape)
    rows = []
    for gains in sets:
        difference = estimates(gains, runs, noise).stiffness - estimates(gains, runs).stiffness
        row: dict[str, Any] = {"observer": gains.label, "cycle": excitation}
        for i, name in enumerate(TABLE_ROADS):
            late = within(runs.time, runs.begins[:, i : i + 1] + SETTLED, runs.ends[:, i : i + 1])
            row[name] = round(float(rms(difference, late).mean()), 3)
        rows.append(row)
    return rows


def speed_rows(sets: Sequence[GainSet], runs: Scenarios, factors=(0.8, 0.9, 1.0, 1.1, 1.2)) -> list[dict[str, Any]]:
    """XBS error and zero crossings under a wrong vehicle speed: rms, and how far the crossings are off, s."""
    settled = within(runs.time, runs.begins + SETTLED, runs.ends)
    rows = []
    for gains in sets:
        for factor in factors:
            estimate = estimates(gains, runs, speed=factor).stiffness
            gaps, missed = [], 0
            for i in range(runs.runs):
                true = crossings(runs.time, runs.stiffness[i])
                true = true[settled[i, np.searchsorted(runs.time, true)]]
                found = crossings(runs.time, estimate[i])
                gap = np.abs(true[:, None] - found[None]).min(axis=1) if found.size else np.full(true.size, np.inf)
                missed += int((gap > 0.05).sum())
                gaps.extend(gap[gap <= 0.05])
            error = float(rms(estimate - runs.stiffness, settled).mean())
            rows.append(
                {
                    "observer": gains.label,
                    "speed": f"{100 * (factor - 1):+.0f} %",
                    "XBS rms": round(error, 3),
                    "crossings": len(gaps) + missed,
                    "median gap [ms]": round(1e3 * float(np.median(gaps)), 2),
                    "95 % [ms]": round(1e3 * float(np.quantile(gaps, 0.95)), 2),
                    "off by > 50 ms": missed,
                }
            )
    return rows


def clamp_rows(sets: Sequence[GainSet], runs: Scenarios) -> list[dict[str, Any]]:
    """What clamping the estimate to the physical range changes."""
    rows = []
    for gains in sets:
        for clamp in (False, True):
            error = estimates(gains, runs, clamp=clamp).stiffness - runs.stiffness
            after = within(runs.time, runs.begins[:, 1:], runs.begins[:, 1:] + 0.3)
            times = settling(runs.time, error, runs.begins, runs.ends)
            rows.append(
                {
                    "observer": gains.label,
                    "clamped": "yes" if clamp else "no",
                    "largest |error| after a change": round(float(np.abs(np.where(after, error, 0.0)).max()), 2),
                    "rms in the 0.3 s after it": round(float(rms(error, after).mean()), 3),
                    "worst settling [s]": round(float(times.max()), 3),
                }
            )
    return rows


BEST_CONSTANT = "the best constant, in hindsight"


class RigStudy(NamedTuple):
    """Observers and baselines on a log with measured force."""

    signals: LogSignals
    truth: np.ndarray
    """XBS the force gives, (samples,)"""
    estimates: dict[str, np.ndarray]
    braking: np.ndarray
    """samples that count, bool (samples,)"""
    rows: list[dict[str, Any]]


def rig_study(log: BrakeLog, wheel: Wheel, tyre, sets: Sequence[GainSet], start: float = 0.5) -> RigStudy:
    """Estimates against the XBS that measured force gives (Aguado-Rojas 2019, Fig. 3.14).

    Args:
        log: a checked log with force.
        wheel: its wheel.
        tyre: the curve fitted to slip and force.
        sets: observers to compare with least squares, and with the constant that fits the log best.
        start: time from which errors count, s.
    """
    signals = observer_signals(log, wheel)
    truth = force_stiffness(signals, tyre)
    found = {}
    for gains in sets:
        run = observe(gains.observer(wheel), signals.samples, log.period, substeps=gains.substeps)
        found[gains.label] = np.asarray(run.raise_if_failed().stiffness)
    found["recursive least squares"] = np.asarray(rls.recursive(signals.samples, log.period, wheel))
    found["least squares, 50 ms"] = np.asarray(rls.windowed(signals.samples, log.period, wheel))
    braking = signals.time - signals.time[0] >= start
    found[BEST_CONSTANT] = np.full(len(truth), truth[braking].mean())
    rows = []
    for label, estimate in found.items():
        error = estimate - truth
        right = np.sign(estimate[braking]) == np.sign(truth[braking])
        row = {"observer": label, "XBS rms": rms(error, braking), "largest": np.abs(error[braking]).max()}
        rows.append({k: v if k == "observer" else round(float(v), 3) for k, v in row.items()})
        rows[-1]["right side of the peak [%]"] = round(100 * float(right.mean()), 1)
    return RigStudy(signals, truth, found, braking, rows)


def rig_states(study: RigStudy, wheel: Wheel, tyre) -> dict[str, np.ndarray]:
    """w1, w2, c and d of the adaptive observer, as the curve fitted to force gives them, arrays (samples,).

    Source: Aguado-Rojas 2019, section 3.5.
    """
    y, c = np.asarray(study.signals.samples.y), float(tyre.c2)
    w2 = study.truth + c / float(wheel.slip_gain) * y
    return {"w1": y, "w2": w2, "c": np.full(y.size, c), "d": np.full(y.size, c * float(tyre.c3))}


def rig_adaptive_rows(
    study: RigStudy, states: Mapping[str, np.ndarray], found: Mapping[str, Observation]
) -> list[dict[str, Any]]:
    """How near the adaptive observer comes to its states and parameters, rms over the second half of a log."""
    late = study.signals.time > 0.5 * (study.signals.time[0] + study.signals.time[-1])
    rows = []
    for label, observed in found.items():
        row: dict[str, Any] = {"gains": label}
        for name, truth in states.items():
            error = np.asarray(getattr(observed.state, name)) - truth
            row |= {
                f"{name}, true": float(f"{truth[late].mean():.3g}"),
                f"{name}, rms": float(f"{rms(error, late):.3g}"),
            }
        rows.append(row)
    return rows


def rig_sets(tyre, tuned: Sequence[GainSet]) -> list[GainSet]:
    """The 4-state observer with rates for the rig, for dry and wet, for all roads; the 3-state one; the others given.

    Source: Aguado-Rojas 2019, Fig. 3.14, (a) to (c).
    """
    four, c2 = defaults_of(UnknownRoad), float(tyre.c2)
    bounds = {"the rig's road": (c2 - 1, c2 + 1), "dry and wet": (22.0, 36.0), "all roads": (6.0, 96.0)}
    sets = [
        GainSet(f"4-state, bounds of {name}", "unknown_road", {**four, "rate1": low, "spread": high - low})
        for name, (low, high) in bounds.items()
    ]
    known = GainSet("3-state, c2 known", "known_road", {**defaults_of(KnownRoad), "c2": c2})
    return [known, *sets, *tuned]


def perturbation(runs: Scenarios, ripple: float = 0.002) -> np.ndarray:
    """Oscillation of y with the wheel's angle that an imperfect encoder causes, m/s^2, (runs, samples).

    An encoder that reads w (1 + ripple cos(angle)) adds R times its derivative, -R ripple w^2 sin(angle): large
    at speed, vanishing with it. Source: Aguado-Rojas 2019, Fig. 3.6.

    Args:
        ripple: relative amplitude of the error of the wheel speed.
    """
    radius = float(runs.wheel.radius)
    wheel_speed = (1 + runs.slip) * np.asarray(runs.samples.speed) / radius
    angle = np.cumsum(wheel_speed, axis=1) * runs.period
    return -radius * ripple * wheel_speed**2 * np.sin(angle)
