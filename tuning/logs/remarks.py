"""What reading did to signals, and what looks wrong with them, in sentences."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from tuning.logs.grid import Grid, Signal, gaps_of, timing_of
from tuning.logs.quality import Quality
from tuning.logs.units import OWN

COARSE, COARSE_SPEED = 0.01, 0.005
"""Share of the span of a signal, and of a speed, from which its quantisation is coarse: slip is a ratio of speeds."""
SHOWN = 3
"""Stretches of a kind that are named; the others are counted."""


def notes_on(path: Path, signals: Sequence[Signal], qualities: Sequence[Quality], grid: Grid) -> list[str]:
    """What was made of the signals."""
    step = float(np.median(np.diff(grid.time)))
    found: list[tuple[str, str]] = []
    for signal, quality in zip(signals, qualities):
        timing = timing_of(signal.time)
        if quality.held > 1:
            hold = quality.held * timing.period
            found.append((f"each value held for {hold:g} s: sampled at {1 / hold:.4g} Hz", signal.name))
        taken = timing_of(signal.time[quality.taken])
        if quality.held == 1:
            gaps = gaps_of(path, signal, quality.taken)
            if gaps.size:
                longest = np.diff(signal.time[quality.taken])[gaps].max()
                found.append((f"{gaps.size} gaps bridged, the longest {longest:.3g} s", signal.name))
        if not timing.uniform:
            off = f"instants jitter by {timing.jitter:.0%} of {timing.period:g} s"
            found.append((f"{off}; resampled", signal.name))
        if timing.period < 0.75 * step:
            found.append((f"sampled every {timing.period:g} s, averaged over {step:g} s", signal.name))
        elif quality.held == 1 and taken.period > 1.25 * step:
            found.append((f"sampled every {taken.period:g} s, interpolated", signal.name))
    grid_said = f"grid of {step:g} s, {len(grid.time)} samples from {grid.time[0]:g} s to {grid.time[-1]:g} s"
    return [*_together(found), grid_said]


def doubts_on(signals: Sequence[Signal], qualities: Sequence[Quality]) -> list[str]:
    """What looks wrong with signals and was not refused."""
    found = []
    for signal, quality in zip(signals, qualities):
        name, unit = signal.name, OWN[signal.name]
        for level in quality.clipped:
            share = np.mean(signal.values[quality.taken] == level)
            found.append((f"sits at {level:g} {unit} in {share:.0%} of its samples, as a clipped signal does", name))
        for stretches, what in ((quality.stuck, "is stuck at {:g} " + unit), (quality.lost, "drops to {:g}")):
            found += [(said, name) for said in _stretches(signal, stretches, what)]
        if quality.spikes.size:
            at = signal.time[quality.spikes[0]]
            found.append((f"{quality.spikes.size} spikes, the first at {at:g} s; left out", name))
        low, middle, high = np.quantile(signal.values, [0.02, 0.5, 0.98])
        coarse = COARSE_SPEED * middle if name.endswith("speed") else COARSE * (high - low)
        if quality.resolution > coarse:
            found.append((f"is quantised in steps of {quality.resolution:.3g} {unit}", name))
    return _together(found)


def _stretches(signal: Signal, stretches: Sequence[tuple[int, int]], what: str) -> list[str]:
    said = [
        f"{what.format(signal.values[a])} for {signal.time[b] - signal.time[a]:.3g} s at {signal.time[a]:g} s"
        for a, b in stretches[:SHOWN]
    ]
    if len(stretches) > SHOWN:
        said[-1] += f", and {len(stretches) - SHOWN} times more"
    return said


def _together(found: Iterable[tuple[str, str]]) -> list[str]:
    """Sentences that hold for several signals said once."""
    names: dict[str, list[str]] = {}
    for sentence, name in found:
        names.setdefault(sentence, []).append(name)
    return [f"{', '.join(signals)}: {sentence}" for sentence, signals in names.items()]
