"""What the imperfections of encoders do: to their edges, to time-stamping, and to the models they are learned with.

Source: Aguado-Rojas 2019, Figs 5.3, 5.4 and 6.1, at 1020 rpm. The source's encoders are real; these are drawn at
random with errors of the usual sizes, and their edges jitter.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from absjax.encoder.encoder import Encoder
from absjax.encoder.position import PositionLeastSquares, learn_position
from absjax.encoder.wheel_speed import estimate
from tuning.encoder.bench import PERIOD, SPEED, bench_of, mean_errors
from tuning.encoder.chains import SIGNALS, filtered_chain, least_harmonics, measured_chain
from tuning.logs.edges import EdgeLog
from tuning.logs.teeth import passings_of
from tuning.logs.tooth_errors import ToothErrors, tooth_errors

REVOLUTIONS = 102
"""Of which the first and the last are not drawn."""
TICK = 1e-8
"""Of the clock that stamps the edges, s."""
TEETH, SEED = 60, 3
ENCODERS: dict[str, dict[str, Any]] = {
    "60 pulses": {"teeth": 60, "tolerance": 0.004, "eccentricity": 1.6e-4, "jitter": 0.001},
    "1024 pulses": {"teeth": 1024, "tolerance": 0.02, "eccentricity": 5e-5, "jitter": 0.01},
}
"""Errors in cycles but for the eccentricity [m]: a cycle of the finer one is a 17th of that of the other."""
EVENTS = (6, 10, 15, 20, 60)
SHOWN = 0.4
"""s"""
DURATION, SETTLE = 12.0, 6.0
"""Of what is learned, and from when on it counts, s."""


def steady_log(encoder: Encoder, name: str = "simulated") -> EdgeLog:
    """Edges of a wheel that turns at 1020 rpm."""
    passing = np.arange(REVOLUTIONS * encoder.teeth)
    turn, tooth = np.divmod(passing, encoder.teeth)
    angle = np.asarray(encoder.edge_angle(tooth, jnp.asarray(passing))) + 2 * np.pi * turn
    stamps = np.round(np.sort(angle) / SPEED / TICK).astype(np.int64)
    return EdgeLog(name, stamps - stamps[0], TICK, encoder.teeth)


def transitions() -> dict[str, ToothErrors]:
    """Errors of the edges, as a log of them tells, by encoder."""
    return {
        name: tooth_errors(passings_of(steady_log(Encoder.random(SEED, **made), name)))
        for name, made in ENCODERS.items()
    }


def transition_rows(found: dict[str, ToothErrors]) -> list[dict[str, Any]]:
    """What the log tells of each encoder, beside what it was made with."""
    rows = []
    for name, errors in found.items():
        made = ENCODERS[name]
        rows.append(
            {
                "encoder": name,
                "edges": int(errors.tooth.size),
                "e / r": float(f"{errors.eccentricity:.3g}"),
                "e / r, made with": made["eccentricity"] / float(Encoder.ideal(3).track_radius),
                "teeth within [cycles]": float(f"{errors.tolerance:.3g}"),
                "teeth, made with": made["tolerance"],
                "jitter [cycles]": float(f"{errors.jitter:.2g}"),
                "jitter, made with": made["jitter"],
            }
        )
    return rows


def transitions_figure(found: dict[str, ToothErrors]):
    """Error of every edge and the mean of each tooth, against the angle ([A] Fig. 5.3)."""
    figure, grid = plt.subplots(len(found), 1, figsize=(9, 3.4 * len(found)), layout="constrained")
    for axes, (name, errors) in zip(grid, found.items()):
        teeth = errors.mean.size
        pitch = 360 / teeth
        every = slice(teeth, -teeth, max(1, errors.tooth.size // 20000))
        axes.plot(pitch * errors.tooth[every], errors.error[every], ".", ms=1.5, alpha=0.3, label="an edge")
        axes.plot(pitch * np.arange(teeth), errors.mean, "kx", ms=3, mew=0.7, label="mean of a tooth")
        axes.set(title=f"{name}, 100 revolutions at 1020 rpm", ylabel="error [cycles]", xlabel="angle [°]")
        axes.legend(fontsize="small", loc="upper right")
        axes.grid(alpha=0.3)
    return figure


def stamped_figure():
    """Speed and acceleration by time-stamping over n events, each shifted ([A] Fig. 5.4)."""
    figure, axes = plt.subplots(2, 1, figsize=(9, 8), sharex=True, layout="constrained")
    bench = bench_of(Encoder.random([SEED], TEETH), "constant", SHOWN, 0.0)
    for i, events in enumerate(EVENTS):
        measured = estimate(measured_chain(TEETH, events), bench.edges, PERIOD)[0].measured
        time, valid = PERIOD * np.arange(len(measured.valid[0])), np.asarray(measured.valid[0])
        for panel, signal, step in zip(axes, SIGNALS, (2.0, 300.0)):
            shift = step * (len(EVENTS) // 2 - i)
            values = np.asarray(getattr(measured.rotation, signal)[0]) + shift
            panel.plot(time[valid], values[valid], lw=0.9, label=f"n = {events}, shifted by {shift:+g}")
    axes[0].axhline(SPEED, color="k", lw=0.5)
    axes[0].set(ylabel="wheel speed [rad/s]", title="1020 rpm, 60 teeth")
    axes[1].set(ylabel="wheel acceleration [rad/s²]", xlabel="time [s]")
    for panel in axes:
        panel.grid(alpha=0.3)
        panel.legend(fontsize="small", loc="center left", bbox_to_anchor=(1, 0.5))
    return figure


def stamped_rows(encoders: int = 16) -> list[dict[str, Any]]:
    """Errors of time-stamping over n events: what an encoder's imperfections cause, and what its lag does without."""
    steady = bench_of(Encoder.random(range(encoders), TEETH), "constant", 3.0, 1.0)
    perfect = {
        name: bench_of(Encoder.ideal(TEETH, phase=np.zeros(1)), name, 4.0, 2.5) for name in ("varying", "braking")
    }
    rows = []
    for events in EVENTS:
        chain = measured_chain(TEETH, events)
        row: dict[str, Any] = {"n": events}
        for label, bench in (("1020 rpm", steady), *((f"no imperfections, {k}", b) for k, b in perfect.items())):
            for signal, error in zip(SIGNALS, mean_errors(bench, chain)):
                row[f"{label}: {signal} rms"] = float(f"{error:.3g}")
        rows.append(row)
    return rows


