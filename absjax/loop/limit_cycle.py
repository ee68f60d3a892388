"""The limit cycle of any automaton, by located rollout: return map, fixed point, contraction.

On a test rig at constant speed a closed loop maps its state where a cycle begins, x, to that where the next one
does, M(x). The fixed point x = M(x) is found by Newton's method, the derivative of M taken through the located
switchings. M ends on the threshold that begins the cycle, so M' has one eigenvalue 0; the largest magnitude of the
others is the contraction of the Poincare map. Both are differentiable: the fixed point implicitly,
dx = (I - M')^-1 dM, the contraction through the second derivative of the rollout.
Source: Aguado-Rojas 2019, section 4.3.3 and appendix A, for the Poincare map.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from absjax.hybrid.rollout import Status, rollout
from absjax.lanes import each_lane
from absjax.loop.closed_loop import ClosedLoop, LoopState
from absjax.loop.memory import Memory
from absjax.parameters import concrete, model, part
from absjax.plant.test_rig import TestRig
from absjax.results import FINISHED, EndCode

NEWTON_STEPS = 6
TOLERANCE = 1e-5
"""Largest step of Newton's method left at a fixed point, as a share of max(|x|, 1)."""


class CycleStatus(EndCode):
    """What the search for a limit cycle found."""

    FOUND = 0, "a fixed point"
    NOT_CYCLING = 1, "the loop stops cycling: within the horizon no further cycle begins", True
    NOT_CONVERGED = 2, "it cycles, but Newton's method found no fixed point", True


class LimitCycle(NamedTuple):
    """A limit cycle; arrays (lanes,), or scalars without lanes.

    Attributes:
        state: of the loop where the cycle begins; where none was found, `state`, `offset` and `stiffness` are those
            of the search's last point.
        offset: the wheel acceleration offset there [m/s^2].
        stiffness: XBS there.
        period: seconds; infinite where none was found.
        contraction: largest magnitude of an eigenvalue of the return map; below 1 the cycle is attractive.
            Infinite where none was found.
        status: a `CycleStatus` code.
    """

    state: LoopState
    offset: jax.Array
    stiffness: jax.Array
    period: jax.Array
    contraction: jax.Array
    status: jax.Array


@model
class _Cycles:
    """The loop until so many cycles have begun."""

    loop: ClosedLoop = part("the loop")
    count: int = 1

    def flow(self, time, state, mode):
        return self.loop.flow(time, state, mode)

    def guards(self, time, state, mode):
        return self.loop.guards(time, state, mode)

    def jump(self, time, state, mode, slot):
        state, following = self.loop.jump(time, state, mode, slot)
        return state, jnp.where(state.memory.control.cycles >= self.count, FINISHED, following)


def limit_cycle(
    loop: ClosedLoop, *, warm_up: int = 12, horizon: float = 2.0, step: float = 1e-3, max_events: int = 40
) -> LimitCycle:
    """The limit cycle a closed loop settles on, with its contraction.

    Args:
        loop: on an `absjax.plant.test_rig.TestRig` at constant speed; leaves with a leading axis make an ensemble. What
            the controller keeps must be decided where a cycle begins (`Controller.initial_state`), as of all here.
        warm_up: cycles from the first touch of the pedal before the search begins.
        horizon: longest time for one cycle [s].
        step: grid step [s].
        max_events: switchings in one cycle.

    Returns:
        A `LimitCycle`; every field but `status` is differentiable with respect to the loop.

    Raises:
        ValueError: if the controller does not cycle, the plant is not a rig at constant speed, or the loop has a
            stop speed.
    """
    plant = loop.plant
    if not isinstance(plant, TestRig) or (concrete(plant.acceleration) and np.any(plant.acceleration)):
        raise ValueError("a limit cycle needs a TestRig whose acceleration is 0: speed is a parameter of the cycle")
    if loop.controller.cycle_phase is None:
        raise ValueError(f"{type(loop.controller).__name__} does not cycle; it has no limit cycle")
    if loop.stop_speed is not None:
        raise ValueError("ClosedLoop.stop_speed must be None on a rig at constant speed")
    steps = round(horizon / step)
    return _limit_cycle(loop, step, steps, warm_up, max_events)


