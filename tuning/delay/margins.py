"""Delay margins of the acceleration loop over speed and friction slope, and what simulations say of them.

Source: Hoang 2014 (thesis), section 8.4, Fig. 8.5 to 8.12.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.delay.acceleration_loop import AccelerationLoop
from absjax.delay.margins import delay_margin
from absjax.hybrid.rollout import rollout
from absjax.plant.wheel import Wheel

WANTED = 0.025
"""Margin the gains are chosen for, s."""
DAMPINGS = (0.1, 0.01)
RATIO = 0.01
"""zn / zd."""
KMH = 1 / 3.6
STEP, DURATION = 1e-3, 6.0
"""Of the simulations, s."""


class Slope(NamedTuple):
    """A friction slope with its gain over speed."""

    label: str
    theta: float
    """a mu', m/s^2"""


SLOPES = (Slope("mu' = 0", 0.0), Slope("mu' > 0", 1875.0), Slope("mu' < 0", -375.0))
_margins = jax.jit(jax.vmap(lambda p: delay_margin(*p)))


def gain_of(slope: Slope, speeds: np.ndarray) -> np.ndarray:
    """K (speeds,) as published: 63 v, 88.63 v, or what gives 25 ms at each speed; NaN-free, 0 where none does."""
    if slope.theta == 0:
        return 63.0 * speeds
    if slope.theta > 0:
        return 88.63 * speeds
    return np.array([_gain_for(v, slope.theta) for v in speeds])


def _gain_for(speed: float, theta: float) -> float:
    """The largest K with the wanted margin; 0 without one."""
    gains = np.geomspace(-theta * 1.0001, 200 * speed - theta, 4000)
    cases = np.stack(np.broadcast_arrays(gains, speed, theta, 1.0, 1.0, 1.0), axis=1)
    good = np.flatnonzero(np.asarray(_margins(cases).margin) >= WANTED)
    return float(gains[good[-1]]) if good.size else 0.0


def loops_of(slope: Slope, speeds: np.ndarray, zd: float | None) -> np.ndarray:
    """Arguments (speeds, 6) of the margin, with the notch following the wheel, or without one."""
    radius, gains = float(Wheel().radius), gain_of(slope, speeds)
    zn, damping = (1.0, 1.0) if zd is None else (RATIO * zd, zd)
    return np.stack(np.broadcast_arrays(gains, speeds, slope.theta, speeds / radius, zn, damping), axis=1)


def curves(slope: Slope, speeds: np.ndarray) -> dict[str, np.ndarray]:
    """Margins [s] over speed; where no gain gives the wanted one, none is drawn."""
    found = {}
    for zd in (None, *DAMPINGS):
        loops = loops_of(slope, speeds, zd)
        possible = loops[:, 0] > 0
        margins = np.full(len(speeds), np.nan)
        margins[possible] = np.asarray(_margins(loops[possible]).margin)
        found["without a filter" if zd is None else f"zd = {zd:g}"] = margins
    return found


def margin_rows(speeds: tuple[float, ...] = (10.0, 20.0, 30.0, 50.0)) -> list[dict[str, Any]]:
    """Margins [ms] by friction slope and filter; inf: no crossover; 0: unstable without delay."""
    rows = []
    for slope in SLOPES:
        for name, margins in curves(slope, np.array(speeds)).items():
            at = {f"{v:g} m/s": round(1e3 * float(m), 3) for v, m in zip(speeds, margins)}
            rows.append({"friction": slope.label, "filter": name, **at})
    return rows


