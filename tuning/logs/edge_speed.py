"""Wheel speed and acceleration from the edges of a log, looking both ways in time; and where they can be trusted.

A cubic in time is fitted to the angles of the edges around each edge, as few of them as the noise allows: its slope
is w, its curvature w'. Unlike a control unit, which must wait for the next edge, a fit that looks ahead does not lag.
What the teeth are off their places is learned over the revolutions and taken off the angles, if that leaves less noise.
"""

from typing import NamedTuple

import numpy as np

from tuning.logs.edges import EdgeLog
from tuning.logs.teeth import Passings, passings_of
from tuning.logs.tooth_errors import NORMAL, ToothErrors, tooth_errors

HALVES = (3, 5, 7, 10, 14)
"""Edges on either side of the fit, of which the fewest are taken that are quiet enough."""
ROUGH = 7
"""The same, where the noise is not known yet."""
QUIET = 1.0
"""rad/s^2: noise of the acceleration that is quiet enough"""
LOUD = 5.0
"""rad/s^2: noise of the acceleration that is worth a word"""
WORTH = 0.9
"""The errors of the teeth are taken off if the noise falls below so many times what it was."""
OUTLIER, LEAST_OUTLIER = 8.0, 0.02
"""An edge so many times the noise, and so many pitches, off the fit is none."""
LONGEST_WAIT = 0.05
"""s without an edge beyond which nothing is known"""
LEAST_TRUSTED = 0.5
"""Share of the samples below which the log refutes that it is one of edges."""
CHUNK = 50_000


class Turning(NamedTuple):
    """How the wheel turns, at the samples; arrays (samples,)."""

    time: np.ndarray
    """in the log's clock, s"""
    speed: np.ndarray
    """rad/s"""
    acceleration: np.ndarray
    """rad/s^2"""
    valid: np.ndarray
    """where both are known: not where edges were repaired, nor where the wheel may have done anything"""


class EdgeStudy(NamedTuple):
    """What the edges of a log say."""

    log: EdgeLog
    passings: Passings
    errors: ToothErrors
    turning: Turning
    noise: float
    """of the edges, encoder cycles"""
    verdict: str
    """'sound', 'doubtful' or 'refuted'"""
    reasons: tuple[str, ...]
    """sentences: why it is not sound"""
    notes: tuple[str, ...]
    """sentences: what was done with the log"""


class _Motion(NamedTuple):
    """At the edges; arrays (edges,)."""

    speed: np.ndarray
    acceleration: np.ndarray
    off: np.ndarray
    """angle of the edge off the fit"""
    noise: np.ndarray
    """of speed and acceleration over that of the angle, (edges, 2)"""
    inner: np.ndarray
    """whether the fit has as many edges on either side"""


def study_of(log: EdgeLog, *, period: float = 1e-3, both: bool | None = None) -> EdgeStudy:
    """Wheel speed and acceleration every `period` s from the first edge on, and what to think of them.

    Raises:
        LogError: as `passings_of`.
    """
    passings = passings_of(log, both)
    notes, doubts = [*log.notes, *passings.notes], [*log.doubts, *passings.doubts]
    errors = tooth_errors(passings)
    pitch = 2 * np.pi / passings.pattern.slots
    time = (passings.stamps - log.stamps[0]) * log.clock
    moved = passings.tooth + errors.shift[passings.stretch]
    plain, known = pitch * passings.tooth, pitch * (passings.tooth - errors.clear[moved % errors.clear.size])
    angle, rough, noise = plain, *_noise(time, plain, passings.stretch)
    if errors.clear.any():
        other, less = _noise(time, known, passings.stretch)
        if less < WORTH * noise:
            angle, rough, noise = known, other, less
            notes.append(
                f"errors of the teeth, {errors.clear.std():.2g} cycles rms, learned and taken off: edges are "
                f"{less / pitch:.2g} cycles off instead of {np.median(np.abs(rough.off)) and _noise(time, plain, passings.stretch)[1] / pitch:.2g}"
            )
    repaired = passings.repaired.copy()
    bad = np.abs(rough.off) > np.maximum(OUTLIER * noise, LEAST_OUTLIER * pitch)
    if bad.any() and not bad.all():
        notes.append(f"{bad.sum()} edges off their places, left out")
        repaired[1:] |= bad[:-1]
        repaired = np.add.reduceat(repaired | bad, np.flatnonzero(~bad)) > 0 if False else _carried(repaired | bad, ~bad)
        time, angle, stretch = time[~bad], angle[~bad], passings.stretch[~bad]
    else:
        stretch = passings.stretch
    motion = _quiet(time, angle, stretch, noise)
    turning = _sampled(log, time, motion, stretch, repaired, period)
    loud = float(np.median(motion.noise[:, 1]) * noise)
    if loud > LOUD:
        doubts.append(f"edges are {noise / pitch:.2g} cycles off: accelerations are so by {loud:.2g} rad/s^2")
    share = float(turning.valid.mean())
    verdict = "doubtful" if doubts else "sound"
    if share < LEAST_TRUSTED:
        verdict = "refuted"
        doubts.append(f"{share:.0%} of the samples can be trusted: these are not the edges of one wheel")
        turning = turning._replace(valid=np.zeros_like(turning.valid))
    return EdgeStudy(log, passings, errors, turning, noise / pitch, verdict, tuple(doubts), tuple(notes))


