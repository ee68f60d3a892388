"""What the samples of a signal are worth: held, stuck, clipped, quantised, spiked, lost.

A recorder that writes faster than a sensor tells repeats the last value (*held*); a sensor that hangs repeats it too
(*stuck*), and one at the end of its range repeats that (*clipped*). They are told apart by where the values change:
held ones change at multiples of a period, the others do not, and stand still where their own noise never does.
The thresholds are ours.
"""

from typing import NamedTuple

import numpy as np

from tuning.logs.stated import AT_ZERO, Zero

FEWEST_CHANGES = 8
"""Changes from which a period of holding is concluded."""
STILL = 8
"""Equal samples in a row that noise does not leave; also as a multiple of what is usual."""
AROUND = 60
"""Samples before and after a stretch in which noise is looked for."""
DROP_RATE = {"wheel_speed": 1e4, "vehicle_speed": 150.0}
"""Rate of change that no wheel (rad/s^2) and no vehicle (m/s^2) reaches."""


class Runs(NamedTuple):
    """Stretches of equal values."""

    first: np.ndarray
    length: np.ndarray


class Quality(NamedTuple):
    """Of the samples of a signal; arrays (samples,)."""

    taken: np.ndarray
    """where the sensor told something: not held, no spike, not lost"""
    trusted: np.ndarray
    """of those taken, where it told the truth: neither stuck nor clipped"""
    held: int
    """samples for which a value is held; 1 if none is"""
    resolution: float
    """step of quantisation; 0 if it is lost in the noise"""
    clipped: tuple[float, ...]
    """values at which the signal is clipped"""
    stuck: tuple[tuple[int, int], ...]
    """first and last sample of each stretch in which it is stuck"""
    spikes: np.ndarray
    """indices of single samples far from both neighbours"""
    lost: tuple[tuple[int, int], ...]
    """first and last sample of each drop to zero and back that nothing physical makes"""


def runs_of(values: np.ndarray) -> Runs:
    """Stretches of equal values, in order."""
    first = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1])
    return Runs(first, np.diff(np.append(first, len(values))))


def quality_of(signal: str, time: np.ndarray, values: np.ndarray, zero: Zero = AT_ZERO) -> Quality:
    """What the samples of a signal are worth.

    Args:
        signal: name of the signal; some may stand still: a locked wheel, a brake that is not pressed.
        time: of the samples [s].
        values: of the samples.
        zero: where the signal may stand still.
    """
    held = hold_length(values)
    taken = held_points(values, held)
    points = np.flatnonzero(taken)
    told = values[points]
    lost = _lost(signal, time[points], told)
    kept = np.ones(len(points), bool)
    for first, last in lost:
        kept[first : last + 1] = False
    spikes = _spikes(told)
    kept[spikes] = False
    step, noise = lattice(told[kept]), noise_of(told[kept])
    clipped, stuck = _still(signal, told, kept, zero)
    true = kept & ~np.isin(told, clipped)
    for first, last in stuck:
        true[first + 1 : last + 1] = False
    taken[points[~kept]] = False
    trusted = np.zeros(len(values), bool)
    trusted[points[true]] = True
    return Quality(
        taken,
        trusted,
        held,
        step if step > 0.5 * noise and _recur(told[kept]) else 0.0,
        clipped,
        tuple((int(points[a]), int(points[b])) for a, b in stuck),
        points[spikes],
        tuple((int(points[a]), int(points[b])) for a, b in lost),
    )


def hold_length(values: np.ndarray) -> int:
    """Samples for which each value is held: changes lie at multiples of it, and are not all of one step.

    A quantised signal that moves at a constant rate changes regularly too, but always by its one step.
    """
    changes = runs_of(values).first[1:]
    between = np.diff(changes)
    if between.size < FEWEST_CHANGES:
        return 1
    counts = np.bincount(between)
    length = int(np.argmax(counts))
    if length < 2:
        return 1
    multiple = np.round(between / length)
    off = np.abs(between - multiple * length)
    regular = (multiple >= 1) & (off <= (1 if length >= 4 else 0))
    steps = np.abs(values[changes] - values[changes - 1])
    one_step = np.mean(steps < 1.5 * steps.min()) > 0.9
    if np.mean(regular) < 0.9 or np.mean(regular & (multiple == 1)) < 0.3 or one_step:
        return 1
    return length


def held_points(values: np.ndarray, length: int) -> np.ndarray:
    """Where a message of a held signal came, bool (samples,): at each new value, and at periods while it stays."""
    taken = np.ones(len(values), bool)
    if length > 1:
        runs = runs_of(values)
        messages = np.maximum(1, np.round(runs.length / length).astype(int))
        order = np.arange(messages.sum()) - np.repeat(np.cumsum(messages) - messages, messages)
        taken[:] = False
        taken[np.minimum(np.repeat(runs.first, messages) + order * length, len(values) - 1)] = True
    return taken


