"""Every set that was judged on split friction, and the front among them.

A set lies on the front if none that is sound has both less yaw rate and less distance.
"""

import dataclasses
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from absjax.loop.stop import Outcome
from tuning.vehicle.regulation.screening import LONGEST_LOCK, LONGEST_SLIDE
from tuning.vehicle.split_mu import SPUN, SplitStop


class Turned(NamedTuple):
    """What counts of stops on split friction; arrays (sets,)."""

    distance: Any
    """m"""
    yaw_rate: Any
    """largest |r| [rad/s]"""
    side_slip: Any
    """largest |beta| [rad]"""
    lock: Any
    """longest lock of a wheel above 15 km/h [s]"""
    slide: Any
    """of the wheel that has a slip below -0.8 above 15 km/h for longest in all [s]"""
    ended: Any
    """whether the stop speed was reached"""

    @classmethod
    def of(cls, found: SplitStop) -> "Turned":
        """Of stops (sets,); traceable."""
        stop = found.stop
        slide = jnp.stack(stop.slide_time).max(axis=0)
        ended = stop.outcome == Outcome.STOPPED
        return cls(found.distance, found.yaw_rate, found.side_slip, stop.longest_lock[0], slide, ended)

    @property
    def spun(self):
        """Whether the car lost its way: its distance is no braking distance."""
        return self.side_slip > SPUN

    @property
    def sound(self):
        """Whether the car stops without spinning, and no wheel locks or slides for longer than the screening after the
        regulation allows."""
        return self.ended & ~self.spun & (self.lock <= LONGEST_LOCK) & (self.slide <= LONGEST_SLIDE)

    def taken(self, index: Any) -> "Turned":
        """Of some of the sets."""
        return Turned(*(np.asarray(values)[index] for values in self))

    def joined(self, others: "Turned") -> "Turned":
        """With others behind."""
        return Turned(*(np.concatenate(pair) for pair in zip(self, others)))

    def worse(self, others: "Turned") -> "Turned":
        """The worse of both, quantity by quantity."""
        return Turned(*map(np.maximum, self, others))._replace(ended=self.ended & others.ended)


@dataclasses.dataclass(frozen=True)
class Archive:
    """Sets that were judged."""

    points: np.ndarray
    """(sets, parameters)"""
    located: Turned
    sampled: Turned
    """in a control unit; of sets that are not sound located, and so out already, as located"""

    @property
    def worse(self) -> Turned:
        """At the worse of both semantics."""
        return self.located.worse(self.sampled)

    def joined(self, more: "Archive") -> "Archive":
        """With more sets behind."""
        points = np.concatenate([self.points, more.points])
        return Archive(points, self.located.joined(more.located), self.sampled.joined(more.sampled))

    def front(self) -> np.ndarray:
        """Indices of the sets on the front, from the most yaw rate to the least; none if no set is sound."""
        worse = self.worse
        (sound,) = np.nonzero(worse.sound)
        by_yaw_rate = sound[np.lexsort((worse.distance[sound], worse.yaw_rate[sound]))]
        shortest = np.minimum.accumulate(worse.distance[by_yaw_rate])
        return by_yaw_rate[np.diff(shortest, prepend=np.inf) < 0][::-1]

    def limits(self, count: int, beyond: float = 1.0) -> np.ndarray:
        """Limits of the yaw rate [rad/s] in equal ratios, from that of the shortest sound stop down to the least that a
        sound set reaches; empty if no set is sound.

        Args:
            beyond: factor by which the ends are moved outwards.
        """
        front = self.front()
        if not front.size:
            return np.empty(0)
        most, least = self.worse.yaw_rate[front[[0, -1]]]
        # Rounding may not put one below the least, which no set would keep.
        return np.maximum(np.geomspace(most * beyond, least / beyond, count), least / beyond)

    def shortest(self, limit: float) -> int:
        """Index of the shortest sound stop that keeps a limit of the yaw rate [rad/s].

        Raises:
            ValueError: if no sound set keeps it.
        """
        front = self.front()
        keeping = front[self.worse.yaw_rate[front] <= limit]
        if not keeping.size:
            raise ValueError(f"no sound set keeps {limit:g} rad/s")
        return int(keeping[0])
