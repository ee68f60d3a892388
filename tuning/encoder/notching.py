"""The notch filter in the loop, as published: it quietens control of slip, and brings the cycle of five phases back.

There the wheel's frequency lies far above that of the cycle, the filter is narrow, and the acceleration is not late.
What becomes of it in a stop to 20 km/h is in `tuning.encoder.sticking`.
Source: Hoang 2014 (thesis), Figs 8.1 to 8.4. Road, set point, amplitude and gains are not printed there.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from absjax.controllers.five_phase import FivePhase
from absjax.controllers.slip import SlipControl
from absjax.hybrid.rollout import rollout
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import FreeRamp
from absjax.loop.sampled_loop import SampledLoop
from absjax.parameters import model
from absjax.plant.brake import Brake
from absjax.plant.road import UniformRoad
from absjax.plant.test_rig import RigState, TestRig
from absjax.plant.wheel import Wheel
from absjax.signals import Signals
from absjax.tyres.surfaces import surface
from tuning.encoder.disturbance import OscillatingSensor
from tuning.encoder.loop import PERIOD
from tuning.observers.metrics import rms

RATIO = 0.01
"""zn / zd of the Bode plot."""
WIDTHS = (0.01, 0.1, 1.0)
"""zd of the Bode plot."""
WIDTH = 0.1
"""zd in the loop; the source has 0.1 and 0.01 where it computes delay margins."""
SLIP_AMPLITUDE, CYCLE_AMPLITUDE = 15.0, 5.0
"""A of the oscillation, under control of slip and under five phases, m/s^2."""
FAST, SLOW = 150 / 3.6, 80 / 3.6
"""Speeds between which the manoeuvre brakes, m/s."""
HELD, BRAKED = 1.0, 5.0
"""Time for which either is held, and from one to the other, s."""
CYCLE_SPEED = 130 / 3.6
"""At which five phases cycle, m/s."""
CYCLED = 4.0
"""s"""
TOLD = ("no oscillation", "not filtered", "notch filter at w", "notch filter at v / R")
"""What the controller may be told."""


@model
class HoldingRig(TestRig):
    """A test rig whose speed is held, changes at a constant rate, and is held again."""

    __test__ = False

    def _share(self, time):
        return jnp.clip(time - HELD, 0.0, BRAKED)

    def speed_of(self, time, state=None):
        """v(time) [m/s]."""
        return self.speed + self.acceleration * self._share(time)

    def position(self, time, state=None):
        """Length of drum surface passed [m]."""
        held = BRAKED * jnp.maximum(time - HELD - BRAKED, 0.0)
        return self.speed * time + self.acceleration * (0.5 * self._share(time) ** 2 + held)

    def signals(self, time, state: RigState, pressure) -> Signals:
        """Signals of the true state."""
        found = TestRig.signals(self, time, state, pressure)
        braking = jnp.where((time >= HELD) & (time < HELD + BRAKED), self.acceleration, 0.0)
        late = found.vehicle_acceleration - braking
        return found._replace(vehicle_acceleration=braking, acceleration_offset=found.acceleration_offset + late)


class Told(NamedTuple):
    """A run; arrays (samples,)."""

    time: np.ndarray
    signals: Signals
    """the true ones"""
    slip: np.ndarray
    offset: np.ndarray
    """x2 as the controller was told [m/s^2]"""
    rate: np.ndarray
    """dPb/dt [bar/s]"""


def filters(amplitude: float) -> dict[str, OscillatingSensor]:
    """What the controller may be told, by name."""
    sensors = (
        OscillatingSensor(0.0, filtered=False),
        OscillatingSensor(amplitude, filtered=False),
        OscillatingSensor(amplitude, WIDTH),
        OscillatingSensor(amplitude, WIDTH, by_vehicle=True),
    )
    return dict(zip(TOLD, sensors))


def _drive(rig: TestRig, controller: Any, sensor: OscillatingSensor, duration: float) -> Told:
    loop = ClosedLoop(rig, Brake(), controller, driver=FreeRamp())
    sampled = SampledLoop(loop, sensor)
    steps = round(duration / PERIOD)
    start = sampled.initial_state(jnp.asarray(rig.speed))
    path = rollout(sampled, start, step=PERIOD, steps=steps, save_every=1, max_events=500).raise_if_failed().path
    signals = jax.tree.map(np.asarray, jax.vmap(loop.measured)(path.time, path.state.loop, path.mode))
    slip = np.asarray(rig.wheel.slip(signals.wheel_speed, signals.vehicle_speed))
    return Told(
        np.asarray(path.time), signals, slip, np.asarray(path.state.sensor.told), np.asarray(path.state.rates[-1])
    )


def slip_runs(names: Sequence[str] = TOLD) -> dict[str, Told]:
    """Continuous wheel-slip control over the manoeuvre, by what x2 it is told; `names` of `filters`."""
    wheel = Wheel()
    rig = HoldingRig(wheel, UniformRoad(surface("dry_asphalt")), FAST, (SLOW - FAST) / BRAKED)
    controller = SlipControl(wheel=wheel, slip=-0.1, eps0=15.0)
    sensors = filters(SLIP_AMPLITUDE)
    return {name: _drive(rig, controller, sensors[name], 2 * HELD + BRAKED) for name in names}


def cycle_runs(names: Sequence[str] = TOLD) -> dict[str, Told]:
    """Five phases at constant speed, by what x2 they are told; `names` of `filters`."""
    rig = TestRig(Wheel(), UniformRoad(surface("dry_concrete")), CYCLE_SPEED)
    controller = FivePhase(ways_back=False)
    sensors = filters(CYCLE_AMPLITUDE)
    return {name: _drive(rig, controller, sensors[name], CYCLED) for name in names}


def slip_rows(runs: Mapping[str, Told]) -> list[dict[str, Any]]:
    """What is left of the oscillation while speed is held and while it changes; how restless pressure and slip are."""
    rows = []
    for name, run in runs.items():
        error, time = run.offset - run.signals.acceleration_offset, run.time
        parts = {
            "held, 150 km/h": (0.6, 1.0),
            "first half": (1.0, 3.5),
            "second half": (3.5, 6.0),
            "held, 80 km/h": (6.3, 7.0),
        }
        row: dict[str, Any] = {"told": name}
        for part, (begin, end) in parts.items():
            row[f"x2 off, {part} [m/s²]"] = round(float(rms(error, (time >= begin) & (time < end))), 3)
        late = time > 0.6
        row["dPb/dt, rms [bar/s]"] = round(float(rms(run.rate, late)), 1)
        row["slip, standard deviation"] = round(float(run.slip[late].std()), 5)
        rows.append(row)
    return rows


def cycle_rows(runs: Mapping[str, Told]) -> list[dict[str, Any]]:
    """Extent of the cycles after the first second, and the friction they use of what the road offers."""
    curve = surface("dry_concrete")
    rows = []
    for name, run in runs.items():
        late = run.time > 1.0
        used = -np.asarray(curve.friction(run.slip[late])).mean() / float(curve.peak().friction)
        x2 = run.signals.acceleration_offset[late]
        rows.append(
            {
                "told": name,
                "slip from": round(float(run.slip[late].min()), 3),
                "slip to": round(float(run.slip[late].max()), 3),
                "x2 from": round(float(x2.min()), 1),
                "x2 to": round(float(x2.max()), 1),
                "friction used [%]": round(100 * float(used), 2),
            }
        )
    return rows


def bode_figure():
    """Amplitude and phase of the filter by its width ([H] Fig. 8.1)."""
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(8, 6), sharex=True, layout="constrained")
    ratio = np.concatenate([np.geomspace(0.1, 10, 2001), 1 + np.linspace(-0.05, 0.05, 1001)])
    ratio.sort()
    for width in WIDTHS:
        response = transfer(ratio, RATIO * width, width)
        upper.semilogx(ratio, 20 * np.log10(np.abs(response)), label=f"zd = {width:g}")
        lower.semilogx(ratio, np.degrees(np.angle(response)))
    upper.set(ylabel="amplitude [dB]", title=f"notch filter, zn = {RATIO:g} zd")
    lower.set(ylabel="phase [°]", xlabel="frequency over that of the wheel")
    upper.legend(fontsize="small")
    for axes in (upper, lower):
        axes.grid(alpha=0.3, which="both")
    return figure


def transfer(ratio, depth: float, width: float):
    """N(i w) at w / wn = `ratio`, eq. 8.1."""
    s = 1j * np.asarray(ratio)
    return (s**2 + 2 * depth * s + 1) / (s**2 + 2 * width * s + 1)


def slip_figure(runs: Mapping[str, Told]):
    """x2 and pressure over the manoeuvre, with and without a filter ([H] Figs 8.2 and 8.3)."""
    names = [name for name in runs if name != "no oscillation"]
    figure, grid = plt.subplots(4, len(names), figsize=(5 * len(names), 10), sharey="row", layout="constrained")
    for column, name in zip(grid.T, names):
        run, ideal = runs[name], runs["no oscillation"]
        column[0].plot(run.time, 3.6 * run.signals.vehicle_speed, "k", label="vehicle")
        column[0].plot(run.time, 3.6 * run.signals.radius * run.signals.wheel_speed, "C0", lw=0.8, label="rim")
        for axes in column[1:3]:
            axes.plot(run.time, run.offset, "C3", lw=0.7, label="told")
            axes.plot(run.time, run.signals.acceleration_offset, "k", lw=0.9, label="true")
        column[3].plot(run.time, run.signals.pressure, "C3", lw=0.8, label=name)
        column[3].plot(ideal.time, ideal.signals.pressure, "k", lw=0.8, label="no oscillation")
        column[0].set(title=name)
        column[1].set(ylim=(-30, 30))
        column[2].set(xlim=(5.7, 6.4), ylim=(-20, 20))
        column[3].set(xlabel="time [s]", xlim=(0.3, 7.0), ylim=(35, 65))
        for axes in column:
            axes.grid(alpha=0.3)
    for axes, label in zip(grid[:, 0], ("speed [km/h]", "x2 [m/s²]", "x2 [m/s²], from 5.7 s", "pressure [bar]")):
        axes.set_ylabel(label)
        axes.legend(fontsize="small")
    return figure


def cycles_figure(runs: Mapping[str, Told]):
    """Cycles of five phases in the plane of slip and x2 ([H] Fig. 8.4)."""
    figure, grid = plt.subplots(
        1, len(runs), figsize=(4.6 * len(runs), 4.2), sharex=True, sharey=True, layout="constrained"
    )
    for axes, (name, run) in zip(grid, runs.items()):
        late = run.time > 1.0
        axes.plot(run.slip, run.signals.acceleration_offset, color="0.75", lw=0.7, label="first second")
        axes.plot(run.slip[late], run.signals.acceleration_offset[late], "C0", lw=0.9, label="later")
        axes.axvline(-float(surface("dry_concrete").peak().slip), color="k", ls=":", lw=0.8)
        axes.set(xlabel="slip λ", title=name)
        axes.grid(alpha=0.3)
    grid[0].set_ylabel("x2 [m/s²]")
    grid[0].legend(fontsize="small")
    return figure
