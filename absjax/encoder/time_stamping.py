"""The time-stamping algorithm: a polynomial through the last n edges gives angle, speed and acceleration.

With the stamps shifted and scaled to the unit interval, s = (t - t_oldest) / (t_newest - t_oldest), the angles of the
n edges are fitted by a polynomial of order m in s; its derivatives at the time of the sample are w and w'.

Only the times between edges and the age of the newest are kept: they do not grow, and may be integer clock ticks.
Source: Aguado-Rojas 2019, section 5.2 and appendix C.
"""

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax._numerics import safe_divide, tree_where
from absjax.encoder.edges import Edges
from absjax.encoder.polynomial import fit, unit_interval
from absjax.encoder.rotation import Rotation
from absjax.parameters import model, parameter

LATE = 1.2
"""An edge is late when it has not come after so many times of the last one."""
OVERDUE = 2.2
"""From so many times on it is not one that was missed: the wheel is slower."""
FARTHEST = 2.0
"""Teeth from the newest edge beyond which the polynomial is not believed."""
LONGEST_TICKS = 2**30
"""Longest time that is told apart in integer clock ticks."""
LONGEST_SECONDS = 1e6
"""The same in seconds, for ages that are not integers."""
MOST_MISSED = 3
"""Most edges missed in a row that are recognised."""
LONG = 1.5
"""An interval so many times the one before may have had an edge missed in it."""
ALIKE = 1.5
"""Intervals within this factor are of a wheel that turns as before."""
BOTH_WAYS = 1 / 6
"""Share of the greatest deceleration that a wheel cannot slow down and speed up by, one after the other."""


@model
class Stamps:
    """What the algorithm keeps: the last n edges, newest first. Times in s or clock ticks."""

    intervals: Any = parameter("times between successive edges, shape (n - 1,)", ndim=1)
    teeth: Any = parameter("teeth passed between them, shape (n - 1,)", ndim=1)
    age: Any = parameter("time since the newest edge")
    tooth: Any = parameter("teeth passed since the first edge, modulo those of the encoder")
    edges: Any = parameter("edges seen since the wheel last stood, n at most")


class Weights(NamedTuple):
    """Speed and acceleration as what they are, sums over the angles of the edges; shape (n,), newest first.

    0 where a signal is not that sum, but held to what the wait for the next edge tells.
    """

    angle: jax.Array
    """of the edge, where it should be [rad]"""
    speed: jax.Array
    """d(speed) / d(angle) [1/s]"""
    acceleration: jax.Array
    """d(acceleration) / d(angle) [1/s^2]"""


class Measured(NamedTuple):
    """What the algorithm makes of its stamps at a sample."""

    rotation: Rotation
    """th [rad] in [0, 2 pi), from the first edge seen; w [rad/s] >= 0; w' [rad/s^2]"""
    weights: Any
    """`Weights` of the edges in speed and acceleration; None over a log, where they are not kept"""
    valid: jax.Array
    """n edges have been seen since the wheel last stood"""
    regular: jax.Array
    """and the next is not late, nor was the last: no edge seems to be missing"""


