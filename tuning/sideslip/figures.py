"""Figures of side-slip: estimates against the truth as in Figs. 4 to 7 of [G], excitation, Figs. 2 and 3, tables."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from absjax.sideslip.excitation import PATTERNS
from absjax.sideslip.friction import TanhFriction
from tuning.logs.vehicle_log import VehicleLog
from tuning.sideslip.study import LogStudy

NOT_TOLD, LOW = "0.85", "C1"
REAL, ESTIMATED = {"color": "k", "ls": "--", "lw": 1.0}, {"color": "C0", "lw": 1.0}


def estimates_figure(study: LogStudy):
    """Longitudinal and lateral velocity, side-slip and friction; bands where the log does not tell the friction."""
    log, truth = study.log, study.log.truth
    panels: list[tuple[str, Any, Any]] = [
        ("longitudinal velocity [m/s]", study.estimate.longitudinal_speed, truth.get("longitudinal_speed")),
        ("lateral velocity [m/s]", study.estimate.lateral_speed, truth.get("lateral_speed")),
        ("side-slip β [deg]", np.degrees(study.estimate.side_slip), _true_degrees(log)),
        ("friction parameter θ", study.estimate.friction, truth.get("friction")),
    ]
    if study.offsets is not None:
        panels.append(("bank [deg]", np.degrees(study.offsets.bank), _degrees(truth.get("bank"))))
    figure, axes = plt.subplots(len(panels), 1, figsize=(9, 2.1 * len(panels)), sharex=True)
    for panel, (label, told, real) in zip(axes, panels):
        _bands(panel, study)
        if real is not None:
            panel.plot(log.time, real, **REAL, label="real")
        panel.plot(log.time, told, **ESTIMATED, label="estimated")
        if label.startswith("bank"):
            panel.plot(log.time, np.degrees(study.applied_bank), "C2", lw=1, label="beyond what biases explain")
            panel.legend(loc="best", fontsize="small")
        panel.set_ylabel(label, fontsize="small")
        panel.grid(alpha=0.3)
    axes[0].legend(loc="best", fontsize="small")
    axes[0].set_title(f"{log.name}; grey: the run does not tell θ, orange: the monitor draws θ to 1", fontsize="medium")
    axes[-1].set_xlabel("time [s]")
    return figure


def _degrees(angle):
    return None if angle is None else np.degrees(angle)


def _true_degrees(log: VehicleLog):
    return np.degrees(log.true_side_slip) if {"longitudinal_speed", "lateral_speed"} <= set(log.truth) else None


def _bands(panel, study: LogStudy) -> None:
    for interval in study.verdicts().get("friction", []):
        if not interval["identifiable"]:
            panel.axvspan(interval["from"], interval["to"], color=NOT_TOLD, lw=0)
    for interval in study.verdicts().get("monitor", []):
        if not interval["excited"]:
            panel.axvspan(interval["from"], interval["to"], ymax=0.06, color=LOW, alpha=0.6, lw=0)


def excitation_figure(study: LogStudy):
    """Choice functions, the sign of the slope, condition (9) in windows, and the driving pattern."""
    insight, told = study.insight, study.excitation
    assert insight is not None and told is not None
    time = study.log.time
    figure, axes = plt.subplots(5, 1, figsize=(9, 10.5), sharex=True)
    axes[0].plot(time, np.asarray(insight.slope) / 1e3, lw=0.9, label="∂f*_y/∂v_y")
    axes[0].plot(time, np.asarray(insight.xi) / 1e3, lw=0.7, alpha=0.7, label="ξ")
    axes[0].axhline(0, color="k", lw=0.6)
    axes[0].set_ylabel("[kN s/m]")
    axes[1].semilogy(time, insight.scaling, lw=0.9)
    axes[1].set_ylabel("Λ")
    axes[2].semilogy(time, np.maximum(told.determinant, 1e-12), lw=0.9, label="determinant (9) [m²/s⁴]")
    axes[2].semilogy(time, np.maximum(told.eigenvalue, 1e-12), lw=0.9, label="smallest eigenvalue [m²/s³]")
    axes[2].set_ylim(1e-6, None)
    axes[3].semilogy(time, told.deviation, lw=0.9)
    axes[3].axhline(0.1, color="k", ls=":", lw=1)
    axes[3].set(ylabel="θ told within", ylim=(5e-3, 5))
    axes[4].step(time, told.pattern, where="post", lw=0.9)
    axes[4].set_yticks(range(len(PATTERNS)), PATTERNS, fontsize="x-small")
    axes[4].set_xlabel("time [s]")
    for panel in axes:
        _bands(panel, study)
        panel.grid(alpha=0.3)
    for panel in (axes[0], axes[2]):
        panel.legend(loc="best", fontsize="x-small")
    axes[0].set_title(f"{study.log.name}: excitation; grey: the run does not tell θ", fontsize="medium")
    return figure


def friction_curves_figure():
    """Fig. 2: one tyre's curves, the friction in the model (solid) against theta times the nominal curve (dashed)."""
    nominal, tyre = 0.6, TanhFriction()
    slip = np.linspace(0, 0.3, 200)
    figure, axes = plt.subplots(figsize=(7, 4))
    for i, friction in enumerate((0.2, 0.4, 0.6, 0.8, 1.0)):
        model = friction * np.tanh(float(tyre.stiffness_at_rest) * slip / friction)
        scaled = friction * np.tanh(float(tyre.stiffness_at_rest) * slip / nominal)
        axes.plot(slip, model, color=f"C{i}", label=f"{friction:g}")
        axes.plot(slip, scaled, color=f"C{i}", ls="--")
    axes.set(xlabel="slip", ylabel="friction", title="μ_H in the model (solid), θ at μ*_H = 0.6 (dashed)")
    axes.legend(title="at large slip", loc="lower right", fontsize="small")
    axes.grid(alpha=0.3)
    return figure


