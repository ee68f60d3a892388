"""What the grid step changes of random stops, down to walking pace: `python -m tests.attack.steps`.

For each controller, stops at several steps against those at the shortest: how many end otherwise or switch another
number of times, how many of these are told (`STEP_TOO_LARGE`, or unstable by their growth), and how far the distances
of the others are apart.
"""

import argparse
import dataclasses

import jax
import numpy as np

from absjax.controllers import CONTROLLERS
from absjax.loop.growth import is_unstable
from absjax.loop.stop import Outcome, stop
from tests.attack.stops import random_loop, random_speeds


def attack(kind, lanes: int, seed: int, steps: list[float], end: float) -> dict[float, dict]:
    """Outcomes, numbers of switchings, distances and whether they are unstable, (lanes,), of every step."""
    rng = np.random.default_rng(seed)
    loop, speed = random_loop(kind, rng, lanes), random_speeds(rng, lanes)
    loop = dataclasses.replace(loop, stop_speed=end)
    order = np.argsort(speed)
    loop = jax.tree.map(lambda leaf: leaf[order] if np.ndim(leaf) else leaf, loop)
    found = {}
    speed = speed[order]
    for step in steps:

        def run(v, step=step):
            result = stop(loop, v, horizon=14.0, step=step, max_events=800, tile=64)
            return result.distance, (result.rollout.events, result.outcome)

        if step == steps[-1]:
            distance, (events, outcome) = run(speed)
            unstable = np.zeros(lanes, bool)
        else:
            distance, change, (events, outcome) = jax.jvp(run, (speed,), (speed,), has_aux=True)
            unstable = is_unstable(change / distance)
        names = ("distance", "events", "outcome", "unstable")
        found[step] = dict(zip(names, map(np.asarray, (distance, events, outcome, unstable))))
    return found


def row(found: dict, shortest: dict) -> str:
    """A line of the table."""
    told = found["outcome"] == Outcome.STEP_TOO_LARGE
    plain = (shortest["outcome"] == Outcome.STOPPED) & ~told
    stops = plain & (found["outcome"] == Outcome.STOPPED)
    other, apart = found["events"] != shortest["events"], np.abs(found["distance"] - shortest["distance"])

    def far(which):
        if not which.any():
            return "0"
        return f"{which.sum()} (apart {np.median(apart[which]):.1e} m, at most {apart[which].max():.1e} m)"

    regular, unstable = stops & ~found["unstable"], stops & found["unstable"]
    return (
        f"told {told.sum()}; of {plain.sum()} that stop at the shortest, otherwise ended {(plain & ~stops).sum()}; "
        f"regular, as often switched {far(regular & ~other)}, otherwise {far(regular & other)}; "
        f"unstable, as often {far(unstable & ~other)}, otherwise {far(unstable & other)}"
    )


def main() -> None:
    """Print a row for each controller and step."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--lanes", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=float, nargs="*", default=[2e-3, 1e-3, 2.5e-4], help="s, the shortest last")
    parser.add_argument("--end", type=float, default=0.7, help="stop speed, m/s")
    parser.add_argument("--controllers", nargs="*", default=None, help="class names; all where not given")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    for kind in CONTROLLERS.values():
        if options.controllers and kind.__name__ not in options.controllers:
            continue
        found = attack(kind, options.lanes, options.seed, options.steps, options.end)
        for step in options.steps[:-1]:
            print(f"{kind.__name__:21} {1e3 * step:g} ms: {row(found[step], found[options.steps[-1]])}", flush=True)


if __name__ == "__main__":
    main()
