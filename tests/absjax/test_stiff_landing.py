"""Where a step is long for the flow, a switching still ends on its guard, and its derivative is that of the scheme."""

from typing import Any

import jax
import jax.numpy as jnp
import pytest

from absjax.hybrid.rollout import rollout
from absjax.parameters import model, parameter
from tests.systems import Level

RATE, STEP = 600.0, 2e-3


@model
class Approach:
    """x' = rate (1 - x) until x reaches a level, then x' = -1."""

    level: Any = parameter("where it turns", default=0.5)

    def flow(self, time, state, mode):
        return Level(jnp.where(mode == 0, RATE * (1.0 - state.x), -1.0))

    def guards(self, time, state, mode):
        return (jnp.where(mode == 0, state.x - self.level, -1.0),)

    def jump(self, time, state, mode, slot):
        return state, mode + 1


def end(level):
    return rollout(Approach(level), Level(jnp.asarray(0.0)), step=STEP, steps=4, max_events=3).state.x


@pytest.mark.parametrize("level", [0.45, 0.5, 0.6])
def test_gradient_where_a_step_is_longer_than_the_time_constant(level):
    h = 1e-6
    exact = float(jax.grad(end)(level))
    assert exact == pytest.approx(float(end(level + h) - end(level - h)) / (2 * h), rel=1e-7)
