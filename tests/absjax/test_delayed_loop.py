"""Controllers that predict over a delay of the brake: in a control unit against a plain loop, located against both."""

import dataclasses
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.figure import Figure

from absjax.controllers.predictive_tracking import PredictiveTracking
from absjax.hybrid.rollout import rollout
from absjax.loop.delayed_loop import DelayedLoop, in_unit, nodes_of
from absjax.loop.driver import Driver
from absjax.parameters import defaults_of
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.plots import phase_plane
from absjax.tyres.surfaces import surface
from tests.oracles import predictive

SPEED, END, TICK, TICKS, STEP = 20.0, 0.7, 1e-3, 10, 1e-3
TYRE = surface("dry_asphalt")
GIVEN = SimpleNamespace(**defaults_of(PredictiveTracking), rate_limit=750.0, pedal=200.0)


def loop_of(controller=None, **of):
    car = QuarterCar(Wheel(), UniformRoad(TYRE))
    parts = car, Brake(rate_limit=750.0), controller or PredictiveTracking()
    return DelayedLoop(*parts, driver=Driver(rate=200.0), nodes=nodes_of(0.02, STEP), **of)


def test_in_a_control_unit_against_a_plain_loop():
    unit = loop_of().in_unit(TICKS)
    result = rollout(unit, unit.initial_state(SPEED), step=TICK, steps=round(END / TICK), save_every=1)
    path = result.raise_if_failed().path
    truth, phases = predictive.run(GIVEN, TYRE, SPEED, TICKS, TICK, END)
    assert len(np.unique(phases)) == 6
    assert np.array_equal(jax.vmap(unit.loop.phase)(path.mode), phases)
    found = path.state.loop.plant.speed, path.state.loop.plant.wheel_speed, path.state.loop.brake.commanded
    np.testing.assert_allclose(np.stack(found, axis=1), truth, rtol=1e-9, atol=1e-9)
    axes = Figure().subplots()
    phase_plane(axes, unit.loop, path)
    slip = np.asarray(found[1]) * 0.3 / np.asarray(found[0]) - 1
    np.testing.assert_allclose(axes.lines[0].get_xdata(), slip, rtol=1e-12)


def speeds(eps1, delay):
    """Vehicle and wheel speed at the end of lanes."""
    controller = PredictiveTracking(eps1=eps1, delay=delay)
    loop = dataclasses.replace(loop_of(), controller=controller, delay=delay)
    result = rollout(loop, loop.initial_state(SPEED), step=STEP, steps=round(END / STEP)).raise_if_failed()
    return result.state.loop.plant.speed, result.state.loop.plant.wheel_speed


def test_located_is_what_a_quick_control_unit_comes_to_and_its_gradient_that_of_differences():
    # Off the grid: where the past is read at a node, differences by the delay see the corner of its second derivative;
    # and narrow, for wider ones see a step that is parted on one side only.
    eps1, delay, move = 30.0, 0.0103, 1e-6
    lanes = jnp.array([1 + move, 1 - move, 1.0, 1.0, 1.0, 1.0, 1.0])
    delays = jnp.array([1.0, 1.0, 1.0, 1 + move, 1 - move, 1.0, 0.01 / delay])
    towards = jnp.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]), jnp.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    found, slopes = jax.jvp(speeds, (eps1 * lanes, delay * delays), towards)
    coarse, fine = (predictive.run(GIVEN, TYRE, SPEED, n, 0.01 / n, END)[0][-1, :2] for n in (100, 200))
    here = np.array([x[6] for x in found])
    np.testing.assert_allclose(here, coarse, rtol=1e-2)
    assert np.all(np.abs(here - fine) < 0.6 * np.abs(here - coarse))
    for x, slope in zip(found, slopes):
        np.testing.assert_allclose(slope[2], (x[0] - x[1]) / (2 * move * eps1), rtol=1e-5)
        np.testing.assert_allclose(slope[5], (x[3] - x[4]) / (2 * move * delay), rtol=1e-5)


def test_what_cannot_be_is_refused_by_name():
    loop = loop_of(delay=5e-4)
    with pytest.raises(ValueError, match="longer than the delay"):
        loop.require_step(STEP)
    with pytest.raises(ValueError, match="do not reach back"):
        loop_of(delay=0.2).require_step(STEP)
    with pytest.raises(ValueError, match="ticks of its delay"):
        unit = in_unit(loop.undelayed(), None, None, TICK)
        unit.tick(0.001, unit.initial_state(SPEED), 0)
