"""The study of delays: gains by gradient, cases, and predicting controllers in the tuning of controllers."""

import numpy as np
import pytest

from absjax.loop.delayed_loop import DelayedLoop
from tuning.controllers.config import TuningConfig
from tuning.controllers.setup import Setup
from tuning.core.config import ConfigError
from tuning.delay import brake, margins
from tuning.delay.tune import GainSearch, LoopGains, PredictorGains


def test_a_configuration_with_a_delay_and_a_predictor_makes_a_delayed_loop():
    setup = Setup.of(TuningConfig(controller="predictive_tracking", delay=0.012, lag=None))
    loop = setup.loop(setup.controller())
    assert isinstance(loop, DelayedLoop) and float(loop.delay) == float(loop.controller.delay) == 0.012
    assert loop.brake.delay is None
    unit, step = setup.sampled(loop)
    assert step == 1e-3 and unit.delay == 12 and unit.loop.controller.ticks == 12
    assert {"gain", "beta1", "beta2"} <= set(setup.box().names) and "delay" not in setup.box().names


def test_what_a_predicting_controller_cannot_have_is_refused():
    for entry in ({}, {"delay": 5e-4}, {"delay": 0.01, "largest_contraction": 0.9}):
        with pytest.raises(ConfigError, match=r"delay|largest_contraction"):
            TuningConfig.from_json({"controller": "predictive_tracking", **entry})


@pytest.mark.parametrize(
    "problem", [PredictorGains(), LoopGains(GainSearch(least_margin=0.025))], ids=["root", "margin"]
)
def test_gradients_of_the_gains_against_differences(problem):
    point, move = problem.given + 0.1, 1e-5
    slope = np.asarray(problem.costs_and_gradients(point, None)[1])[0]
    ahead, behind = problem.judge(point + move * np.eye(2)), problem.judge(point - move * np.eye(2))
    np.testing.assert_allclose(slope, (ahead - behind) / (2 * move), rtol=1e-5, atol=1e-8)


def test_gains_for_25_ms_have_that_margin_or_there_are_none():
    speeds = np.array([5.0, 20.0, 50.0])
    for slope in (margins.SLOPES[0], margins.SLOPES[2]):
        found = margins.curves(slope, speeds)["without a filter"]
        np.testing.assert_allclose(found[1:], margins.WANTED, rtol=0.03)
    assert np.isnan(found[0]) and margins.gain_of(margins.SLOPES[2], speeds)[0] == 0


def test_cases_know_what_they_are_said_to_know():
    case = brake.Case(known=0.5, efficiency=0.9, road="wet_asphalt")
    loop = brake.loop_of(case)
    assert loop.controller.delay == pytest.approx(0.005) and loop.delay == brake.DELAY
    assert loop.plant.wheel.brake_efficiency == pytest.approx(0.9 * loop.controller.wheel.brake_efficiency)
    assert loop.controller.gain == pytest.approx(np.pi / 0.02) and loop.controller.c2 == pytest.approx(33.822)
    for parameters in brake.tuned_parameters().values():
        brake.loop_of(brake.Case(parameters=parameters))
