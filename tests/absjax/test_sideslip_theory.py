"""Excitation, driving patterns and offsets against plain loops; Kalman filters against a plain loop."""

import jax
import numpy as np
import pytest

from absjax.sideslip.baselines import KinematicIntegration, extended_filter, linear_filter
from absjax.sideslip.car import Car
from absjax.sideslip.excitation import CIRCLE, STRAIGHT, VARIED, excitation, intervals, patterns, regressors
from absjax.sideslip.observer import better_gains
from absjax.sideslip.offsets import OffsetAdaptation
from absjax.sideslip.run import estimate
from tests.absjax.test_sideslip import samples_of
from tests.oracles.car_simulator import CAR, drive, slalom

PERIOD = 0.01
KNOWN = Car(**CAR)
LOG = slalom(6.0, amplitude=0.045)
SAMPLES = samples_of(LOG)


def run(estimator, samples=SAMPLES):
    return estimate(estimator, KNOWN, samples, PERIOD).raise_if_failed()


@pytest.fixture(scope="module")
def observed():
    return run(better_gains()).estimate


def test_regressors_against_differences_of_the_force(observed):
    """eta_v goes to the slope as the deviation goes to zero, and is a chord otherwise."""
    observer = better_gains()
    slope, force = regressors(observer, KNOWN, SAMPLES, observed)
    chord, moved = regressors(observer, KNOWN, SAMPLES, observed, 1e-5)
    np.testing.assert_allclose(chord, slope, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(moved, force, atol=1e-3)
    chord, moved = regressors(observer, KNOWN, SAMPLES, observed, 0.2)
    np.testing.assert_allclose(0.2 * chord, np.asarray(observed.friction) * (force - moved), atol=1e-9)


def test_windows_of_condition_9_against_a_plain_loop(observed):
    found = excitation(better_gains(), KNOWN, SAMPLES, observed, PERIOD, window=1.0, deviations=(0.0,))
    slope, force = (np.asarray(x) for x in regressors(better_gains(), KNOWN, SAMPLES, observed))
    scale = 0.5 * np.maximum(np.asarray(observed.longitudinal_speed), 3.0) / 26.0
    for k in (20, 150, 400, 599):
        inside = slice(max(0, k - 99), k + 1)
        pair = np.stack([slope[inside], force[inside]])
        matrix = PERIOD * pair @ pair.T
        np.testing.assert_allclose(found.determinant[k], np.linalg.det(matrix), rtol=1e-6, atol=1e-9)
        scaled = np.stack([scale[inside] * slope[inside], force[inside]])
        least = np.linalg.eigvalsh(PERIOD * scaled @ scaled.T)[0]
        np.testing.assert_allclose(found.eigenvalue[k], least, rtol=1e-6, atol=1e-9)
        if k > 100:
            told = 0.3 * np.sqrt(0.1 * np.linalg.inv(matrix)[1, 1])
            np.testing.assert_allclose(found.deviation[k], told, rtol=1e-6)


def test_theta_is_told_in_the_slalom_and_not_before_it(observed):
    found = excitation(better_gains(), KNOWN, SAMPLES, observed, PERIOD)
    assert not found.identifiable[:100].any() and found.identifiable[300:].all()
    assert found.pattern[90] == STRAIGHT and found.pattern[-1] == VARIED
    assert [code for *_, code in intervals(found.identifiable.astype(int), LOG["time_s"])] == [0, 1]
    with pytest.raises(ValueError, match=r"window = 0\.01 s"):
        excitation(better_gains(), KNOWN, SAMPLES, observed, PERIOD, window=0.01)


def test_patterns_of_section_7():
    time = np.arange(0, 12, PERIOD)
    lateral = np.where(time < 4, 0.1, np.where(time < 8, 3.0, 3.0 * np.sin(3 * time)))
    found = patterns(lateral, 200)
    assert found[300] == STRAIGHT and found[700] == CIRCLE and found[1150] == VARIED


def test_short_intervals_join_the_one_before():
    codes = np.repeat([0, 1, 0, 1], [100, 10, 100, 100])
    found = intervals(codes, np.arange(310) * PERIOD)
    assert [(round(a, 2), round(b, 2), code) for a, b, code in found] == [(0.0, 2.1, 0), (2.1, 3.09, 1)]


def test_kinematic_integration_against_a_loop():
    found = run(KinematicIntegration()).estimate
    vx, vy = SAMPLES.wheel_speed[0].mean() * CAR["radius"], 0.0
    for k in range(200):
        np.testing.assert_allclose((found.longitudinal_speed[k], found.lateral_speed[k]), (vx, vy), atol=1e-10)
        ax, ay = SAMPLES.longitudinal_acceleration[k] / 1.04905, SAMPLES.lateral_acceleration[k] / 1.14715
        r = SAMPLES.yaw_rate[k]
        vx, vy = vx + PERIOD * (ax + r * vy), vy + PERIOD * (ay - r * vx)


@pytest.mark.parametrize("kind", [linear_filter, extended_filter])
def test_kalman_filter_against_the_textbook(kind):
    """One filter step with differences for the Jacobians, and the covariance in its plain form."""
    estimator = kind()
    first, second = (jax.tree.map(lambda x, k=k: x[k], SAMPLES) for k in (200, 201))
    state = estimator.initial_state(KNOWN, first)
    state, *_ = estimator.step(KNOWN, state, first, PERIOD)
    after, told, _ = estimator.step(KNOWN, state, second, PERIOD)
    from absjax.sideslip.forces import forces

    level = estimator.accelerometer.level(second)
    loads = KNOWN.loads(level.longitudinal_acceleration, level.lateral_acceleration)

    def accelerations(mean):
        velocity = (state.longitudinal_speed, mean[0], mean[1])
        f = forces(estimator.friction_model, KNOWN, velocity, level.steering_angle, level.wheel_speed, loads)
        theta = mean[2] if len(mean) > 2 else 1.0
        return float(theta * f.lateral / KNOWN.mass), float(theta * f.yaw / KNOWN.yaw_inertia)

    def ahead(mean):
        lateral, yaw = accelerations(mean)
        rates = [lateral - mean[1] * float(state.longitudinal_speed), yaw, 0.0][: len(mean)]
        return mean + PERIOD * np.array(rates)

    def measured(mean):
        return np.array([accelerations(mean)[0], mean[1]])

    def jacobian(function, at):
        steps = np.eye(len(at)) * 1e-6
        return np.stack([(function(at + h) - function(at - h)) / 2e-6 for h in steps], axis=1)

    mean, covariance = np.asarray(state.mean), np.asarray(state.covariance)
    H = jacobian(measured, mean)
    R = np.diag([float(estimator.acceleration_noise) ** 2, float(estimator.yaw_noise) ** 2])
    K = covariance @ H.T @ np.linalg.inv(H @ covariance @ H.T + R)
    mean = mean + K @ (np.array([level.lateral_acceleration, level.yaw_rate]) - measured(mean))
    covariance = (np.eye(len(mean)) - K @ H) @ covariance
    F = jacobian(ahead, mean)
    drifts = [estimator.lateral_drift, estimator.yaw_drift, estimator.friction_drift][: len(mean)]
    covariance = F @ covariance @ F.T + PERIOD * np.diag(np.square(drifts))
    np.testing.assert_allclose(told.lateral_speed, state.mean[0])
    np.testing.assert_allclose(after.mean, ahead(mean), rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(after.covariance, covariance, rtol=1e-4, atol=1e-9)


def test_the_extended_filter_finds_a_slippery_road():
    found = run(extended_filter()).estimate
    assert abs(np.mean(found.friction[400:]) - 0.35) < 0.15
    assert np.all(np.asarray(run(linear_filter()).estimate.friction) == 1)


def test_bank_is_adapted_and_off_by_default():
    log = drive(
        lambda t: 0.03 * np.sin(2 * np.pi * 0.4 * t),
        lambda t: 0.3,
        14.0,
        12.0,
        bank=lambda t: 0.06 * min(max(t - 2.0, 0.0), 1.0),
        seed=2,
    )
    samples, settled = samples_of(log), slice(700, None)
    with_bank, without = run(better_gains(offsets=OffsetAdaptation()), samples), run(better_gains(), samples)
    assert without.insight.offsets is None
    bank = np.asarray(with_bank.insight.offsets.bank)
    assert np.abs(bank[:150]).max() < 0.02 and abs(bank[settled].mean() - 0.06) < 0.02
    truth = -np.arctan2(log["true_vy_m_s"], log["true_vx_m_s"])
    rms = [np.sqrt(np.mean((np.asarray(x.estimate.side_slip) - truth)[settled] ** 2)) for x in (with_bank, without)]
    assert rms[0] < 0.7 * rms[1]
