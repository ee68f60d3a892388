"""What a set is worth in conditions drawn apart: those it was tuned on, those it was chosen by, and further ones."""

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np

from tuning.controllers.batch import Batch, Scored, scored
from tuning.controllers.scatter import SPLITS, Split, scattered
from tuning.controllers.setup import Setup

STUCK = 1.0
"""A cycle that lasts longer is counted as stuck, s."""
TAIL = 0.05
"""Share of the stops that are the worst."""


@dataclasses.dataclass(frozen=True)
class SplitFigures:
    """Stops of one set in the conditions of one split; distances from the pedal over the ideal ones."""

    split: Split
    which: str
    """untuned, which is the start of the search, or tuned"""
    stops: int
    mean: float | None
    """over the stops that end; None where none does"""
    worst: float | None
    """mean of the worst twentieth of those"""
    unfinished: int
    """stops that do not end"""
    locked: int
    """stops that lock above 15 km/h for longer than allowed"""
    stuck: int
    """stops with a cycle longer than 1 s"""
    slid: int | None = None
    """stops in which a wheel slides for longer than allowed, in all; None in results of earlier versions"""

    @property
    def feasible(self) -> bool:
        """Whether every stop ends and none locks, slides or sticks."""
        return not (self.unfinished or self.locked or self.slid or self.stuck)


def figures_of(batch: Batch, split: Split, sets: Mapping[str, Mapping[str, float]], grid) -> list[SplitFigures]:
    """Of sets by name, on the sampled loop of a batch; `grid`: its step [s] and steps to a tick."""
    names = tuple(next(iter(sets.values())))
    arrays = {name: np.array([float(values[name]) for values in sets.values()]) for name in names}
    found = scored(batch, arrays, *grid, chunk=len(sets))
    return [_of(found, split, which, i, batch) for i, which in enumerate(sets)]


def _of(found: Scored, split: Split, which: str, i: int, batch: Batch) -> SplitFigures:
    ended = np.asarray(found.stops.outcome)[:, i] == 0
    ratios = np.sort(found.ratios[ended, i])
    slides = np.max(found.stops.slide_time, axis=0)
    tail = ratios[-max(1, round(TAIL * len(ratios))) :]
    return SplitFigures(
        split=split,
        which=which,
        stops=len(ended),
        mean=float(ratios.mean()) if len(ratios) else None,
        worst=float(tail.mean()) if len(ratios) else None,
        unfinished=int((~ended).sum()),
        locked=int((np.asarray(found.stops.longest_lock[0])[:, i] > batch.longest_lock).sum()),
        slid=int((slides[:, i] > batch.slide_time).sum()),
        stuck=int((np.asarray(found.stops.longest_cycle)[:, i] > STUCK).sum()),
    )


def all_splits(
    setup: Setup, sets: Mapping[str, Mapping[str, float]], say: Callable[[str], None] = lambda text: None
) -> list[SplitFigures]:
    """Sets by name in all splits of a setup; each is told of before its stops are made."""
    grid, rows = setup.sampled_grid(), []
    for split in SPLITS:
        say(f"{split} draws ...")
        rows += figures_of(scattered(setup, split), split, sets, grid)
    return rows
