"""Whether the errors of the edges repeat after as many teeth as were declared."""

import numpy as np
from scipy.signal import fftconvolve

from tuning.logs.recording import LogError
from tuning.logs.teeth import Passings

SHORTEST = 8
"""Fewest teeth of a revolution that are looked for."""
LONGEST = 512
"""Most that are looked for, if twice those declared are fewer."""
CLEAR = 0.6
"""Correlation of errors of a revolution with those of another from which they are the teeth's."""
OTHER = 0.5
"""Share of that correlation below which a number of teeth is not theirs."""
AS_GOOD = 0.9
ROUNDING = 0.6
"""Median error in ticks up to which it may be rounding."""
LARGEST = 5.0
"""Errors beyond so many times their median are cut."""


def repetition(name: str, passings: Passings, off: np.ndarray, tick: float) -> int | None:
    """Teeth after which errors repeat: those declared, or a half, a third or a quarter of them; None if they do not.

    Args:
        name: of the log, for messages.
        passings: its teeth.
        off: what each edge is off a smooth motion, (edges,).
        tick: by which rounding may put an edge off, in the unit of `off`: at constant speed that repeats too.

    Raises:
        LogError: if they clearly repeat after another number.
    """
    teeth, edges = passings.pattern.slots, passings.pattern.edges
    if edges == 2:
        # Rising and falling edges are off in turn; what is looked for is what the teeth are.
        kind = 2 * passings.stretch + passings.tooth % 2
        off = off - np.array([np.median(off[kind == k]) if k in kind else 0.0 for k in range(kind.max() + 1)])[kind]
    if np.median(np.abs(off)) < ROUNDING * tick:
        return None
    limit = LARGEST * max(float(np.median(np.abs(off))), 1e-300)
    parts = []
    for number in np.unique(passings.stretch):
        inside = passings.stretch == number
        place = passings.tooth[inside]
        if place.size > 3 * teeth:
            error = np.zeros(place[-1] - place[0] + 1)
            error[place - place[0]] = np.clip(off[inside], -limit, limit)
            parts.append(error)
    if not parts:
        return None
    most = min(max(2 * teeth, LONGEST), max(map(len, parts)) // 2)
    total = np.zeros(most + 1)
    weight = np.zeros(most + 1)
    for error in parts:
        size = min(most + 1, len(error))
        total[:size] += fftconvolve(error, error[::-1])[len(error) - 1 :][:size]
        square = np.cumsum(error**2)
        weight[:size] += square[-1] - 0.5 * np.concatenate([[0.0], square[: size - 1]])
        weight[:size] -= 0.5 * (square[-1] - square[::-1][:size])
    share = total / np.maximum(weight, 1e-300)
    best = SHORTEST + int(np.argmax(share[SHORTEST:]))
    if share[best] < CLEAR:
        return None
    if share[teeth] < OTHER * share[best]:
        first = SHORTEST + int(np.argmax(share[SHORTEST:] > AS_GOOD * share[best]))
        raise LogError(
            f"{name}: {teeth // edges} teeth declared, but the errors of the edges repeat after {first / edges:g} "
            f"(correlation {share[first]:.2f}; after {teeth // edges}: {share[teeth]:.2f}); "
            f"declare {first / edges:g} teeth"
        )
    for parts_of in (4, 3, 2):
        if teeth % parts_of == 0 and teeth // parts_of >= SHORTEST:
            if share[teeth // parts_of] > AS_GOOD * share[teeth]:
                return teeth // parts_of
    return teeth
