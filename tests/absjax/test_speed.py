"""Vehicle speed from wheels and an accelerometer: against plain loops and least squares, where wheels tell little."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.parameters import defaults_of, trainable_names
from absjax.sensors.noisy import NoisySensor
from absjax.signals import Signals
from absjax.speed import SPEED_ESTIMATORS, FixedGradient, KalmanSpeed, LargestRim, ReferenceSpeed
from absjax.speed.accelerometer import Accelerometer
from absjax.speed.base import SpeedSamples
from absjax.speed.run import after_rolling, estimate_speed
from tests.oracles import vehicle_speed as oracle

PERIOD = 0.01
GATED = {"speed_drift": 0.1, "bias_drift": 0.05, "bias_deviation": 0.8, "rim_noise": 0.1}
GATED |= {"below": 1.5, "above": 6.0, "deviation": 4.0, "slip": 0.004, "unbraked": 2.0}
ESTIMATORS = [KalmanSpeed(), ReferenceSpeed(refreshed_by=1), LargestRim(), FixedGradient()]


def braked(seconds=3.0, wheels=2, deceleration=8.0, bias=0.5, speed=30.0, seed=0, dips=0.15):
    """Half a second of rolling, then braking in which the rims dip below the speed in turn; true speed and log."""
    rng, time = np.random.default_rng(seed), PERIOD * np.arange(round(seconds / PERIOD))
    braking = time > 0.5
    truth = speed - np.where(braking, deceleration * (time - 0.5), 0.0)
    phase = np.arange(wheels) * 1.3
    dips = dips * np.maximum(np.sin(14 * time[:, None] + phase), 0.0) ** 2 + 0.02
    rims = truth[:, None] * np.where(braking[:, None], 1 - dips, 1.0) + 0.03 * rng.normal(size=(time.size, wheels))
    measured = np.where(braking, -deceleration, 0.0) + bias + 0.1 * rng.normal(size=time.size)
    return truth, SpeedSamples(measured, rims)


TRUTH, LOG = braked()


def speeds(estimator, samples=LOG, **given):
    return np.asarray(estimate_speed(estimator, samples, PERIOD, **given).speed)


@pytest.mark.parametrize("rims, wheels", [(2, 1), (2, None), (4, None)])
def test_filter_against_the_matrices_of_the_textbook(rims, wheels):
    """On the first wheels, or on all there are."""
    _, log = braked(wheels=rims)
    heard = log.rims[:, :wheels]
    found = estimate_speed(KalmanSpeed(**GATED, wheels=wheels), log, PERIOD, speed=heard[0].max()).path
    states, covariances = oracle.kalman(log.acceleration, heard, PERIOD, **GATED)
    np.testing.assert_allclose(np.stack([found.speed, found.bias], axis=1), states, rtol=1e-9, atol=1e-10)
    mine = np.array([[found.speed_variance, found.covariance], [found.covariance, found.bias_variance]])
    np.testing.assert_allclose(np.moveaxis(mine, 2, 0), covariances, rtol=1e-8, atol=1e-12)


def test_filter_that_trusts_its_wheels_against_least_squares_over_the_whole_log():
    """With gates that are never reached its last state is the least-squares one, every noise a residual."""
    wide, (_, samples) = {"below": 1e9, "above": 1e9, "deviation": 1e9, "slip": 0.0}, braked(seconds=0.9)
    found = estimate_speed(KalmanSpeed(**{**GATED, **wide}), samples, PERIOD).path
    count, rows, wanted = len(samples.acceleration), [], []

    def residual(weight, target, **at):
        row = np.zeros((count, 2))
        for place, factors in at.values():
            row[place] = factors
        rows.append(weight * row.ravel())
        wanted.append(weight * target)

    residual(1 / GATED["rim_noise"], samples.rims[0].max(), v=(0, (1, 0)))
    residual(1 / GATED["bias_deviation"], 0.0, b=(0, (0, 1)))
    for k in range(1, count):
        moved = PERIOD * samples.acceleration[k]
        residual(1 / (GATED["speed_drift"] * PERIOD**0.5), moved, now=(k, (1, 0)), before=(k - 1, (-1, PERIOD)))
        residual(1 / (GATED["bias_drift"] * PERIOD**0.5), 0.0, now=(k, (0, 1)), before=(k - 1, (0, -1)))
        for rim in samples.rims[k]:
            residual(1 / GATED["rim_noise"], rim, v=(k, (1, 0)))
    solved = np.linalg.lstsq(np.array(rows), np.array(wanted))[0].reshape(count, 2)
    np.testing.assert_allclose((found.speed[-1], found.bias[-1]), solved[-1], rtol=1e-9)


@pytest.mark.parametrize("form", [{}, {"rank": 2}, {"refreshed_by": 1}])
def test_reference_against_a_plain_loop(form):
    values = {"margin": 0.8, "refresh": 0.2, "steadiness": 4.0}
    found = speeds(ReferenceSpeed(**values, **form))
    np.testing.assert_allclose(found, oracle.reference(*LOG, PERIOD, **values, **form), rtol=1e-12)


def test_baselines_against_plain_loops():
    np.testing.assert_array_equal(speeds(LargestRim())[1:], LOG.rims.max(axis=1)[1:])
    wanted = [LOG.rims[0].max()]
    for rim in LOG.rims[1:, 1]:
        wanted.append(max(rim, wanted[-1] - 7.0 * PERIOD))
    np.testing.assert_allclose(speeds(FixedGradient(gradient=7.0, wheel=1)), wanted, rtol=1e-13)


def test_every_estimator_is_tested_here():
    assert {type(one) for one in ESTIMATORS} == set(SPEED_ESTIMATORS.values())


@pytest.mark.parametrize("estimator", [KalmanSpeed(unbraked=0.02, above=5.0), ESTIMATORS[1]], ids=lambda one: one.title)
def test_gradients_by_noise_levels_lanes_and_single_precision(estimator):
    names = trainable_names(estimator)

    def cost(point):
        found = estimate_speed(dataclasses.replace(estimator, **dict(zip(names, point))), LOG, PERIOD)
        return jnp.mean((found.speed - TRUTH) ** 2)

    point = np.array([float(getattr(estimator, name)) for name in names])
    steps = 1e-5 * np.maximum(point, 1e-2)
    points = np.concatenate([point + np.diag(steps), point - np.diag(steps)])
    ends = np.asarray(jax.jit(jax.vmap(cost))(points)).reshape(2, -1)
    exact = np.asarray(jax.jit(jax.grad(cost))(point))
    np.testing.assert_allclose(exact, (ends[0] - ends[1]) / (2 * steps), rtol=1e-5, atol=1e-8)
    assert np.all(np.abs(exact) > 1e-7)
    alone = jax.jit(cost)
    np.testing.assert_allclose(ends[0, :3], [alone(one) for one in points[:3]], rtol=1e-12)
    single = speeds(estimator, jax.tree.map(np.float32, LOG))
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, speeds(estimator), atol=2e-3)


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda one: one.title)
def test_standstill_gives_numbers_and_gradients(estimator):
    still = SpeedSamples(np.zeros(40), np.zeros((40, 2)))

    @jax.jit
    def total(leaves, samples):
        found = estimate_speed(jax.tree.unflatten(tree, leaves), samples, PERIOD, speed=0.0)
        return jnp.sum(found.speed[1:]) + jnp.sum(found.acceleration), found.speed

    leaves, tree = jax.tree.flatten(jax.tree.map(float, estimator))
    (_, found), slopes = jax.value_and_grad(total, (0, 1), has_aux=True)(leaves, still)
    assert np.all(np.asarray(found[1:]) >= 0.1)
    assert all(np.all(np.isfinite(x)) for x in jax.tree.leaves(slopes))


def test_all_wheels_locked_for_two_seconds_on_ice():
    """The filter coasts and finds the wheels again, the reference is held by its gradient; the largest rim is lost."""
    truth, samples = braked(seconds=6.0, deceleration=0.45, speed=20.0)
    locked = np.arange(200, 400)
    samples.rims[locked] = 0.0
    errors = {type(one): np.abs(speeds(one, samples) - truth) for one in ESTIMATORS}
    # The least slip of these wheels, that of a braked one, which may be theirs or not, and what their noise moves.
    rolling = (0.02 + 0.45 * KalmanSpeed().slip) * truth + 0.05
    assert np.all(errors[KalmanSpeed][50:] < rolling[50:])
    assert errors[ReferenceSpeed][locked].max() < (1.0 - 0.45) * 3.5  # its margin, less the car's deceleration
    assert errors[LargestRim][locked].min() > 15 and errors[FixedGradient][locked].max() > 10


def test_a_wheel_let_go_of_lifts_the_estimate_no_higher_than_its_rim():
    """The rear wheel slips deep, spins back and rolls freely while the front one brakes: it has no slip of a braked
    wheel, and the bias that was found while rolling stays found."""
    truth, samples = braked(dips=0.4)
    time = PERIOD * np.arange(len(truth))
    samples.rims[:, 1] = truth * np.where((time > 0.6) & (time < 1.2), 0.5, 1.0)
    found = estimate_speed(KalmanSpeed(slip=0.005), samples, PERIOD)
    after = time > 1.4
    assert np.abs(np.asarray(found.speed) - truth)[after].max() < 0.1
    assert np.abs(np.asarray(found.path.bias) - 0.5)[after].max() < 0.15


def test_the_filter_finds_the_bias_and_beats_the_rims():
    found = estimate_speed(KalmanSpeed(), LOG, PERIOD)
    assert abs(float(found.path.bias[49]) - 0.5) < 0.2
    relieved = np.asarray(found.acceleration) - (LOG.acceleration - 0.5)
    assert np.abs(relieved[50:]).mean() < 0.2
    errors = [np.abs(speeds(one) - TRUTH)[50:].mean() for one in (KalmanSpeed(), LargestRim())]
    assert errors[0] < 0.5 * errors[1]


def test_a_wheel_braked_less_refreshes_the_reference_and_a_locked_one_does_not():
    time = PERIOD * np.arange(300)
    truth = 25.0 - 3.0 * time
    rims = np.stack([0.8 * truth, 0.8 * truth, np.where(time < 2.0, 0.8 * truth, 0.99 * truth)], axis=1)
    biased = SpeedSamples(np.full(300, -1.5), rims)

    def error(samples, by):
        return speeds(ReferenceSpeed(refreshed_by=by, margin=0.5), samples, speed=25.0) - truth

    assert error(biased, None)[-1] == pytest.approx(2.99, abs=0.02)  # falls by 2 m/s^2 where the car does by 3
    assert abs(error(biased, 2)[-1]) < 0.35
    locked = biased._replace(rims=rims * [1.0, 1.0, 0.0])
    assert error(locked, 2)[-1] == pytest.approx(2.99, abs=0.05)


def test_a_wheel_that_spins_raises_the_reference_of_the_first_rank_only():
    rims = np.full((50, 4), 20.0)
    rims[20:, 3] = 30.0
    samples = SpeedSamples(np.zeros(50), rims)
    assert speeds(ReferenceSpeed(), samples)[-1] == 30 and speeds(ReferenceSpeed(rank=2), samples)[-1] == 20


@pytest.mark.parametrize("dtype, near", [(np.float64, 1e-9), (np.float32, 2e-4)])
def test_free_rolling_before_against_the_matrices_of_the_textbook(dtype, near):
    """The bias is found of what the accelerometer tells up to the time 0; of lanes as of one car."""
    sensor, estimator, samples = Accelerometer(seed=2, gain=0.3, slope=0.7), KalmanSpeed(**GATED), 150
    time = PERIOD * np.arange(-samples, 1)
    told = np.asarray(sensor.measure(np.zeros(time.size, dtype), time))
    states, covariances = oracle.kalman(told, np.full((time.size, 2), 25.0), PERIOD, **GATED)

    def rolled(speed):
        return after_rolling(estimator, sensor, speed, 2, PERIOD, samples)

    found = jax.jit(jax.vmap(rolled))(np.array([10.0, 25.0], dtype))
    assert found.bias.dtype == dtype and abs(found.bias[1] - 0.5) < 0.05
    np.testing.assert_allclose((found.speed[1], found.bias[1]), states[-1], rtol=near)
    np.testing.assert_allclose(found.bias_variance[1], covariances[-1][1, 1], rtol=near)
    np.testing.assert_allclose(found.bias[0], jax.jit(rolled)(found.speed.dtype.type(10.0)).bias, rtol=near)


def test_without_rolling_before_an_estimator_begins_as_it_does():
    begun = after_rolling(KalmanSpeed(), Accelerometer(), np.float64(20.0), 2, PERIOD, 0)
    jax.tree.map(np.testing.assert_array_equal, begun, KalmanSpeed().initial_state(np.float64(20.0), 2))


def test_an_estimate_too_high_to_believe_its_wheels_finds_them_where_the_car_does_not_brake():
    """All wheels roll, a quarter below it; where the car brakes for the slip they seem to have, it is not found."""
    samples = SpeedSamples(np.full(200, 0.1), np.full((200, 2), 15.0))
    found, lost, braking = (
        speeds(KalmanSpeed(unbraked=u, bias_deviation=0.02), samples._replace(acceleration=a), speed=20.0)
        for u, a in ((0.3, samples.acceleration), (1e-3, samples.acceleration), (0.3, np.full(200, -1.0)))
    )
    assert abs(found[-1] - 15.0) < 0.05 and lost[-1] > 20.0 and braking[-1] == pytest.approx(18.0, abs=0.1)


def test_a_released_wheel_that_turns_steadily_takes_the_estimate_to_its_rim_where_pressures_are_told():
    """However far it is below, but not while it spins up, nor at a pressure that may hold it at a slip."""
    estimator, truth = KalmanSpeed(bias_deviation=0.02), 15.0 - 4.0 * PERIOD * np.arange(40)
    spun_up = np.maximum(np.arange(40) - 19, 0) * 50.0 * PERIOD

    def error_of(rear, pressure):
        def body(state, sample):
            rims, released = sample
            told = None if pressure is None else (60.0, jnp.where(released, pressure, 60.0))
            return estimator.update(state, -4.0, tuple(rims), PERIOD, told), None

        rims = np.stack([0.8 * truth, rear], axis=1)
        begun = estimator.initial_state(jnp.asarray(20.0), 2)
        end, _ = jax.lax.scan(body, begun, (rims, np.arange(40) >= 20))
        return float(end.speed) - truth[-1]

    assert abs(error_of(truth, 0.0)) < 0.6
    assert min(error_of(truth, pressure) for pressure in (None, 8.0)) > 4.9
    assert error_of(truth - 10.0 + spun_up, 0.0) > 4.0
    with pytest.raises(ValueError, match="2 pressures are given with the rims of 1 wheels"):
        estimator.update(estimator.initial_state(20.0, 1), -4.0, (20.0,), PERIOD, (60.0, 0.0))


def test_accelerometer():
    time, braking = PERIOD * np.arange(4000), np.full(4000, -6.0)
    drawn = np.asarray(Accelerometer(noise=0.2, seed=3).measure(braking, time)) + 6.0
    assert drawn.mean() == pytest.approx(0.5, abs=0.02) and drawn.std() == pytest.approx(0.2, rel=0.05)
    assert np.asarray(Accelerometer(noise=0.2, seed=3).measure(-6.0, time[7])) + 6 == pytest.approx(drawn[7], rel=1e-12)
    scaled = np.asarray(Accelerometer(noise=0.2, seed=3, gain=0.05, slope=0.3).measure(braking, time)) + 6.0
    np.testing.assert_allclose(scaled, drawn - 0.05 * 6.0 + np.where(time > 0, 0.3, 0.0), rtol=1e-9)
    signals = Signals(20.0, 0.0, 60.0, np.zeros(9), 0.3, 40.0, 0.5, time[:9])
    wheel = np.asarray(NoisySensor(noise=0.2, seed=3).begin(signals)[0].acceleration_offset)
    assert np.abs(wheel - (drawn[:9] - 0.5)).min() > 1e-4


@pytest.mark.parametrize(
    "make, said",
    [
        (lambda: KalmanSpeed(rim_noise=0.0), r"KalmanSpeed\.rim_noise = 0 is outside"),
        (lambda: KalmanSpeed(wheels=0), r"KalmanSpeed\.wheels = 0"),
        (lambda: ReferenceSpeed(rank=0), r"ReferenceSpeed\.rank = 0"),
        (lambda: ReferenceSpeed(refreshed_by=-1), r"ReferenceSpeed\.refreshed_by = -1"),
        (lambda: FixedGradient(wheel=-1), r"FixedGradient\.wheel = -1"),
        (lambda: Accelerometer(noise=-1.0), r"Accelerometer\.noise = -1"),
        (lambda: Accelerometer(gain=-1.0), r"Accelerometer\.gain = -1"),
        (lambda: speeds(KalmanSpeed(wheels=3)), "KalmanSpeed needs the rim speeds of 3 wheels; 2 are given"),
        (lambda: speeds(ReferenceSpeed(refreshed_by=2)), "ReferenceSpeed needs the rim speeds of 3 wheels"),
    ],
)
def test_what_cannot_be_is_refused_by_name(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_defaults_are_within_the_spans_of_a_tuner():
    for kind in SPEED_ESTIMATORS.values():
        spans = {f.name: f.metadata["span"] for f in dataclasses.fields(kind) if f.metadata.get("span")}
        assert all(spans[n][0] <= defaults_of(kind)[n] <= spans[n][1] for n in spans)