def lattice(values: np.ndarray) -> float:
    """Step of the lattice on which values lie; 0 if they lie on none."""
    levels = np.unique(values)
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * max(np.abs(levels).max(initial=0), 1e-300)]
    if gaps.size < 2:
        return 0.0
    step = float(np.quantile(gaps, 0.02))
    near = gaps[gaps < 1.5 * step]
    step = float(near.mean())
    off = np.abs(gaps - np.round(gaps / step) * step)
    return step if np.mean(off < 0.1 * step) > 0.95 else 0.0


def _recur(values: np.ndarray) -> bool:
    """Whether values come back: else their steps are those of the signal, not of a sensor."""
    return np.unique(values).size < 0.7 * values.size


def noise_of(values: np.ndarray) -> float:
    """Standard deviation of white noise, from second differences where the signal moves."""
    steps = np.diff(values)
    moving = (steps[1:] != 0) | (steps[:-1] != 0)
    second = np.diff(values, 2)[moving]
    return float(np.median(np.abs(second)) / 0.6745 / np.sqrt(6)) if second.size else 0.0


def _noisy(values: np.ndarray, first: int, last: int) -> bool:
    """Whether noise moves the signal from sample to sample around a stretch, more than rounding does.

    Second differences of a smooth signal keep their sign, those of a rounded one are one or two steps.
    """
    second = np.concatenate(
        [np.diff(values[max(0, first - AROUND) : first], 2), np.diff(values[last + 1 :][:AROUND], 2)]
    )
    second[np.abs(second) < 1e-9 * np.abs(values).max()] = 0.0
    turned = second[1:] * second[:-1]
    turned, size = turned[turned != 0], np.abs(second[second != 0])
    return bool(turned.size and np.median(size) > 1.5 * size.min() and np.mean(turned < 0) > 0.5)


def _still(signal: str, values: np.ndarray, kept: np.ndarray, zero: Zero):
    """Values at which a signal is clipped, and stretches in which it is stuck.

    Without noise a signal may stand still by itself; then only a jump at the end shows that it was stuck.
    """
    runs = runs_of(values)
    usual = float(np.quantile(runs.length, 0.9)) if len(runs.first) >= FEWEST_CHANGES else np.inf
    long = np.flatnonzero(runs.length >= STILL * max(1.0, usual))
    if not long.size:
        return (), ()
    moves = np.abs(np.diff(values))
    usual_move = float(np.quantile(moves[moves > 0], 0.99)) if np.any(moves > 0) else np.inf
    lowest, highest = values[kept].min(), values[kept].max()
    clipped, stuck = set(), []
    for i in long:
        first, last = int(runs.first[i]), int(runs.first[i] + runs.length[i] - 1)
        level = float(values[first])
        if not kept[first] or _at_rest(signal, level, lowest, highest, zero, first == 0 or last == len(values) - 1):
            continue
        noisy = _noisy(values, first, last)
        if noisy and level in (lowest, highest):
            clipped.add(level)
        elif noisy or (last + 1 < len(values) and moves[last] > 3 * usual_move):
            stuck.append((first, last))
    return tuple(sorted(clipped)), tuple(stuck)


def _at_rest(signal: str, level: float, lowest: float, highest: float, zero: Zero, at_the_end: bool) -> bool:
    """Whether a signal may stand still there: a locked wheel, a brake not pressed, a car that is not braked."""
    if signal == "wheel_speed":
        return level <= 0.01 * highest
    span = max(abs(lowest - zero.value), abs(highest - zero.value))
    near_zero = abs(level - zero.value) <= 0.02 * span + zero.within
    return near_zero and (signal in ("brake_pressure", "vehicle_speed") or at_the_end)


def _spikes(values: np.ndarray) -> np.ndarray:
    """Single samples that jump away from both neighbours and back, much farther than the signal usually moves."""
    if len(values) < 10:
        return np.zeros(0, int)
    steps = np.diff(values)
    if not steps.any():
        return np.zeros(0, int)
    usual = np.quantile(np.abs(steps[steps != 0]), 0.97)
    span = np.ptp(np.quantile(values, [0.02, 0.98]))
    least = max(5 * usual, 0.05 * span)
    there, back = steps[:-1], steps[1:]
    return np.flatnonzero((there * back < 0) & (np.minimum(np.abs(there), np.abs(back)) > least)) + 1


def _lost(signal: str, time: np.ndarray, values: np.ndarray) -> tuple[tuple[int, int], ...]:
    """Stretches at exactly zero, entered and left faster than anything turns or drives."""
    rate = DROP_RATE.get(signal)
    if rate is None or len(values) < 3:
        return ()
    runs = runs_of(values)
    last = runs.first + runs.length - 1
    zero = np.flatnonzero((values[runs.first] == 0) & (runs.first > 0) & (last < len(values) - 1))
    a, b = runs.first[zero], last[zero]
    least = 0.2 * np.quantile(values, 0.99)
    fell, rose = values[a - 1], values[b + 1]
    sudden = (fell > least) & (rose > least) & (fell > rate * (time[a] - time[a - 1]))
    return tuple((int(x), int(y)) for x, y in zip(a[sudden], b[sudden]))
