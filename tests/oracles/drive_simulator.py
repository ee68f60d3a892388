"""The log of a drive: stops of the simulator, and in between the car stands and speeds up again."""

import numpy as np

from tests.oracles.log_scenarios import GRAVITY, LOGGED, Sensors, Stop
from tests.oracles.log_simulator import simulate

PUSH, CRUISE = 3.0, 0.4
"""Acceleration to the speed of the next stop [m/s^2]; time at constant speed before each [s]."""


def drive(stops: list[Stop], rest: float = 1.5, seed: int = 0):
    """Signals by name, `time` among them, and when each stop begins and ends [s].

    Args:
        stops: of one car, all sampled alike.
        rest: time for which the car stands after each stop but the last [s].
    """
    rng, records, period = np.random.default_rng(seed), simulate(stops), stops[0].logging.period
    pieces, spans, count = [], [], 0
    for i, (stop, record) in enumerate(zip(stops, records)):
        speeds = [(np.arange(0.0, stop.speed, PUSH * period), PUSH), (np.full(round(CRUISE / period), stop.speed), 0.0)]
        if i:
            speeds = [(np.zeros(round(rest / period)), 0.0), *speeds]
        pieces += [steadily(stop, speed, acceleration, rng) for speed, acceleration in speeds]
        count = sum(len(piece["acceleration"]) for piece in pieces)
        pieces.append(record.signals)
        spans.append((count * period, (count + len(record.time)) * period))
    signals = {name: np.concatenate([piece[name] for piece in pieces]) for name in LOGGED}
    return {"time": np.arange(count + len(records[-1].time)) * period, **signals}, spans


def steadily(stop: Stop, speed: np.ndarray, acceleration: float, rng) -> dict[str, np.ndarray]:
    """Signals at a constant acceleration; the brake carries what slows down, the engine what speeds up."""
    car, surface, friction = stop.car, stop.road.surfaces[0], acceleration / GRAVITY
    slips = np.linspace(0.0, surface.peak_slip, 2001)
    reached = surface.c1 * (1 - np.exp(-surface.c2 * slips)) - surface.c3 * slips
    slip = np.sign(friction) * np.interp(abs(friction), reached, slips)
    torque = car.radius * car.load * friction + car.inertia * (1 + slip) * acceleration / car.radius
    true = {
        "wheel_speed": (1 + slip) * speed / car.radius,
        "vehicle_speed": speed,
        "brake_pressure": np.full(len(speed), max(-torque, 0.0) / car.brake_efficiency),
        "acceleration": np.full(len(speed), acceleration),
    }
    noise = {name: getattr(Sensors(), name).noise * rng.standard_normal(len(speed)) for name in LOGGED}
    return {name: true[name] + (0.0 if "speed" in name and not speed.any() else noise[name]) for name in LOGGED}
