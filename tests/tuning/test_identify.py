"""Identification on logs from an independent simulator, whose true parameters lie beside them."""

import dataclasses
import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import curve_fit, lsq_linear

import tuning
from absjax.plant.wheel import Wheel
from absjax.tyres.burckhardt import Burckhardt
from tuning.logs.brake_log import BrakeLog, read_log
from tuning.logs.tables import LogError
from tuning.road.arrow_fit import arrow_fit
from tuning.road.changes import find_stretches
from tuning.road.identify import Identification, identify
from tuning.road.samples import FrictionSamples, friction_samples, is_rig

DATA = Path(tuning.__file__).parent / "data"


def case(name):
    truth = json.loads((DATA / f"{name}.json").read_text())
    return read_log(DATA / f"{name}.csv"), Wheel(load=truth["load"]), truth


def check(result, truth):
    assert [len(result.segments)] == [len(truth["burckhardt"])]
    for segment, c, start in zip(result.segments, truth["burckhardt"], truth["surface_start"]):
        peak = Burckhardt(*c).peak()
        assert abs(segment.start - start) < 0.03
        assert segment.peak_friction == pytest.approx(float(peak.friction), rel=0.02)
        assert segment.peak_slip == pytest.approx(float(peak.slip), abs=0.02)
        assert all(segment.identifiable.values()) and not segment.statements
        for name, true in zip(("c1", "c2", "c3"), c):
            low, high = segment.ci95[name]
            assert abs(segment.parameters[name] - true) < 1.5 * (high - low) / 2
            assert (high - low) / 2 < 0.05 * true
        assert 0.9 < segment.residual_rms < 1.1


def test_rig_with_measured_force():
    log, wheel, truth = case("rig_65kmh")
    result = identify(log, wheel)
    check(result, truth)
    assert result.segments[0].method == "curve fit"


def test_rig_without_force_by_output_error():
    log, wheel, truth = case("rig_65kmh")
    log = dataclasses.replace(log, force=None)
    assert is_rig(log)
    result = identify(log, wheel)
    check(result, truth)
    assert result.segments[0].method == "output error"


@pytest.fixture(scope="module")
def stop_result():
    log, wheel, truth = case("stop_dry_wet")
    return identify(log, wheel), truth


def test_stop_with_a_change_of_surface(stop_result):
    check(*stop_result)
    road = stop_result[0].road()
    assert float(road.friction(-0.1, 1.0, 0.0)) == pytest.approx(
        float(Burckhardt(1.2801, 23.99, 0.52).friction(-0.1)), rel=2e-3
    )


def test_intervals_are_those_of_95_percent_by_another_least_squares():
    """White noise on the force, none on the speeds: half widths are 1.96 standard deviations as SciPy's curve_fit has
    them. Ours are a little wider, as they are robust against noise that is not white."""
    rng, wheel = np.random.default_rng(0), Wheel(load=2850.0)
    time = np.arange(10_000) * 1e-3
    slip, speed = -0.13 - 0.12 * np.sin(43 * time), np.full(time.size, 18.0)
    friction = np.asarray(Burckhardt(1.2, 27.0, 0.6).friction(slip)) + 0.02 * rng.standard_normal(time.size)
    log = BrakeLog("made", time, (1 + slip) * speed / 0.3, speed, np.full(time.size, 40.0), force=2850.0 * friction)
    (segment,) = identify(log, wheel).segments

    def magnitude(s, c1, c2, c3):
        return c1 * (1 - np.exp(-c2 * s)) - c3 * s

    found, covariance = curve_fit(magnitude, -slip, -friction, (1.0, 20.0, 0.3))
    for name, value, deviation in zip(("c1", "c2", "c3"), found, np.sqrt(np.diag(covariance))):
        low, high = segment.ci95[name]
        assert (low + high) / 2 == pytest.approx(value, abs=0.02 * deviation)
        assert (high - low) / 2 == pytest.approx(1.96 * deviation, rel=0.15)


def test_result_goes_through_json(stop_result):
    result = stop_result[0]
    data = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert Identification.from_json(data) == result
    assert {"segments", "log", "version"} <= set(data)
    keys = {"start", "end", "c1", "c2", "c3", "peak_friction", "peak_slip", "ci95", "identifiable"}
    assert keys <= set(data["segments"][0])


def test_a_log_that_never_passes_the_peak_says_so():
    log, wheel, _ = case("rig_65kmh")
    result = identify(log.window(end=0.21), wheel)
    segment = result.segments[0]
    assert segment.largest_slip < segment.peak_slip
    assert segment.identifiable == {"c1": segment.identifiable["c1"], "c2": True} | dict.fromkeys(
        ("c3", "peak_friction", "peak_slip"), False
    )
    assert any("c3 is not identifiable: slip reached" in statement for statement in segment.statements)


