"""Wheel speed and acceleration from the edges of a log, looking both ways in time; and where they can be trusted.

A cubic in time is fitted to the angles of the edges around each edge, as few of them as the noise allows: its slope
is w, its curvature w'. Unlike a control unit, which must wait for the next edge, a fit that looks ahead does not lag.
What the teeth are off their places is learned over the revolutions and taken off the angles, if that leaves less noise.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from tuning.logs.edges import EdgeLog
from tuning.logs.gaps import rejoined
from tuning.logs.motion import Motion, fitted
from tuning.logs.repetition import repetition
from tuning.logs.teeth import Passings, passings_of
from tuning.logs.tooth_errors import NORMAL, ToothErrors, tooth_errors, unknown_share

HALVES = (3, 5, 7, 10, 14)
"""Edges on either side of the fit, of which the fewest are taken that are quiet enough."""
ROUGH = 7
"""The same, where the noise is not known yet."""
QUIET = 1.0
"""rad/s^2: noise of the acceleration that is quiet enough"""
NO_LOUDER = 4.0
"""Fits, as they are at the ends of a stretch, whose noise is so many times the usual are not trusted."""
LONGEST_FIT = 0.1
"""s; a wheel may do anything in a longer time"""
CHECKED = 20_000
"""Edges at which fits of two lengths are compared."""
LOUD = 5.0
"""rad/s^2: noise of the acceleration that is worth a word"""
FAST = 0.05
"""rad/s: error of the speed that is worth a word"""
WORTH = 0.9
"""The errors of the teeth are taken off if the noise falls below so many times what it was."""
OUTLIER, LEAST_OUTLIER = 8.0, 0.02
"""An edge so many times the noise, and so many pitches, off the fit is none."""
AROUND, AROUND_SHORT = 31, 11
"""Edges among which one stands out; and of the shortest fits, which must leave little."""
SLIPPED = 3
"""Such edges in a row that mean that a tooth was lost or counted twice."""
LONGEST_WAIT = 0.05
"""s without an edge beyond which nothing is known"""
LEAST_TRUSTED = 0.5
"""Share of the samples below which the log refutes that it is one of edges."""


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


class Placed(NamedTuple):
    """The edges that were used; arrays (edges,)."""

    time: np.ndarray
    """in the log's clock, s"""
    angle: np.ndarray
    """of the wheel, rad"""
    joined: np.ndarray
    """whether the edge before is that of the tooth before, and nothing was repaired in between"""


