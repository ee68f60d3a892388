"""What the encoder chain is worth: the published table, other encoders, endurance, and the chain in the loop.

Each function returns rows, a list of dictionaries with one key a column.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np

from absjax.encoder.edges import edges_of, in_ticks
from absjax.encoder.encoder import Encoder
from absjax.encoder.rotation import Rotation
from absjax.encoder.wheel_speed import WheelSpeedChain, estimate
from tuning.core.files import shipped
from tuning.encoder.bench import PERIOD, bench_of, joined, ratio_rows, reference
from tuning.encoder.chains import (
    SIGNALS,
    all_harmonics,
    edge_chain,
    enough_harmonics,
    filtered_chain,
    measured_chain,
    notch_chain,
    published_chain,
)
from tuning.encoder.loop import Course
from tuning.encoder.tune import EncoderResult
from tuning.observers.metrics import rms

DURATION, SETTLE = 20.0, 10.0
"""Of a run, and from when on errors count, s."""
TEETH, EVENTS = 60, 15
CLOCK = 1e-6
HOUR = 3600.0


def tuned_chain() -> WheelSpeedChain:
    """The chain shipped: n as in the table, M and the rest tuned on other encoders under both references."""
    return EncoderResult.from_json(shipped("encoder_chain.json")).chain()


def table_chains() -> dict[str, WheelSpeedChain]:
    """The chains of the table by name; the first is the measurement."""
    few, all_ = enough_harmonics(TEETH, EVENTS), all_harmonics(TEETH)
    return {
        "measured": measured_chain(TEETH, EVENTS),
        "notch filter": notch_chain(TEETH, EVENTS),
        "RLS, M = 5, as published": published_chain(TEETH, EVENTS),
        f"RLS, M = {few}, filtered": filtered_chain(TEETH, EVENTS),
        f"RLS, M = {all_}, through the edges": edge_chain(TEETH, EVENTS),
    }


def _rows(encoder: Encoder, name: str, chains: Mapping[str, WheelSpeedChain], **about: Any) -> list[dict[str, Any]]:
    return ratio_rows(bench_of(encoder, name, DURATION, SETTLE), chains, reference=name, **about)


SOURCE: dict[str, dict[str, tuple[float, float]]] = {
    "constant": {"measured": (0.3007, 30.0886), "notch filter": (3.0730, 7.9528), "estimated": (0.0716, 7.9405)},
    "varying": {"measured": (0.1430, 12.8528), "notch filter": (5.2597, 33.5899), "estimated": (0.0783, 5.9237)},
}
"""Rms errors of speed [rad/s] and acceleration [rad/s^2] the source measured on its rig, Table 6.1."""


def source_rows(name: str) -> list[dict[str, Any]]:
    """What the source prints, with its ratios to measured."""
    measured = SOURCE[name]["measured"]
    rows = []
    for label, errors in SOURCE[name].items():
        row: dict[str, Any] = {"reference": name, "signals": f"source, on its rig: {label}"}
        for signal, error, before in zip(SIGNALS, errors, measured):
            row |= {f"{signal} rms": error, f"{signal} ratio": round(before / error, 2)}
        rows.append(row)
    return rows


def table_rows(seeds: int = 16) -> list[dict[str, Any]]:
    """Aguado-Rojas 2019, Table 6.1: eps = 0.004, e = 0.16 mm, N = 60, n = 15; ours, and what the source prints."""
    encoder, chains = Encoder.random(range(seeds), TEETH), table_chains()
    tuned = tuned_chain()
    most = 0 if tuned.speed is None else tuned.speed.harmonics
    chains[f"RLS, M = {most}, tuned"] = tuned
    return [row for name in SOURCE for row in (*_rows(encoder, name, chains), *source_rows(name))]


def encoder_rows(seeds: int = 16) -> list[dict[str, Any]]:
    """Other encoders and clocks at constant speed."""
    chains = table_chains()
    kept = {label: chains[label] for label in chains if "notch" not in label}
    cases = {
        "teeth within 0.004 cycles": {},
        "teeth within 0.02 cycles": {"tolerance": 0.02},
        "jitter of 0.002 cycles": {"jitter": 0.002},
        "clock of 1 us": {"clock": 1e-6},
        "clock of 10 us": {"clock": 1e-5},
        "1 of 1000 edges missing": {"missing": 1e-3},
    }
    return [
        row
        for about, other in cases.items()
        for row in _rows(Encoder.random(range(seeds), TEETH, **other), "constant", kept, encoders=about)
    ]


def _lock() -> Rotation:
    time = PERIOD * np.arange(8000)
    speed = np.where(time < 4.0, 100.0, 0.0)
    return Rotation.of_speed(speed, np.zeros_like(speed), PERIOD)


def endurance_cases(hours: float = 1.0, standstill: float = 600.0) -> dict[str, tuple[Rotation, Encoder]]:
    """Long and hard runs: how the wheel turns, and the encoder on it."""
    encoder = Encoder.random(7, TEETH, clock=CLOCK)
    stops = 5.0 + standstill
    stands = joined([0.0, 3.0, 5.0, stops, stops + 3.0], [80.0, 80.0, 0.0, 0.0, 80.0], stops + 9.0)
    steady, fast = (joined([0.0], [speed], 8.0) for speed in (100.0, 500 / 3.6 / 0.3))
    return {
        f"{hours:g} h of varying speed": (reference("varying", hours * HOUR), encoder),
        f"{standstill:g} s of standstill": (stands, encoder),
        "a sudden lock": (_lock(), encoder),
        "1 of 1000 edges missing": (steady, Encoder.random(7, TEETH, clock=CLOCK, missing=1e-3)),
        "500 km/h": (fast, encoder),
    }


def endurance_rows(cases: Mapping[str, tuple[Rotation, Encoder]]) -> list[dict[str, Any]]:
    """Single precision and integer ticks against double, and both against stamps without a clock."""
    chain, rows = filtered_chain(TEETH, EVENTS), []
    ticks = round(PERIOD / CLOCK)
    for label, (rotation, encoder) in cases.items():
        stamped = in_ticks(edges_of(encoder, rotation, PERIOD), CLOCK)
        single, double = (
            _numbers(estimate(chain, stamped, ticks, jnp.asarray(CLOCK, t))) for t in ("float32", "float64")
        )
        exact = _numbers(estimate(chain, edges_of(_without_clock(encoder), rotation, PERIOD), PERIOD))
        finite = all(np.isfinite(x).all() for found in (single, double, exact) for x in found)
        row: dict[str, Any] = {"run": label, "finite": "yes" if finite else "no"}
        late = slice(-min(2000, len(rotation.speed) // 4), None)
        for i, signal in enumerate(SIGNALS):
            row[f"{signal}: float32 - float64"] = float(f"{_rms(single[i] - double[i]):.3g}")
            row[f"{signal}: ticks - exact"] = float(f"{_rms(double[i] - exact[i]):.3g}")
            row[f"{signal}: error at the end"] = float(
                f"{_rms(single[i][late] - np.asarray(rotation[i + 1])[late]):.3g}"
            )
        rows.append(row)
    return rows


def _rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _without_clock(encoder: Encoder) -> Encoder:
    return dataclasses.replace(encoder, clock=None)


def _numbers(result) -> tuple[np.ndarray, np.ndarray]:
    found, _ = result
    return np.asarray(found.speed, float), np.asarray(found.acceleration, float)


def stiffness_rows(courses: Mapping[str, Course]) -> list[dict[str, Any]]:
    """XBS as the observer in the loop estimates it from what it is told."""
    rows = []
    for label, found in courses.items():
        assert found.estimate is not None
        error = np.where(found.settled, found.estimate - found.signals.stiffness, 0.0)
        right = np.sign(found.estimate) == np.sign(found.signals.stiffness)
        rows.append(
            {
                "told": label,
                "XBS rms": round(float(rms(error, found.settled).mean()), 2),
                "right side of the peak [%]": round(100 * float(right[found.settled].mean()), 1),
            }
        )
    return rows
