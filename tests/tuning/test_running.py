"""A controller tuned for where it runs: conditions drawn apart, limits that nothing pays for, a slope that descends."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from tuning.controllers import scatter
from tuning.controllers.config import TuningConfig
from tuning.controllers.running import INFEASIBLE, running_problem
from tuning.controllers.scatter import scattered
from tuning.controllers.setup import Setup
from tuning.controllers.splits import SplitFigures
from tuning.controllers.tune import with_charge, worse_apart
from tuning.core.config import ConfigError
from tuning.core.roads import NEVER

CONFIG = TuningConfig(
    setting="sampled",
    sampled_period=5e-3,
    roads=("dry_asphalt",),
    speeds_kmh=(50.0,),
    stop_speed_kmh=15.0,
    draws=16,
    checked=2,
    start={"eps1": 22.0, "eps2": 60.0, "u1": 25000.0, "u3": 3000.0, "u4": 400.0},
    tune=("eps1", "eps5", "u4"),
    smoothing=0.05,
)


@pytest.fixture(scope="module")
def problem():
    return running_problem(CONFIG)


def test_a_step_down_the_slope_is_shorter_in_the_mean(problem):
    start = problem.given
    costs, slope = (np.asarray(x) for x in problem.costs_and_gradients(start, None))
    before, after = problem.judge(np.concatenate([start, start - 0.1 * slope / np.linalg.norm(slope)]))
    assert costs[0] == pytest.approx(before, abs=0.01)
    assert after < before - 0.3 * 0.1 * np.linalg.norm(slope)


def test_a_set_that_breaks_a_limit_is_worse_than_any_other(problem):
    shorter = dataclasses.replace(problem.judged, longest_cycle=1e-3)
    strict = dataclasses.replace(problem, judged=shorter)
    assert problem.judge(problem.given)[0] < 2
    assert strict.judge(problem.given)[0] > INFEASIBLE


def test_a_cost_with_a_charge_in_it_says_for_what(problem):
    assert with_charge(problem, INFEASIBLE - 1) == []
    (said,) = with_charge(problem, INFEASIBLE + 0.25)
    assert "the cost of 100.2500 has one in it, for a stop that does not end, or that locks" in said


def test_splits_are_drawn_apart_and_again_the_same():
    setup = Setup.of(dataclasses.replace(CONFIG, draws=2))
    training, again, test = (scattered(setup, split) for split in ("training", "training", "test"))
    np.testing.assert_array_equal(training.speed, again.speed)
    assert not np.any(np.isclose(training.speed, test.speed))
    phase = np.asarray(training.loop.driver.delay)
    assert np.all((phase >= 0) & (phase < CONFIG.sampled_period)) and np.ptp(phase) > 0
    assert np.all(training.ideal > 0)


CAR = TuningConfig.from_json(
    {
        "controller": "slip",
        "setting": "sampled",
        "vehicle": {"car": "small", "speed": "kalman"},
        "roads": ["wet_asphalt"],
        "speeds_kmh": [40.0],
        "stop_speed_kmh": 20.0,
        "draws": 16,
        "checked": 2,
        "start": {"slip": -0.4},
        "tune": ["slip"],
        "smoothing": 0.05,
        "sampled_period": 2e-3,
        "conditions": {"noise": 0.3},
    }
)


def test_what_validation_refutes_is_said():
    """A set that is no better than the untuned one, or breaks a limit there; not one that is better and keeps them."""

    def told(untuned: tuple, tuned: tuple, began: str = "untuned") -> list[str]:
        rows = (("untuned", untuned), ("tuned", tuned))
        return worse_apart(
            [SplitFigures("validation", which, 4, mean, mean, 0, locked, 0) for which, (mean, locked) in rows], began
        )

    assert told((1.2, 1), (1.1, 0)) == [] and told((1.2, 0), (1.1, 0)) == []
    (worse,) = told((1.2, 0), (1.3, 0))
    assert worse.endswith("no shorter than the untuned one, 30.0 and 20.0 % above ideal in the mean")
    assert "no shorter than the start, 30.0" in told((1.2, 0), (1.3, 0), "start")[0]
    (paid,) = told((1.2, 1), (1.3, 0))
    assert "of the untuned one 0 of 4 stops do not end, 1 lock above 15 km/h, 0 slide, 0 stick" in paid
    assert "1 lock above 15 km/h" in told((1.2, 0), (1.1, 1))[0]


def test_of_a_vehicle_every_wheel_is_another_and_the_fitted_slope_descends():
    problem = running_problem(CAR)
    batch = problem.judged
    loop = batch.loop
    for name in ("radius", "brake_efficiency"):
        front, rear = (np.asarray(getattr(axle, name)) for axle in loop.vehicle.axles)
        assert front.shape == (16,) and np.ptp(front) > 0 and np.ptp(front / rear) > 0
    assert np.ptp(loop.vehicle.mass) > 0 and np.ptp(loop.vehicle.height) > 0
    assert loop.channels[0].controller.wheel.radius == 0.285
    bias = np.asarray(batch.speedometer.accelerometer.bias)
    assert abs(bias.mean()) < 0.4 and 0.2 < bias.std() < 0.9
    assert len(set(np.concatenate([np.asarray(sensor.seed) for sensor in batch.sensor]))) == 32
    few = batch.of(np.array([3, 5]))
    assert few.speedometer.accelerometer.bias[0] == bias[3]
    assert few.loop.channels[1].brake.lag[1] == loop.channels[1].brake.lag[5]
    start = problem.given
    _, slope = problem.costs_and_gradients(start, None)
    before, after = problem.judge(np.concatenate([start, start - 0.1 * np.sign(slope)]))
    assert np.asarray(slope).shape == (1, 1) and after < before < 2


def test_roads_that_change_are_scattered_too(monkeypatch):
    """Every surface has its own coefficients in every lane; all changes of a road come sooner or later alike."""
    monkeypatch.setattr(scatter, "shortest", lambda loop, speed, horizon: np.zeros(len(speed)))
    changing = {"surfaces": ["dry_asphalt", "snow", "dry_asphalt"], "changes": [20.0, 35.0]}
    config = TuningConfig.from_json(
        {"setting": "sampled", "roads": [changing, "wet_asphalt"], "speeds_kmh": [80.0], "draws": 40, "checked": 3}
    )
    setup = Setup.of(config)
    batch = scattered(setup, "training")
    plant: Any = batch.loop.plant
    first, second = (np.asarray(change) for change in plant.road.changes)
    changes = first < NEVER / 2
    assert changes.sum() == 40
    np.testing.assert_allclose(second[changes] / first[changes], 35 / 20)
    logs = np.log(first[changes] / 20)
    assert abs(logs.mean()) < 0.05 and 0.06 < logs.std() < 0.15
    snow, dry = (np.log(np.asarray(plant.road.surfaces[i].c1)[changes]) for i in (1, 2))
    assert 0.06 < snow.std() < 0.15 and abs(np.corrcoef(snow, dry)[0, 1]) < 0.4
    still = scattered(
        dataclasses.replace(setup, config=dataclasses.replace(config, conditions={"change": 0.0})), "test"
    )
    np.testing.assert_allclose(np.sort(still.loop.plant.road.changes[0])[:3], 20.0)


def test_what_cannot_be_scattered_is_refused():
    with pytest.raises(ConfigError, match=r"setting = 'sampled'.*predictive_tracking predicts over a delay"):
        TuningConfig(controller="predictive_tracking", delay=0.01, lag=None, setting="sampled")
    with pytest.raises(ConfigError, match="conditions"):
        TuningConfig(setting="chain", conditions={"weight": 0.1})
    with pytest.raises(ConfigError, match="reference"):
        TuningConfig(setting="chain", reference="published")
