"""Fits of several parts with parameters in common, and loads that follow the acceleration with a lag."""

import dataclasses

import numpy as np
import pytest

from tests.oracles.log_scenarios import SURFACES, Channel, Logging, Sensors, Stop, on_two_axles
from tests.oracles.log_simulator import simulate
from tuning.logs.brake_log import read_log
from tuning.logs.car import car_from
from tuning.road.arrow_fit import Part, Prior, arrow_fit, joint_fit
from tuning.road.identify import identify
from tuning.road.vehicle_speed import ERRORS, _walk

DRY = SURFACES["dry_asphalt"]
CAR = {
    "load": 4280.0,
    "brake_efficiency": 40.0,
    "wheelbase": 2.7,
    "cg_height": 0.55,
    "cg_to_front": 2.7 * 3080 / (3080 + 4280),
    "axle": "front",
}


def test_parts_with_a_parameter_in_common_against_a_dense_solution():
    rng = np.random.default_rng(2)
    sizes, ats = (9, 14), (np.array([0, 1]), np.array([2, 1, 3]))
    parts, rows, target = [], [], []
    for i, (lanes, at) in enumerate(zip(sizes, ats)):
        by_shared, by_own = rng.normal(size=(lanes, 30, len(at))), rng.normal(size=(lanes, 30, 1))
        aim = rng.normal(size=(lanes, 30))

        def evaluate(shared, own, by_shared=by_shared, by_own=by_own, aim=aim):
            return by_shared @ shared + (by_own * own[:, None, :]).sum(-1) - aim, by_shared, by_own

        parts.append(Part(evaluate, np.zeros((lanes, 1)), at))
        first = 4 + sum(sizes[:i])
        for lane in range(lanes):
            row = np.zeros((30, 4 + sum(sizes)))
            row[:, at], row[:, first + lane] = by_shared[lane], by_own[lane, :, 0]
            rows.append(row)
            target.append(aim[lane])
    prior = Prior(np.array([0.0, 0.3, 0.0, 0.0]), np.array([np.inf, 0.05, np.inf, np.inf]))
    known = np.zeros((1, 4 + sum(sizes)))
    known[0, 1] = 1 / 0.05
    dense = np.vstack([*rows, known])
    solution = np.linalg.lstsq(dense, np.append(np.concatenate(target), 0.3 / 0.05), rcond=None)[0]
    fits = joint_fit(parts, np.ones(4), lower=np.full(4, -np.inf), prior=prior)
    for fit, at in zip(fits, ats):
        assert fit.converged
        np.testing.assert_allclose(fit.shared, solution[at], rtol=1e-6, atol=1e-9)
    # Apart from the level of the residuals, near 1 here, the covariance is that of the dense problem.
    covariance = np.linalg.inv(dense.T @ dense)
    for fit, at in zip(fits, ats):
        np.testing.assert_allclose(fit.plain, covariance[np.ix_(at, at)], rtol=0.2, atol=1e-5)
    alone = arrow_fit(parts[1].evaluate, np.ones(3), parts[1].own, lower=np.full(3, -np.inf))
    assert fits[1].plain[1, 1] < 0.7 * alone.plain[1, 1]


def of_two_axles(folder, *, lag=0.0, zero=0.0):
    sensors = dataclasses.replace(Sensors(), brake_pressure=Channel(0.2, quantum=0.05, bias=zero))
    logging = Logging(duration=1.3, sensors=sensors)
    stop = on_two_axles(Stop(speed=30.0, logging=logging), pitch_lag=lag)
    (record,) = simulate([stop])
    record.write_csv(folder / "log.csv")
    return identify(read_log(folder / "log.csv"), car_from(CAR))


def test_the_lag_of_the_load_is_found(tmp_path):
    result = of_two_axles(tmp_path, lag=0.05)
    (segment,) = result.segments
    lag = result.quantities["load_lag"]
    assert lag.value == pytest.approx(0.05, abs=max(4 * lag.spread, 2e-4)) and lag.spread < 2e-3
    assert segment.peak_friction == pytest.approx(DRY.peak_friction, rel=3e-3)
    assert segment.peak_slip == pytest.approx(DRY.peak_slip, abs=3e-3)
    assert result.verdict == "sound"


def test_the_zero_of_the_pressure_is_that_of_the_rolling_wheel(tmp_path):
    result = of_two_axles(tmp_path, zero=4.0)
    (segment,) = result.segments
    assert result.quantities["pressure_zero"].value == pytest.approx(4.0, abs=0.15)
    assert segment.peak_friction == pytest.approx(DRY.peak_friction, rel=0.01)
    assert any("pressure zero" in reason for reason in result.reasons)


def test_the_walk_of_an_integral_against_many_of_them():
    rng, clock = np.random.default_rng(1), np.arange(800) * 2e-3
    steps = 0.3 * rng.standard_normal((3000, 800)) * 2e-3
    walks = np.cumsum(steps, axis=1)
    columns = np.stack([np.ones(800), clock], axis=1)
    walks = walks - walks @ columns @ np.linalg.inv(columns.T @ columns) @ columns.T
    terms = _walk(clock, 0.3)
    assert terms.shape == (ERRORS - 2, 800)
    share = np.sum(terms**2) / np.sum(walks.var(axis=0))
    assert 0.7 < share < 1.02