class EdgeStudy(NamedTuple):
    """What the edges of a log say."""

    log: EdgeLog
    filled: EdgeLog
    """with an edge for every tooth, those that are missing put where the wheel has them"""
    passings: Passings
    errors: ToothErrors
    turning: Turning
    placed: Placed
    noise: float
    """of the edges, encoder cycles"""
    verdict: str
    """'sound', 'doubtful' or 'refuted'"""
    reasons: tuple[str, ...]
    """sentences: why it is not sound"""
    notes: tuple[str, ...]
    """sentences: what was done with the log"""


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
    plain = pitch * passings.tooth
    counted = passings.tooth
    angle, rough, noise = plain, *_noise(time, plain, passings.stretch)
    usual_speed = float(pitch * np.median(np.diff(passings.tooth) / np.diff(time)))
    repeats = repetition(log.name, passings, rough.off, usual_speed * log.step * log.clock)
    if repeats == log.teeth // 2 and passings.both and both is None:
        said = f"{log.teeth} declared, but errors repeat after {repeats}: both edges of {repeats} teeth were counted"
        study = study_of(dataclasses.replace(log, teeth=repeats), period=period, both=both)
        return study._replace(notes=(*study.notes, said))
    if repeats is not None and repeats < passings.pattern.slots:
        doubts.append(
            f"errors of the edges repeat after {repeats} already: a wheel of {repeats} teeth turns "
            f"{passings.pattern.slots // repeats} times as fast as one of the {passings.pattern.slots} declared"
        )
    clear = errors.refined(moved % errors.mean.size, -rough.raw / pitch, ROUGH)
    if clear.any():
        known = pitch * (passings.tooth + clear[moved % clear.size])
        other, less = _noise(time, known, passings.stretch)
        if less < WORTH * noise:
            notes.append(
                f"errors of the teeth, {clear.std():.2g} cycles rms, learned and taken off: edges are then "
                f"{less / pitch:.2g} cycles off, not {noise / pitch:.2g}"
            )
            angle, rough, noise = known, other, less
            share = unknown_share(clear, ROUGH)
            if share * usual_speed > FAST:
                doubts.append(
                    "errors of the teeth that change slowly over a revolution are not told from the wheel's own speed: "
                    f"it may be off by {share * usual_speed:.2g} rad/s rms"
                )
        else:
            notes.append("errors of the teeth are left on: without them edges are no nearer to their places")
    passings, unknown, said, doubted = rejoined(
        log, passings, lambda ends: fitted(time, angle, passings.stretch, HALVES[-1], ends), noise
    )
    notes += said
    doubts += doubted
    angle = angle + pitch * (passings.tooth - counted)
    time = (passings.stamps - log.stamps[0]) * log.clock
    repaired = passings.repaired.copy()
    # A wheel that turns unevenly leaves all edges of a while off the fit; one that is none stands out among them.
    around = NORMAL * median_filter(np.abs(rough.off), size=AROUND, mode="mirror")
    bad = np.abs(rough.off) > np.maximum(OUTLIER * np.maximum(noise, around), LEAST_OUTLIER * pitch)
    if bad.any() and not bad.all():
        notes.append(f"{bad.sum()} edges off their places, left out")
        repaired[1:] |= bad[:-1]
        repaired = _carried(repaired | bad, ~bad)
        # Several in a row: the teeth were not counted right there, and are counted anew.
        slipped = np.convolve(bad, np.ones(SLIPPED), "same") >= SLIPPED
        stretch = passings.stretch + np.cumsum(np.diff(slipped.astype(int), prepend=0) > 0)
        time, angle, stretch = time[~bad], angle[~bad], stretch[~bad]
    else:
        stretch = passings.stretch
    # Where even the shortest fit leaves far more than the noise, teeth were not counted right.
    short = fitted(time, angle, stretch, HALVES[0])
    level = NORMAL * median_filter(np.abs(short.off), size=AROUND_SHORT, mode="mirror")
    repaired |= level > np.maximum(OUTLIER * noise, LEAST_OUTLIER * pitch)
    motion = _quiet(time, angle, stretch, noise)
    turning = _sampled(log, time, motion, stretch, repaired, period)
    plain_step = np.round(np.diff(angle, prepend=angle[0] - pitch) / pitch) == 1
    joined = plain_step & ~repaired & (np.diff(stretch, prepend=stretch[0] - 1) == 0)
    placed = Placed(log.stamps[0] * log.clock + time, angle, joined)
    loud = float(np.median(motion.noise[:, 1]) * noise)
    if loud > LOUD:
        doubts.append(f"edges are {noise / pitch:.2g} cycles off: accelerations are so by {loud:.2g} rad/s^2")
    swift = _swift(time, angle, stretch, noise)
    if swift > LOUD:
        doubts.append(
            f"the acceleration changes faster than {passings.pattern.name} teeth tell: it is off by {swift:.2g} rad/s^2"
        )
    trusted = float(turning.valid.mean())
    if unknown is not None:
        placed = placed._replace(joined=placed.joined & (placed.time <= unknown * log.clock))
        turning = turning._replace(valid=turning.valid & (turning.time <= unknown * log.clock))
    verdict = "doubtful" if doubts else "sound"
    if trusted < LEAST_TRUSTED:
        verdict = "refuted"
        doubts.append(f"{trusted:.0%} of the samples can be trusted: these are not the edges of one wheel")
        turning = turning._replace(valid=np.zeros_like(turning.valid))
    return EdgeStudy(
        log,
        _filled(log, passings, motion, ~bad),
        passings,
        errors,
        turning,
        placed,
        noise / pitch,
        verdict,
        tuple(doubts),
        tuple(notes),
    )


