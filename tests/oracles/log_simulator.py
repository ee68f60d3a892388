"""Brake logs from a simulator of its own: NumPy alone, nothing of the project's engine, models or readers.

`simulate` takes the scenarios of `log_scenarios`: `simulate(random_stops(200, seed=1))` gives 200 records, whose
`write_csv` writes log and car, and whose `truth` says what they were made from.
"""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tests.oracles.log_dynamics import TICK, Trace, drive
from tests.oracles.log_scenarios import Car, Channel, RigSweep, Scenario, Stop, Surface, TwoAxleStop

COLUMNS = {
    "wheel_speed": "wheel_speed_rad_s",
    "vehicle_speed": "vehicle_speed_m_s",
    "brake_pressure": "brake_pressure_bar",
    "acceleration": "longitudinal_acceleration_m_s2",
    "force": "longitudinal_force_n",
    "load": "vertical_load_n",
}


@dataclasses.dataclass(frozen=True)
class Truth:
    """What the log was made from; signals are as they were, at the times of the log."""

    surfaces: tuple[Surface, ...]
    """those the logged wheel met"""
    starts: tuple[float, ...]
    """s: when it met them, 0 first"""
    car: Car
    """of the logged wheel"""
    brake_lag: float
    brake_delay: float
    signals: dict[str, np.ndarray]
    """time, those of `COLUMNS`, acting_pressure, slip, friction"""

    @property
    def locks(self) -> bool:
        """Whether the logged wheel comes to rest, or so near that its speed drowns in noise."""
        return bool(self.signals["wheel_speed"].min() < 0.5)

    def slips(self, i: int) -> np.ndarray:
        """Slips seen on surface i, once the road has settled."""
        time = self.signals["time"]
        ends = (*self.starts[1:], np.inf)
        return self.signals["slip"][(time >= self.starts[i] + (0.05 if i else 0.0)) & (time < ends[i])]


@dataclasses.dataclass(frozen=True)
class Record:
    """A log, and what it was made from."""

    time: np.ndarray
    signals: dict[str, np.ndarray]
    """as logged, by the names of `COLUMNS`"""
    truth: Truth
    declared: Car
    """as the car's file has it"""
    scenario: Scenario

    def write_csv(self, path: Path) -> None:
        """The log at `path`, and its car as JSON of the same name."""
        table = np.column_stack([self.time, *self.signals.values()])
        header = ",".join(["time_s", *(COLUMNS[name] for name in self.signals)])
        np.savetxt(path, table, "%.4f", ",", header=header, comments="")
        path.with_suffix(".json").write_text(json.dumps(dataclasses.asdict(self.declared), indent=1))


def simulate(scenarios: Sequence[Scenario]) -> list[Record]:
    """The log of each scenario, in their order; stops of a kind run together."""
    traces: dict[int, tuple[Trace, int]] = {}
    for kind in (Stop, TwoAxleStop):
        chosen = [i for i, s in enumerate(scenarios) if isinstance(s, kind)]
        if chosen:
            traces |= {
                i: (trace, int(getattr(scenarios[i], "logged_axle", "front") == "rear"))
                for i, trace in zip(chosen, drive([scenarios[i] for i in chosen]))
            }
    traces |= {i: (_swept(s), 0) for i, s in enumerate(scenarios) if isinstance(s, RigSweep)}
    return [_record(s, *traces[i]) for i, s in enumerate(scenarios)]


def _swept(rig: RigSweep) -> Trace:
    """All by hand: w = (1 + slip) v / R, torque = R Fx + J w'."""
    time = np.arange(round(rig.logging.duration / TICK) + 1) * TICK
    low, high = rig.slip
    angle = 2 * np.pi * time / rig.sweep
    slip = high - (high - low) * (1 - np.cos(angle)) / 2
    slip_rate = -(high - low) * np.pi / rig.sweep * np.sin(angle)
    load = rig.car.load * (1 + rig.load_swing * np.sin(angle / 3))
    c, s = rig.surface, np.abs(slip)
    friction = np.sign(slip) * (c.c1 * (1 - np.exp(-c.c2 * s)) - c.c3 * s)
    torque = rig.car.radius * friction * load + rig.car.inertia * slip_rate * rig.speed / rig.car.radius
    pressure = np.maximum(-torque, 0.0) / rig.car.brake_efficiency
    speed = np.full_like(time, rig.speed)
    w, pressure, friction, load = (x[:, None] for x in (speed * (1 + slip) / rig.car.radius, pressure, friction, load))
    return Trace(time, speed, w, pressure, pressure, np.zeros_like(time), friction, load, np.zeros((0, 1)))


def _record(scenario: Scenario, trace: Trace, axle: int) -> Record:
    logging = scenario.logging
    surfaces = (scenario.surface,) if isinstance(scenario, RigSweep) else scenario.road.surfaces
    car = scenario.car if not isinstance(scenario, TwoAxleStop) else (scenario.front, scenario.rear)[axle]
    starts = (0.0, *(float(t) for t in trace.starts[:, axle] if t < trace.time[-1]))
    every = {
        "wheel_speed": trace.wheel_speed[:, axle],
        "vehicle_speed": trace.speed,
        "brake_pressure": trace.logged_pressure[:, axle],
        "acting_pressure": trace.acting_pressure[:, axle],
        "acceleration": trace.acceleration,
        "force": (trace.friction * trace.load)[:, axle],
        "load": trace.load[:, axle],
        "slip": car.radius * trace.wheel_speed[:, axle] / trace.speed - 1,
        "friction": trace.friction[:, axle],
    }
    time = np.arange(int(trace.time[-1] / logging.period + 1e-6) + 1) * logging.period
    rng = np.random.default_rng(logging.seed)
    seeds = {name: rng.integers(2**63) for name in COLUMNS}
    signals = {
        name: _logged(getattr(logging.sensors, name), trace.time, every[name], time, np.random.default_rng(seeds[name]))
        for name in logging.columns
    }
    brake = getattr(scenario, "brake", None)
    truth = Truth(
        surfaces[: len(starts)],
        starts,
        car,
        brake.lag if brake else 0.0,
        brake.delay if brake else 0.0,
        {"time": time, **{name: np.interp(time, trace.time, x) for name, x in every.items()}},
    )
    return Record(time, signals, truth, logging.declared or car, scenario)


def _logged(channel: Channel, time, values, at, rng) -> np.ndarray:
    """A channel's samples at the times `at` of the log."""
    period = channel.period or (at[1] - at[0])
    index = np.floor(at / period + 1e-6).astype(int)
    sampled = np.interp(np.arange(index[-1] + 1) * period - channel.delay, time, values)
    sampled = sampled + channel.bias + channel.noise * rng.standard_normal(len(sampled))
    if channel.quantum:
        sampled = channel.quantum * np.round(sampled / channel.quantum)
    return np.maximum(sampled, channel.lowest)[index]
