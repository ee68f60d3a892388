"""What is told of a stop."""

import dataclasses

import numpy as np

from absjax.loop.stop import Outcome, Stop


@dataclasses.dataclass(frozen=True)
class StopFigures:
    """What is told of a stop."""

    distance: float | None
    """from the pedal, m; None where it does not end"""
    published_quantity: float | None
    """v0^2 / (2 g mean friction of the ABS-active time), m; None where the vehicle was not slowed down"""
    cycles: int
    longest_cycle: float
    """s"""
    outcome: str
    onset_s: float | None = None
    """of the first switching, from the pedal; this and what follows is None in results of earlier versions"""
    onset_kmh: float | None = None
    """speed then"""
    lock_s_above_15: float | None = None
    lock_s_above_2_5: float | None = None
    longest_lock_above_15: float | None = None
    """s"""
    slide_s_above_15: float | None = None
    """of the wheel that slides longest"""

    @classmethod
    def of(cls, stops: Stop, lane: int) -> "StopFigures":
        """Of one lane of stops, arrays (lanes,)."""
        outcome = Outcome(int(stops.outcome[lane]))
        distance, quantity = float(stops.distance[lane]), float(stops.published_quantity[lane])
        return cls(
            distance=distance if outcome is Outcome.STOPPED else None,
            published_quantity=quantity if np.isfinite(quantity) else None,
            onset_s=float(stops.onset_time[lane]),
            onset_kmh=3.6 * float(stops.onset_speed[lane]),
            cycles=int(stops.cycles[lane]),
            longest_cycle=float(stops.longest_cycle[lane]),
            lock_s_above_15=float(stops.lock_time[0][lane]),
            lock_s_above_2_5=float(stops.lock_time[1][lane]),
            longest_lock_above_15=float(stops.longest_lock[0][lane]),
            slide_s_above_15=max(float(time[lane]) for time in stops.slide_time),
            outcome=outcome.name,
        )
