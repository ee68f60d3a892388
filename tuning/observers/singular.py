"""Observation through a singularity: what is seen of XBS where y = 0, and the switched observer in the loop there.

The 3-state observer tells five phases that track the acceleration what XBS is, at constant speed on a road whose c2
it knows. At the start its error is that of a road that has just changed. The pole is the published one, 0.1 in the
time of s(y) = -a y, so 0.1 a in that of y / v.
Source: Hoang 2014 (thesis), sections 2.1.3, 2.2.3 and 4.4, Figs 4.1 and 4.2; thresholds are not printed there.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from scipy.linalg import expm

from absjax.controllers.stiffness import StiffnessControl
from absjax.controllers.tracking import AccelerationTracking
from absjax.hybrid.rollout import rollout
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import FreeRamp
from absjax.observers import rls
from absjax.observers.along_a_run import admissible, certify_run
from absjax.observers.base import Sample
from absjax.observers.certificate import certify
from absjax.observers.observability import observability_rows
from absjax.observers.run import observe
from absjax.observers.switched import LinearModel, SwitchedObserver, constant_stiffness, known_road, unknown_road
from absjax.plant.brake import Brake
from absjax.plant.road import UniformRoad
from absjax.plant.test_rig import TestRig
from absjax.plant.wheel import Wheel
from absjax.tyres.burckhardt import Burckhardt
from tuning.observers.metrics import settling
from tuning.observers.scenarios import Scenarios

SPEED, DURATION, STEP = 17.8, 2.0, 2.5e-4
"""m/s, s, s"""
PERIOD = 1e-3
"""Between the points that are kept, s."""
ROAD = Burckhardt(1.28, 24.0, 0.52)
POLE = 0.1
"""Triple, in the time of the source."""
BEGUN = 5.0
"""Deceleration y from which on a run counts, m/s^2."""
BAND = 1.0
"""eps of Theorem 4.2, m/s^2."""
LEAST_ENERGY, LEAST_EIGENVALUE = 1.0, 1e-3
"""mu_0 [m^2/s^3] and mu_1 below which there is no excitation to speak of."""
QUICK = 60.0
"""Poles of the other observers where they are not those of the source, 1/(scaled time)."""
MODELS = {"2 states": constant_stiffness, "3 states": lambda wheel: known_road(wheel, 24.0), "4 states": unknown_road}


class Ride(NamedTuple):
    """A ride with an observer in the loop; arrays (samples,) unless said otherwise."""

    observer: SwitchedObserver
    time: np.ndarray
    samples: Sample
    stiffness: np.ndarray
    """true XBS"""
    errors: np.ndarray
    """z - z^, (samples, 3)"""
    onset: float
    """of the controller's first switching, s"""

    @property
    def lyapunov(self) -> np.ndarray:
        """e' P e."""
        return np.einsum("ti,ij,tj->t", self.errors, certify(self.observer).lyapunov, self.errors)


def placed(linear: LinearModel, wheel: Wheel) -> SwitchedObserver:
    """An observer with all its poles where the source has them."""
    rate = POLE * float(wheel.slip_gain)
    return SwitchedObserver.placed(linear, [(rate,)] * linear.A.shape[0])


def ride() -> Ride:
    """Five phases with acceleration tracking on the observed XBS."""
    wheel = Wheel()
    observer = placed(known_road(wheel, ROAD.c2), wheel)
    rig = TestRig(wheel, UniformRoad(ROAD), SPEED)
    loop = ClosedLoop(rig, Brake(), AccelerationTracking(wheel=wheel), driver=FreeRamp(), observer=observer)
    time, samples, stiffness, state, onset = _drive(loop)
    truth = samples.y, stiffness, np.full(time.size, float(ROAD.c2 * ROAD.c3))
    errors = np.stack([x - np.asarray(z) for x, z in zip(truth, state)], axis=1)
    return Ride(observer, time, samples, stiffness, errors, onset)


def _drive(loop: ClosedLoop) -> tuple[np.ndarray, Sample, np.ndarray, Any, float]:
    result = rollout(
        loop,
        loop.initial_state(jnp.asarray(SPEED)),
        step=STEP,
        steps=round(DURATION / STEP),
        save_every=round(PERIOD / STEP),
        max_events=400,
    )
    path = result.raise_if_failed().path
    signals = jax.tree.map(np.asarray, jax.vmap(loop.measured)(path.time, path.state, path.mode))
    onset = float(result.state.memory.control.onset_time)
    return np.asarray(path.time), Sample.of(signals), signals.stiffness, path.state.observer, onset


