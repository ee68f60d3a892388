"""The wheel speed of a brake log made of edges that were logged beside it."""

import dataclasses


from tuning.logs.edge_speed import EdgeStudy
from tuning.logs.recording import Channel, LogError, Recording

NAME = "wheel_speed_rad_s"
"""The project's own name of the signal."""


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
    time, speed, valid = edges.turning.time, edges.turning.speed, edges.turning.valid
    channel = Channel(NAME, speed[valid], time=time[valid], unit="rad/s")
    rest = tuple(other for other in recording.channels if other.name != NAME)
    said = [f"edges, {edges.log.name}: {note}" for note in edges.notes]
    note = f"wheel_speed is made of {edges.passings.stamps.size} edges of a {edges.passings.pattern.name} wheel"
    return dataclasses.replace(recording, channels=(*rest, channel), notes=(*recording.notes, note, *said))
