"""Edges of an encoder: the instants at which teeth pass, sample by sample, and their packing from a log.

A control unit that samples every T seconds is told at each sample of the edges since the one before, by their age:
the time from the edge to the sample. Ages never grow with the time of operation, so that nothing is lost in single
precision, or in clock ticks of 32 bits.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from absjax._numerics import safe_divide
from absjax.encoder.encoder import Encoder
from absjax.encoder.rotation import Rotation, hermite
from absjax.lanes import lane_axes, mapped
from absjax.parameters import concrete

TOLERANCE = 1e-14
"""Angle to which an edge is located, as a share of what the wheel turns in a sample; or rounding, if larger."""
MOST_ITERATIONS = 60
BACKWARDS = 1e-9
"""What a wheel may turn backwards between two samples by rounding, rad; and its speed, rad/s."""


class Edges(NamedTuple):
    """Edges between two samples, oldest first; or of a log, arrays with axes (samples,) or (lanes, samples) before."""

    ages: Any
    """time from the edge to the sample, s or clock ticks, shape (capacity,); those past the count mean nothing"""
    count: Any
    """number of edges, int32"""


def capacity_for(teeth: float) -> int:
    """Most edges between two samples of a wheel that turns by so many teeth at most, errors of the teeth included."""
    return int(np.ceil(teeth + 1e-9)) + 1


class Place(NamedTuple):
    """Where an encoder is."""

    rotation: Rotation
    """of the wheel, its angle counted from the revolution in which `tooth` passes"""
    tooth: jax.Array
    """index of the tooth that passes next, int32"""
    passing: jax.Array
    """number of that passing since the start, int32"""

    @classmethod
    def of(cls, encoder: Encoder, rotation: Rotation) -> "Place":
        """The place of an encoder on a wheel; scalars."""
        rotation = rotation._replace(angle=rotation.angle % (2 * np.pi))
        passed = encoder.edge_angle(jnp.arange(encoder.teeth)) <= rotation.angle
        return cls(rotation, passed.sum(dtype=jnp.int32), jnp.zeros((), jnp.int32))


def passing_edges(encoder: Encoder, place: Place, after: Rotation, period, capacity: int) -> tuple[Edges, Place]:
    """Edges that pass until the next sample, and the place then.

    Args:
        place: at this sample.
        after: the motion at the next sample, its angle counted as that of `place`.
        period: time between the samples [s].
        capacity: most edges that can pass. Where more do, the later ones are told of in the sample after.

    Returns:
        Edges with ages in s, located to rounding and differentiable. Scalars per lane.
    """
    ahead = jnp.arange(capacity, dtype=jnp.int32)
    tooth, number = place.tooth + ahead, place.passing + ahead
    before = place.rotation
    turns = (tooth // encoder.teeth).astype(before.angle.dtype)
    angle = encoder.edge_angle(tooth % encoder.teeth, number) + 2 * np.pi * turns
    passes = jnp.cumprod(angle <= after.angle).astype(bool)
    share = _root(hermite(before, after, period), angle - before.angle, passes)
    ages = jnp.where(passes, period * (1 - share), 0.0)
    if encoder.clock is not None:
        ages = encoder.clock * jnp.ceil(ages / encoder.clock)
    passed = told = passes.sum(dtype=jnp.int32)
    if encoder.missing is not None:
        seen = passes & encoder.seen(number)
        ages, told = ages[jnp.argsort(~seen, stable=True)], seen.sum(dtype=jnp.int32)
    following = place.tooth + passed
    turned = following // encoder.teeth
    after = after._replace(angle=after.angle - 2 * np.pi * turned.astype(after.angle.dtype))
    return Edges(ages, told), Place(after, following - encoder.teeth * turned, place.passing + passed)


def _turned(terms, s):
    """The polynomial without a constant term, and its slope, at s."""
    value, slope = jnp.zeros_like(s), jnp.zeros_like(s)
    for term in reversed(terms):
        value, slope = term + s * value, value + s * slope
    return s * value, value + s * slope


def _root(terms, target, wanted):
    """Share s in [0, 1] at which the polynomial reaches the target; the derivative is that of the implicit function."""
    s = _bracketed(*lax.stop_gradient((terms, target, wanted)))
    value, slope = _turned(terms, s)
    slope = lax.stop_gradient(slope)
    return s - safe_divide(value - target, slope, slope > 0)


def _bracketed(terms, target, wanted):
    """Newton's method, by bisection where it would leave the bracket."""
    whole = sum(terms)
    enough = jnp.abs(whole) * max(TOLERANCE, 2 * float(jnp.finfo(target.dtype).eps))

    def going_on(carry):
        i, s, _, _ = carry
        return (i < MOST_ITERATIONS) & jnp.any(wanted & (jnp.abs(_turned(terms, s)[0] - target) > enough))

    def improve(carry):
        i, s, low, high = carry
        value, slope = _turned(terms, s)
        excess = value - target
        low, high = jnp.where(excess < 0, s, low), jnp.where(excess < 0, high, s)
        newton = s - safe_divide(excess, slope, slope > 0)
        return i + 1, jnp.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high)), low, high

    start = jnp.clip(safe_divide(target, whole, whole > 0), 0.0, 1.0)
    return lax.while_loop(going_on, improve, (jnp.int32(0), start, jnp.zeros_like(start), jnp.ones_like(start)))[1]


