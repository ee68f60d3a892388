"""Wheels that lack teeth: the pattern found from places that stay empty, named, and held against the declared teeth.

Where a tooth is missing, one is missing a revolution later too: the share of empty places that are empty L places on,
over all L, is largest at the teeth of a revolution. Names are those in use: 36-1 is a wheel of 36 pitches that lacks
one tooth, 36-2-2 lacks two in two places.
"""

import dataclasses

import numpy as np
from scipy.signal import fftconvolve

from tuning.logs.recording import LogError

REPEATS = 0.5
"""Share of empty places that are empty a revolution later, from which on there is a pattern."""
AS_GOOD = 0.8
"""The fewest places of whose share is so much of the largest are a revolution, not the most."""
EMPTY = 0.5
"""Share of the revolutions in which a place of the pattern is empty, at least."""
FEWEST_TURNS = 3
SHORTEST, LONGEST = 4, 512
"""Pitches of a pattern."""
USUAL = ((2, 2), (1, 1))
"""Gaps of wheels whose pattern repeats within a revolution."""


@dataclasses.dataclass(frozen=True)
class Pattern:
    """The pattern of a wheel."""

    slots: int
    """pitches of a revolution"""
    period: int
    """pitches after which it repeats; a divisor of them"""
    absent: tuple[int, ...]
    """places in a period without a tooth; none: a wheel that lacks none, its period is one"""
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    edges: int = 1
    """of a tooth that are counted as pitches"""

    @property
    def gaps(self) -> tuple[int, ...]:
        """Teeth missing in each gap of a revolution."""
        there = np.ones(self.period, bool)
        there[list(self.absent)] = False
        starts = [k for k in self.absent if there[k - 1]]
        lengths = []
        for start in starts:
            length = 0
            while not there[(start + length) % self.period]:
                length += 1
            lengths.append(length)
        return tuple(length // self.edges for length in lengths) * (self.slots // self.period)

    @property
    def name(self) -> str:
        """As 60, 36-1, 60-2, 36-2-2."""
        return "-".join(map(str, (self.slots // self.edges, *self.gaps)))

    def turn(self, place: np.ndarray) -> int:
        """By how much to move places of a stretch so that its empty ones are those of the pattern."""
        if not self.absent:
            return 0
        seen = np.bincount(place % self.period, minlength=self.period)
        empty = np.zeros(self.period)
        empty[list(self.absent)] = 1.0
        hits = [float(np.roll(seen, k) @ empty) for k in range(self.period)]
        return int(np.argmin(hits))

    def absent_between(self, place: np.ndarray) -> np.ndarray:
        """Places of the pattern without a tooth between each of these and the one before."""
        empty = np.zeros(self.period, int)
        empty[list(self.absent)] = 1
        upto = np.concatenate([[0], np.cumsum(empty)])
        total = (place // self.period) * len(self.absent) + upto[place % self.period]
        return np.diff(total, prepend=total[:1])


def pattern_of(name: str, place: np.ndarray, stretch: np.ndarray, slots: int, fewest: int, edges: int) -> Pattern:
    """The pattern of the wheel that left these places empty.

    Args:
        name: of the log, for messages.
        place: of every edge, whole pitches.
        stretch: of every edge; places are counted anew in each.
        slots: pitches of a revolution as declared.
        fewest: edges of a stretch that is looked at.
        edges: of a tooth that are counted as pitches.

    Raises:
        LogError: if the pattern is that of another number of teeth.
    """
    empties = []
    for number in np.unique(stretch):
        inside = place[stretch == number]
        if inside.size >= fewest:
            empty = np.ones(inside[-1] - inside[0] + 1)
            empty[inside - inside[0]] = 0.0
            empties.append(empty)
    period = _period(empties, slots)
    if period is None:
        return Pattern(slots, 1, (), edges=edges)
    first = max(empties, key=len)
    turns = len(first) // period
    share = first[: turns * period].reshape(turns, period).mean(axis=0)
    absent = np.flatnonzero(share > EMPTY)
    start = _start(absent, period)
    absent = tuple(sorted(int(k) for k in (absent - start) % period))
    found = Pattern(period, period, absent, edges=edges)
    if slots % period == 0:
        return _declared(found, slots)
    if slots == period - len(absent):
        note = f"{slots} teeth and {len(absent)} missing: a {found.name} wheel, {period} pitches in a revolution"
        return dataclasses.replace(found, notes=(note,))
    if period == 2 * slots:
        note = f"the pattern repeats after {period} edges: both edges of {slots} teeth"
        return dataclasses.replace(found, notes=(note,), edges=2)
    raise LogError(
        f"{name}: {slots} teeth declared, but the gaps repeat after {period} pitches, as those of a {found.name} wheel "
        f"do: declare {period} teeth, or a multiple"
    )


def _declared(found: Pattern, slots: int) -> Pattern:
    pattern = dataclasses.replace(found, slots=slots)
    note = f"a {pattern.name} wheel: {sum(pattern.gaps)} of {slots // pattern.edges} teeth are missing"
    doubts: tuple[str, ...] = ()
    if slots != found.period and pattern.gaps not in USUAL:
        doubts = (
            f"the gaps repeat after {found.period} pitches: a {pattern.name} wheel, as declared, or a "
            f"{found.name} wheel, and then it turns {slots // found.period} times as fast",
        )
    elif pattern.edges == 1 and all(gap >= 4 and gap % 2 == 0 for gap in pattern.gaps):
        doubts = (
            f"a {pattern.name} wheel, or both edges of one that lacks half as many in each gap: "
            "then it turns half as fast",
        )
    return dataclasses.replace(pattern, notes=(note,), doubts=doubts)


def _period(empties: list[np.ndarray], slots: int) -> int | None:
    """Pitches after which empty places repeat; None if they do not."""
    total = sum(empty.sum() for empty in empties)
    longest = min(max(LONGEST, 2 * slots), max(map(len, empties)) // FEWEST_TURNS)
    if total < FEWEST_TURNS or longest < SHORTEST:
        return None
    again, could = np.zeros(longest + 1), np.zeros(longest + 1)
    for empty in empties:
        size = min(longest, len(empty) - 1) + 1
        again[:size] += fftconvolve(empty, empty[::-1])[len(empty) - 1 : len(empty) - 1 + size]
        could[:size] += np.cumsum(empty)[::-1][:size]
    share = np.where(could > 0.3 * total, again / np.maximum(could, 1), 0.0)
    share[:SHORTEST] = 0.0
    best = share.max()
    if best < REPEATS or again[int(np.argmax(share))] < FEWEST_TURNS - 1:
        return None
    return int(np.flatnonzero(share > AS_GOOD * best)[0])


def _start(absent: np.ndarray, period: int) -> int:
    """The place behind the longest gap."""
    there = np.ones(period, bool)
    there[absent] = False
    lengths = {}
    for k in absent:
        if there[k - 1]:
            length = 0
            while not there[(k + length) % period]:
                length += 1
            lengths[int(k + length) % period] = length
    return max(lengths, key=lambda k: lengths[k])
