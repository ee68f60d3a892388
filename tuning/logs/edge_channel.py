"""The wheel speed of a brake log made of edges that were logged beside it.

A sample is the angle from one edge to a later one over the time between them, at the middle of that time: what the
edges tell, with their noise, and nothing of what a smooth motion would make of it. Where edges are missing there is no
sample.
"""

import dataclasses

import numpy as np

from tuning.logs.edge_speed import EdgeStudy, Placed
from tuning.logs.recording import Channel, LogError, Recording

NAME = "wheel_speed_rad_s"
"""The project's own name of the signal."""
SHORTEST = 1e-3
"""s from the first to the last edge of a sample, at least"""


def with_wheel_speed(recording: Recording, edges: EdgeStudy) -> Recording:
    """A recording whose wheel speed is that of the edges, where that can be trusted.

    Args:
        recording: of a brake log.
        edges: on the same clock.

    Raises:
        LogError: if the edges are not those of one wheel.
    """
    if edges.verdict == "refuted":
        raise LogError(f"{edges.log.name}: {'; '.join(edges.reasons)}")
    time, speed = measured_speed(edges.placed)
    channel = Channel(NAME, speed, time=time, unit="rad/s")
    rest = tuple(other for other in recording.channels if other.name != NAME)
    said = [f"edges, {edges.log.name}: {note}" for note in edges.notes]
    note = f"wheel_speed is made of {edges.passings.stamps.size} edges of a {edges.passings.pattern.name} wheel"
    return dataclasses.replace(recording, channels=(*rest, channel), notes=(*recording.notes, note, *said))


def measured_speed(placed: Placed) -> tuple[np.ndarray, np.ndarray]:
    """Time [s] and wheel speed [rad/s] from edge to edge."""
    samples, first = [], 0
    joined, time = placed.joined.tolist(), placed.time.tolist()
    for i in range(1, len(time)):
        if not joined[i]:
            first = i
        elif time[i] - time[first] >= SHORTEST:
            samples.append((first, i))
            first = i
    a, b = np.array(samples, int).reshape(-1, 2).T
    length = placed.time[b] - placed.time[a]
    return 0.5 * (placed.time[a] + placed.time[b]), (placed.angle[b] - placed.angle[a]) / length
