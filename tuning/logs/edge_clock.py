"""The clock of a log of edges: counters that overflow, unwrapped; clocks too coarse for the wheel, refused."""

import dataclasses

import numpy as np

from tuning.logs.recording import LogError

WIDTHS = (16, 24, 32)
"""Bits of counters that overflow."""
LONG, GAP = 8.0, 0.01
"""A step back is an overflow if what it becomes is shorter than so many usual steps, or, of a wide counter, than this
share of its range."""
COARSEST = 4.0
"""Fewest ticks from edge to edge."""
ALIKE = 0.9
"""Share of intervals that are equal from which on they do not tell the clock."""
FINE = 20.0
"""Ticks from edge to edge below which the clock is said to be coarse."""


@dataclasses.dataclass(frozen=True)
class Unwrapped:
    """Stamps of a counter as if it were wide enough."""

    stamps: np.ndarray
    wraps: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(0, np.int64))
    """edges before which it overflowed"""
    modulus: int = 0
    """ticks of its range; 0 if it never overflowed"""
    notes: tuple[str, ...] = ()


def unwrapped(place: str, stamps: np.ndarray, rows: np.ndarray) -> Unwrapped:
    """Undo the overflows of a counter.

    An overflow takes the range of the counter off, 2^16, 2^24 or 2^32 ticks, and leaves the usual time from edge to
    edge; whatever else goes back in time is refused.

    Args:
        place: file and column, for messages.
        stamps: ticks as they stand.
        rows: of the file.

    Raises:
        LogError: naming the row that goes back in time.
    """
    steps = np.diff(stamps)
    back = np.flatnonzero(steps < 0)
    if not back.size:
        return Unwrapped(stamps)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    low, high = int(stamps.min()), int(stamps.max())
    for bits in WIDTHS:
        modulus = 1 << bits
        within = (low >= 0 and high < modulus) or (low >= -modulus // 2 and high < modulus // 2)
        mended = steps[back] + modulus
        if not within or (mended <= 0).any():
            continue
        # An overflow is seen as what it hides, an ordinary step; a gap may hide one too.
        ordinary = mended < max(LONG * usual, GAP * modulus)
        if not ordinary.all() if bits > 16 else np.median(mended) > LONG * usual:
            continue
        count = np.concatenate([[0], np.cumsum(steps < 0)])
        note = f"the counter of {bits} bits overflows {back.size} times; unwrapped"
        return Unwrapped(stamps + count * modulus, back + 1, modulus, (note,))
    at = int(back[0]) + 1
    raise LogError(
        f"{place}, row {rows[at]}: {stamps[at]} goes back in time, and not as a counter of "
        f"{', '.join(map(str, WIDTHS))} bits overflows; is there more than one channel?"
    )


def check_fine(place: str, steps: np.ndarray, tick: float, repeated: int) -> tuple[int, list[str]]:
    """Whether the clock tells edges apart.

    Args:
        place: file and column, for messages.
        steps: ticks from edge to edge.
        tick: s.
        repeated: edges at the instant of the one before.

    Returns:
        Ticks by which the clock moves; and doubts.

    Raises:
        LogError: if fewer than `COARSEST` steps of the clock lie between edges.
    """
    step = int(np.gcd.reduce(steps))
    # A common divisor of intervals that are all alike is the interval's, not the clock's.
    if np.mean(steps == np.median(steps)) > ALIKE:
        step = 1
    usual = float(np.quantile(steps, 0.25)) / step
    if np.median(steps) / step < COARSEST or repeated > 0.2 * steps.size:
        raise LogError(
            f"{place}: the clock moves by {step * tick:.3g} s, and edges come every {np.median(steps) * tick:.3g} s: "
            f"{np.median(steps) / step:.2g} ticks from edge to edge, {COARSEST:g} needed to tell them apart; "
            "is the clock right, or too coarse for this wheel?"
        )
    if usual < FINE:
        return step, [
            f"the clock moves by {step * tick:.3g} s, {usual:.2g} times from edge to edge: speeds are rounded by "
            f"{0.41 / usual:.0%} of an interval"
        ]
    return step, []
