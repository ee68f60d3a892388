"""Channels that know nothing of each other and switch in the same instant, against their closed form."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.hybrid.rollout import rollout
from absjax.parameters import model, parameter

END, CYCLES = 4.2, 2
"""Cycles of 1.5 p that are behind at the end, when both channels fall."""


class Levels(NamedTuple):
    x: Any
    y: Any


@model
class Channels:
    """Each of two integrators rises at 1 up to its threshold and falls at -2 down to 0: bits 1 and 2 of the mode."""

    p: Any = parameter("threshold of the first", default=1.0)
    q: Any = parameter("threshold of the second", default=1.0)

    def flow(self, time, state, mode):
        return Levels(jnp.where(mode & 1, -2.0, 1.0), jnp.where(mode & 2, -2.0, 1.0))

    def guards(self, time, state, mode):
        x, y = state
        return jnp.where(mode & 1, -x, x - self.p), jnp.where(mode & 2, -y, y - self.q)

    def jump(self, time, state, mode, slot):
        return state, mode ^ (1 << slot)


def ends(thresholds):
    start = Levels(jnp.asarray(0.0), jnp.asarray(0.0))
    return rollout(Channels(*thresholds), start, step=0.03, steps=round(END / 0.03), max_events=12)


@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.jacrev], ids=["forward", "reverse"])
@pytest.mark.parametrize("apart", [0.0, 1e-12, -1e-12, 1e-8, -1e-3])
def test_each_threshold_moves_its_own_switchings_only(derivative, apart):
    thresholds = jnp.array([1.0, 1.0 + apart])
    result = ends(thresholds)
    assert int(result.events) == 2 * (2 * CYCLES + 1)
    time = float(result.time)
    exact = thresholds - 2 * (time - 1.5 * CYCLES * thresholds - thresholds)
    np.testing.assert_allclose(result.state, exact, atol=1e-8)
    slopes = derivative(lambda thresholds: jnp.stack(ends(thresholds).state))(thresholds)
    np.testing.assert_allclose(slopes, np.diag([3.0 + 3 * CYCLES] * 2), atol=1e-9)


@model
class Watched:
    """Two oscillators, x = sin t and y = sin(w t): bits 1 and 2 of the mode say which of them are above a level."""

    level: Any = parameter("of both", default=0.3)
    faster: Any = parameter("w of the second", default=1.0)

    def flow(self, time, state, mode):
        return Levels(jnp.cos(time), self.faster * jnp.cos(self.faster * time))

    def guards(self, time, state, mode):
        return tuple(jnp.where(mode & bit, self.level - x, x - self.level) for bit, x in zip((1, 2), state))

    def jump(self, time, state, mode, slot):
        return state, mode ^ (1 << slot)


@pytest.mark.parametrize("faster", [1.0, 1.0 + 1e-13, 1.1])
def test_a_guard_that_turns_back_where_it_fired_fires_once(faster):
    """Above and below have one level: each guard falls from where the jump of the other has left it, at zero."""
    start = Levels(jnp.asarray(0.0), jnp.asarray(0.0))
    found = rollout(Watched(faster=faster), start, step=0.05, steps=300, max_events=60, save_switches=True)
    first = np.array([np.arcsin(0.3) + 2 * np.pi * k for k in range(3)])
    passes = np.sort(np.concatenate([first, np.pi * np.arange(1, 6, 2) - np.arcsin(0.3)]))
    passes = np.concatenate([passes[passes < 15.0], (passes / faster)[passes / faster < 15.0]])
    assert int(found.events) == len(passes)
    np.testing.assert_allclose(np.sort(np.asarray(found.log.time))[: len(passes)], np.sort(passes), atol=1e-7)
