"""Which edge is which tooth: doubled and missed edges, gaps, both edges of a tooth, and wheels that lack teeth.

Edges between two that are regular, each a pitch from its neighbours, are placed by the time between those: what is
near a place is the tooth, what is not is an edge too many, and a place without an edge is a tooth missed. Where the
number of places is not certain, the log is cut, and counted anew behind. Places that stay empty in every revolution
are the pattern of a wheel that lacks teeth; its repetition tells how many teeth there are.

The thresholds are ours.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from tuning.logs.edges import EdgeLog
from tuning.logs.patterns import Pattern, pattern_of
from tuning.logs.recording import LogError

AROUND = (9, 21)
"""Intervals whose median is the pitch; of both edges, an edge too many is in three of them."""
REGULAR = 0.25
"""Share of the pitch by which an interval may be off and still be one."""
NEAR = 0.2
"""The same of an edge, to be taken for a tooth."""
BOUNCE = 0.06
"""Pitches between two edges of one tooth, of which the first is taken; of others the nearer."""
LONGEST = 8
"""Pitches without a regular edge that are counted."""
CERTAIN = 0.3
"""Share of a pitch by which their number may be off."""
FEWEST = 16
"""Edges of a stretch that is used."""
ALTERNATING, UNLIKE = 0.04, 0.42
"""Both edges: logarithm of the ratio of intervals that alternate, at least; share of the pitch between the edges of a
tooth up to which only one of them is taken."""


class Passings(NamedTuple):
    """The edges of a log that are teeth; arrays (edges,)."""

    stamps: np.ndarray
    """clock ticks"""
    tooth: np.ndarray
    """number of the tooth since the first, those that are missing counted; after a cut as near as can be told"""
    stretch: np.ndarray
    """number of the stretch between cuts"""
    repaired: np.ndarray
    """whether something was repaired between the edge before and this one: doubled or missed edges, a cut"""
    pattern: Pattern
    """of the wheel"""
    doubled: int
    """edges too many"""
    missed: int
    """teeth without an edge, but for those the wheel lacks"""
    cuts: int
    """gaps that are too long to count the teeth in"""
    both: bool
    """whether the log has both edges of the teeth"""
    notes: tuple[str, ...]
    doubts: tuple[str, ...]


class _Template(NamedTuple):
    """Places of the edges of a tooth, in pitches."""

    places: tuple[float, ...]
    regular: float
    near: float
    steps: int
    """intervals after which they repeat"""


class _Counted(NamedTuple):
    """Edges with their places; arrays (edges,)."""

    index: np.ndarray
    """in the log"""
    place: np.ndarray
    """whole pitches since the first"""
    half: np.ndarray
    """0; 1 for the other edge of a tooth"""
    cut: np.ndarray
    """whether a cut lies before"""
    unsure: np.ndarray
    """whether an edge was left out since the edge before"""


def passings_of(log: EdgeLog, both: bool | None = None) -> Passings:
    """Tell which edge is which tooth.

    Args:
        log: of edges.
        both: whether it has both edges of every tooth; found if None.

    Raises:
        LogError: if edges come too irregularly to be counted, or the teeth declared are not those of the pattern.
    """
    time = (log.stamps - log.stamps[0]).astype(float)
    steps = np.diff(time)
    share = _alternation(steps)
    notes, doubts = [], []
    template, alternating = _Template((0.0,), REGULAR, NEAR, 1 + (share is not None)), share is not None
    if share is not None and share < UNLIKE:
        room = min(share, 0.5 - share)
        template = _Template((0.0, share), min(REGULAR, 0.45 * room), min(NEAR, 0.45 * room), 2)
    counted = _counted(log, time, template)
    two = len(template.places) == 2
    taken = counted.half == 0
    index, place = counted.index[taken], counted.place[taken]
    cut, unsure = _since(counted.cut, taken), _since(counted.unsure, taken)
    if index.size < FEWEST:
        raise LogError(f"{log.name}: edges come too irregularly to be counted")
    stretch = np.cumsum(cut)
    # Pitches of what was counted in a revolution: of N teeth, or of 2 N edges that are alike.
    doubled_count = alternating and not two and both is not False
    pitches = 2 * log.teeth if doubled_count or (both and not two) else log.teeth
    if two and both is False:
        if log.teeth % 2:
            raise LogError(f"{log.name}: intervals alternate as both edges of a tooth do; {log.teeth} teeth are odd")
        pitches = log.teeth // 2
    pattern = pattern_of(log.name, place, stretch, pitches, FEWEST, 1 + (pitches == 2 * log.teeth))
    notes += pattern.notes
    doubts += pattern.doubts
    place = _aligned(place, stretch, pattern)
    if pattern.absent:
        cut = cut & ~_bridged(time[index], place, cut)
        stretch = np.cumsum(cut)
    if share is not None:
        teeth = pattern.slots // pattern.edges
        said = f"intervals alternate, {share:.0%} and {1 - share:.0%} of a pitch: both edges of {teeth} teeth"
        notes.append(said + ("; one of them is taken" if two else ""))
    absent = pattern.absent_between(place)
    missed_here = np.concatenate([[0], np.diff(place) - 1]) - absent
    missed_here[cut] = 0
    repaired = (missed_here > 0) | unsure | cut
    doubled = log.stamps.size - counted.index.size
    missed = int(missed_here.sum())
    cuts = int(cut[1:].sum())
    _say(notes, doubts, log, doubled, missed, cuts, index.size)
    return Passings(
        log.stamps[index],
        place,
        stretch,
        repaired,
        pattern,
        doubled,
        missed,
        cuts,
        alternating,
        tuple(notes),
        tuple(doubts),
    )


def _say(notes: list[str], doubts: list[str], log: EdgeLog, doubled: int, missed: int, cuts: int, edges: int) -> None:
    said = []
    if doubled:
        said.append(f"{doubled} edges too many, left out")
    if missed:
        said.append(f"{missed} teeth without an edge, filled in")
    if cuts:
        said.append(f"{cuts} gaps, behind which teeth are counted anew")
    notes += said
    for count, what in ((doubled, "edges too many"), (missed, "teeth without an edge")):
        if count > 0.05 * edges:
            doubts.append(f"{count} {what} of {edges}: {count / edges:.0%} is more than now and then")


def _since(flags: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """Whether a flag stood since the last edge taken, for those taken."""
    total = np.cumsum(flags)[taken]
    return np.diff(total, prepend=0) > 0


def _alternation(steps: np.ndarray) -> float | None:
    """Shorter share of the pitch between both edges of a tooth, if intervals alternate; None if they do not."""
    ratio = np.log(steps[1:] / steps[:-1])
    size = float(np.median(np.abs(ratio)))
    turned = np.median(np.abs(ratio[2:] - ratio[:-2])) < 0.3 * size
    opposed = np.mean(ratio[1:] * ratio[:-1] < 0) > 0.8
    if size < ALTERNATING or not turned or not opposed:
        return None
    share = steps[:-1] / (steps[:-1] + steps[1:])
    return float(np.median(share[share < 0.5]))


def _counted(log: EdgeLog, time: np.ndarray, template: _Template) -> _Counted:
    steps = np.diff(time)
    width = len(template.places)
    over = (time[template.steps :] - time[: -template.steps]) * width / template.steps
    pitch = median_filter(over, size=AROUND[template.steps - 1], mode="mirror")
    pitch = np.concatenate([pitch, np.full(time.size - pitch.size, pitch[-1])])
    if template.steps == 2:
        pitch = np.concatenate([pitch[:1], 0.5 * (pitch[1:] + pitch[:-1])])
    slack = log.step / pitch[:-1]
    share = steps / pitch[:-1]
    if width == 1:
        fits = [np.abs(share - 1) < np.minimum(template.regular + slack, 0.45)]
    else:
        f = template.places[1]
        fits = [np.abs(share - x) < np.minimum(template.regular + slack, 0.45 * min(f, 0.5 - f)) for x in (f, 1 - f)]
    # An edge is regular if the interval after it, and the one before, are what they should be.
    ahead = [np.concatenate([fit, [True]]) for fit in fits]
    behind = [np.concatenate([[True], fit]) for fit in fits]
    half = np.zeros(time.size, int)
    regular = ahead[0] & behind[-1]
    if width == 2:
        other = ahead[1] & behind[0] & ~regular
        half[other] = 1
        regular |= other
    anchors = np.flatnonzero(regular)
    if anchors.size < max(FEWEST, 0.2 * time.size):
        raise LogError(
            f"{log.name}: edges come too irregularly to be counted: {anchors.size} of {time.size} are a pitch from "
            "their neighbours"
        )
    return _placed(time, pitch, anchors, half, template)


def _placed(time, pitch, anchors, half, template: _Template) -> _Counted:
    """Places of all edges, from those of the regular ones."""
    width = len(template.places)
    offset = np.array(template.places)
    a, b = anchors[:-1], anchors[1:]
    rate = 0.5 * (1 / pitch[a] + 1 / pitch[b])
    turned = (time[b] - time[a]) * rate
    whole = np.round(turned - (offset[half[b]] - offset[half[a]])).astype(int)
    off = np.abs(turned - (offset[half[b]] - offset[half[a]]) - whole)
    direct = b == a + 1
    least = np.where(half[b] > half[a], 0, 1)
    counted = direct | ((off < CERTAIN) & (whole <= LONGEST) & (whole >= least))
    whole = np.where(direct, least, whole)
    # Behind a cut the number is a guess, but never fewer than one.
    place = np.concatenate([[0], np.cumsum(np.maximum(whole, least))])
    index, places, halves = [anchors], [place], [half[anchors]]
    cut = np.zeros(time.size, bool)
    cut[b[~counted]] = True
    used = np.zeros(time.size, bool)
    used[anchors] = True
    for i in np.flatnonzero(~direct & counted):
        inner = np.arange(a[i] + 1, b[i])
        total = whole[i] + offset[half[b[i]]] - offset[half[a[i]]]
        phase = offset[half[a[i]]] + (time[inner] - time[a[i]]) / (time[b[i]] - time[a[i]]) * total
        end = offset[half[a[i]]] + total
        if width == 1:
            slot, kind = np.round(phase).astype(int), np.zeros(inner.size, int)
        else:
            nearer = np.stack([np.abs(phase - o - np.round(phase - o)) for o in offset])
            kind = np.argmin(nearer, axis=0)
            slot = np.round(phase - offset[kind]).astype(int)
        where = slot + offset[kind]
        away = np.abs(phase - where)
        good = (away < template.near) & (where > offset[half[a[i]]] + 1e-9) & (where < end - 1e-9)
        chosen: dict[tuple[int, int], int] = {}
        for j in np.flatnonzero(good):
            key = (int(slot[j]), int(kind[j]))
            if key not in chosen or (phase[j] - phase[chosen[key]] > BOUNCE and away[j] < away[chosen[key]]):
                chosen[key] = int(j)
        if chosen:
            picked = np.array(list(chosen.values()))
            index.append(inner[picked])
            places.append(place[i] + slot[picked])
            halves.append(kind[picked])
            used[inner[picked]] = True
    order = np.argsort(np.concatenate(index))
    index = np.concatenate(index)[order]
    places, halves = np.concatenate(places)[order], np.concatenate(halves)[order]
    # Stretches that are too short to tell anything are left out.
    stretch = np.cumsum(cut[index])
    long = np.bincount(stretch) >= FEWEST
    kept = long[stretch]
    left = np.concatenate([[0], np.cumsum(~used)])
    unsure = np.concatenate([[False], np.diff(left[index]) > 0])
    stretch = stretch[kept]
    return _Counted(
        index[kept],
        places[kept] - (places[kept][0] if kept.any() else 0),
        halves[kept],
        np.diff(stretch, prepend=stretch[:1]) > 0,
        unsure[kept],
    )


def _bridged(time: np.ndarray, place: np.ndarray, cut: np.ndarray) -> np.ndarray:
    """Whether the number of teeth in a short gap, as the pattern has it, goes with the pitches on both sides."""
    found = np.zeros(cut.size, bool)
    for i in np.flatnonzero(cut):
        if 3 <= i < cut.size - 3:
            before = (time[i - 1] - time[i - 3]) / (place[i - 1] - place[i - 3])
            after = (time[i + 2] - time[i]) / (place[i + 2] - place[i])
            passed = place[i] - place[i - 1]
            turned = 2 * (time[i] - time[i - 1]) / (before + after)
            found[i] = passed <= LONGEST and abs(turned / passed - 1) < REGULAR
    return found


def _aligned(place: np.ndarray, stretch: np.ndarray, pattern: Pattern) -> np.ndarray:
    """Tooth numbers from the first tooth of the pattern on, moved behind each cut so that it fits there too."""
    place = place.copy()
    for number in range(int(stretch[-1]) + 1):
        inside = stretch == number
        turn = pattern.turn(place[inside])
        if number == 0:
            place += turn
        else:
            before = place[np.flatnonzero(inside)[0] - 1]
            turn = turn - pattern.period if turn > pattern.period / 2 else turn
            first = place[inside][0] + turn
            turn += pattern.period * max(0, -(-(before + 1 - first) // pattern.period))
            place[np.flatnonzero(inside)[0] :] += turn
    return place
