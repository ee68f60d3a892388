"""How good an estimate of XBS is."""

import numpy as np

TOLERANCE = 1.0
"""Error of XBS within which an estimate has settled."""


def settling(time, error, begins, ends, tolerance: float = TOLERANCE) -> np.ndarray:
    """Time from the beginning of each road to the last |error| > tolerance on it [s].

    Args:
        time: (samples,), s.
        error: of XBS, (runs, samples); what is not finite counts as not settled.
        begins: of the roads, (runs, roads), s.
        ends: of the roads, (runs, roads), s.
        tolerance: of |error|.

    Returns:
        (runs, roads); the whole length of a road on which the estimate never settles.
    """
    outside = ~(np.abs(error) <= tolerance)
    result = np.zeros(begins.shape)
    for road in range(begins.shape[1]):
        begin, end = begins[:, road, None], ends[:, road, None]
        last = np.where(outside & (time >= begin) & (time < end), time, -np.inf).max(axis=1)
        result[:, road] = np.maximum(last - begins[:, road], 0.0)
    return result


def within(time, begins, ends) -> np.ndarray:
    """Which samples lie on a road and not in a blend, (runs, samples)."""
    inside = (time >= begins[..., None]) & (time < ends[..., None])
    return inside.any(axis=1)


def rms(values, where) -> np.ndarray:
    """Root mean square over the samples `where` holds, (runs,)."""
    count = np.maximum(where.sum(axis=-1), 1)
    return np.sqrt(np.where(where, np.square(values), 0.0).sum(axis=-1) / count)


def crossings(time, stiffness) -> np.ndarray:
    """Instants at which a signal (samples,) changes sign, s."""
    sign = np.sign(stiffness)
    k = np.flatnonzero(sign[:-1] * sign[1:] < 0)
    share = stiffness[k] / (stiffness[k] - stiffness[k + 1])
    return time[k] + share * (time[k + 1] - time[k])
