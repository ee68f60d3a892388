"""A ball that bounces, whose jump has a kink on the guard or leaves it at zero, against its closed form."""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.controllers.two_phase_cycle import two_phase_cycle
from absjax.hybrid.rollout import Status, rollout
from absjax.parameters import model, parameter

G, START, END = 9.81, 1.0, 2.0
RESTITUTIONS = np.linspace(0.66, 0.9, 25)
"""Below 0.63 the ball has come to rest by the end, after bounces without number."""


class Ball(NamedTuple):
    h: Any
    v: Any


@model
class Bounce:
    e: Any = parameter("restitution", default=0.8)
    lifted: bool = True
    """whether a bounce takes the ball's magnitude of height, with a kink at the floor, or leaves it as it is"""

    def flow(self, time, state, mode):
        return Ball(state.v, -G)

    def guards(self, time, state, mode):
        return (-state.h,)

    def jump(self, time, state, mode, slot):
        return Ball(jnp.abs(state.h) if self.lifted else state.h, -self.e * state.v), mode


def run(e, lifted=True, max_events=100):
    start = Ball(jnp.asarray(START), jnp.asarray(0.0))
    return rollout(Bounce(e, lifted), start, step=0.01, steps=200, max_events=max_events)


def closed_form(e):
    """Height at the end, its derivative with respect to e, and the number of bounces."""
    fall = math.sqrt(2 * START / G)
    time, d_time, speed, d_speed, bounces = fall, 0.0, e * G * fall, G * fall, 1
    while time + 2 * speed / G < END:
        time, d_time, bounces = time + 2 * speed / G, d_time + 2 * d_speed / G, bounces + 1
        speed, d_speed = e * speed, speed + e * d_speed
    left = END - time
    return speed * left - G * left**2 / 2, d_speed * left - (speed - G * left) * d_time, bounces


@pytest.mark.parametrize("lifted", [True, False])
def test_height_and_both_derivatives_are_exact(lifted):
    def height(e):
        return run(e, lifted).state.h

    reverse, forward = jax.grad(height), jax.jit(jax.jacfwd(height))
    jitted = jax.jit(reverse)
    for i, e in enumerate(RESTITUTIONS):
        exact, slope, _ = closed_form(e)
        assert float(height(e)) == pytest.approx(exact, abs=1e-9)
        assert float(jitted(e)) == pytest.approx(slope, rel=1e-9)
        assert float(forward(e)) == pytest.approx(slope, rel=1e-9)
        if i % 10 == 0:
            assert float(reverse(e)) == pytest.approx(slope, rel=1e-9)


def test_no_more_switchings_than_allowed():
    bounces = closed_form(0.8)[2]
    enough, short = run(0.8, max_events=bounces), run(0.8, max_events=bounces - 1)
    assert (int(enough.events), int(enough.status)) == (bounces, Status.COMPLETED)
    assert (int(short.events), int(short.status)) == (bounces - 1, Status.BUDGET_EXHAUSTED)
    assert 0.0 < float(short.state.h) < 0.1, "it waits within a step of the bounce"


def test_checks_of_constants_hold_under_jit():
    settings = {"zref": 20.0, "chi_a": -0.2, "chi_b": 3.0}
    cycle = jax.jit(lambda gain: two_phase_cycle(23.99, 12.4748, gain=gain, **settings).contraction)
    assert float(cycle(200.0)) == pytest.approx(0.00399099, abs=5e-9)
    with pytest.raises(ValueError, match=r"chi_a = -0\.6 must be above -d/c"):
        jax.jit(lambda: two_phase_cycle(23.99, 12.4748, gain=200.0, **{**settings, "chi_a": -0.6}))()
