"""Random manoeuvres on random roads: `python -m tests.attack.side_slip [MANOEUVRES]`.

Made by the plain simulator of `tests.oracles.car_simulator`, estimated side by side in one vmap, and one by one for the
time. Prints the distribution of the side-slip error, and how often theta is right while the monitor says excited.
"""

import sys
import time

import jax
import numpy as np

from absjax.lanes import stacked
from absjax.sideslip.car import Car, CarSample
from absjax.sideslip.observer import better_gains
from absjax.sideslip.run import estimate, estimate_logs, padded
from tests.oracles.car_simulator import CAR, COLUMNS, drive

PERIOD = 0.01


def random_drive(seed: int):
    """A road of one friction or two, steered by two sines and a step; no spin: the steering suits the friction."""
    rng = np.random.default_rng(seed)
    first, second = np.exp(rng.uniform(np.log(0.2), 0.0, 2))
    change, speed = rng.uniform(3.0, 6.0), rng.uniform(8.0, 25.0)
    friction = (lambda t: first if t < change else second) if rng.random() < 0.5 else (lambda t: first)
    least = min(first, second) if friction(10.0) != first else first
    largest = rng.uniform(0.4, 0.9) * least * 9.81 * 2.5 / speed**2 + rng.uniform(0.0, 0.02)
    rates, phases = rng.uniform(0.1, 0.8, 2), rng.uniform(0, 6.28, 2)

    def steering(t):
        waves = np.sin(2 * np.pi * rates * t + phases) - np.sin(phases)
        return 0.6 * largest * waves.sum() * min(max(t - 0.5, 0.0), 1.0)

    push = rng.uniform(-0.15, 0.1) * least * 9.81
    return drive(steering, friction, speed, 10.0, push=lambda t: push if t > 2.0 else 0.0, seed=seed)


def main(count: int = 200) -> None:
    """Print the table."""
    jax.config.update("jax_enable_x64", True)
    made = [random_drive(seed) for seed in range(count)]
    logs = [CarSample(*(x[n] for n in COLUMNS[:4]), np.stack([x[n] for n in COLUMNS[4:]], 1)) for x in made]
    beside, cars = padded(logs), stacked([Car(**CAR)] * count)

    def timed(function):
        jax.block_until_ready(function())
        begun = time.perf_counter()
        found = jax.block_until_ready(function())
        return found, time.perf_counter() - begun

    run = jax.jit(lambda cars, logs: estimate_logs(better_gains(), cars, logs, PERIOD))
    found, together = timed(lambda: run(cars, beside))
    one = jax.jit(lambda log: estimate(better_gains(), Car(**CAR), log, PERIOD))
    _, alone = timed(lambda: [one(log) for log in logs])
    fixed = estimate_logs(better_gains(adapts=False), cars, beside, PERIOD)
    truth = {name: np.stack([x[name] for x in made]) for name in made[0] if name.startswith("true_")}
    slip = -np.arctan2(truth["true_vy_m_s"], truth["true_vx_m_s"])
    spun = np.abs(slip).max(axis=1) > np.radians(20)
    print(
        f"{count} manoeuvres of 10 s, {spun.sum()} of them spins; {count / together:.0f} logs/s in one vmap, ", end=""
    )
    print(f"{count / alone:.0f} one by one")
    for name, estimates in (("adapted", found), ("theta fixed at 1", fixed)):
        rms = np.degrees(np.sqrt(np.mean((np.asarray(estimates.estimate.side_slip) - slip)[:, 100:] ** 2, axis=1)))
        shares = np.quantile(rms[~spun], [0.1, 0.5, 0.9, 1.0])
        print(f"{name}: side-slip rms [deg], 10 %, half, 90 %, all below: " + ", ".join(f"{x:.3f}" for x in shares))
    excited = np.asarray(found.insight.low) < 0.5
    off = np.abs(np.asarray(found.estimate.friction) - truth["true_friction"])[excited]
    print(
        f"excited in {excited.mean():.0%} of the time; there theta within 0.1 of the friction of the road "
        f"in {np.mean(off < 0.1):.0%}"
    )
    used = np.hypot(*(np.stack([x[n] for x in made]) for n in COLUMNS[:2])) / 9.81 / truth["true_friction"]
    near = excited & (used > 0.7)
    off = np.abs(np.asarray(found.estimate.friction) - truth["true_friction"])[near]
    print(f"where more than 0.7 of the friction is used besides ({near.mean():.0%}): in {np.mean(off < 0.1):.0%}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