def test_a_log_without_braking_and_one_of_uneven_sampling_are_refused():
    log, wheel, _ = case("rig_65kmh")
    rolling = dataclasses.replace(log, wheel_speed=log.vehicle_speed / 0.3)
    with pytest.raises(LogError, match="holds no braking"):
        identify(rolling, wheel)
    time = log.time.copy()
    time[1000] += 4e-4
    with pytest.raises(LogError, match=r"not uniform, the step is 0\.0014 s at 0\.999 s"):
        identify(dataclasses.replace(log, time=time), wheel)


@pytest.mark.parametrize("kind, source", [("force", "force"), ("acceleration", "acceleration"), ("neither", "speed")])
def test_friction_samples_come_from_the_best_signal(kind, source):
    log, wheel, _ = case("stop_dry_wet")
    if kind == "force":
        log = dataclasses.replace(log, force=log.acceleration * float(wheel.mass))
    if kind == "neither":
        log = dataclasses.replace(log, acceleration=None)
    samples = friction_samples(log, wheel)
    assert samples.source == source
    middle = slice(300, -300)
    expected = log.acceleration if log.acceleration is not None else case("stop_dry_wet")[0].acceleration
    assert np.sqrt(np.mean((samples.friction - expected / 9.81)[middle] ** 2)) < 0.05


def test_change_instants_of_three_surfaces():
    rng = np.random.default_rng(0)
    time = np.arange(3000) * 1e-3
    slip = -0.15 - 0.1 * np.sin(40 * time)
    surfaces = [Burckhardt(1.28, 24.0, 0.52), Burckhardt(0.86, 34.0, 0.35), Burckhardt(1.2, 25.0, 0.54)]
    friction = np.concatenate([np.asarray(s.friction(slip[i * 1000 : (i + 1) * 1000])) for i, s in enumerate(surfaces)])
    stretches = find_stretches(FrictionSamples(time, slip, friction + 0.01 * rng.standard_normal(3000), "force"))
    assert [abs(s.first - i * 1000) < 5 for i, s in enumerate(stretches)] == [True] * 3


def test_arrow_fit_against_a_dense_solution():
    rng = np.random.default_rng(1)
    shared_matrix, own_matrix = rng.normal(size=(6, 20, 2)), rng.normal(size=(6, 20, 1))
    target = rng.normal(size=(6, 20))

    def evaluate(shared, own):
        return shared_matrix @ shared + (own_matrix * own[:, None, :]).sum(-1) - target, shared_matrix, own_matrix

    fit = arrow_fit(evaluate, np.ones(2), np.zeros((6, 1)), lower=np.full(2, -np.inf))
    dense = np.zeros((120, 8))
    dense[:, :2] = shared_matrix.reshape(120, 2)
    for lane in range(6):
        dense[lane * 20 : (lane + 1) * 20, 2 + lane] = own_matrix[lane, :, 0]
    solution = np.linalg.lstsq(dense, target.ravel(), rcond=None)[0]
    assert fit.converged
    np.testing.assert_allclose(np.concatenate([fit.shared, fit.own[:, 0]]), solution, rtol=1e-6, atol=1e-9)


def test_arrow_fit_ends_where_rounding_alone_is_left():
    """Every cost is a little higher than the one before: no step from the minimum is ever accepted."""
    rng, costs = np.random.default_rng(3), itertools.count()
    matrix, target = rng.normal(size=(4, 30, 2)), rng.normal(size=(4, 30))

    def evaluate(shared, own):
        return (matrix @ shared - target) * (1 + 1e-13 * next(costs)), matrix, np.zeros((4, 30, 0))

    fit = arrow_fit(evaluate, np.ones(2), np.zeros((4, 0)), lower=np.full(2, -np.inf))
    assert fit.converged and next(costs) < 8
    solution = np.linalg.lstsq(matrix.reshape(-1, 2), target.ravel(), rcond=None)[0]
    np.testing.assert_allclose(fit.shared, solution, rtol=1e-6, atol=1e-9)


def test_arrow_fit_on_bounds_is_the_bounded_solution_within_few_steps():
    """Alike parameters, as a car's are: those off their bounds have to know of those that stay there."""
    rng = np.random.default_rng(2)
    matrix = rng.normal(size=(4, 30, 1)) + 0.1 * rng.normal(size=(4, 30, 4))
    target = matrix @ np.array([1.0, -2.0, 3.0, -0.5]) + 0.1 * rng.normal(size=(4, 30))

    def evaluate(shared, own):
        return matrix @ shared - target, matrix, np.zeros((4, 30, 0))

    lower = np.array([-np.inf, 0.0, 0.0, 0.0])
    fit = arrow_fit(evaluate, np.ones(4), np.zeros((4, 0)), lower=lower)
    bounded = lsq_linear(matrix.reshape(-1, 4), target.ravel(), (lower, np.inf), tol=1e-14)
    assert np.any(bounded.active_mask) and fit.converged and fit.iterations < 10
    np.testing.assert_allclose(fit.shared, bounded.x, rtol=1e-6, atol=1e-9)
    fit = arrow_fit(evaluate, np.full(4, 9.0), np.zeros((4, 0)), lower=np.full(4, 9.0))
    assert fit.converged and list(fit.shared) == [9.0] * 4