@model
class TimeStamping:
    """The algorithm of order m over the last n edges of an encoder with N teeth."""

    teeth: int = 60
    """N"""
    events: int = 15
    """n"""
    order: int = 2
    """m"""
    window: Any = parameter("n, of which only the newest so many edges are used; None: all", default=None, low=3.0)
    memory: Any = parameter(
        "age beyond which an edge is not used, s, but for the newest m + 2; None: n edges at every speed",
        default=None,
        low=0.0,
        open_low=True,
    )
    greatest_deceleration: Any = parameter(
        "of the wheel, rad/s^2; an edge that comes so late that it would have been exceeded was preceded by one that "
        "was missed. None: no edge is ever missed",
        default=3000.0,
        low=0.0,
        open_low=True,
    )
    standstill: Any = parameter("longest time between edges of a turning wheel, s", default=0.5, low=0.0, open_low=True)

    def __post_init__(self):
        for name, least in (("teeth", 3), ("order", 2), ("events", self.order + 1)):
            value = getattr(self, name)
            if value != int(value) or value < least:
                raise ValueError(f"TimeStamping.{name} = {value} must be an integer >= {least}")

    @property
    def pitch(self) -> float:
        """2 pi / N [rad]."""
        return 2 * np.pi / self.teeth

    def initial_state(self, times, dtype) -> Stamps:
        """Before any edge.

        Args:
            times: dtype of the ages.
            dtype: of everything else.
        """
        longest = _longest(times)
        zero = jnp.zeros((), dtype)
        intervals = jnp.full(self.events - 1, longest, times)
        return Stamps(intervals, jnp.ones(self.events - 1, dtype), jnp.asarray(longest, times), zero, zero)

    def absorb(self, stamps: Stamps, edges: Edges, period, tick) -> Stamps:
        """The stamps at the next sample, after its edges.

        Args:
            edges: of one sample.
            period: time since the sample before, in the unit of the ages.
            tick: that unit [s].
        """
        longest = _longest(edges.ages.dtype)
        waited = jnp.minimum(stamps.age + period, longest)
        for i in range(edges.ages.shape[-1]):
            interval = jnp.minimum(waited - edges.ages[i], longest)
            stamps = tree_where(i < edges.count, self._push(stamps, interval, tick), stamps)
            waited = jnp.where(i < edges.count, edges.ages[i], waited)
        return dataclasses.replace(stamps, age=waited)

    def _push(self, stamps: Stamps, interval, tick) -> Stamps:
        dtype = stamps.edges.dtype
        waited = interval.astype(dtype) * tick
        stamps = self._put_right(stamps, waited, tick)
        teeth = self._teeth_passed(stamps, waited, tick)
        stood = (waited > self.standstill) | (stamps.edges == 0)
        return Stamps(
            jnp.concatenate([interval[None], stamps.intervals[:-1]]),
            jnp.concatenate([teeth[None], stamps.teeth[:-1]]),
            stamps.age,
            jnp.where(stamps.edges == 0, 0.0, (stamps.tooth + teeth) % self.teeth),
            jnp.where(stood, 1.0, jnp.minimum(stamps.edges + 1, self.events)),
        )

    def _teeth_passed(self, stamps: Stamps, waited, tick):
        """1, or more where edges have been missed: their times would need a deceleration the wheel cannot have."""
        one = jnp.ones_like(waited)
        if self.greatest_deceleration is None:
            return one
        usual = _tooth_time(stamps, 0) * tick
        passed = jnp.round(safe_divide(waited, usual, usual > 0))
        missed = (stamps.edges > 1) & (passed > 1) & (passed <= MOST_MISSED + 1)
        return jnp.where(missed & (self._deceleration(usual, waited) > self.greatest_deceleration), passed, one)

    def _put_right(self, stamps: Stamps, waited, tick) -> Stamps:
        """The stamps once the next edge is here: a long interval between two usual ones had edges missed in it.

        A slow wheel might have stopped so fast; but not have started again as fast.
        """
        if self.greatest_deceleration is None:
            return stamps
        last, usual = (_tooth_time(stamps, i) * tick for i in (0, 1))
        passed = jnp.round(safe_divide(2 * last, usual + waited, usual + waited > 0))
        alike = jnp.maximum(usual, waited) < ALIKE * jnp.minimum(usual, waited)
        rate = jnp.minimum(self._deceleration(usual, last), self._deceleration(waited, last))
        missed = alike & (stamps.edges > 2) & (stamps.teeth[0] == 1) & (passed > 1) & (passed <= MOST_MISSED + 1)
        more = jnp.where(missed & (rate > BOTH_WAYS * self.greatest_deceleration), passed - 1, 0.0)
        tooth = (stamps.tooth + more) % self.teeth
        return dataclasses.replace(stamps, teeth=stamps.teeth.at[0].add(more), tooth=tooth)

    def _deceleration(self, before, after):
        """From a speed of one tooth in `before` seconds to one in `after`."""
        change = 2 * self.pitch * (after - before)
        return safe_divide(change, before * after * (before + after), (before > 0) & (after > 0))

    def measure(self, stamps: Stamps, tick) -> Measured:
        """Angle, speed and acceleration at the sample; `tick` is the unit of the times [s]."""
        dtype = stamps.edges.dtype
        window = self.events if self.window is None else jnp.clip(self.window, self.order + 1, self.events)
        window = jnp.minimum(window, self._young(stamps, tick))
        used = jnp.minimum(stamps.edges, window)
        counts = jnp.arange(self.events) < used
        old, span, teeth = unit_interval(stamps.intervals, stamps.teeth, counts, dtype)
        enough = (used > self.order) & (span > 0)
        span = jnp.where(enough, span, 1.0)
        age = stamps.age.astype(dtype)
        now = 1 + age / span
        found = fit(old, teeth, counts & enough, now, self.order)
        seconds, waited = span * tick, age * tick
        usual, before = (_tooth_time(stamps, i) * tick for i in (0, 1))
        speed = jnp.where(enough, jnp.maximum(found.slope, 0.0) * self.pitch / seconds, 0.0)
        acceleration = jnp.where(enough, found.curvature * self.pitch / seconds**2, 0.0)
        late = waited > LATE * usual
        fitted = found.slope * self.pitch / seconds, acceleration
        speed, acceleration = self._held(speed, acceleration, waited, usual, late)

        turned = jnp.where(enough, jnp.clip(found.value, -FARTHEST, FARTHEST), 0.0)
        angle = self.pitch * ((stamps.tooth + turned) % self.teeth)
        weights = Weights(
            self.pitch * ((stamps.tooth + teeth) % self.teeth),
            jnp.where(speed == fitted[0], found.by_slope / seconds, 0.0),
            jnp.where(acceleration == fitted[1], found.by_curvature / seconds**2, 0.0),
        )
        valid = enough & (stamps.edges >= window)
        regular = valid & ~late & (usual <= LONG * before)
        return Measured(Rotation(angle, speed, acceleration), weights, valid, regular)

    def _held(self, speed, acceleration, waited, usual, late):
        """Speed and acceleration held to what the wait for the next edge tells, once it is late.

        A wheel that has not shown its next tooth has turned by less than one, w <= (2 pi / N) / waited; unless the
        edge was missed: with a greatest deceleration the speed does not fall faster than that either.
        """
        bound = safe_divide(self.pitch, waited, waited > 0, jnp.inf)
        greatest = self.greatest_deceleration
        if greatest is not None:
            bound = jnp.maximum(bound, safe_divide(self.pitch, usual, usual > 0) - greatest * waited)
        speed = jnp.where(late, jnp.minimum(speed, bound), speed)
        falling = safe_divide(speed, waited, waited > 0)
        falling = falling if greatest is None else jnp.minimum(falling, greatest)
        return speed, jnp.where(waited > OVERDUE * usual, -falling, acceleration)

    def _young(self, stamps: Stamps, tick):
        """Number of the newest edges that are young enough."""
        if self.memory is None:
            return self.events
        steps = jnp.concatenate([stamps.age[None], stamps.intervals]).astype(stamps.edges.dtype)
        young = jnp.sum(jnp.cumsum(steps) * tick <= self.memory).astype(stamps.edges.dtype)
        return jnp.maximum(young, self.order + 2)


def _tooth_time(stamps: Stamps, i: int):
    """Time a tooth took in the interval `i`, newest first."""
    return stamps.intervals[i].astype(stamps.edges.dtype) / stamps.teeth[i]


def _longest(dtype):
    return LONGEST_TICKS if jnp.issubdtype(dtype, jnp.integer) else LONGEST_SECONDS