def rows(found: Ride) -> list[dict[str, Any]]:
    """The observer in the loop, and others on what it was told."""
    wheel, three = Wheel(), found.observer
    one_gain = SwitchedObserver(three.A, three.B, three.plus, three.plus)
    others = {
        "3 states, one gain for both signs": one_gain,
        f"3 states, poles -{QUICK:g}": SwitchedObserver.placed(known_road(wheel, ROAD.c2), [(QUICK,)] * 3),
        "2 states, XBS constant": placed(constant_stiffness(wheel), wheel),
        "4 states, road unknown": placed(unknown_road(wheel), wheel),
    }
    estimates = {"3 states, in the loop": found.stiffness - found.errors[:, 1]}
    estimates |= {k: np.asarray(observe(o, found.samples, PERIOD, substeps=4).stiffness) for k, o in others.items()}
    estimates["recursive least squares"] = np.asarray(rls.recursive(found.samples, PERIOD, wheel))
    begin, end = np.array([[found.onset]]), np.array([[DURATION]])
    late = found.time > 0.5 * DURATION
    table = []
    for label, estimate in estimates.items():
        error = estimate - found.stiffness
        settled = float(settling(found.time, error[None], begin, end)[0, 0])
        table.append(
            {
                "observer": label,
                "settles after the first switching [s]": round(settled, 3)
                if settled < DURATION - found.onset - 0.01
                else "never",
                "XBS rms, second half": float(f"{np.sqrt(np.mean(error[late] ** 2)):.3g}"),
            }
        )
    return table


def ride_figure(found: Ride):
    """What the loop does, and the errors of the observer ([H] Fig. 4.1)."""
    figure, grid = plt.subplots(5, 1, figsize=(9, 10), sharex=True, layout="constrained")
    time, errors = found.time, found.errors
    grid[0].plot(time, found.samples.y, "k", lw=0.9, label="true")
    grid[0].plot(time, found.samples.y - errors[:, 0], "C3--", lw=0.9, label="estimated")
    grid[0].set(ylabel="z1 = x2 [m/s²]", title="five phases with acceleration tracking on the observed XBS")
    grid[1].plot(time, found.stiffness, "k", lw=0.9, label="true")
    grid[1].plot(time, found.stiffness - errors[:, 1], "C3--", lw=0.9, label="estimated")
    grid[1].set(ylabel="z2 = XBS", ylim=(-3, 8))
    grid[2].plot(time, found.samples.pressure, "C0", lw=0.9)
    grid[2].set(ylabel="pressure [bar]")
    for k, (label, unit) in enumerate((("e1", " [m/s²]"), ("e2", ""), ("e3", ""))):
        grid[3].plot(time, errors[:, k] / np.abs(errors[:, k]).max(), lw=0.9, label=f"{label}{unit} / its largest")
    grid[3].set(ylabel="errors")
    grid[4].semilogy(time, found.lyapunov, "C2", lw=0.9)
    grid[4].set(ylabel="e' P e", xlabel="time [s]")
    for axes in grid:
        axes.axvline(found.onset, color="k", ls=":", lw=0.7)
        axes.grid(alpha=0.3)
    for axes in grid[[0, 1, 3]]:
        axes.legend(fontsize="small", loc="upper right")
    return figure


def error_plane_figure(found: Ride):
    """The error in the plane (e1, e2), from the first switching on ([H] Fig. 4.2)."""
    figure, axes = plt.subplots(figsize=(6, 5), layout="constrained")
    on = found.time >= found.onset
    e1, e2 = found.errors[on, 0], found.errors[on, 1]
    positive = found.samples.y[on] > 0
    for sign, colour, label in ((positive, "C0", "y > 0: A+"), (~positive, "C1", "y < 0: A-")):
        axes.plot(np.where(sign, e1, np.nan), np.where(sign, e2, np.nan), color=colour, lw=1.1, label=label)
    axes.plot(e1[0], e2[0], "ko", ms=5, label="first switching")
    axes.plot(0, 0, "k+", ms=9)
    axes.set(xlabel="e1: x2 [m/s²]", ylabel="e2: XBS", title="projection of the three-dimensional error")
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small")
    return figure


def conditioning(linear: LinearModel, y: np.ndarray) -> np.ndarray:
    """Least over largest singular value of C, C s A, ..., s = y / v; 0 where a direction is not seen."""
    rows = (np.asarray(observability_rows(linear.A, linear.C, value / SPEED)) for value in y)
    values = np.array([np.linalg.svd(each, compute_uv=False) for each in rows])
    return values[:, -1] / values[:, 0]