def _carried(flags: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Whether a flag stood since the last one kept, for those kept."""
    return np.diff(np.cumsum(flags)[kept], prepend=0) > 0


def _noise(time, angle, stretch) -> tuple[Motion, float]:
    """The fits over a usual number of edges, and the noise of the angles."""
    motion = fitted(time, angle, stretch, ROUGH)
    return motion, float(NORMAL * np.median(np.abs(motion.off)))


def _quiet(time, angle, stretch, noise: float) -> Motion:
    """At every edge the shortest of the fits that is quiet enough."""
    best, here = fitted(time, angle, stretch, HALVES[0]), np.arange(time.size)
    for half in HALVES[1:]:
        length = time[np.minimum(here + half, time.size - 1)] - time[np.maximum(here - half, 0)]
        loud = np.flatnonzero((best.noise[:, 1] * noise > QUIET) & (length < LONGEST_FIT))
        longer = fitted(time, angle, stretch, half, loud)
        better = longer.inner | ~best.inner[loud]
        for before, now in zip(best, longer):
            before[loud[better]] = now[better]
    return best


def _swift(time, angle, stretch, noise: float) -> float:
    """What the acceleration is off since it changes within the fits, as fits of two lengths tell, rad/s^2.

    It grows with the square of their length; what noise may make of the difference is taken off twice.
    """
    some = np.arange(0, time.size, 1 + time.size // CHECKED)
    short, longer = (fitted(time, angle, stretch, half, some) for half in HALVES[:2])
    inner = short.inner & longer.inner
    if not inner.any():
        return 0.0
    apart = NORMAL * np.median(np.abs(short.acceleration - longer.acceleration)[inner])
    expected = noise * np.median(np.hypot(short.noise[inner, 1], longer.noise[inner, 1]))
    beyond = float(np.sqrt(max(apart**2 - (2 * expected) ** 2, 0.0)))
    return beyond * HALVES[0] ** 2 / (HALVES[1] ** 2 - HALVES[0] ** 2)


def _filled(log: EdgeLog, passings: Passings, motion: Motion, kept: np.ndarray) -> EdgeLog:
    """An edge for every tooth."""
    stamps, place = passings.stamps[kept], passings.tooth[kept]
    pitch = 2 * np.pi / passings.pattern.slots
    every = np.arange(place[0], place[-1] + 1)
    after = np.clip(np.searchsorted(place, every), 1, place.size - 1)
    before = after - 1
    gap, length = place[after] - place[before], (stamps[after] - stamps[before]).astype(float)
    s = (every - place[before]) / gap
    # Time over angle: a cubic with the slopes 1 / w, if it only rises; else a straight line.
    slopes = [gap * pitch / np.maximum(motion.speed[i], 1e-9) / log.clock for i in (before, after)]
    bent = s**2 * (3 - 2 * s) * length + s * (1 - s) * ((1 - s) * slopes[0] - s * slopes[1])
    rises = (slopes[0] < 2.5 * length) & (slopes[1] < 2.5 * length)
    since = np.round(np.where(rises, bent, s * length)).astype(np.int64)
    time = stamps[before] + since
    time = np.maximum.accumulate(time - np.arange(time.size)) + np.arange(time.size)
    return dataclasses.replace(log, stamps=time, teeth=passings.pattern.slots)


def _sampled(log: EdgeLog, time, motion: Motion, stretch, repaired, period: float) -> Turning:
    """From edges to samples: a cubic between two of them."""
    grid = period * np.arange(int(np.floor(time[-1] / period + 1e-9)) + 1)
    after = np.clip(np.searchsorted(time, grid), 1, time.size - 1)
    before = after - 1
    step = time[after] - time[before]
    s = np.clip((grid - time[before]) / step, 0.0, 1.0)
    w0, w1, a0, a1 = motion.speed[before], motion.speed[after], motion.acceleration[before], motion.acceleration[after]
    known = (
        ~repaired[after]
        & (stretch[before] == stretch[after])
        & motion.inner[before]
        & motion.inner[after]
        & (step < LONGEST_WAIT)
        & (grid >= time[0])
    )
    loud = motion.noise[:, 1] > NO_LOUDER * np.median(motion.noise[:, 1])
    known &= ~loud[before] & ~loud[after]
    speed = (1 + 2 * s) * (1 - s) ** 2 * w0 + s**2 * (3 - 2 * s) * w1 + step * s * (1 - s) * ((1 - s) * a0 - s * a1)
    speed = np.where(known | (stretch[before] == stretch[after]), speed, (1 - s) * w0 + s * w1)
    acceleration = (1 - s) * a0 + s * a1
    return Turning(log.stamps[0] * log.clock + grid, speed, acceleration, known)