@partial(jax.jit, static_argnums=(1, 2, 3, 4))
def _limit_cycle(loop, step, steps, warm_up, max_events) -> LimitCycle:
    # What is iterated carries no derivative: the fixed point has its own.
    held_loop = jax.tree.map(lax.stop_gradient, loop)
    first = held_loop.initial_state(jnp.asarray(held_loop.plant.speed, jnp.result_type(float)))
    many = _Cycles(held_loop, warm_up)
    warm = rollout(many, first, step=step, steps=warm_up * steps, max_events=warm_up * max_events)
    cycling = warm.status == Status.FINISHED
    leaves, tree = jax.tree.flatten((warm.state.plant, warm.state.brake, warm.state.observer))
    start = jnp.stack(jnp.broadcast_arrays(*leaves), axis=-1)

    def begin(loop, point) -> LoopState:
        plant, brake, observer = jax.tree.unflatten(tree, [point[..., i] for i in range(point.shape[-1])])
        zero = 0.0 * point[..., 0]
        state = LoopState(plant, brake, loop.driver.pressed(zero), observer, (), Memory.blank(zero))
        return state._replace(
            controller=each_lane(lambda loop, told: loop.controller.initial_state(told), loop, _told(loop, state))
        )

    def returned(loop, point):
        begun, mode = begin(loop, point), loop.mode(loop.controller.cycle_phase)
        end = rollout(_Cycles(loop, 1), begun, mode, step=step, steps=steps, max_events=max_events)
        parts = jax.tree.leaves((end.state.plant, end.state.brake, end.state.observer))
        return jnp.stack(parts, axis=-1), (end.time, end.status)

    def with_slope(loop, point):
        """M(x) and M'(x), (..., n, n): lanes do not know of each other, so one direction serves them all."""
        directions = jnp.eye(point.shape[-1], dtype=point.dtype)

        def along(e):
            return jax.jvp(partial(returned, loop), (point,), (jnp.broadcast_to(e, point.shape),), has_aux=True)

        image, columns, rest = jax.vmap(along, out_axes=(None, -1, None))(directions)
        return image, columns, rest

    def newton_step(image, slope, point, sound):
        matrix = jnp.eye(point.shape[-1], dtype=point.dtype) - jnp.where(sound[..., None, None], slope, 0.0)
        return jnp.linalg.solve(matrix, (image - point)[..., None])[..., 0]

    def look(loop, point):
        """What is known at a point, and Newton's step from there."""
        image, slope, (period, ended) = with_slope(loop, point)
        finished = ended == Status.FINISHED
        step = newton_step(image, slope, point, finished)
        near = jnp.abs(step) < TOLERANCE * jnp.maximum(jnp.abs(point), 1.0)
        return step, slope, period, jnp.all(near, axis=-1) & finished

    @jax.custom_jvp
    def search(loop, start):
        """Point, slope, period and whether it is the fixed point, whose derivative is not one of where it began."""

        def newton(i, carry):
            point = carry[0] + jnp.where(i == 0, 0.0, carry[1])
            return point, *look(loop, point)

        nowhere = jnp.zeros((*start.shape, start.shape[-1]), start.dtype)
        blank = start[..., 0]
        carry = lax.fori_loop(0, NEWTON_STEPS + 2, newton, (start, start, nowhere, blank, blank < -jnp.inf))
        return carry[0], *carry[2:]

    @search.defjvp
    def implicitly(primals, tangents):
        loop, d_loop = primals[0], tangents[0]
        point, slope, period, fixed = search(*primals)
        _, d_image = jax.jvp(lambda loop: returned(loop, point)[0], (loop,), (d_loop,))
        d_point = jnp.where(fixed[..., None], newton_step(point + d_image, slope, point, fixed), 0.0)
        (_, slope, (period, _)), (_, d_slope, (d_period, _)) = jax.jvp(with_slope, (loop, point), (d_loop, d_point))
        return (point, slope, period, fixed), (d_point, d_slope, d_period, np.zeros(fixed.shape, jax.dtypes.float0))

    point, slope, period, fixed = search(loop, start)
    state = begin(loop, point)
    told = _told(loop, state)
    reached = jnp.where(fixed, CycleStatus.FOUND, CycleStatus.NOT_CONVERGED)
    status = jnp.where(cycling, reached, CycleStatus.NOT_CYCLING).astype(jnp.int32)
    found = status == CycleStatus.FOUND
    contraction = _largest_eigenvalue(jnp.where(found[..., None, None], slope, 0.0))
    contraction, period = (jnp.where(found, x, jnp.inf) for x in (contraction, period))
    return LimitCycle(state, told.acceleration_offset, told.stiffness, period, contraction, status)


def _told(loop: ClosedLoop, state: LoopState):
    """What the controller is told at time 0."""
    return each_lane(lambda loop, state: loop.signals(0.0 * state.plant.wheel_speed, state, loop.mode(0)), loop, state)


def _largest_eigenvalue(matrix):
    """Magnitude of the eigenvalue of largest magnitude; d(lambda) = y^H dA x / (y^H x), with x and y its right
    and left eigenvectors."""
    fixed = lax.stop_gradient(matrix)
    (values, right), (transposed, left) = (jnp.linalg.eig(a) for a in (fixed, jnp.swapaxes(fixed, -1, -2)))
    largest = jnp.argmax(jnp.abs(values), axis=-1)
    chosen = jnp.take_along_axis(values, largest[..., None], axis=-1)
    value, x = jnp.abs(chosen[..., 0]), _column(right, largest)
    y = _column(left, jnp.argmin(jnp.abs(transposed - chosen), axis=-1))
    norm = jnp.sum(y * x, axis=-1)
    change = jnp.einsum("...i,...ij,...j->...", y, (matrix - fixed).astype(x.dtype), x)
    sound = (jnp.abs(norm) > 0) & (value > 0)
    direction = jnp.where(sound, jnp.conj(chosen[..., 0]) / jnp.where(sound, value * norm, 1.0), 0.0)
    return value + jnp.real(direction * change)


def _column(vectors, index):
    """Column `index` (...) of `vectors` (..., n, n)."""
    return jnp.take_along_axis(vectors, index[..., None, None], axis=-1)[..., 0]
