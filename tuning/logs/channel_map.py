"""Which channel of a log is which signal, in which unit."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from tuning.logs.recording import Channel, LogError, Recording
from tuning.logs.units import FACTORS

COLUMNS = {
    "time": "time_s",
    "wheel_speed": "wheel_speed_rad_s",
    "vehicle_speed": "vehicle_speed_m_s",
    "brake_pressure": "brake_pressure_bar",
    "acceleration": "longitudinal_acceleration_m_s2",
    "force": "longitudinal_force_n",
    "load": "vertical_load_n",
}
"""Column of each signal, unless declared otherwise."""
REQUIRED = ("time", "wheel_speed", "vehicle_speed")
BRAKING = ("brake_pressure", "acceleration", "force")
"""One of these is required too."""


@dataclasses.dataclass(frozen=True)
class Source:
    """Where a signal comes from."""

    signal: str
    channel: Channel
    scale: float = 1.0
    delay: float = 0.0

    def converted(self, values: np.ndarray) -> np.ndarray:
        """Cells in the project's unit."""
        return values * self.scale


def sources_of(recording: Recording, declared: Mapping[str, str]) -> tuple[list[Source], list[str]]:
    """Where each signal comes from; and notes."""
    wanted, found = {**COLUMNS, **declared}, []
    for signal, text in wanted.items():
        column, _, unit = text.partition(":")
        if column not in recording.names:
            if signal not in REQUIRED and signal not in declared:
                continue
            there = ", ".join(recording.names)
            raise LogError(f"{recording.path}: no column {column!r} for {signal}; there are {there}")
        factor = FACTORS[signal].get(unit or next(iter(FACTORS[signal])))
        if factor is None:
            raise LogError(
                f"{recording.path}, column {column!r}: unit {unit!r} is unknown; "
                f"{signal} may be in {', '.join(FACTORS[signal])}"
            )
        found.append(Source(signal, recording.channel(column), factor))
    if not {source.signal for source in found} & set(BRAKING):
        names = [COLUMNS[signal] for signal in BRAKING]
        raise LogError(
            f"{recording.path}: none of {', '.join(BRAKING)} (columns {', '.join(map(repr, names))}); "
            f"there are {', '.join(recording.names)}"
        )
    return found, []