def decay_at(observer: SwitchedObserver, dwell: np.ndarray) -> np.ndarray:
    """Rate in scaled time at which the error decays where the sign of y changes every `dwell` of it, (dwells,).

    Both matrices share P, but neither decreases e' P e strictly: as dwell times vanish, so does the rate ([H] 2.7).
    """
    A, C = np.asarray(observer.A), np.eye(len(observer.B))[0]
    plus, minus = A - np.outer(observer.plus, C), -A + np.outer(observer.minus, C)
    radius = [np.abs(np.linalg.eigvals(expm(minus * d) @ expm(plus * d))).max() for d in dwell]
    return -np.log(radius) / (2 * dwell)


def indistinguishable(rate: float, stiffness: tuple[float, float] = (0.5, 3.0), duration: float = 0.15):
    """y of the 2-state model from y = 0 with either XBS under a constant dPb/dt [bar/s]: time [s], (2, samples)."""
    wheel, time = Wheel(), np.linspace(0.0, duration, 200)
    pace = wheel.slip_gain / SPEED * np.array(stiffness)[:, None]
    return time, -wheel.pressure_gain * rate / pace * (1 - np.exp(-pace * time))


def singularity_figure():
    """What is observable where y = 0, and what changes of its sign cost ([H] 2.24, Proposition 4.1, 2.7)."""
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(15, 4.2), layout="constrained")
    wheel, y = Wheel(), np.geomspace(1e-3, 50.0, 60)
    for label, model in MODELS.items():
        left.loglog(y, conditioning(model(wheel), y), label=label)
        dwell = np.geomspace(1e-2, 1.0, 60)
        right.loglog(dwell, decay_at(placed(model(wheel), wheel), dwell), label=label)
    left.set(xlabel="|y| [m/s²]", ylabel="least / largest singular value", title="rows C (s A)^k, s = y / v")
    for rate, colour in ((0.0, "C3"), (300.0, "C0")):
        time, pair = indistinguishable(rate)
        for values, style, xbs in zip(pair, ("-", "--"), ("0.5", "3")):
            middle.plot(1e3 * time, values, style, color=colour, label=f"dPb/dt = {rate:g} bar/s, XBS {xbs}")
    middle.set(xlabel="time [ms]", ylabel="y [m/s²]", title="two states with y = 0, with and without a control")
    right.axhline(POLE * float(wheel.slip_gain), color="k", ls=":", lw=0.8, label="the poles")
    right.set(xlabel="dwell time, scaled", ylabel="rate of decay, scaled", title="the sign of y changes periodically")
    for axes in (left, middle, right):
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize="small")
    return figure


def excited_rows(runs: dict[str, Scenarios], found: Ride) -> list[dict[str, Any]]:
    """What each kind of run offers an observer: Assumption 1 and Proposition 2 of [A], Theorem 4.2 of [H]."""
    told = {
        f"{name.replace('_', ' ')}, road changes": (
            jax.tree.map(lambda x: np.asarray(x)[0], each.samples),
            each.stiffness[0],
        )
        for name, each in runs.items()
    }
    told["tracking on observed XBS"] = (found.samples, found.stiffness)
    told["continuous control of XBS"] = continuous()
    table = []
    for label, (samples, stiffness) in told.items():
        begin = int(np.argmax(samples.y < -BEGUN))
        samples, stiffness = jax.tree.map(lambda x, k=begin: x[k:], (samples, stiffness))
        run = certify_run(samples, PERIOD, Wheel(), energy=LEAST_ENERGY, eigenvalue=LEAST_EIGENVALUE)
        control = admissible(samples, stiffness, PERIOD, Wheel(), BAND)
        table.append(
            {
                "run": label,
                "int y² over 1 s": float(f"{run.value('(3.17)'):.3g}"),
                "|dy/dt| at zeros [m/s³]": float(f"{run.value('(3.18)'):.3g}"),
                "dwell time [ms]": float(f"{1e3 * run.value('(3.19)'):.3g}"),
                "eigenvalue of int Psi'Psi": float(f"{run.value('(3.7)'):.3g}"),
                "assumptions": "hold" if run.holds else "fail: " + ", ".join(c.name.split(":")[0] for c in run.failed),
                "dwell, at least [ms]": float(f"{1e3 * control.conditions[-1].low:.3g}"),
                "admissible": "yes" if control.holds else "no",
            }
        )
    return table


def continuous() -> tuple[Sample, np.ndarray]:
    """A run under continuous control of the true XBS, which leads y to 0 and keeps it there."""
    controller = StiffnessControl(c=float(ROAD.c2), d=float(ROAD.c2 * ROAD.c3))
    loop = ClosedLoop(TestRig(Wheel(), UniformRoad(ROAD), SPEED), Brake(), controller, driver=FreeRamp())
    _, samples, stiffness, *_ = _drive(loop)
    return samples, stiffness