def _carried(flags: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Whether a flag stood since the last one kept, for those kept."""
    return np.diff(np.cumsum(flags)[kept], prepend=0) > 0


def _noise(time, angle, stretch) -> tuple[_Motion, float]:
    """The fits over a usual number of edges, and the noise of the angles."""
    motion = _fitted(time, angle, stretch, ROUGH)
    return motion, float(NORMAL * np.median(np.abs(motion.off)))


def _quiet(time, angle, stretch, noise: float) -> _Motion:
    """At every edge the shortest of the fits that is quiet enough."""
    best = _fitted(time, angle, stretch, HALVES[0])
    for half in HALVES[1:]:
        loud = best.noise[:, 1] * noise > QUIET
        if not loud.any():
            break
        longer = _fitted(time, angle, stretch, half)
        better = loud & (longer.inner | ~best.inner)
        best = _Motion(*(np.where(better if x.ndim == 1 else better[:, None], y, x) for x, y in zip(best, longer)))
    return best


def _fitted(time, angle, stretch, half: int) -> _Motion:
    """Cubics through the edges around each edge of the same stretch."""
    size = time.size
    starts = np.flatnonzero(np.diff(stretch, prepend=-1))
    first = starts[stretch - stretch[0]] if stretch.size else starts
    last = np.append(starts[1:], size)[stretch - stretch[0]] - 1
    here = np.arange(size)
    begin = np.maximum(np.minimum(here - half, last - 2 * half), first)
    inner = (here - half >= first) & (here + half <= last)
    parts = [
        _cubic(time, angle, here[k : k + CHUNK], begin[k : k + CHUNK], half, last[k : k + CHUNK])
        for k in range(0, size, CHUNK)
    ]
    coefficients = np.concatenate([part[0] for part in parts])
    noise = np.concatenate([part[1] for part in parts])
    return _Motion(
        coefficients[:, 1], 2 * coefficients[:, 2], -coefficients[:, 0] / noise[:, 0], noise[:, 1:], inner
    )


def _cubic(time, angle, here, begin, half: int, last):
    """Coefficients at each edge, and the noise of the first three over that of the angles."""
    index = begin[:, None] + np.arange(2 * half + 1)
    weight = (index <= last[:, None]).astype(float)
    index = np.minimum(index, last[:, None])
    x = time[index] - time[here][:, None]
    scale = np.abs(x).max(axis=1)
    x = x / scale[:, None]
    powers = np.stack([np.ones_like(x), x, x**2, x**3], axis=-1)
    weighted = powers * weight[..., None]
    normal = np.einsum("enp,enq->epq", weighted, powers)
    y = angle[index] - angle[here][:, None]
    inverse = np.linalg.inv(normal)
    found = np.einsum("epq,eq->ep", inverse, np.einsum("enp,en->ep", weighted, y))
    spread = np.sqrt(np.maximum(np.diagonal(inverse, axis1=1, axis2=2), 0))
    own = np.sqrt(np.maximum(1 - spread[:, 0] ** 2, 0.01))
    powers_of = scale[:, None] ** np.arange(4)
    noise = np.stack([own, spread[:, 1] / scale, 2 * spread[:, 2] / scale**2], axis=1)
    return found / powers_of, noise


def _sampled(log: EdgeLog, time, motion: _Motion, stretch, repaired, period: float) -> Turning:
    """From edges to samples: a cubic between two of them."""
    grid = period * np.arange(int(np.floor(time[-1] / period + 1e-9)) + 1)
    after = np.clip(np.searchsorted(time, grid), 1, time.size - 1)
    before = after - 1
    step = time[after] - time[before]
    s = np.clip((grid - time[before]) / step, 0.0, 1.0)
    w0, w1, a0, a1 = motion.speed[before], motion.speed[after], motion.acceleration[before], motion.acceleration[after]
    known = (
        ~repaired[after] & (stretch[before] == stretch[after]) & motion.inner[before] & motion.inner[after]
        & (step < LONGEST_WAIT) & (grid >= time[0])
    )
    speed = (
        (1 + 2 * s) * (1 - s) ** 2 * w0 + s**2 * (3 - 2 * s) * w1 + step * s * (1 - s) * ((1 - s) * a0 - s * a1)
    )
    speed = np.where(known | (stretch[before] == stretch[after]), speed, (1 - s) * w0 + s * w1)
    acceleration = (1 - s) * a0 + s * a1
    return Turning(log.stamps[0] * log.clock + grid, speed, acceleration, known)
