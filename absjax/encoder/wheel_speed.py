"""From edges to wheel speed and acceleration: time-stamping, then compensation of either signal.

One sample at a time (`absorb`), as in a control unit, or over a log (`estimate`); both are the same steps.
"""

from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from absjax.contracts import require_contract
from absjax.encoder.edges import Edges
from absjax.encoder.time_stamping import Measured, Stamps, TimeStamping
from absjax.lanes import lane_axes, lane_count, mapped
from absjax.parameters import concrete, model, part


class Compensation(Protocol):
    """What takes the encoder's errors off one of the signals: a class made by `absjax.parameters.model`.

    Scalars per lane.
    """

    @property
    def signal(self) -> str:
        """speed or acceleration"""
        ...

    @property
    def harmonics(self) -> int:
        """How many harmonics of the wheel's frequency it tells apart."""
        ...

    def initial_state(self, dtype: Any) -> Any:
        """State before any sample."""
        ...

    def clean(self, state: Any, measured: Measured, period: Any) -> tuple[Any, jax.Array]:
        """State after a sample, and the signal without the errors."""
        ...


class ChainState(NamedTuple):
    """State of the chain."""

    stamps: Stamps
    speed: Any
    acceleration: Any


class WheelSpeed(NamedTuple):
    """What the chain says at a sample; arrays (samples,) or (lanes, samples) over a log."""

    speed: jax.Array
    """estimate of w [rad/s]"""
    acceleration: jax.Array
    """estimate of w' [rad/s^2]"""
    measured: Measured
    """what the time-stamping algorithm makes of the edges, not compensated"""


@model
class WheelSpeedChain:
    """Time-stamping, and the compensation of each signal; None leaves a signal as it is."""

    stamping: TimeStamping = part("the time-stamping algorithm")
    speed: Compensation | None = part("of the speed", default=None)
    acceleration: Compensation | None = part("of the acceleration", default=None)

    def __post_init__(self):
        for name in ("speed", "acceleration"):
            compensation = getattr(self, name)
            if compensation is None:
                continue
            require_contract(compensation, Compensation)
            if compensation.signal != name:
                raise ValueError(f"WheelSpeedChain.{name} compensates the {compensation.signal}")
            if 2 * compensation.harmonics >= self.stamping.teeth:
                raise ValueError(
                    f"WheelSpeedChain.{name} has {compensation.harmonics} harmonics; {self.stamping.teeth} teeth tell "
                    f"{(self.stamping.teeth - 1) // 2} apart"
                )

    def initial_state(self, times, dtype) -> ChainState:
        """State before any edge; `times` is the dtype of the edges' ages, `dtype` that of all else."""
        speed, acceleration = (None if c is None else c.initial_state(dtype) for c in (self.speed, self.acceleration))
        return ChainState(self.stamping.initial_state(times, dtype), speed, acceleration)

    def absorb(self, state: ChainState, edges: Edges, period, tick=1.0) -> tuple[ChainState, WheelSpeed]:
        """The state at the next sample, and what is known then.

        Args:
            edges: since the sample before.
            period: from one sample to the next, in the unit of the ages.
            tick: that unit [s]; 1 for ages in s.
        """
        stamps = self.stamping.absorb(state.stamps, edges, period, tick)
        measured = self.stamping.measure(stamps, tick)
        seconds = tick * jnp.asarray(period, measured.rotation.speed.dtype)
        kept, values = [], []
        for compensation, before in ((self.speed, state.speed), (self.acceleration, state.acceleration)):
            if compensation is None:
                kept.append(None)
                values.append(None)
            else:
                after, value = compensation.clean(before, measured, seconds)
                kept.append(after)
                values.append(value)
        speed = measured.rotation.speed if values[0] is None else values[0]
        acceleration = measured.rotation.acceleration if values[1] is None else values[1]
        return ChainState(stamps, *kept), WheelSpeed(speed, acceleration, measured)


def estimate(
    chain: WheelSpeedChain, edges: Edges, period, tick: Any = 1.0, *, start: ChainState | None = None
) -> tuple[WheelSpeed, ChainState]:
    """Run the chain over a log, or over many.

    Lanes: wherever a leaf of the chain or the edges have one leading axis more than a single log needs, it counts
    lanes; other leaves are shared. Differentiable in forward and reverse mode.

    Args:
        chain: the chain.
        edges: ages (samples, capacity), or (lanes, samples, capacity), with their counts.
        period: from one sample to the next, in the unit of the ages.
        tick: that unit [s]; 1 for ages in s. Results are of its dtype if that is an array's, else of the ages'
            (float32 for integers unless double precision is on).
        start: state before the first sample, as it came back; None: nothing seen yet.

    Returns:
        What is known at every sample, and the state after the last.

    Raises:
        ValueError: if shapes do not fit, ages are integers and the period is not, or a cut-off is too high for it.
    """
    ages, count = jnp.asarray(edges.ages), jnp.asarray(edges.count)
    if ages.ndim not in (2, 3) or count.shape != ages.shape[:-1]:
        raise ValueError(
            f"edges: ages of shape {ages.shape} and counts of shape {count.shape}; "
            "(samples, capacity) and (samples,) are needed, or the same after an axis of lanes"
        )
    whole = jnp.issubdtype(ages.dtype, jnp.integer)
    if whole and int(period) != period:
        raise ValueError(f"period = {period} must be a whole number of ticks, as the ages are")
    for part_ in (chain.speed, chain.acceleration):
        cutoff = getattr(part_, "cutoff", None)
        if cutoff is not None and all(map(concrete, (cutoff, period, tick))):
            if np.max(cutoff) * float(period) * float(tick) >= 0.5:
                raise ValueError(f"cutoff = {np.max(cutoff):g} Hz is not below half the sampling frequency")
    dtype = tick.dtype if hasattr(tick, "dtype") else jnp.result_type(float) if whole else ages.dtype
    chain = jax.tree.map(lambda x: jnp.asarray(x, dtype), chain)
    return _estimate(chain, Edges(ages, count), jnp.asarray(period, ages.dtype), jnp.asarray(tick, dtype), start)


@jax.jit
def _estimate(chain, edges: Edges, period, tick, start):
    def one(chain, edges, start):
        first = chain.initial_state(edges.ages.dtype, tick.dtype) if start is None else start
        step = jax.checkpoint(lambda state, now: chain.absorb(state, now, period, tick), prevent_cse=False)

        def without_weights(state, now):
            state, found = step(state, now)
            return state, found._replace(measured=found.measured._replace(weights=None))

        final, path = lax.scan(without_weights, first, edges)
        return path, final

    many = edges.ages.ndim == 3
    if lane_count(chain, "chain", edges.ages.shape[0] if many else None) is None:
        return one(chain, edges, start)
    over = mapped(lane_axes(chain))
    return jax.vmap(one, in_axes=(over, 0 if many else None, None if start is None else 0))(chain, edges, start)
