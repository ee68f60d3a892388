"""The chain in the loop: a stop under five phases told what an encoder's edges tell, against one told the truth.

Dry concrete from 130 km/h, thresholds 50, 30, 40, 20, 20 and 30 m/s^2, the automaton as
published, from whose holds there is no way back (Aguado-Rojas 2019, section 6.4). The slower
the wheel, the further back the last edges reach, and the later the controller is told, by an encoder without errors
too: below 20 km/h the wheel locks, so stops end there, and excursions count above 60 km/h.
"""

from typing import Any, NamedTuple

import jax
import numpy as np

from absjax.controllers.five_phase import FivePhase
from absjax.encoder.encoder import Encoder
from absjax.encoder.wheel_speed import WheelSpeedChain
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import Driver, FreeRamp
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.stop import Outcome, Stop, stop
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.sensors.encoder import EncoderSensor
from absjax.signals import Signals
from absjax.tyres.surfaces import surface

SPEED = 130 / 3.6
"""m/s"""
END_SPEED = 20 / 3.6
"""m/s"""
HORIZON = 6.0
"""Longest time of a stop, s."""
PERIOD = 1e-3
"""Between the ticks of the control unit, s."""
EXCURSION_SPEED = 60 / 3.6
"""Vehicle speed above which excursions count, m/s."""
SETTLED = 0.3
"""Time after the first switching from which excursions count, s."""
STUCK = 1.0
"""A cycle that lasts longer is counted as stuck, s."""


def braking_loop(observer: Any = None, free: bool = False) -> ClosedLoop:
    """The loop of the study; `free`: under the ramp of the source, the pressure free, below 0 too."""
    car = QuarterCar(Wheel(), UniformRoad(surface("dry_concrete")))
    driver = FreeRamp() if free else Driver()
    return ClosedLoop(car, Brake(), FivePhase(ways_back=False), stop_speed=END_SPEED, observer=observer, driver=driver)


class Course(NamedTuple):
    """A stop and its course, arrays (lanes, samples)."""

    stop: Stop
    time: np.ndarray
    signals: Signals
    """the true ones"""
    estimate: np.ndarray | None
    """XBS as the observer estimates it; None without one"""
    slip: np.ndarray
    valid: np.ndarray

    @property
    def settled(self) -> np.ndarray:
        """Samples on which excursions count."""
        onset = np.asarray(self.stop.rollout.state.loop.memory.control.onset_time)
        fast = self.signals.vehicle_speed > EXCURSION_SPEED
        return self.valid & fast & (self.time > onset[:, None] + SETTLED)


def course(
    sensor: EncoderSensor | None,
    observer: Any = None,
    substeps: int = 1,
    free: bool = False,
) -> Course:
    """A stop from 130 km/h under a sensor; None tells the truth. `free` as in `braking_loop`."""
    loop = braking_loop(observer, free)
    sampled = SampledLoop(loop, sensor, substeps=substeps)
    result = stop(sampled, np.array([SPEED]) if sensor is None else SPEED, horizon=HORIZON, step=PERIOD, save_every=1)
    trajectory = result.rollout.path
    time, state = np.asarray(trajectory.time), trajectory.state.loop
    signals = jax.vmap(jax.vmap(loop.measured))(time, state, np.asarray(trajectory.mode))
    estimate = None
    if observer is not None:
        estimate = np.asarray(observer.stiffness(state.observer, signals.acceleration_offset))
    signals = jax.tree.map(np.asarray, signals)
    slip = np.asarray(loop.plant.wheel.slip(signals.wheel_speed, signals.vehicle_speed))
    return Course(result, time, signals, estimate, slip, np.asarray(trajectory.valid))


def braked_wheel(samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Speed [rad/s] and acceleration [rad/s^2] of the wheel in the first samples of that stop, told the truth.

    Raises:
        ValueError: if the stop is shorter.
    """
    ideal = course(None)
    if ideal.valid.sum() < samples:
        raise ValueError(f"the stop has {ideal.valid.sum()} samples, {samples} are asked for")
    signals = jax.tree.map(lambda x: x[0, :samples], ideal.signals)
    return signals.wheel_speed, (signals.acceleration_offset + signals.vehicle_acceleration) / signals.radius


def loop_row(label: str, found: Course, ideal: float | None) -> dict[str, Any]:
    """What became of the stops under a sensor; `ideal` distance from the pedal [m], None where there is no driver."""
    stops, counts = found.stop, found.settled
    slip, offset = (np.where(counts, x, np.nan) for x in (found.slip, found.signals.acceleration_offset))
    distance = np.asarray(stops.distance)
    ended = np.asarray(stops.outcome) == Outcome.STOPPED

    def over(values, statistic=np.mean):
        return round(float(statistic(values)), 3)

    row: dict[str, Any] = {"told": label, "stops": int(distance.size), "do not end": int((~ended).sum())}
    for name, statistic in (("shortest", np.min), ("mean", np.mean), ("longest", np.max)):
        row[f"{name} [m]"] = round(float(statistic(distance[ended])), 2) if ended.any() else "-"
    known = None if ideal is None or not ended.any() else 100 * (float(distance[ended].mean()) / ideal - 1)
    row["mean above ideal [%]"] = "-" if known is None else round(known, 2)
    row["longest lock > 15 km/h [s]"] = round(float(np.max(stops.longest_lock[0])), 3)
    row["stuck"] = int((np.asarray(stops.longest_cycle) > STUCK).sum())
    row["slip from"], row["slip to"] = over(np.nanmin(slip, axis=1)), over(np.nanmax(slip, axis=1))
    row["x2 from"], row["x2 to"] = over(np.nanmin(offset, axis=1)), over(np.nanmax(offset, axis=1))
    return row


def sensors(encoder: Encoder, chains: dict[str, WheelSpeedChain]) -> dict[str, EncoderSensor]:
    """The sensors of the study by what the controller is told: chains on the encoders, and one without errors."""
    teeth = encoder.teeth
    found = {label: EncoderSensor(encoder, chain) for label, chain in chains.items()}
    blank = Encoder.ideal(teeth, phase=np.zeros(1))
    return {"encoder without errors": EncoderSensor(blank, chains["as measured"]), **found}
