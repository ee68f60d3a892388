"""A chain that follows a reference through a delay of its input, under the predictor: located, and sampled.

`DelayedTracking` is the delayed differential equation itself: signals of h ago are read off their past at the stages of
the Runge-Kutta step, and the instant at which the first command arrives, with which the past begins a new piece, is an
event. `SampledTracking` is a control unit: at every tick it advances the integrals by the trapezoidal rule, and holds
its command until the next; delays are whole ticks, rows of a ring.
Source: Hoang 2014 (thesis), eq. 6.9 and 6.20, sections 6.2 to 6.4.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.delay.chain import Chain, field
from absjax.delay.history import History
from absjax.delay.located import ReadsItsPast
from absjax.delay.predictor import Law, Predictor, row_of, signals_of
from absjax.delay.reference import SquareWave
from absjax.delay.ring import Ring
from absjax.hybrid.system import Smooth
from absjax.lanes import of_each_lane
from absjax.parameters import model, parameter, part

EDGE = 0.5
"""Share of a grid step after which the level of the reference is looked up, so that an edge belongs to what follows."""


class TrackingState(NamedTuple):
    """State of the located system; scalars per lane but for the past."""

    x: tuple[Any, ...]
    integrals: tuple[Any, ...]
    """S, I, T of i = 1 to n, one after the other"""
    reference: tuple[Any, ...]
    """x_1* and n derivatives"""
    level: Any
    """of the square wave"""
    past: History
    """of u, and of what the predictor reads again"""
    piece: Any
    """of the past that is read; 1 once a command has arrived"""


def _width(order: int) -> int:
    return 1 + 3 * order * (order + 1) // 2


def _row(law: Law):
    return jnp.concatenate([jnp.reshape(law.u, 1), row_of(law.now)])


def _law(system, x, reference, row, integrals, defined) -> Law:
    known = system.chain if system.known is None else system.known
    return _law_of(system.predictor, known, x, reference, row, integrals, defined)


@jax.jit
def _law_of(predictor: Predictor, known: Chain, x, reference, row, integrals, defined) -> Law:
    n = known.order
    stacked = jnp.stack(jnp.broadcast_arrays(*integrals)).reshape(3, n)
    past = signals_of(row[1:], n)
    return predictor.law(known, jnp.stack(x), list(reference), past, stacked, defined)


def _begin(system, x):
    n, zero = system.chain.order, 0.0 * jnp.asarray(x[0])
    level = system.reference.level(zero) + zero
    return (zero,) * (3 * n), (zero,) * (n + 1), level, zero


def _require(system) -> None:
    n = system.chain.order
    for name in ("alpha", "beta"):
        gains = np.shape(getattr(system.predictor, name))
        if not gains or gains[-1] != n:
            raise ValueError(f"Predictor.{name} has shape {gains}; a chain of order {n} needs ({n},)")


@model
class DelayedTracking(ReadsItsPast):
    """A chain under the predictor and a delay of its input, which has been zero until time 0.

    A lane whose past does not reach back far enough ends as `UNDEFINED`.

    Raises:
        ValueError: at construction, if the gains are not as many as the chain is long.
    """

    chain: Chain = part("the system")
    predictor: Predictor = part("the predictor and its law")
    delay: Any = parameter("h, s", low=0.0, open_low=True)
    reference: SquareWave = part("what x_1 follows", default=SquareWave())
    known: Chain | None = part("the system as the law knows it; None: as it is", default=None)
    nodes: int = 64
    """kept of the past, two a grid step and a switching: those of one delay at least"""

    def __post_init__(self):
        _require(self)

    def initial_state(self, *x: Any) -> TrackingState:
        """State x at time 0; scalars, or arrays (lanes,)."""

        def begun(system, *x):
            integrals, reference, level, zero = _begin(system, x)
            past = History.constant(self.nodes, jnp.zeros(_width(self.chain.order), zero.dtype) + zero)
            state = TrackingState(x, integrals, reference, level, past, zero)
            return state._replace(past=system.past_of(zero, state))

        x = tuple(jnp.asarray(value, jnp.result_type(float, value)) for value in jnp.broadcast_arrays(*x))
        return of_each_lane(begun, self, *x)

    def law(self, time, state: TrackingState) -> Law:
        """What the predictor makes of an instant."""
        return self._read(time, state)[1]

    def _read(self, time, state: TrackingState):
        """The input that arrives, and the law."""
        row = state.past.read(time - self.delay, state.piece)
        defined = jnp.where(state.piece >= 1, 1.0, 0.0)
        return row[0], _law(self, state.x, state.reference, row, state.integrals, defined)

    def errors(self, time, state: TrackingState):
        """e_1 to e_n, scalars."""
        return [derivatives[0] for derivatives in self.law(time, state).now.error]

    def flow(self, time, state: TrackingState, mode):
        """d(state)/dt."""
        return self._flow(time, state, *self._read(time, state))

    def _flow(self, time, state: TrackingState, arrived, law: Law):
        slope = field(self.chain, jnp.stack(state.x), arrived)
        reference = self.reference.rates(state.reference, state.level)
        held = jax.tree.map(lambda _: None, state.past)
        return TrackingState(tuple(slope), tuple(law.rates.reshape(-1)), reference, None, held, None)

    def kept(self, time, state: TrackingState):
        """u, and what the predictor reads again."""
        return _row(self.law(time, state))

    def ticked(self, time, state: TrackingState) -> TrackingState:
        """The reference may have an edge."""
        level = self.reference.level(time + EDGE * (time - state.past.time[0]))
        return state._replace(level=level + 0.0 * state.level)


class SampledTrackingState(NamedTuple):
    """State of the sampled system; scalars per lane but for the ring."""

    x: tuple[Any, ...]
    integrals: tuple[Any, ...]
    rates: tuple[Any, ...]
    """of the integrals, at the last tick"""
    reference: tuple[Any, ...]
    level: Any
    ring: Ring
    acting: Any
    """the input that has arrived"""
    tick: Any
    """time of the last one, s"""


@model
class SampledTracking(Smooth):
    """The same in a control unit with a clock; the delay is `ticks` of them.

    Raises:
        ValueError: at construction, if the gains are not as many as the chain is long, or there is no tick of delay.
    """

    chain: Chain = part("the system")
    predictor: Predictor = part("the predictor and its law")
    ticks: int = 20
    reference: SquareWave = part("what x_1 follows", default=SquareWave())
    known: Chain | None = part("the system as the law knows it; None: as it is", default=None)
    tick_every: int = 1

    def __post_init__(self):
        _require(self)
        if self.ticks < 1:
            raise ValueError(f"SampledTracking.ticks = {self.ticks} must be >= 1")

    def initial_state(self, *x: Any) -> SampledTrackingState:
        """State x at time 0, where the unit ticks first; scalars, or arrays (lanes,)."""

        def begun(system, *x):
            integrals, reference, level, zero = _begin(system, x)
            ring = Ring.empty(self.ticks, _width(self.chain.order), zero)
            state = SampledTrackingState(x, integrals, integrals, reference, level, ring, zero, zero)
            return system.tick(zero, state, 0)[0]

        x = tuple(jnp.asarray(value, jnp.result_type(float, value)) for value in jnp.broadcast_arrays(*x))
        return of_each_lane(begun, self, *x)

    def errors(self, time, state: SampledTrackingState):
        """e_1 to e_n at the last tick, scalars."""
        return [derivatives[0] for derivatives in signals_of(state.ring.rows[0, 1:], self.chain.order).error]

    def flow(self, time, state: SampledTrackingState, mode):
        """d(state)/dt under the input that has arrived."""
        held = jax.tree.map(lambda _: None, state)
        slope = field(self.chain, jnp.stack(state.x), state.acting)
        return held._replace(x=tuple(slope), reference=self.reference.rates(state.reference, state.level))

    def tick(self, time, state: SampledTrackingState, mode):
        """One pass of the control unit."""
        row, defined = state.ring.rows[-1], state.ring.known[-1]
        half = 0.5 * (time - state.tick)
        integrals, rates = state.integrals, state.rates
        law = _law(self, state.x, state.reference, row, integrals, defined)
        # T_i waits for the prediction of i + 1: after n passes all are those of this tick.
        for _ in range(self.chain.order):
            rates = tuple(law.rates.reshape(-1))
            integrals = tuple(s + half * (a + b) for s, a, b in zip(state.integrals, rates, state.rates))
            law = _law(self, state.x, state.reference, row, integrals, defined)
        rates = tuple(law.rates.reshape(-1))
        level = self.reference.level(time + EDGE * (time - state.tick)) + 0.0 * time
        acting = row[0]
        after = SampledTrackingState(
            state.x, integrals, rates, state.reference, level, state.ring.pushed(_row(law)), acting, time + 0.0 * acting
        )
        return after, mode
