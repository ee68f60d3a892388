"""The five-phase stop whose distance and gradient are known from two independent methods."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.hybrid.rollout import Status, rollout
from absjax.loop.driver import Driver
from absjax.tyres.burckhardt import Burckhardt
from tests.systems import (
    DURATION,
    PARAMETERS,
    SPEED,
    TRUE_DISTANCE,
    TRUE_GRADIENT,
    five_phase_loop,
    mean_deceleration_distance,
)


def run(parameters, step=2e-3, checkpoint=False, tile=None, **brake):
    loop = five_phase_loop(parameters, **brake)
    return rollout(
        loop,
        loop.initial_state(jnp.asarray(SPEED)),
        step=step,
        steps=round(DURATION / step),
        max_events=60,
        checkpoint=checkpoint,
        tile=tile,
    )


def distance(parameters, **options):
    return mean_deceleration_distance(run(parameters, **options))


def test_distance_and_number_of_switchings():
    result = run(PARAMETERS)
    assert abs(float(mean_deceleration_distance(result)) - TRUE_DISTANCE) < 3e-7
    assert int(result.events) == 45
    assert int(result.grazes) == 0
    assert int(result.status) == Status.COMPLETED


def test_fourth_order_convergence():
    errors = [abs(float(distance(PARAMETERS, step=step)) - TRUE_DISTANCE) for step in (4e-3, 2e-3, 1e-3, 5e-4)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(np.abs(orders - 4) < 0.1), (errors, orders)


@pytest.fixture(scope="module")
def central_differences():
    """Fourth-order central differences of the scheme itself, parameter-scaled, all in one ensemble."""
    eps = 3e-5
    shifts = np.concatenate([np.eye(9) * k * eps for k in (-2, -1, 1, 2)])
    lanes = (1 + jnp.asarray(shifts)) * PARAMETERS
    value = np.asarray(distance(lanes.T, tile=36)).reshape(4, 9)
    return (value[0] - 8 * value[1] + 8 * value[2] - value[3]) / (12 * eps)


@pytest.mark.parametrize(
    "gradient",
    [
        jax.grad(distance),
        jax.jacfwd(distance),
        jax.grad(partial(distance, checkpoint=True)),
        jax.jacfwd(partial(distance, checkpoint=True)),
    ],
    ids=["reverse", "forward", "checkpointed reverse", "checkpointed forward"],
)
def test_gradient(gradient, central_differences):
    scaled = np.asarray(jax.jit(gradient)(PARAMETERS) * PARAMETERS)
    largest = np.abs(TRUE_GRADIENT).max()
    assert np.abs(scaled - TRUE_GRADIENT).max() < 1e-5 * largest
    assert np.abs(scaled - central_differences).max() < 1e-6 * largest


def test_gradient_with_actuator_and_road_parameters_against_differences():
    def final_speed(p):
        loop = five_phase_loop(
            PARAMETERS, Burckhardt(p[0], p[1], p[2]), driver=Driver(p[5], p[6], p[7]), rate_limit=p[3], lag=p[4]
        )
        result = rollout(loop, loop.initial_state(p[8]), step=2e-3, steps=400, max_events=40)
        return result.state.plant.speed

    p = jnp.array([1.2801, 23.99, 0.52, 750.0, 5e-3, 400.0, 0.013, 55.0, 20.0])
    # One program for both: it is quickly run, and long compiled.
    both, eps = jax.jit(jax.value_and_grad(final_speed)), 1e-6
    scaled = np.asarray(both(p)[1] * p)
    sides = [[float(both(p.at[i].mul(1 + side * eps))[0]) for side in (1, -1)] for i in range(p.size)]
    differences = [(ahead - behind) / (2 * eps) for ahead, behind in sides]
    assert np.abs(scaled - differences).max() < 1e-5 * np.abs(scaled).max()


def test_scattered_roads_as_with_a_tenth_of_a_millisecond():
    scatter = 1 + 0.1 * np.random.default_rng(0).standard_normal((3, 256))
    tyre = Burckhardt(*(np.array([[1.2801], [23.99], [0.52]]) * scatter))
    loop = five_phase_loop(tyre=tyre, stop_speed=2.5)
    start = loop.initial_state(jnp.full(256, SPEED))
    coarse, fine = (rollout(loop, start, step=h, steps=round(DURATION / h)) for h in (2e-3, 1e-4))
    np.testing.assert_array_equal(coarse.events, fine.events)
    np.testing.assert_allclose(coarse.state.plant.distance, fine.state.plant.distance, rtol=0, atol=1e-5)
    assert int(coarse.events.max()) > 45


def test_single_precision():
    single = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), five_phase_loop())
    start = single.initial_state(jnp.float32(SPEED))
    result = rollout(single, start, step=2e-3, steps=1250, max_events=60)
    assert result.time.dtype == result.state.plant.speed.dtype == jnp.float32
    assert abs(float(mean_deceleration_distance(result)) - TRUE_DISTANCE) < 3e-4
    assert int(result.events) == 45
