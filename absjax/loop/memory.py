"""What a manoeuvre remembers of its course: the pedal, the first switching, the cycles, how wheels slid."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import safe_divide

LOCK_SPEEDS = (15 / 3.6, 2.5 / 3.6)
"""Vehicle speeds above which lock is counted, m/s: regulation tolerates it below the first (UN R13-H, annex 6), the
source below the second (Aguado-Rojas 2019, section 2.3)."""
DEEP_SLIP = -0.8
"""Slip below which a wheel slides: at a side-slip of 4 deg it has less than a sixth of its lateral force left there. A
wheel that is let go of for a moment whenever it stands has no long lock, and slides all the same."""
NONE = -1.0
"""When none began."""


class Locks(NamedTuple):
    """When a wheel was locked; scalars per lane, those with two entries by `LOCK_SPEEDS`."""

    count: jax.Array
    """how often"""
    since: jax.Array
    """when the one that lasts began, s, or `NONE`"""
    speed: jax.Array
    """vehicle speed when the last one began, m/s"""
    time: tuple[jax.Array, jax.Array]
    """spent locked above each speed, s"""
    longest: tuple[jax.Array, jax.Array]
    """longest of them, s"""

    @classmethod
    def blank(cls, speed) -> "Locks":
        """Of a manoeuvre that begins at `speed` [m/s]."""
        zero = 0.0 * speed
        return cls(zero, zero + NONE, zero, (zero, zero), (zero, zero))

    def after(self, begins, ends, time, speed) -> "Locks":
        """Where one `begins` now, or the one that lasts `ends`."""
        above = [jnp.where(ends, _above(limit, self, time, speed), 0.0) for limit in LOCK_SPEEDS]
        return self._replace(
            count=self.count + begins,
            since=jnp.where(begins, time, jnp.where(ends, NONE, self.since)),
            speed=jnp.where(begins, speed, self.speed),
            time=tuple(total + more for total, more in zip(self.time, above)),
            longest=tuple(jnp.maximum(longest, more) for longest, more in zip(self.longest, above)),
        )


class Slides(NamedTuple):
    """When a wheel had a slip below `DEEP_SLIP`, locks included; scalars per lane."""

    since: jax.Array
    """when the one that lasts began, s, or `NONE`"""
    speed: jax.Array
    """vehicle speed when the last one began, m/s"""
    time: jax.Array
    """in all above the first of `LOCK_SPEEDS`, s"""

    @classmethod
    def blank(cls, speed) -> "Slides":
        """Of a manoeuvre that begins at `speed` [m/s]."""
        zero = 0.0 * speed
        return cls(zero + NONE, zero, zero)

    def after(self, begins, ends, time, speed) -> "Slides":
        """Where one `begins` now, or the one that lasts `ends`."""
        return Slides(
            since=jnp.where(begins, time, jnp.where(ends, NONE, self.since)),
            speed=jnp.where(begins, speed, self.speed),
            time=self.time + jnp.where(ends, _above(LOCK_SPEEDS[0], self, time, speed), 0.0),
        )


def _above(limit: float, began: Locks | Slides, time, speed):
    """How much of the one that lasts was above a vehicle speed [s]. While a wheel slides the vehicle loses its speed
    all but evenly: that follows from the two ends."""
    lasted, lost = time - began.since, began.speed - speed
    share = safe_divide(jnp.maximum(began.speed - limit, 0.0), lost, lost > 0)
    return jnp.where(speed >= limit, lasted, lasted * share)


class Sliding(NamedTuple):
    """How a wheel slid."""

    slides: Slides
    locks: Locks

    @classmethod
    def blank(cls, speed) -> "Sliding":
        """Of a manoeuvre that begins at `speed` [m/s]."""
        return cls(Slides.blank(speed), Locks.blank(speed))

    def until(self, time, speed) -> "Sliding":
        """With what lasts ended now."""
        slides, locks = self
        return Sliding(
            slides.after(False, slides.since != NONE, time, speed), locks.after(False, locks.since != NONE, time, speed)
        )


class Cycles(NamedTuple):
    """What is remembered of a controller's switchings; scalars per lane."""

    onset_time: jax.Array
    """when the controller first switched, s"""
    onset_speed: jax.Array
    """vehicle speed then, m/s"""
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
        return cls(zero, speed, zero, zero, zero)

    def switched(self, time, speed, cycles) -> "Cycles":
        """After a switching of the controller; `cycles`: whether a cycle begins with it."""
        first = self.onset_time == 0
        longest = jnp.maximum(self.longest_cycle, time - self.cycle_time)
        return Cycles(
            onset_time=jnp.where(first, time, self.onset_time),
            onset_speed=jnp.where(first, speed, self.onset_speed),
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
    wheel: Sliding

    @classmethod
    def blank(cls, speed) -> "Memory":
        """Of a manoeuvre that begins at `speed` [m/s]."""
        zero = 0.0 * speed
        return cls(zero, zero, Cycles.blank(speed), Sliding.blank(speed))

    def pressed(self, first, time, position) -> "Memory":
        """After a move of the foot, where it is the `first`: the pedal is touched."""
        return _pressed(self, first, time, position)


class VehicleMemory(NamedTuple):
    """The same of a vehicle."""

    pedal_time: jax.Array
    pedal_position: jax.Array
    control: tuple[Cycles, ...]
    """of each channel"""
    wheels: tuple[Sliding, ...]

    @classmethod
    def blank(cls, speed, channels: int, wheels: int) -> "VehicleMemory":
        """Of a manoeuvre that begins at `speed` [m/s]."""
        zero = 0.0 * speed
        return cls(zero, zero, (Cycles.blank(speed),) * channels, (Sliding.blank(speed),) * wheels)

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
    """slides and locks that last included"""
    longest_cycle: jax.Array
    """the cycle that lasts included, s; 0 where nothing cycles"""
    slide_time: tuple[jax.Array, ...]
    """of each wheel, above 15 km/h, what lasts included, s"""
