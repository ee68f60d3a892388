"""Stops on five roads against SciPy's DOP853 with terminal events, restarted at every switching."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from absjax.controllers.five_phase import FivePhase
from absjax.hybrid.rollout import rollout
from absjax.tyres.surfaces import SURFACES
from tests.systems import five_phase_loop

INERTIA, RADIUS, LOAD, BRAKE, GRAVITY = 1.2, 0.3, 2500.0, 17.5, 9.81
ROADS = ("dry_asphalt", "wet_asphalt", "dry_concrete", "dry_cobblestones", "wet_cobblestones")
SPEED, END = 20.0, 1.2


def scipy_stop(c1, c2, c3, lag=None):
    """Distance, number of switchings and speed at END; written without the project's models."""
    p = FivePhase()
    rates = [3 * p.u4, -p.u1, 0.0, p.u3, p.u4, 0.0]

    def accelerations(y):
        slip = (RADIUS * y[1] - y[0]) / y[0]
        friction = np.sign(slip) * (c1 * (1 - np.exp(-c2 * abs(slip))) - c3 * abs(slip))
        pressure = y[3] if lag is None else y[4]
        return friction * GRAVITY, (-RADIUS * LOAD * friction - BRAKE * pressure) / INERTIA

    def offset(y):
        dv, dw = accelerations(y)
        return RADIUS * dw - dv

    def flow(t, y, mode):
        dv, dw = accelerations(y)
        slope = [dv, dw, y[0], rates[mode] / (RADIUS * y[1])]
        return slope if lag is None else [*slope, (y[3] - y[4]) / lag]

    edges = {
        0: [(-p.eps0, -1, 1)],
        1: [(p.eps1, 1, 2)],
        2: [(p.eps2, 1, 3), (p.fallback * p.eps1, -1, 4)],
        3: [(p.eps3, -1, 4)],
        4: [(-p.eps4, -1, 5)],
        5: [(-p.eps5, -1, 1)],
    }
    y, t, mode, count = [SPEED, SPEED / RADIUS, 0.0, 0.0] + ([] if lag is None else [0.0]), 0.0, 0, 0
    while True:
        events = []
        for threshold, direction, _ in edges[mode]:

            def event(t, y, m, threshold=threshold):
                return offset(y) - threshold

            event.terminal, event.direction = True, direction
            events.append(event)
        solution = solve_ivp(flow, (t, END), y, "DOP853", events=events, args=(mode,), rtol=1e-11, atol=1e-11)
        t, y = solution.t[-1], solution.y[:, -1]
        if solution.status == 0:
            return y[2], count, y[0]
        mode = next(target for times, (_, _, target) in zip(solution.t_events, edges[mode]) if len(times))
        count += 1


@pytest.mark.parametrize("road, lag", [*((road, None) for road in ROADS), ("dry_asphalt", 5e-3)])
def test_stop(road, lag):
    tyre = SURFACES[road]
    distance, count, speed = scipy_stop(float(tyre.c1), float(tyre.c2), float(tyre.c3), lag)
    loop = five_phase_loop(tyre=tyre, **({} if lag is None else {"lag": lag}))
    result = rollout(loop, loop.initial_state(jnp.asarray(SPEED)), step=5e-4, steps=round(END / 5e-4), max_events=100)
    assert int(result.events) == count > 3
    assert abs(float(result.state.plant.distance) - distance) < 1e-7
    assert abs(float(result.state.plant.speed) - speed) < 1e-6