@partial(jax.jit, static_argnames="capacity")
def _edges(encoder: Encoder, rotation: Rotation, period, capacity: int) -> Edges:
    axes = mapped(lane_axes(encoder))
    over = 0 if rotation.angle.ndim == 2 else None
    if over is None and not jax.tree.leaves(axes):
        return _edges_of_one(encoder, rotation, period, capacity)
    return jax.vmap(partial(_edges_of_one, period=period, capacity=capacity), in_axes=(axes, over))(encoder, rotation)


def _edges_of_one(encoder: Encoder, rotation: Rotation, period, capacity: int) -> Edges:
    def body(carry, now):
        place, angle = carry
        after = now._replace(angle=place.rotation.angle + (now.angle - angle))
        edges, place = passing_edges(encoder, place, after, period, capacity)
        return (place, now.angle), edges

    first = jax.tree.map(lambda x: x[0], rotation)
    none = Edges(jnp.zeros(capacity, rotation.angle.dtype), jnp.int32(0))
    rest = jax.tree.map(lambda x: x[1:], rotation)
    _, edges = lax.scan(body, (Place.of(encoder, first), first.angle), rest)
    return jax.tree.map(lambda one, more: jnp.concatenate([one[None], more]), none, edges)


def edges_of(encoder: Encoder, rotation: Rotation, period, capacity: int | None = None) -> Edges:
    """Edges of an encoder on a wheel that turns as told, sample by sample; or of many.

    Args:
        encoder: the encoder; leaves with a leading axis count lanes.
        rotation: arrays (samples,) or (lanes, samples), every `period` s; the first sample has no edges.
        period: time between samples [s].
        capacity: most edges between two samples; what the rotation needs when None, then it must be known.

    Returns:
        Edges, ages (samples, capacity) in s, or the same after an axis of lanes. Differentiable with respect to encoder
        and rotation.

    Raises:
        ValueError: if the wheel turns backwards, or faster than the capacity allows for.
    """
    rotation = jax.tree.map(jnp.asarray, rotation)
    if rotation.angle.shape[-1] < 2:
        raise ValueError(f"rotation has {rotation.angle.shape[-1]} samples, two are needed")
    if all(map(concrete, rotation)):
        if not all(np.isfinite(x).all() for x in rotation):
            raise ValueError("rotation is not finite everywhere")
        turned = np.diff(np.asarray(rotation.angle), axis=-1)
        if min(turned.min(), np.min(rotation.speed)) < -BACKWARDS:
            raise ValueError("the wheel turns backwards; an encoder with one channel cannot tell")
        needed = capacity_for(turned.max() / encoder.pitch)
        capacity = needed if capacity is None else capacity
        if needed > capacity:
            raise ValueError(f"capacity = {capacity} edges between two samples, {needed} are needed")
    if capacity is None:
        raise ValueError("capacity must be given where the rotation is not known")
    dtype = rotation.angle.dtype
    encoder = jax.tree.map(lambda x: jnp.asarray(x, dtype), encoder)
    return _edges(encoder, rotation, jnp.asarray(period, dtype), capacity)


def in_ticks(edges: Edges, clock: float) -> Edges:
    """The same edges, ages in whole ticks of a clock [s], int32, rounded up as a counter does."""
    rounding = 1 - 4 * jnp.finfo(edges.ages.dtype).eps
    return edges._replace(ages=jnp.ceil(edges.ages / clock * rounding).astype(jnp.int32))


def pack(stamps: np.ndarray, period: int, capacity: int | None = None) -> tuple[Edges, np.ndarray]:
    """Pack the edge times of a log sample by sample; the first sample is at the first edge.

    Args:
        stamps: instants of the edges, clock ticks, integers that increase.
        period: ticks from one sample to the next.
        capacity: most edges between two samples; what the log needs when None.

    Returns:
        Edges, ages (samples, capacity) in ticks, int32; and the instants of the samples, ticks.

    Raises:
        ValueError: if the stamps are not integers that increase, or more edges fall between two samples than the
            capacity allows for.
    """
    stamps = np.asarray(stamps)
    if stamps.ndim != 1 or not np.issubdtype(stamps.dtype, np.integer) or stamps.size == 0:
        raise ValueError(f"stamps must be a list of integers, not {stamps.dtype} of shape {stamps.shape}")
    if period < 1 or period != int(period):
        raise ValueError(f"period = {period} ticks must be an integer >= 1")
    stamps, period = stamps.astype(np.int64), int(period)
    if (np.diff(stamps) <= 0).any():
        at = int(np.argmax(np.diff(stamps) <= 0)) + 1
        raise ValueError(f"stamp {at} ({stamps[at]}) does not come after the one before it ({stamps[at - 1]})")
    since = stamps - stamps[0]
    sample = -(-since // period)
    count = np.bincount(sample).astype(np.int32)
    needed = int(count.max())
    capacity = needed if capacity is None else capacity
    if needed > capacity:
        raise ValueError(f"capacity = {capacity} edges between two samples, sample {count.argmax()} has {needed}")
    ages = np.zeros((count.size, capacity), np.int32)
    ages[sample, np.arange(since.size) - np.searchsorted(sample, sample)] = sample * period - since
    return Edges(ages, count), stamps[0] + period * np.arange(count.size)
