"""Where a step is long for the flow, a switching still ends on its guard, and its derivative is that of the scheme."""

from typing import Any

import jax
import jax.numpy as jnp
import pytest

from absjax.hybrid.rollout import rollout
from absjax.parameters import model, parameter
from tests.systems import Level

STEP = 2e-3


@model
class Approach:
    """x' = rate (1 - x) until x reaches a level, then x' = -1."""

    level: Any = parameter("where it turns", default=0.5)
    rate: Any = parameter("rate, 1/s", default=600.0)

    def flow(self, time, state, mode):
        return Level(jnp.where(mode == 0, self.rate * (1.0 - state.x), -1.0))

    def guards(self, time, state, mode):
        return (jnp.where(mode == 0, state.x - self.level, -1.0),)

    def jump(self, time, state, mode, slot):
        return state, mode + 1


def end(level, rate):
    start = Level(jnp.asarray(0.0))
    return rollout(Approach(level, rate), start, step=STEP, steps=4, max_events=3).state.x


def error_of_gradient(level, rate):
    h = 1e-6
    differences = float(end(level + h, rate) - end(level - h, rate)) / (2 * h)
    return float(jax.grad(end)(level, rate)) / differences - 1


@pytest.mark.parametrize("level", [0.45, 0.5, 0.6])
def test_gradient_where_a_step_is_longer_than_the_time_constant(level):
    assert error_of_gradient(level, 600.0) == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize(("level", "rate"), [(0.69, 850.0), (0.66, 950.0), (0.51, 1150.0)])
def test_gradient_where_steps_of_growing_size_turn_back(level, rate):
    """Near 2 / STEP the end of a step says little of the way there, and the landing takes many tries; what is left of
    its miss after the last is no more than a hundred-thousandth of the gradient."""
    assert error_of_gradient(level, rate) == pytest.approx(0.0, abs=1e-5)
