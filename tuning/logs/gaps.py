"""Gaps in a log of edges: how many teeth passed in them, and how long they were where the counter may have overflowed.

On both sides of a gap of length T the wheel is known, so that in between

    th1 - th0 = T (w0 + w1) / 2 + T^2 (a0 - a1) / 12,    (w1 - w0) / T = (a0 + a1) / 2

up to terms of higher order. A counter of 16 bits that overflowed unseen leaves T unknown by laps of its range: T is
that lap for which the teeth fall on their places and the speeds go with the accelerations, if there is but one.
"""

from collections.abc import Callable

import numpy as np

from tuning.logs.edges import EdgeLog
from tuning.logs.motion import Motion
from tuning.logs.teeth import Passings

LONGEST = 2.0
"""s; a gap that may be longer is not looked into"""
SHORT = 8
"""Pitches up to which a gap is taken for as long as it looks."""
ROOM_ANGLE, ROOM_ACCELERATION = 0.1, 5.0
"""What the equations may be off by beside the noise: pitches; rad/s^2, and a share of the change of acceleration."""
ROOM_CHANGE = 0.2
FITS, CLEAR = 4.0, 9.0
"""Sum of squares up to which a lap fits; by which the next must be worse."""


def rejoined(
    log: EdgeLog, passings: Passings, motion_at: Callable[[np.ndarray], Motion], noise: float
) -> tuple[Passings, int | None, list[str], list[str]]:
    """Teeth and, of a counter that overflows, time behind each gap.

    Args:
        log: of the edges.
        passings: its teeth.
        motion_at: how the wheel turns at edges, by their indices.
        noise: of their angles [rad].

    Returns:
        The passings, moved; the instant from which on the time is not known, ticks, or None; notes; doubts.
    """
    stamps, tooth = passings.stamps.copy(), passings.tooth.copy()
    notes, doubts, unknown = [], [], None
    pattern, pitch = passings.pattern, 2 * np.pi / passings.pattern.slots
    for after in np.flatnonzero(np.diff(passings.stretch)) + 1:
        gap = int(stamps[after] - stamps[after - 1])
        if gap * log.clock > LONGEST:
            continue
        motion = motion_at(np.array([after - 1, after]))
        short = gap * log.clock * max(motion.speed.max(), 0.0) < SHORT * pitch
        laps = np.zeros(1, int) if short else _laps(log, gap)
        length = log.clock * (gap + log.modulus * laps)
        turned = _turned(length, motion.speed, motion.acceleration) / pitch
        chosen = 0
        if laps.size > 1:
            odds = _misfit(length, turned - (tooth[after] - tooth[after - 1]), pattern.period, motion, noise, pitch)
            order = np.argsort(odds)
            if odds[order[0]] > FITS or odds[order[1]] < odds[order[0]] + CLEAR:
                doubts.append(
                    f"a gap at {log.clock * stamps[after - 1]:.6g} s: {length[0]:.4g} s, or any number of times "
                    f"{log.modulus * log.clock:.4g} s longer, as the counter overflows; time is not known from there on"
                )
                unknown = int(stamps[after - 1]) if unknown is None else unknown
            else:
                chosen = int(order[0])
                notes.append(
                    f"a gap at {log.clock * stamps[after - 1]:.6g} s: {length[chosen]:.4g} s long by speed and teeth "
                    f"on both sides; the counter overflows every {log.modulus * log.clock:.4g} s"
                )
        passed = tooth[after] - tooth[after - 1]
        steps = np.round((turned[chosen] - passed) / pattern.period) * pattern.period
        tooth[after:] += max(int(steps), -(passed - 1) // pattern.period * pattern.period if passed > 1 else 0)
        stamps[after:] += log.modulus * chosen
    return passings._replace(stamps=stamps, tooth=tooth), unknown, notes, doubts


def _laps(log: EdgeLog, gap: int) -> np.ndarray:
    most = int((LONGEST / log.clock - gap) // log.modulus) if log.modulus else 0
    return np.arange(max(most, 0) + 1)


def _turned(length, speed, acceleration):
    return length * speed.mean() + length**2 * (acceleration[0] - acceleration[1]) / 12


def _misfit(length, off, period: int, motion: Motion, noise: float, pitch: float) -> np.ndarray:
    """Sum of squares of what each length leaves of the equations, over what it may leave."""
    speed, acceleration = motion.speed, motion.acceleration
    spread = noise * np.sqrt((motion.noise**2).sum(axis=0))
    change = abs(acceleration[1] - acceleration[0])
    away = off - np.round(off / period) * period
    angle = np.hypot(0.5 * length * spread[0], length**2 * spread[1] / 12) / pitch
    angle = np.hypot(angle, ROOM_ANGLE + length**2 * ROOM_CHANGE * change / 12 / pitch)
    rate = (speed[1] - speed[0]) / length - acceleration.mean()
    room = np.sqrt((spread[0] / length) ** 2 + spread[1] ** 2) + ROOM_ACCELERATION + ROOM_CHANGE * change
    return (away / angle) ** 2 + (rate / room) ** 2
