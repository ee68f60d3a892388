"""Stops on five roads against SciPy's DOP853 with terminal events, restarted at every switching."""

import jax.numpy as jnp
import pytest

from absjax.controllers.five_phase import FivePhase
from absjax.hybrid.rollout import rollout
from absjax.tyres.surfaces import SURFACES
from tests.oracles import five_phase
from tests.oracles.automaton import until_switching
from tests.oracles.quarter_car import GRAVITY, RADIUS, coefficients, friction, offset, spin
from tests.systems import five_phase_loop

ROADS = ("dry_asphalt", "wet_asphalt", "dry_concrete", "dry_cobblestones", "wet_cobblestones")
SPEED, END = 20.0, 1.2


def scipy_stop(c, lag=None):
    """Distance, number of switchings and speed at END; written without the project's models."""
    p = FivePhase()

    def x2(y):
        return offset(y[0], y[1], y[-1], c)

    def flow(t, y):
        dv, dw = GRAVITY * friction(y[0], y[1], c), spin(y[0], y[1], y[-1], c)
        rim = RADIUS * y[1]
        slope = [dv, dw, y[0], five_phase.rate(mode, rim, p) if mode else 3 * p.u4 / rim]
        return slope if lag is None else [*slope, (y[3] - y[4]) / lag]

    def guards(t, y):
        return [guard for guard, _ in five_phase.edges(mode, x2(y), p)]

    y, t, mode, count = [SPEED, SPEED / RADIUS, 0.0, 0.0] + ([] if lag is None else [0.0]), 0.0, 0, 0
    while True:
        t, y, fired = until_switching(flow, guards, t, y, END, rtol=1e-11, atol=1e-11)
        if fired is None:
            return y[2], count, y[0]
        mode, count = five_phase.edges(mode, x2(y), p)[fired][1], count + 1


@pytest.mark.parametrize("road, lag", [*((road, None) for road in ROADS), ("dry_asphalt", 5e-3)])
def test_stop(road, lag):
    tyre = SURFACES[road]
    distance, count, speed = scipy_stop(coefficients(tyre), lag)
    loop = five_phase_loop(tyre=tyre, **({} if lag is None else {"lag": lag}))
    result = rollout(loop, loop.initial_state(jnp.asarray(SPEED)), step=5e-4, steps=round(END / 5e-4), max_events=100)
    assert int(result.events) == count > 3
    assert abs(float(result.state.plant.distance) - distance) < 1e-7
    assert abs(float(result.state.plant.speed) - speed) < 1e-6
