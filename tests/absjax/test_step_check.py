"""Stops that are another at half their grid step say so."""

import dataclasses

import jax
import numpy as np

from absjax.controllers.predictive_two_phase import PredictiveTwoPhase
from absjax.controllers.two_phase import TwoPhase
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.delayed_loop import DelayedLoop, nodes_of
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.step_check import checked_stop, for_half_step
from absjax.loop.stop import Outcome
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.tyres.surfaces import SURFACES

CAR = QuarterCar(Wheel(), UniformRoad(SURFACES["dry_asphalt"]))
LOOP = ClosedLoop(CAR, Brake(), TwoPhase(), 13.0)
SPEED, LANES = 16.0, 16
HOW = {"horizon": 0.8, "max_events": 60}


@jax.jit
def checked(speeds):
    found = checked_stop(dataclasses.replace(LOOP, stop_speed=speeds), SPEED, **HOW)
    return found.outcome, found.events


def test_one_that_ends_before_a_switching_at_one_step_and_after_it_at_half_of_it():
    """Stop speeds on ever finer grids around the one at which a stop just has its sixth switching."""
    low, high = 13.0, 15.9
    for _ in range(10):
        speeds = np.linspace(low, high, LANES)
        outcome, events = map(np.asarray, checked(speeds))
        last = np.flatnonzero(events >= 6).max()
        told = outcome == Outcome.STEP_TOO_LARGE
        if told.any():
            break
        low, high = speeds[last], speeds[last + 1]
    assert np.isin(outcome, (Outcome.STOPPED, Outcome.STEP_TOO_LARGE)).all() and high - low < 1e-3
    # Those between the instants of both steps are told, on one side of the one that is returned, and no others.
    between = np.flatnonzero(told)
    assert len(between) < LANES - 1 and np.all(np.diff(between) == 1)
    assert between[-1] == last or between[0] == last + 1


def test_control_units_tick_as_often_and_the_past_reaches_as_far():
    assert for_half_step(LOOP) is LOOP
    assert for_half_step(SampledLoop(LOOP, tick_every=3)).tick_every == 6
    parts = LOOP.plant, LOOP.brake, PredictiveTwoPhase(delay=0.1), 13.0
    for_half_step(DelayedLoop(*parts, delay=0.1, nodes=nodes_of(0.1, 2e-3))).require_step(1e-3)
