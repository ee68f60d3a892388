"""Where the edges of an encoder lie off their places, learned from revolution to revolution."""

from typing import NamedTuple

import numpy as np

from tuning.logs.teeth import Passings

NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median deviation."""
CLEAR = 4.0
"""A harmonic of the mean error is one of the wheel if it is so many times its standard error."""
WHOLE, FEWEST = 0.6, 4
"""Share of its edges that a revolution must have to count; and how many of those there must be."""
NOTHING = 1e-6
"""Share of the largest harmonic that is rounding."""
LEFT = 0.3
"""Share of a harmonic that a cubic leaves, from which on it is learned from that."""
ALIKE = 0.5
"""Correlation from which the errors behind a cut are taken for those before it."""


class ToothErrors(NamedTuple):
    """Where the edges of an encoder lie off their places, in encoder cycles."""

    tooth: np.ndarray
    """of every edge, (edges,); tooth 0 is the first of the log, or the first behind the longest gap of the pattern"""
    error: np.ndarray
    """of every edge, (edges,)"""
    mean: np.ndarray
    """by tooth, (teeth,)"""
    missing: int
    """edges that are missing from the log"""
    shift: np.ndarray
    """teeth to add behind each cut so that the errors fit, (stretches,)"""
    clear: np.ndarray
    """the mean error with nothing but harmonics that repeat, (teeth,)"""

    def refined(self, tooth: np.ndarray, error: np.ndarray, half: int) -> np.ndarray:
        """The mean error, its higher harmonics from what edges are off a smooth motion, (teeth,).

        A cubic through the 2 h + 1 edges around an edge follows the low harmonics of the error, and leaves the share
        1 - H of the others, H = sum of c_j cos(2 pi k j / N) with the weights c_j of the fit. What they leave, unlike
        what is off the mean of a revolution, does not depend on how the speed changes.

        Args:
            tooth: of every edge, (edges,).
            error: of every edge off the cubic, cycles.
            half: h.
        """
        teeth = self.mean.size
        j = np.arange(-half, half + 1)
        weights = np.linalg.pinv(np.vander(j / half, 4, increasing=True))[0]
        order = np.arange(teeth // 2 + 1)
        left = 1 - np.cos(2 * np.pi * np.outer(order, j) / teeth) @ weights
        high = np.fft.rfft(_clear(tooth, error, _mean(tooth, error, teeth)))
        told = left > LEFT
        spectrum = np.where(told, high / np.where(told, left, 1.0), np.fft.rfft(self.clear))
        return np.fft.irfft(spectrum, teeth)

    @property
    def eccentricity(self) -> float:
        """e / r: amplitude of the first harmonic of the mean error, rad."""
        teeth = self.mean.size
        return float(2 / teeth * abs(np.fft.fft(self.mean)[1]) * 2 * np.pi / teeth)

    @property
    def tolerance(self) -> float:
        """Half the width of a uniform distribution of what the first harmonic leaves of the mean error, cycles."""
        teeth = self.mean.size
        spectrum = np.fft.rfft(self.mean)
        spectrum[:2] = 0.0
        return float(np.sqrt(3) * np.fft.irfft(spectrum, teeth).std())

    @property
    def jitter(self) -> float:
        """Standard deviation of what does not repeat from revolution to revolution, cycles.

        From the median deviation, since a changing speed adds to the errors of its revolutions.
        """
        return float(NORMAL * np.median(np.abs(self.error - self.mean[self.tooth])))


def unknown_share(clear: np.ndarray, half: int) -> float:
    """Rms over a revolution of dw / w that harmonics of the errors make which were not learned, if they are as large as
    those that were.

    Args:
        clear: the mean error, cycles, (teeth,).
        half: of the fit that the others were learned from.
    """
    teeth = clear.size
    size = 2 / teeth * np.abs(np.fft.rfft(clear))
    order = np.arange(size.size)
    found, slow = size > NOTHING * size.max(initial=0), order < teeth / (2 * half + 1)
    low = (order > 0) & slow & ~found
    # What alternates from tooth to tooth says nothing of the others.
    told = found & ~slow & (2 * order < teeth)
    if not told.any() or not low.any():
        return 0.0
    usual = np.sqrt(np.mean(size[told] ** 2))
    return float(2 * np.pi / teeth * usual * np.sqrt(0.5 * np.sum(order[low] ** 2)))


def tooth_errors(passings: Passings) -> ToothErrors:
    """Errors of the edges against a wheel whose speed changes little within two revolutions.

    The time of an edge is compared with the mean over the revolution around it, in which errors that repeat cancel.
    """
    teeth = passings.pattern.slots
    numbers = np.unique(passings.stretch)
    parts = {int(n): _errors(passings, passings.stretch == n) for n in numbers}
    parts = {n: part for n, part in parts.items() if part is not None}
    shift = np.zeros(int(numbers[-1]) + 1, int)
    if not parts:
        none = np.zeros(0)
        return ToothErrors(none.astype(int), none, np.zeros(teeth), passings.missed, shift, np.zeros(teeth))
    longest = max(parts, key=lambda n: parts[n][0].size)
    first = _mean(*parts[longest], teeth)
    for n, (tooth, error) in parts.items():
        if n != longest and not passings.pattern.absent:
            shift[n] = _shift(first, _mean(tooth, error, teeth))
    tooth = np.concatenate([(part[0] + shift[n]) % teeth for n, part in parts.items()])
    error = np.concatenate([part[1] for part in parts.values()])
    mean = _mean(tooth, error, teeth)
    return ToothErrors(tooth, error, mean, passings.missed, shift, _clear(tooth, error, mean))


def _errors(passings: Passings, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Tooth and error of the edges of a stretch; None if it is too short."""
    teeth = passings.pattern.slots
    stamps, place = passings.stamps[inside], passings.tooth[inside]
    every = np.arange(place[0], place[-1] + 1)
    if every.size < 3 * teeth:
        return None
    # Missing edges are put back where a straight line has them.
    time = np.interp(every, place, (stamps - stamps[0]).astype(float))
    window = np.ones(teeth + 1) / teeth
    window[[0, -1]] *= 0.5
    if teeth % 2:
        window = np.ones(teeth) / teeth
    smooth = np.convolve(time, window, mode="valid")
    half = (window.size - 1) // 2
    inner = slice(half, half + smooth.size)
    pace = np.convolve(np.gradient(time), window, mode="valid")
    error = (time[inner] - smooth) / pace
    # What a changing speed adds is the same for all teeth of a revolution.
    centred = error - np.convolve(np.pad(error, half, mode="edge"), window, mode="valid")
    seen = np.isin(every[inner], place, assume_unique=True)
    return every[inner][seen] % teeth, centred[seen]


