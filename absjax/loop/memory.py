"""What a manoeuvre remembers of its course: the pedal, the first switching, the cycles, the locks."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import safe_divide

LOCK_SPEEDS = (15 / 3.6, 2.5 / 3.6)
"""Vehicle speeds above which lock is counted, m/s: regulation tolerates it below the first (UN R13-H, annex 6), the
source below the second (Aguado-Rojas 2019, section 2.3)."""


class Locks(NamedTuple):
    """When the wheel was locked; scalars per lane, those with two entries by `LOCK_SPEEDS`."""

    count: jax.Array
    """how often"""
    since: jax.Array
    """when the last one began, s"""
    speed: jax.Array
    """vehicle speed then, m/s"""
    time: tuple[jax.Array, jax.Array]
    """spent locked above each speed, s"""
    longest: tuple[jax.Array, jax.Array]
    """longest of them, s"""

    @classmethod
    def blank(cls, speed) -> "Locks":
        """Of a manoeuvre that begins at `speed` [m/s]."""
        zero = 0.0 * speed
        return cls(zero, zero, zero, (zero, zero), (zero, zero))

    def begun(self, time, speed) -> "Locks":
        """With a lock that begins now."""
        return self._replace(count=self.count + 1, since=time + 0.0 * speed, speed=speed)

    def ended(self, time, speed) -> "Locks":
        """With the last one over now. A locked wheel slides: what of it was above a speed follows from its two ends."""
        lasted, lost = time - self.since, self.speed - speed
        above = [
            jnp.where(
                speed >= limit, lasted, lasted * safe_divide(jnp.maximum(self.speed - limit, 0.0), lost, lost > 0)
            )
            for limit in LOCK_SPEEDS
        ]
        return self._replace(
            time=tuple(total + more for total, more in zip(self.time, above)),
            longest=tuple(jnp.maximum(longest, more) for longest, more in zip(self.longest, above)),
        )


class Cycles(NamedTuple):
    """What is remembered of a controller's switchings; scalars per lane."""

    onset_time: jax.Array
    """when the controller first switched, s"""
    onset_speed: jax.Array
    """vehicle speed then, m/s"""
    onset_position: jax.Array
    """distance travelled until then, m"""
    cycles: jax.Array
    """times the controller has entered its cycle phase"""
    cycle_time: jax.Array
    """when it last did, s"""
    longest_cycle: jax.Array
    """longest time between two such entries, s"""

    @classmethod
    def blank(cls, speed) -> "Cycles":
        """Of a manoeuvre that begins at `speed` [m/s]."""
        zero = 0.0 * speed
        return cls(zero, speed, zero, zero, zero, zero)

    def switched(self, time, speed, position, cycles) -> "Cycles":
        """After a switching of the controller; `cycles`: whether a cycle begins with it."""
        first = self.onset_time == 0
        longest = jnp.maximum(self.longest_cycle, time - self.cycle_time)
        return Cycles(
            onset_time=jnp.where(first, time, self.onset_time),
            onset_speed=jnp.where(first, speed, self.onset_speed),
            onset_position=jnp.where(first, position, self.onset_position),
            cycles=self.cycles + cycles,
            cycle_time=jnp.where(cycles, time, self.cycle_time),
            longest_cycle=jnp.where(cycles & ~first, longest, self.longest_cycle),
        )

    def longest_until(self, time, pedal_time):
        """Longest cycle [s], one that lasts counted from its beginning, or from the first touch of the pedal."""
        return jnp.maximum(self.longest_cycle, time - jnp.maximum(self.cycle_time, pedal_time))


class Memory(NamedTuple):
    """What a manoeuvre remembers of its course; scalars per lane."""

    pedal_time: jax.Array
    """when the foot first pressed, s"""
    pedal_position: jax.Array
    """distance travelled until then, m"""
    control: Cycles
    locks: Locks

    @classmethod
    def blank(cls, speed) -> "Memory":
        """Of a manoeuvre that begins at `speed` [m/s]."""
        zero = 0.0 * speed
        return cls(zero, zero, Cycles.blank(speed), Locks.blank(speed))

    def pressed(self, first, time, position) -> "Memory":
        """After a move of the foot, where it is the `first`: the pedal is touched."""
        return _pressed(self, first, time, position)


class VehicleMemory(NamedTuple):
    """The same of a vehicle."""

    pedal_time: jax.Array
    pedal_position: jax.Array
    control: tuple[Cycles, ...]
    """of each channel"""
    locks: tuple[Locks, ...]
    """of each wheel"""

    @classmethod
    def blank(cls, speed, channels: int, wheels: int) -> "VehicleMemory":
        """Of a manoeuvre that begins at `speed` [m/s]."""
        zero = 0.0 * speed
        return cls(zero, zero, (Cycles.blank(speed),) * channels, (Locks.blank(speed),) * wheels)

    def pressed(self, first, time, position) -> "VehicleMemory":
        """After a move of the foot, where it is the `first`: the pedal is touched."""
        return _pressed(self, first, time, position)


def _pressed(memory, first, time, position):
    return memory._replace(
        pedal_time=jnp.where(first, time, memory.pedal_time),
        pedal_position=jnp.where(first, position, memory.pedal_position),
    )


class Course(NamedTuple):
    """What is known of a manoeuvre at its end; scalars per lane."""

    speed: jax.Array
    """v [m/s]"""
    position: jax.Array
    """distance travelled [m]"""
    memory: Memory
    """locks that last included"""
    longest_cycle: jax.Array
    """the cycle that lasts included, s; 0 where nothing cycles"""
