"""Signals of different rates on one uniform grid, and which of its samples were measured.

The step is that of the fastest signal as recorded, but no finer than `FINEST`: faster signals are averaged over
blocks, slower ones interpolated linearly between their measurements.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tuning.logs.quality import Quality
from tuning.logs.recording import Channel, LogError

FINEST = 5e-4
"""Smallest step of the grid [s]."""
LONGEST_GAP, GAP_PERIODS = 0.05, 5
"""Gaps up to the larger of so many seconds and periods are bridged."""
DECIMALS = 12
"""Of the time of the grid in s: instants that were printed come back as they were."""
ON_GRID = 0.02
"""Share of a step by which samples on the grid may be off: what rounding of printed time leaves."""


@dataclasses.dataclass(frozen=True)
class Signal:
    """A signal in the project's unit at its own instants; arrays (samples,).

    Attributes:
        name: of the signal.
        channel: it comes from.
        time: s, strictly increasing.
        values: finite.
        index: of each sample in the channel, for messages.
    """

    name: str
    channel: Channel
    time: np.ndarray
    values: np.ndarray
    index: np.ndarray

    def place(self, sample: int) -> str:
        """Where a sample stands, for messages."""
        return f"column {self.channel.name!r}, {self.channel.place(int(self.index[sample]))}"

    def with_values(self, values: np.ndarray) -> "Signal":
        """The same instants, other values."""
        return dataclasses.replace(self, values=values)

    def only(self, kept: np.ndarray) -> "Signal":
        """The samples kept, bool (samples,)."""
        return dataclasses.replace(self, time=self.time[kept], values=self.values[kept], index=self.index[kept])


class Timing(NamedTuple):
    """How a signal is sampled."""

    period: float
    """s"""
    jitter: float
    """rms by which instants are off a uniform grid, as a share of the period; gaps aside"""
    uniform: bool
    """whether the instants lie on a grid, some perhaps left out"""


class Grid(NamedTuple):
    """Signals on a common grid, by name; arrays (samples,)."""

    time: np.ndarray
    values: dict[str, np.ndarray]
    measured: dict[str, np.ndarray]


def timing_of(time: np.ndarray) -> Timing:
    """How a signal is sampled."""
    steps = np.diff(time)
    period = float(np.median(steps))
    count = np.round((time - time[0]) / period)
    if count[-1] > 0:
        exact = float((time[-1] - time[0]) / count[-1])
        if np.abs(time - time[0] - count * exact).max() < ON_GRID * exact:
            return Timing(float(f"{exact:.9g}"), 0.0, True)
    usual = steps[steps < 3 * period]
    # Stamps that are jittered or rounded repeat the true period in the mean only.
    rough = np.mean(np.abs(usual - period) < 0.05 * period) < 0.8
    period = float(f"{usual.mean():.3g}") if rough else period
    return Timing(period, float(np.std(usual) / np.sqrt(2) / period), False)


def gaps_of(path: Path, signal: Signal, taken: np.ndarray) -> np.ndarray:
    """Samples, of those taken, after which one is missing.

    Raises:
        LogError: naming row and length of a gap that is too long to be bridged.
    """
    points = np.flatnonzero(taken)
    timing = timing_of(signal.time[points])
    period, steps = timing.period, np.diff(signal.time[points])
    gaps = np.flatnonzero(steps > (1.8 + 6 * timing.jitter) * period)
    if gaps.size:
        worst = gaps[np.argmax(steps[gaps])]
        if steps[worst] > 1.001 * max(LONGEST_GAP, GAP_PERIODS * period):
            before, after = signal.time[points[worst]], signal.time[points[worst + 1]]
            raise LogError(
                f"{path}, {signal.place(int(points[worst + 1]))}: a gap of {steps[worst]:g} s in {signal.name}; "
                f"the sampling period is {period:g} s. Use the log up to {before:g} s, or from {after:g} s on"
            )
    return gaps


def grid_of(signals: Sequence[Signal], qualities: Sequence[Quality]) -> Grid:
    """Signals on one uniform grid over the time they all cover."""
    timings = [timing_of(signal.time) for signal in signals]
    fastest = min(timings, key=lambda timing: timing.period)
    step = fastest.period * max(1, int(np.ceil(FINEST / fastest.period * (1 - 1e-9))))
    start = max(signal.time[0] for signal in signals)
    end = min(signal.time[-1] for signal in signals)
    count = max(0, int(np.floor((end - start) / step + ON_GRID)) + 1)
    time = np.round(start + step * np.arange(count), DECIMALS)
    values, measured = {}, {}
    for signal, quality, timing in zip(signals, qualities, timings):
        place = _averaged if timing.period < 0.75 * step else _interpolated
        values[signal.name], measured[signal.name] = place(time, step, signal, quality)
    return Grid(time, values, measured)


def _interpolated(time, step, signal: Signal, quality: Quality):
    points = np.flatnonzero(quality.taken)
    at, value = signal.time[points], signal.values[points]
    nearest = np.round((at - time[0]) / step).astype(int)
    inside = (nearest >= 0) & (nearest < len(time))
    values = np.interp(time, at, value)
    exact = inside & (np.abs(at - time[0] - nearest * step) < ON_GRID * step)
    values[nearest[exact]] = value[exact]
    measured = np.zeros(len(time), bool)
    measured[nearest[inside & quality.trusted[points]]] = True
    return values, measured


def _averaged(time, step, signal: Signal, quality: Quality):
    points = np.flatnonzero(quality.taken)
    block = np.round((signal.time[points] - time[0]) / step).astype(int)
    inside = (block >= 0) & (block < len(time))
    points, block = points[inside], block[inside]
    count = np.bincount(block, minlength=len(time))
    filled = count > 0
    values = np.interp(time, signal.time[points], signal.values[points])
    values[filled] = np.bincount(block, signal.values[points], len(time))[filled] / count[filled]
    doubted = np.bincount(block, ~quality.trusted[points], len(time))
    return values, filled & (doubted == 0)
