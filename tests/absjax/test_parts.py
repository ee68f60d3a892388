"""Where the flow is too fast for the grid step it is taken in parts: what switches does not depend on the step."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.controllers.five_phase import FivePhase
from absjax.hybrid.rollout import Status, rollout
from absjax.lanes import taken
from absjax.loop.stop import Outcome, stop
from tests.absjax.test_stiff_landing import STEP, Approach
from tests.attack.stops import random_loop, random_speeds
from tests.systems import Level


def approach(level, rate, steps=4):
    return rollout(Approach(level, rate), Level(jnp.asarray(0.0)), step=STEP, steps=steps, max_events=3)


@pytest.mark.parametrize("level", [0.5, 0.95])
def test_a_switching_ten_time_constants_before_the_next_grid_point(level):
    """Against x = 1 - exp(-rate t) up to the level, and x' = -1 from there on."""
    rate, end = 5000.0, 4 * STEP
    x, slope = jax.value_and_grad(lambda level: approach(level, rate).state.x)(level)
    np.testing.assert_allclose(x, level - (end + np.log(1 - level) / rate), atol=1e-7)
    np.testing.assert_allclose(slope, 1 + 1 / (rate * (1 - level)), atol=1e-6)
    h = 1e-6
    differences = float(approach(level + h, rate).state.x - approach(level - h, rate).state.x) / (2 * h)
    np.testing.assert_allclose(slope, differences, atol=1e-6)


def test_a_level_that_is_not_reached_is_not_crossed():
    """At (rate STEP) = 4 the whole step makes five times its error of what is left of the way."""
    result = approach(1.001, 2000.0, steps=60).raise_if_failed()
    assert int(result.events) == 0
    np.testing.assert_allclose(result.state.x, 1.0, atol=1e-4)


def test_a_flow_that_takes_more_parts_than_there_are_is_told():
    rate = jnp.array([3e2, 4e3, 2e6])
    result = rollout(Approach(2.0, rate), Level(jnp.zeros(3)), step=STEP, steps=60, max_events=3)
    assert np.asarray(result.status).tolist() == [Status.COMPLETED, Status.STEP_TOO_LARGE, Status.DIVERGED]
    assert np.all(np.isfinite(result.state.x))


def test_stops_to_walking_pace_switch_as_often_at_2_ms_as_at_a_quarter():
    """Taken in whole steps, the first two switched at rolling wheels that did not, 1.5 and 4.1 m apart; the third
    stuck in a hold, 0.3 m apart; the last missed a switching."""
    lanes = 128
    rng = np.random.default_rng(0)
    loop, speed = random_loop(FivePhase, rng, lanes), random_speeds(rng, lanes)
    some = np.argsort(speed)[[24, 115, 38, 18]]
    loop = dataclasses.replace(taken(loop, some), stop_speed=0.7)
    found = [stop(loop, speed[some], horizon=8.0, step=step, max_events=200) for step in (STEP, STEP / 8)]
    for result in found:
        assert np.all(np.asarray(result.outcome) == Outcome.STOPPED)
    np.testing.assert_array_equal(*(result.rollout.events for result in found))
    np.testing.assert_allclose(*(result.distance for result in found), atol=2e-3)
