"""Chains from edges to wheel speed and acceleration, by how the encoder's errors are taken off."""

import numpy as np

from absjax.encoder.harmonics import HarmonicCompensation
from absjax.encoder.notch import NotchFilter
from absjax.encoder.time_stamping import TimeStamping
from absjax.encoder.wheel_speed import WheelSpeedChain

SIGNALS = ("speed", "acceleration")


def least_harmonics(teeth: int, events: int) -> int:
    """M of the source, ceil(N / n) + 1."""
    return min(int(np.ceil(teeth / events)) + 1, all_harmonics(teeth))


def enough_harmonics(teeth: int, events: int) -> int:
    """M from which on the residual flattens, ceil(1.5 N / n)."""
    return min(int(np.ceil(1.5 * teeth / events)), all_harmonics(teeth))


def all_harmonics(teeth: int) -> int:
    """As many as teeth tell apart, the largest M below N / 2."""
    return (teeth - 1) // 2


def measured_chain(teeth: int = 60, events: int = 15) -> WheelSpeedChain:
    """Time-stamping alone."""
    return WheelSpeedChain(TimeStamping(teeth, events))


def notch_chain(teeth: int = 60, events: int = 15) -> WheelSpeedChain:
    """With the notch filters of the source, of damping 0.5."""
    return WheelSpeedChain(TimeStamping(teeth, events), NotchFilter("speed"), NotchFilter("acceleration"))


def published_chain(teeth: int = 60, events: int = 15, harmonics: int | None = None) -> WheelSpeedChain:
    """The compensation as the source sets it: regressors not filtered, beta = 0.1, 1 Hz, M = ceil(N / n) + 1."""
    harmonics = least_harmonics(teeth, events) if harmonics is None else harmonics
    parts = (HarmonicCompensation(s, harmonics, filter_regressor=False, cutoff=1.0) for s in SIGNALS)
    return WheelSpeedChain(TimeStamping(teeth, events), *parts)


def filtered_chain(teeth: int = 60, events: int = 15, harmonics: int | None = None) -> WheelSpeedChain:
    """The compensation with filtered regressors, M = ceil(1.5 N / n)."""
    harmonics = enough_harmonics(teeth, events) if harmonics is None else harmonics
    return WheelSpeedChain(TimeStamping(teeth, events), *(HarmonicCompensation(s, harmonics) for s in SIGNALS))


def edge_chain(
    teeth: int = 60, events: int = 15, harmonics: int | None = None, memory: float | None = None
) -> WheelSpeedChain:
    """The compensation with regressors made of the edges, M = all that the teeth tell apart; memory as in
    `TimeStamping`."""
    harmonics = all_harmonics(teeth) if harmonics is None else harmonics
    parts = (HarmonicCompensation(s, harmonics, through_edges=True) for s in SIGNALS)
    return WheelSpeedChain(TimeStamping(teeth, events, memory=memory), *parts)
