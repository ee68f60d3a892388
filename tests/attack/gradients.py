"""Gradients of the stopping distance of random stops against central differences: `python -m tests.attack.gradients`.

Of every lane, the derivative along one random direction of all trainable parameters, by forward mode. Differences
count where three widths in the ratio 4, of twelve, agree to 1e-4 and the number of switchings is the same at their
ends; the widest such three do. Narrow ones are for unstable stops, whose distance is straight over a range that shrinks
as its derivative grows.
Where the distance has a kink within them, as where a stage of a step meets the brake's limit of rate, both sides agree
with themselves and not with each other: the derivative is held against the nearer of the two. Lanes that do not count
are listed with the reason, and how many of them are unstable by their growth: what is straight of their distance is
lost in rounding.
"""

import argparse
import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from absjax.lanes import repeated, taken
from absjax.loop.growth import is_unstable
from absjax.loop.stop import Outcome, stop
from absjax.parameters import trainable_names
from tests.attack.stops import KINDS, random_loop, random_speeds

WIDTHS = 4e-5 * 0.25 ** np.arange(12)
AGREE = 1e-4
KINK = 1e-3
"""By which, as a share, the differences to both sides are apart at a kink."""
NEGLIGIBLE = 1e-6
"""Derivative, as a share of the distance, that counts as none: errors are shares of what is above."""
ROUNDING = 1e-13
"""Of distances, as a share."""


def shifted(loop, directions, shift):
    """The loop with every trainable parameter p of lane i at p (1 + shift direction_i)."""
    names = trainable_names(loop.controller)
    values = {n: getattr(loop.controller, n) * (1 + shift * d) for n, d in zip(names, directions)}
    return dataclasses.replace(loop, controller=dataclasses.replace(loop.controller, **values))


def attack(kind, lanes: int, seed: int, step: float) -> dict:
    """Of the stops that end, which `lanes` they are, how far derivatives are off their differences, and which count."""
    rng = np.random.default_rng(seed)
    loop, speed = random_loop(kind, rng, lanes, step), random_speeds(rng, lanes)
    directions = rng.normal(size=(len(trainable_names(kind)), lanes))

    def run(loop, speed):
        return stop(loop, speed, horizon=14.0, step=step, max_events=600, tile=128)

    @jax.jit
    def exact(loop, speed, directions, along, faster):
        def distance(shift, speed):
            result = run(shifted(loop, directions, shift), speed)
            return result.distance, result

        return jax.jvp(distance, (jnp.zeros(len(speed)), speed), (along, faster), has_aux=True)[1:]

    # Those that do not end by themselves take longest, and say nothing.
    which = np.flatnonzero(np.asarray(jax.jit(run)(loop, speed).outcome) == Outcome.STOPPED)
    if not which.size:
        return {"lanes": which}
    loop, speed, directions = taken(loop, which), speed[which], directions[:, which]
    one, zero = np.ones(len(which)), np.zeros(len(which))
    slope, result = exact(loop, speed, directions, one, zero)
    grown, _ = exact(loop, speed, directions, zero, speed)
    ends = [s * w for w in WIDTHS for s in (1, -1)]
    many = repeated(loop, len(ends))
    moved = shifted(many, np.repeat(directions, len(ends), axis=1), np.tile(ends, len(speed)))
    others = jax.jit(run)(moved, np.repeat(speed, len(ends)))
    distances = np.asarray(others.distance).reshape(-1, len(WIDTHS), 2)
    differences = (distances[..., 0] - distances[..., 1]) / (2 * WIDTHS)
    events = np.asarray(others.rollout.events).reshape(len(speed), -1)
    ended = (np.asarray(others.outcome).reshape(len(speed), -1) == Outcome.STOPPED).all(axis=1)
    same = (events == np.asarray(result.rollout.events)[:, None]).reshape(len(speed), len(WIDTHS), 2).all(axis=2)
    at = np.asarray(result.distance)[:, None]
    scales = np.abs(differences) + NEGLIGIBLE * at
    rounding = at * np.minimum(ROUNDING / WIDTHS, 0.01 * NEGLIGIBLE)
    apart = np.maximum(np.abs(np.diff(differences, axis=1)) - rounding[:, 1:], 0.0) / scales[:, 1:]
    spread = np.maximum(apart[:, :-1], apart[:, 1:])
    spread = np.where(same[:, :-2] & same[:, 1:-1] & same[:, 2:], spread, np.inf)
    best = (spread <= AGREE).argmax(axis=1) + 1
    lane = np.arange(len(speed))
    scale, slope = scales[lane, best], np.asarray(slope)
    every = np.stack([distances[..., 0] - at, at - distances[..., 1]]) / WIDTHS
    gap = np.maximum(np.abs(every[0] - every[1]) - ROUNDING * at / WIDTHS, 0.0)
    # What is curved has sides that approach each other with the width; at a kink they stay apart. Where the distance in
    # the middle is off by what a landing may be, they part the more the less the width.
    stays = (gap[lane, best + 1] > 0.5 * gap[lane, best]) & (gap[lane, best + 1] < 2 * gap[lane, best])
    kinked = (gap[lane, best] > KINK * scale) & stays
    sides = np.abs(slope - every[:, lane, best + 1]).min(axis=0)
    off = np.where(kinked, sides, np.abs(slope - differences[lane, best])) / scale
    grazed, agrees = np.asarray(result.rollout.grazes) > 0, spread.min(axis=1) <= AGREE
    some = (same[:, :-2] & same[:, 1:-1] & same[:, 2:]).any(axis=1)
    reasons = {
        "touches a guard": ended & grazed,
        "switches another number of times": ended & ~grazed & ~some,
        "differences do not agree": ended & ~grazed & some & ~agrees,
    }
    return {
        "lanes": which,
        "off": off,
        "counted": ended & ~grazed & agrees,
        "kinked": kinked,
        "ended": ended,
        "unstable": np.asarray(is_unstable(grown / result.distance)),
        "reasons": reasons,
    }


def main() -> None:
    """Print a row for each controller."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--lanes", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--step", type=float, default=None, help="s; each controller's own where not given")
    parser.add_argument("--controllers", nargs="*", default=None, help="class names; all where not given")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    for kind in KINDS:
        if options.controllers and kind.__name__ not in options.controllers:
            continue
        step = options.step or kind.grid_step
        found = attack(kind, options.lanes, options.seed, step)
        lanes = found["lanes"]
        if not lanes.size:
            print(f"{kind.__name__:21} step {1e3 * step:g} ms: none ends", flush=True)
            continue
        off = np.where(found["counted"], found["off"], 0.0)
        print(
            f"{kind.__name__:21} step {1e3 * step:g} ms: {found['ended'].sum()} end, {found['counted'].sum()} counted; "
            f"off by > 0.1 %: {(off > 1e-3).sum()}, > 1 %: {(off > 1e-2).sum()}, > 10 %: {(off > 0.1).sum()}; "
            f"worst {off.max():.1e}, lanes {lanes[off > 1e-3].tolist()}; at a kink "
            f"{lanes[found['counted'] & found['kinked']].tolist()}",
            flush=True,
        )
        for reason, left_out in found["reasons"].items():
            unstable = (left_out & found["unstable"]).sum()
            print(f"    not counted, {reason}: {left_out.sum()}, of them unstable {unstable}, lanes ", end="")
            print(lanes[left_out].tolist(), flush=True)


if __name__ == "__main__":
    main()