class Learned(NamedTuple):
    """Coefficients of the three models from one encoder, [rad], (2 M,): a1, b1, a2, b2, ..."""

    recursive: dict[str, np.ndarray]
    """by recursive least squares, by model"""
    batch: dict[str, np.ndarray]
    """by least squares on the true signals"""
    rows: list[dict[str, Any]]
    """rms errors of each signal with the coefficients of each model"""


def learned(events: int = 15) -> Learned:
    """Learn the errors of one encoder with the models of position, speed and acceleration, at constant speed."""
    harmonics = least_harmonics(TEETH, events)
    bench = bench_of(Encoder.random([SEED], TEETH), "constant", DURATION, SETTLE)
    chain = filtered_chain(TEETH, events, harmonics)
    found, state = estimate(chain, bench.edges, PERIOD)
    measured = jax.tree.map(lambda x: x[0], found.measured)
    truth, late = jax.tree.map(np.asarray, bench.truth), np.asarray(bench.counts)
    squares = PositionLeastSquares(harmonics)
    recursive = {
        "position": np.asarray(learn_position(squares, measured.rotation.angle, measured.valid, PERIOD)[0][-1])
    }
    off = {"position": np.unwrap(np.asarray(measured.rotation.angle) - truth.angle)}
    phi = {"position": np.asarray(jax.vmap(squares.regressor)(measured.rotation.angle))}
    orders = np.repeat(np.arange(1, harmonics + 1), 2)
    for power, signal in enumerate(SIGNALS, start=1):
        compensation = getattr(chain, signal)
        kept = jax.tree.map(lambda x: x[0], getattr(state, signal))
        recursive[signal] = np.asarray(compensation.coefficients(kept))
        off[signal] = np.asarray(getattr(measured.rotation, signal)) - getattr(truth, signal)
        # The regressor comes on the scale of k^p times the coefficients.
        phi[signal] = np.asarray(jax.vmap(compensation.regressor)(measured)) * orders**power
    batch = {}
    for name, rows in phi.items():
        with_mean = np.column_stack([rows, np.ones(len(rows))])[late]
        batch[name] = np.linalg.lstsq(with_mean, off[name][late], rcond=None)[0][:-1]
    table = []
    for name, scale in (("position [mrad]", 1e3), ("speed [rad/s]", 1.0), ("acceleration [rad/s²]", 1.0)):
        signal = name.split(" ")[0]
        left = {"not compensated": off[signal]}
        left |= {f"with those of the {model}": off[signal] - phi[signal] @ each for model, each in recursive.items()}
        table.append({"rms of": name, **{k: float(f"{scale * x[late].std():.3g}") for k, x in left.items()}})
    return Learned(recursive, batch, table)


def models_figure(found: Learned):
    """Coefficients of the three models, learned and by batch least squares ([A] Fig. 6.1)."""
    figure, grid = plt.subplots(1, 2, figsize=(12, 4), sharey=True, layout="constrained")
    for axes, first, letter in zip(grid, (0, 1), "ab"):
        for i, (name, values) in enumerate(found.recursive.items()):
            order = np.arange(1, values.size // 2 + 1) + 0.27 * (i - 1)
            axes.bar(order, 1e3 * values[first::2], 0.27, color=f"C{i}", label=f"{name}, recursive")
            axes.plot(order, 1e3 * found.batch[name][first::2], "k_", ms=9)
        axes.plot([], [], "k_", ms=9, label="batch, on the true signals")
        axes.set(xlabel="harmonic k", ylabel=f"${letter}_k$ [mrad]")
        axes.grid(alpha=0.3)
    grid[0].legend(fontsize="small")
    return figure
