"""A pressure that touches a limit and turns back within a step, against its closed form."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.hybrid.rollout import rollout
from absjax.loop import pressure_limits
from absjax.loop._modes import FREE, ON_PEDAL, Mode
from absjax.loop.driver import HELD, Driver, Pedal
from absjax.parameters import model, parameter
from absjax.plant.brake import BrakeState

STEP, STEPS, LEVEL = 2e-3, 3, 120.0
FALLS, TURNS = 1e4, 4e6
"""Rate in the beginning, bar/s, and what it gains, bar/s^2: it turns in the middle of the second step, at 2.5 ms."""


class Pressed(NamedTuple):
    commanded: Any


@model
class Dip:
    """P' = sign (-FALLS + TURNS t) between zero and a pedal that is held; the mode is what the pressure does."""

    sign: Any = parameter("1: towards zero first; -1: towards the pedal", default=1.0)

    def _rate(self, time):
        return self.sign * (TURNS * time - FALLS)

    def _parts(self, mode):
        return Mode(0 * mode, mode, 0, HELD)

    def flow(self, time, state, mode):
        return Pressed(pressure_limits.granted(self._parts(mode), self._rate(time), 0.0))

    def guards(self, time, state, mode):
        brake, pedal = BrakeState(state.commanded, None, None), Pedal(LEVEL + 0.0 * time, 1.0)
        return (pressure_limits.guard(Driver(), brake, pedal, self._parts(mode), self._rate(time)),)

    def jump(self, time, state, mode, slot):
        brake, pedal = BrakeState(state.commanded, None, None), Pedal(LEVEL + 0.0 * time, 1.0)
        brake, parts = pressure_limits.met(brake, pedal, self._parts(mode))
        return Pressed(brake.commanded), parts.pressure


def exact(room):
    """What is left to the limit at the end: the lowest point would be FALLS^2 / (2 TURNS) = 12.5 bar down."""
    end = STEP * STEPS
    leaves = (FALLS + pressure_limits.LEAVING_RATE) / TURNS
    free = room - FALLS * end + TURNS * end**2 / 2
    rested = TURNS / 2 * (end**2 - leaves**2) - FALLS * (end - leaves)
    return jnp.where(room < FALLS**2 / (2 * TURNS), rested, free)


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["zero", "pedal"])
def test_a_touch_within_a_step(sign):
    room = np.array([12.4, 12.499, 12.501, 13.0])
    start = Pressed(jnp.asarray(room if sign > 0 else LEVEL - room))
    result = rollout(Dip(sign), start, FREE, step=STEP, steps=STEPS, max_events=4)
    left = result.state.commanded if sign > 0 else LEVEL - result.state.commanded
    np.testing.assert_allclose(left, jax.vmap(exact)(room), atol=1e-6)
    assert np.asarray(result.events).tolist() == [2, 2, 0, 0]


def test_what_leaves_a_limit_is_not_sent_back():
    """At a limit but for rounding, asked inwards: not beyond it; asked outwards it is, but for rounding."""

    def guard(pressure, rate):
        brake, pedal = BrakeState(pressure, None, None), Pedal(LEVEL, 1.0)
        return float(pressure_limits.guard(Driver(), brake, pedal, Mode(0, FREE, 0, HELD), rate))

    for rounding in (-1e-12, 0.0, 1e-12):
        assert guard(rounding, 5.0) < 0 and guard(LEVEL + rounding, -5.0) < 0
        assert abs(guard(rounding, -5.0)) < 1e-11 and abs(guard(LEVEL + rounding, 5.0)) < 1e-11
    assert guard(0.5, 5.0) == guard(0.5, -5.0) == -0.5
    on_pedal = Mode(0, ON_PEDAL, 0, HELD)
    brake, pedal = BrakeState(LEVEL, None, None), Pedal(LEVEL, 1.0)
    assert float(pressure_limits.guard(Driver(), brake, pedal, on_pedal, -5.0)) > 0