def _mean(tooth: np.ndarray, error: np.ndarray, teeth: int) -> np.ndarray:
    """By tooth; of those never seen, as of every second tooth, so that it holds where both edges of a tooth count."""
    count = np.bincount(tooth, minlength=teeth)
    mean = np.bincount(tooth, error, teeth) / np.maximum(count, 1)
    for half in (0, 1):
        seen = count[half::2] > 0
        mean[half::2][~seen] = mean[half::2][seen].mean() if seen.any() else 0.0
    return mean


def _shift(reference: np.ndarray, other: np.ndarray) -> int:
    """By how much to count the teeth of a stretch on so that its errors are those of the reference."""
    product = np.fft.irfft(np.fft.rfft(reference) * np.conj(np.fft.rfft(other)), reference.size)
    size = np.linalg.norm(reference) * np.linalg.norm(other)
    best = int(np.argmax(product))
    return best if product[best] > ALIKE * size else 0


def _clear(tooth: np.ndarray, error: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """The harmonics of the mean error that are larger than what differs from revolution to revolution leaves of it."""
    revolution = np.cumsum(np.diff(tooth, prepend=tooth[0]) < 0)
    count = np.bincount(revolution)
    whole = np.flatnonzero(count >= WHOLE * count.max())
    if whole.size < FEWEST:
        return np.zeros(mean.size)
    table = np.tile(mean, (count.size, 1))
    table[revolution, tooth] = error
    spread = np.fft.rfft(table[whole] - mean, axis=1)
    noise = np.sqrt(np.mean(np.abs(spread) ** 2, axis=0) / whole.size)
    found = np.fft.rfft(mean)
    return np.fft.irfft(np.where(np.abs(found) > CLEAR * np.maximum(noise, np.median(noise)), found, 0.0), mean.size)
