"""Why five phases stick behind a notch filter in a stop, where it is published to help them.

The cycle becomes quicker as the car slows down (the rates of the pressure are u / (R w)), the wheel slower: at some
45 km/h they meet, and there the filter takes off the very signal that the controller switches on, with no oscillation
to take off at all. The wider the filter and the later the acceleration, the sooner; a stop from 130 to 20 km/h passes
through those speeds, the published runs end at 80 km/h.
"""

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from absjax.controllers.five_phase import FivePhase
from absjax.encoder.encoder import Encoder
from absjax.encoder.notch import NotchFilter
from absjax.encoder.time_stamping import TimeStamping
from absjax.encoder.wheel_speed import WheelSpeedChain
from absjax.hybrid.rollout import rollout
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import FreeRamp
from absjax.loop.sampled_loop import SampledLoop
from absjax.plant.brake import Brake
from absjax.plant.road import UniformRoad
from absjax.plant.test_rig import TestRig
from absjax.plant.wheel import Wheel
from absjax.sensors.encoder import EncoderSensor
from absjax.tyres.surfaces import surface
from tuning.encoder.disturbance import OscillatingSensor
from tuning.encoder.loop import PERIOD, STUCK, Course, course

SPEEDS_KMH = np.array([130.0, 100.0, 70.0, 55.0, 43.0, 30.0])
"""Held constant where frequencies are counted."""
COUNTED = 3.0
"""Time for which they are, s."""
WIDTHS = (0.05, 0.1, 0.5)
"""zd of the filters in the stops."""


def frequency_rows() -> list[dict[str, Any]]:
    """Turns of the wheel and cycles a second at constant speeds; cycles behind a filter with nothing to take off."""
    speed = SPEEDS_KMH / 3.6
    found = {}
    for label, sensor in (
        ("told the truth", OscillatingSensor(0.0 * speed, filtered=False)),
        *((f"notch filter, zd = {width:g}", OscillatingSensor(0.0 * speed, width)) for width in (0.1, 0.5)),
    ):
        loop = ClosedLoop(
            TestRig(Wheel(), UniformRoad(surface("dry_concrete")), speed),
            Brake(),
            FivePhase(ways_back=False),
            driver=FreeRamp(),
        )
        sampled = SampledLoop(loop, sensor)
        steps = round(COUNTED / PERIOD)
        result = rollout(sampled, sampled.initial_state(jnp.asarray(speed)), step=PERIOD, steps=steps, max_events=500)
        memory = result.raise_if_failed().state.loop.memory
        # From the first entry to the last, cycles - 1 of them; none that takes longer than a second counts as one.
        sticks = COUNTED - np.asarray(memory.control.cycle_time) > STUCK
        spent = np.maximum(np.asarray(memory.control.cycle_time) - np.asarray(memory.control.onset_time), PERIOD)
        found[label] = np.where(sticks, 0.0, (np.asarray(memory.control.cycles) - 1) / spent)
    return [
        {
            "km/h": float(kmh),
            "wheel [1/s]": round(float(v / Wheel().radius / (2 * np.pi)), 1),
            **{f"cycles [1/s], {label}": round(float(x[i]), 1) if x[i] else "sticks" for label, x in found.items()},
        }
        for i, (kmh, v) in enumerate(zip(SPEEDS_KMH, speed))
    ]


def sticking_courses(encoder: Encoder, events: int) -> dict[str, Course]:
    """Stops from 130 to 20 km/h behind notch filters, by what there is to filter, and how wide the filter is."""
    blank = Encoder.ideal(encoder.teeth, phase=np.zeros(1))

    def chain(width: float) -> WheelSpeedChain:
        parts = (NotchFilter(signal, width=width) for signal in ("speed", "acceleration"))
        return WheelSpeedChain(TimeStamping(encoder.teeth, events), *parts)

    told: dict[str, Any] = {}
    for width in WIDTHS:
        told[f"the truth, zd = {width:g}"] = OscillatingSensor(np.zeros(1), width)
        told[f"encoder without errors, zd = {width:g}"] = EncoderSensor(blank, chain(width))
        told[f"encoders, zd = {width:g}"] = EncoderSensor(encoder, chain(width))
    return {label: course(sensor) for label, sensor in told.items()}


def last_cycle_kmh(found: Course) -> np.ndarray:
    """Vehicle speed at which the last cycle begins [km/h], (lanes,)."""
    begun = np.asarray(found.stop.rollout.state.loop.memory.control.cycle_time)
    return np.array(
        [
            3.6 * np.interp(t, time[ok], v[ok])
            for t, time, v, ok in zip(begun, found.time, found.signals.vehicle_speed, found.valid)
        ]
    )


def stuck(found: Course) -> np.ndarray:
    """Whether a stop has a cycle that lasts longer than a second, or does not end, (lanes,)."""
    return np.asarray(found.stop.longest_cycle) > STUCK


def sticking_rows(courses: Mapping[str, Course]) -> list[dict[str, Any]]:
    """How many stops stick, and at what speed their last cycle begins."""
    rows = []
    for label, found in sorted(courses.items()):
        last, held = last_cycle_kmh(found), stuck(found)
        rows.append(
            {
                "told by": label,
                "stops": int(held.size),
                "stuck": int(held.sum()),
                "last cycle from [km/h], least": round(float(last.min()), 1),
                "median": round(float(np.median(last)), 1),
                "most": round(float(last.max()), 1),
            }
        )
    return rows


def sticking_figure(frequencies: list[dict[str, Any]], courses: Mapping[str, Course]):
    """Where the cycle's frequency meets the wheel's, and where stops behind a notch filter begin their last cycle."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(13, 4.6), layout="constrained")
    kmh = [row["km/h"] for row in frequencies]
    left.plot(kmh, [row["wheel [1/s]"] for row in frequencies], "k.-", label="turns of the wheel")
    for i, name in enumerate(key for key in frequencies[0] if key.startswith("cycles")):
        values = [0.0 if row[name] == "sticks" else row[name] for row in frequencies]
        left.plot(kmh, values, "o--", color=f"C{i}", ms=4, label=name.replace(" [1/s]", ""))
    left.set(xlabel="speed, held constant [km/h]", ylabel="1/s", title="nothing to filter; 0: sticks")
    labels = sorted(courses, reverse=True)
    for row, label in enumerate(labels):
        last, held = last_cycle_kmh(courses[label]), stuck(courses[label])
        right.plot(last[held], np.full(held.sum(), row), "C3x", ms=6)
        right.plot(last[~held], np.full((~held).sum(), row), "C2o", ms=5, mfc="none")
    right.plot([], [], "C3x", label="stuck")
    right.plot([], [], "C2o", mfc="none", label="not stuck")
    right.set_yticks(range(len(labels)), labels, fontsize=8)
    right.set(xlabel="speed at which the last cycle begins [km/h]", title="stops from 130 to 20 km/h", xlim=(15, 135))
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small")
    return figure
