"""What the grid step changes of random stops, down to walking pace: `python -m tests.attack.steps`.

For each controller, stops at several steps against those at the shortest: how many end otherwise or switch another
number of times, how many of these are told (`STEP_TOO_LARGE`, or unstable by their growth), and how far the distances
of the others are apart. Those that switch otherwise and are not told are braked again, to higher stop speeds: how many
have parted by then. Of some of them only the end falls before a switching instead of after it. Last, how many of them
`absjax.loop.step_check` tells, and how many it tells in all.
"""

import argparse
import dataclasses

import jax
import numpy as np

from absjax.lanes import repeated, taken
from absjax.loop.delayed_loop import DelayedLoop, nodes_of
from absjax.loop.growth import is_unstable
from absjax.loop.step_check import differs
from absjax.loop.stop import Outcome, stop
from tests.attack.stops import DELAYS, KINDS, random_loop, random_speeds

ABOVE = (3.0, 2.0, 1.0)
"""Stop speeds down to which stops that switch otherwise are looked at again, m/s."""
PADDED = 32
"""Lanes of those are a multiple of it, so that controllers share programs."""


def random_stops(kind, lanes: int, seed: int, end: float):
    """Loop and initial speeds, in the order of the speeds."""
    rng = np.random.default_rng(seed)
    loop, speed = random_loop(kind, rng, lanes), random_speeds(rng, lanes)
    order = np.argsort(speed)
    return dataclasses.replace(taken(loop, order), stop_speed=end), speed[order]


def braked(loop, speed, step: float, **options):
    """The stops."""
    if isinstance(loop, DelayedLoop):
        loop = dataclasses.replace(loop, nodes=nodes_of(DELAYS[1], step))
    return stop(loop, speed, horizon=14.0, step=step, max_events=800, tile=64, **options)


def attack(loop, speed, steps: list[float]) -> dict[float, dict]:
    """Outcomes, numbers of switchings, distances, whether they are unstable and whether they differ at half the step,
    (lanes,), of every step."""
    found = {}
    for step in steps:

        def run(v, step=step):
            result = braked(loop, v, step)
            return result.distance, result

        if step == steps[-1]:
            distance, result = run(speed)
            unstable = halved = np.zeros(len(speed), bool)
        else:
            distance, change, result = jax.jvp(run, (speed,), (speed,), has_aux=True)
            unstable, halved = is_unstable(change / distance), differs(result, braked(loop, speed, step / 2))
        names = ("distance", "events", "outcome", "unstable", "halved")
        values = (distance, result.events, result.outcome, unstable, halved)
        found[step] = dict(zip(names, map(np.asarray, values)))
    return found


def parted(loop, speed, lanes, step: float, shortest: float) -> str:
    """How many of some lanes part only at their end, and how many switch another number of times down to each speed of
    `ABOVE` [m/s] already."""
    if not len(lanes):
        return "none"
    padded = np.resize(lanes, -(-len(lanes) // PADDED) * PADDED)
    some, speed = taken(loop, padded), speed[padded]
    several = dataclasses.replace(repeated(some, len(ABOVE)), stop_speed=np.tile(ABOVE, len(padded)).astype(float))
    events = [np.asarray(braked(several, np.repeat(speed, len(ABOVE)), h).rollout.events) for h in (step, shortest)]
    differ = (events[0] != events[1]).reshape(-1, len(ABOVE))[: len(lanes)]
    already = ", ".join(f"{n} down to {v:g} m/s" for v, n in zip(ABOVE, differ.sum(axis=0)))
    if isinstance(loop, DelayedLoop):
        # The record of its past would not fit into the memory.
        return f"already {already}"
    paths = [np.asarray(braked(some, speed, h, save_switches=True).rollout.log.target) for h in (step, shortest)]
    ends = sum(_same_but_the_end(*pair) for pair in zip(paths[0][: len(lanes)], paths[1]))
    return f"only at the end {ends}; already {already}"


def _same_but_the_end(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether a sequence of modes, its end left away, is how the other begins."""
    one, other = (modes[modes >= 0] for modes in (one, other))
    some = min(len(one), len(other))
    return bool(np.array_equal(one[:some], other[:some]))


def row(found: dict, shortest: dict) -> tuple[str, np.ndarray]:
    """A line of the table, and the lanes that switch otherwise and are not told."""
    told = found["outcome"] == Outcome.STEP_TOO_LARGE
    plain = (shortest["outcome"] == Outcome.STOPPED) & ~told
    stops = plain & (found["outcome"] == Outcome.STOPPED)
    other, apart = found["events"] != shortest["events"], np.abs(found["distance"] - shortest["distance"])

    def far(which):
        if not which.any():
            return "0"
        return f"{which.sum()} (apart {np.median(apart[which]):.1e} m, at most {apart[which].max():.1e} m)"

    regular, unstable = stops & ~found["unstable"], stops & found["unstable"]
    line = (
        f"told {told.sum()}; of {plain.sum()} that stop at the shortest, otherwise ended {(plain & ~stops).sum()} "
        f"{np.flatnonzero(plain & ~stops).tolist()}; "
        f"regular, as often switched {far(regular & ~other)}, otherwise {far(regular & other)}; "
        f"unstable, as often {far(unstable & ~other)}, otherwise {far(unstable & other)}"
    )
    checked = found["halved"] & plain
    missed = (regular & other & ~checked).sum()
    line += f"; another at half the step {checked.sum()}, not among them {missed} of the regular that switch otherwise"
    return line, np.flatnonzero(regular & other)


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
    for kind in KINDS:
        if options.controllers and kind.__name__ not in options.controllers:
            continue
        loop, speed = random_stops(kind, options.lanes, options.seed, options.end)
        found = attack(loop, speed, options.steps)
        for step in options.steps[:-1]:
            line, lanes = row(found[step], found[options.steps[-1]])
            already = parted(loop, speed, lanes, step, options.steps[-1])
            print(f"{kind.__name__:21} {1e3 * step:g} ms: {line}", flush=True)
            print(f"    the regular that switch otherwise: {lanes.tolist()}; {already}", flush=True)


if __name__ == "__main__":
    main()
