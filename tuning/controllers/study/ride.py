"""What else a driver notices of a stop: how it jerks, how far the wheel slips."""

from typing import Any, NamedTuple

import jax
import numpy as np

from absjax.hybrid.recording import Trajectory
from absjax.lanes import over_lanes
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.memory import LOCK_SPEEDS
from absjax.loop.sampled_loop import loop_state
from absjax.loop.stop import Stop
from absjax.signals import Signals

LARGE_SLIP = 0.5


class Ride(NamedTuple):
    """Figures of recorded stops, arrays (lanes,); or of one."""

    jerk: Any
    """root mean square of the change of deceleration from the first switching on, m/s^3"""
    largest_slip: Any
    """largest |slip| above 15 km/h"""
    time_above_large_slip: Any
    """time with |slip| above 0.5, s"""


def signals_along(loop: ClosedLoop, path: Trajectory) -> Signals:
    """The true signals of recorded lanes, arrays (lanes, points)."""
    state = loop_state(path.state)
    return over_lanes(lambda loop, *at: jax.vmap(loop.measured)(*at), loop, path.time, state, path.mode)


def ride_of(loop: ClosedLoop, stops: Stop) -> Ride:
    """Of stops whose trajectory was kept."""
    path = stops.rollout.path
    signals = signals_along(loop, path)
    valid, time = np.asarray(path.valid), np.asarray(path.time)
    speed, acceleration = np.asarray(signals.vehicle_speed), np.asarray(signals.vehicle_acceleration)
    radius = np.asarray(signals.radius)
    slip = np.abs(radius * np.asarray(signals.wheel_speed) / speed - 1)
    period = np.diff(time, axis=1)
    state = stops.rollout.state
    memory = loop_state(state).memory
    onset = np.asarray(stops.onset_time + memory.pedal_time)
    counts = valid[:, 1:] & (time[:, :-1] > onset[:, None])
    jerk = np.where(counts, np.diff(acceleration, axis=1) / np.where(counts, period, 1.0), 0.0)
    return Ride(
        jerk=np.sqrt((jerk**2).sum(axis=1) / np.maximum(counts.sum(axis=1), 1)),
        largest_slip=np.where(valid & (speed > LOCK_SPEEDS[0]), slip, 0.0).max(axis=1),
        time_above_large_slip=np.where(valid[:, 1:] & (slip[:, 1:] > LARGE_SLIP), period, 0.0).sum(axis=1),
    )