def friction_parameter_figure(log: VehicleLog, implied, estimated):
    """Fig. 3: the theta that makes (2) hold at the true velocities, beside the adapted one."""
    figure, axes = plt.subplots(figsize=(9, 3))
    axes.plot(log.time, implied, ".", ms=1, color="0.6", label="m a_y / f*_y at the truth")
    axes.plot(log.time, estimated, **ESTIMATED, label="adapted")
    if "friction" in log.truth:
        axes.plot(log.time, log.truth["friction"], **REAL, label="of the road")
    axes.set(xlabel="time [s]", ylabel="θ", ylim=(0, 1.4), title=f"{log.name}: friction parameter")
    axes.legend(loc="upper right", fontsize="small", markerscale=8)
    axes.grid(alpha=0.3)
    return figure


def comparison_figure(names: Sequence[str], errors: Mapping[str, np.ndarray]):
    """Side-slip error of every estimator on every log."""
    figure, axes = plt.subplots(figsize=(9, 4.5))
    width = 0.8 / len(errors)
    for i, (title, values) in enumerate(errors.items()):
        axes.bar(np.arange(len(names)) + (i - len(errors) / 2 + 0.5) * width, values, width, label=title)
    axes.set_yscale("log")
    axes.set_xticks(range(len(names)), names, fontsize="small")
    axes.set(ylabel="side-slip, rms [deg]")
    axes.legend(fontsize="x-small", loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    axes.grid(axis="y", alpha=0.3)
    return figure


def history_figure(history: Sequence[Sequence[float]]):
    """Cost of each start, by iteration."""
    figure, axes = plt.subplots(figsize=(7, 3.5))
    axes.plot(np.asarray(history), lw=1)
    axes.set(xlabel="iteration", ylabel="log of errors, after / before")
    axes.grid(alpha=0.3)
    return figure