def published_rows() -> list[dict[str, Any]]:
    """The single numbers of the source."""
    cases = {
        "mu' = 0, K = 62.83 v": (np.pi / 2 / WANTED * 20, 20.0, 0.0),
        "mu' > 0, K = 88.63 v, 180 km/h": (88.63 * 50, 50.0, 1875.0),
        "mu' > 0, K = 1723.37, 70 km/h": (88.63 * 70 * KMH, 70 * KMH, 1875.0),
        "mu' < 0, K = 800, 33 km/h": (800.0, 33 * KMH, -375.0),
        "mu' < 0, K = 300 below -theta, 33 km/h": (300.0, 33 * KMH, -375.0),
    }
    found = _margins(np.array([(*case, 1.0, 1.0, 1.0) for case in cases.values()]))
    rows = []
    for i, name in enumerate(cases):
        margin = 1e3 * float(found.margin[i])
        what = "unstable without delay" if not found.stable[i] else "stable at any" if np.isinf(margin) else "finite"
        rows.append({"loop": name, "margin [ms]": round(margin, 3), "crossover [rad/s]": _finite(found, i), "": what})
    return rows


def _finite(found, i: int) -> str:
    w = [float(c) for c in found.crossovers[i] if np.isfinite(c)]
    return ", ".join(f"{x:.2f}" for x in sorted(w)) or "none"


def simulated_rows(speeds: tuple[float, ...] = (10.0, 20.0, 50.0)) -> list[dict[str, Any]]:
    """Growth of the oscillation per second, at 0.98 and 1.02 of every finite margin; below 1 it decays."""
    named = [
        (slope.label, "none" if zd is None else f"{zd:g}", v, tuple(loops_of(slope, np.array([v]), zd)[0]))
        for slope in SLOPES
        for zd in (None, *DAMPINGS)
        for v in speeds
    ]
    loops = np.array([loop for *_, loop in named])
    margins = np.asarray(_margins(np.where(loops[:, :1] > 0, loops, 1.0)).margin)
    tested = np.flatnonzero((loops[:, 0] > 0) & np.isfinite(margins) & (margins > 0.004))
    shares = np.array([0.98, 1.02])
    K, v, theta, wn, zn, zd = np.repeat(loops[tested], 2, axis=0).T
    delay = np.repeat(margins[tested], 2) * np.tile(shares, len(tested))
    growth = growth_of(AccelerationLoop(K, v, theta, delay, wn, zn, zd)).reshape(-1, 2)
    return [
        {
            "friction": named[i][0],
            "zd": named[i][1],
            "speed [m/s]": named[i][2],
            "margin [ms]": round(1e3 * float(margins[i]), 3),
            "at 0.98": round(float(growth[j, 0]), 4),
            "at 1.02": round(float(growth[j, 1]), 4),
            "confirmed": "yes" if growth[j, 0] < 1 < growth[j, 1] else "no",
        }
        for j, i in enumerate(tested)
    ]


def growth_of(loop: AccelerationLoop) -> np.ndarray:
    """Factor by which the oscillation of lanes grows in a second, after the first half of a run."""
    steps, lanes = round(DURATION / STEP), len(np.asarray(loop.speed))
    path = (
        rollout(loop, loop.initial_state(np.ones(lanes)), step=STEP, steps=steps, save_every=1).raise_if_failed().path
    )
    size, part = np.abs(np.asarray(path.state.offset)), steps // 4
    early, late = size[:, steps // 2 : steps // 2 + part].max(axis=1), size[:, -part:].max(axis=1)
    return (late / early) ** (1 / (part * STEP))


def nyquist(loop: tuple[float, float, float], w: np.ndarray) -> np.ndarray:
    """G(j w) of K, v and theta; to be drawn."""
    K, v, theta = loop
    return K / (v * 1j * w + theta)


def gradient_rows() -> list[dict[str, Any]]:
    """Derivatives of a margin [ms per percent] against central differences."""
    names = ("K", "v", "theta", "wn", "zn", "zd")
    at = loops_of(Slope("", 100.0), np.array([20.0]), 0.1)[0]
    slopes = np.asarray(jax.grad(lambda p: delay_margin(*p).margin)(jnp.asarray(at)))
    move = 1e-6 * np.diag(at)
    differences = np.asarray(_margins(at + move).margin - _margins(at - move).margin) / (2e-6 * at)
    return [
        {"parameter": n, "derivative": float(f"{10 * x * p:.6g}"), "difference": float(f"{10 * d * p:.6g}")}
        for n, p, x, d in zip(names, at, slopes, differences)
    ]
