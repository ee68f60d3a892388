"""The side-slip observer against a plain loop, its parts against differences, streams and batches against loops."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.lanes import stacked
from absjax.results import RolloutError
from absjax.sideslip import FRICTION_MODELS, MONITORS, XI_RULES
from absjax.sideslip.car import Car, CarSample
from absjax.sideslip.forces import forces
from absjax.sideslip.friction import TanhFriction
from absjax.sideslip.monitor import NoMonitor
from absjax.sideslip.observer import SideSlipObserver, better_gains, published_gains
from absjax.sideslip.offsets import OffsetAdaptation
from absjax.sideslip.run import estimate, estimate_logs, padded
from tests.oracles.car_simulator import CAR, COLUMNS, slalom
from tests.oracles.side_slip import observe

PERIOD = 0.01
KNOWN = Car(**CAR)
LOG = slalom(6.0, amplitude=0.045)
SHORT = {name: column[:150] for name, column in LOG.items()}
run = jax.jit(lambda observer, samples: estimate(observer, KNOWN, samples, PERIOD))


def samples_of(log):
    columns = [log[name] for name in COLUMNS]
    return CarSample(*columns[:4], np.stack(columns[4:], axis=1))


def plain(log):
    samples = samples_of(log)
    return dict(zip(("ax", "ay", "r", "delta", "w"), samples))


@pytest.mark.parametrize("gains", [{}, {"lateral_gain": 0.6, "friction_gain": 10.0}, {"adapts": False}])
def test_against_a_plain_loop(gains):
    found = run(SideSlipObserver(**gains), samples_of(LOG)).raise_if_failed()
    wanted = observe(CAR, plain(LOG), **gains)
    assert 0 < wanted[:, 4].mean() < 1
    for mine, his in zip((*found.estimate, found.insight.low), wanted.T):
        np.testing.assert_allclose(mine, his, atol=1e-10)


def test_a_stream_gives_the_numbers_of_the_scan():
    observer, samples = better_gains(), samples_of(SHORT)
    at = [jax.tree.map(lambda x, k=k: jnp.asarray(x[k]), samples) for k in range(150)]
    state, step = observer.initial_state(KNOWN, at[0]), jax.jit(observer.step)
    told = []
    for sample in at:
        state, found, _ = step(KNOWN, state, sample, PERIOD)
        told.append(np.stack(found))
    np.testing.assert_allclose(np.array(told).T, np.stack(run(observer, samples).estimate), rtol=1e-12, atol=1e-14)


def test_logs_of_unequal_length_and_other_cars_side_by_side():
    other = {**CAR, "mass": 1500.0, "yaw_inertia": 2000.0, "driven_front": 0.0, "driven_rear": 1.0}
    logs, cars = [SHORT, {name: column[:90] for name, column in LOG.items()}], [KNOWN, Car(**other)]
    together = estimate_logs(better_gains(), stacked(cars), padded([samples_of(log) for log in logs]), PERIOD)
    for i, (log, car) in enumerate(zip(logs, cars)):
        alone = estimate(better_gains(), car, samples_of(log), PERIOD)
        for all_, one in zip(together.estimate, alone.estimate):
            np.testing.assert_allclose(all_[i, : len(one)], one, rtol=1e-12, atol=1e-14)
            assert np.all(all_[i, len(one) :] == all_[i, -1])


def test_parameter_sets_side_by_side():
    gains = jnp.array([0.5, 2.0])
    together = jax.vmap(lambda gain: run(SideSlipObserver(lateral_gain=gain), samples_of(SHORT)).estimate)(gains)
    for i, gain in enumerate(gains):
        alone = run(SideSlipObserver(lateral_gain=float(gain)), samples_of(SHORT)).estimate
        np.testing.assert_allclose(np.stack(together)[:, i], np.stack(alone), rtol=1e-12, atol=1e-14)


def test_gradient_in_every_parameter_against_differences():
    """Away from the monitor's switch: without a monitor."""
    observer = dataclasses.replace(better_gains(), monitor=NoMonitor(), offsets=OffsetAdaptation(), start=0.6)
    samples = samples_of({name: column[150:300] for name, column in LOG.items()})

    @jax.jit
    def cost(leaves, car):
        found = estimate(jax.tree.unflatten(tree, leaves), car, samples, PERIOD).estimate
        return jnp.mean(found.side_slip**2 + 0.1 * found.friction**2)

    leaves, tree = jax.tree.flatten(jax.tree.map(lambda x: jnp.asarray(x, float), observer))
    exact = jax.jit(jax.grad(cost, (0, 1)))(leaves, KNOWN)
    names = [jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_leaves_with_path(observer)]
    told = 0
    for i, (name, value) in enumerate(zip(names, leaves)):
        h = 1e-5 * max(abs(float(value)), 1e-2)
        ends = [cost([*leaves[:i], value + e, *leaves[i + 1 :]], KNOWN) for e in (h, -h)]
        np.testing.assert_allclose(exact[0][i], (ends[0] - ends[1]) / (2 * h), rtol=1e-6, atol=1e-9, err_msg=name)
        told += abs(float(exact[0][i])) > 1e-6
    assert told >= 12
    h = 1e-3
    ends = [cost(leaves, dataclasses.replace(KNOWN, height=KNOWN.height + e)) for e in (h, -h)]
    np.testing.assert_allclose(exact[1].height, (ends[0] - ends[1]) / (2 * h), rtol=1e-5)


@pytest.mark.parametrize("model", FRICTION_MODELS.values())
def test_friction_is_monotone_and_its_slope_a_difference(model):
    curve, slips = model(), np.linspace(1e-3, 1.2, 400)
    used = np.asarray(curve.friction(slips))
    assert curve.friction(0.0) == 0 and np.all(np.diff(used) > -1e-12)
    assert np.all(used <= 1 + 1e-12) and used[-1] > 0.99
    differences = (curve.friction(slips + 1e-6) - curve.friction(slips - 1e-6)) / 2e-6
    np.testing.assert_allclose(curve.stiffness(slips), differences, rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("model", FRICTION_MODELS.values())
def test_slopes_of_the_forces_against_differences(model):
    car, wheels = KNOWN, np.array([52.0, 50.0, 49.0, 48.0])
    loads = car.loads(-2.0, 3.0)

    def of(vy):
        return forces(model(), car, (16.0, vy, 0.2), 0.06, wheels, loads)

    for vy in (-2.0, -0.1, 0.0, 0.4):
        found, ends = of(vy), (of(vy + 1e-5), of(vy - 1e-5))
        np.testing.assert_allclose(found.lateral_slope, (ends[0].lateral - ends[1].lateral) / 2e-5, rtol=1e-6)
        np.testing.assert_allclose(found.yaw_slope, (ends[0].yaw - ends[1].yaw) / 2e-5, rtol=1e-5, atol=1e-2)
        assert found.lateral_slope <= 0


def test_loads_carry_the_car():
    loads = np.asarray(KNOWN.loads(-3.0, 2.0))
    np.testing.assert_allclose(loads.sum(), 1250 * 9.81)
    moment = loads @ np.asarray(KNOWN.ahead)
    np.testing.assert_allclose(moment, 3.0 * 1250 * 0.55)  # pitches onto the front axle under braking
    assert loads[1] > loads[0] and np.all(np.asarray(KNOWN.loads(0.0, 30.0)) >= 0.02 * 1250 * 9.81)


def test_published_rule_and_others():
    rules = {name: rule() for name, rule in XI_RULES.items()}
    assert rules["published"].xi(-2e3, 1e3, 5e2, 6e2) == -5e3
    assert rules["published"].xi(-2e3, 1e3, 5e2, 4e2) == -2e3
    assert rules["slope"].xi(-2e3, 1e3, 5e2, 6e2) == -2e3
    assert rules["constant"].xi(-2e3, 1e3, 5e2, 6e2) == -2e4


@pytest.mark.parametrize(
    "parts",
    [{"monitor": m()} for m in MONITORS.values()]
    + [{"rule": r()} for r in XI_RULES.values()]
    + [{"friction_model": f()} for f in FRICTION_MODELS.values()],
)
def test_parts_can_be_swapped(parts):
    found = run(better_gains(**parts), samples_of(SHORT)).raise_if_failed()
    assert np.all(np.abs(np.asarray(found.estimate.side_slip)) < 0.5)


def test_the_friction_of_the_road_is_found():
    found = run(better_gains(), samples_of(LOG)).estimate
    fixed = run(better_gains(adapts=False), samples_of(LOG)).estimate
    settled = slice(300, None)
    assert abs(np.mean(found.friction[settled]) - 0.35) < 0.1
    truth = -np.arctan2(LOG["true_vy_m_s"], LOG["true_vx_m_s"])
    errors = [np.sqrt(np.mean((np.asarray(x.side_slip) - truth)[settled] ** 2)) for x in (found, fixed)]
    assert errors[0] < 0.5 * errors[1]


def test_single_precision():
    single = estimate(*jax.tree.map(jnp.float32, (published_gains(), KNOWN, samples_of(LOG), PERIOD)))
    assert single.estimate.lateral_speed.dtype == jnp.float32
    double = run(published_gains(), samples_of(LOG))
    same = np.asarray(single.insight.low) == np.asarray(double.insight.low)
    assert same.mean() > 0.99
    for a, b in zip(single.estimate, double.estimate):
        np.testing.assert_allclose(a, b, atol=5e-3)


@pytest.mark.parametrize("rate", [50, 200])
def test_other_sampling_rates(rate):
    """Half and twice the rate of the source, on the same drive without noise."""
    rms = {}
    for hertz in (100, rate):
        log = slalom(5.0, amplitude=0.045, noise=0.0, rate=hertz)
        found = estimate(better_gains(), KNOWN, samples_of(log), 1 / hertz).estimate
        truth = -np.arctan2(log["true_vy_m_s"], log["true_vx_m_s"])
        rms[hertz] = np.sqrt(np.mean((np.asarray(found.side_slip) - truth)[hertz:] ** 2))
    assert rms[rate] < 1.2 * rms[100]


def test_diverging_gains_are_told():
    observer = SideSlipObserver(yaw_gain=500.0, friction_model=TanhFriction(26.0))
    with pytest.raises(RolloutError, match="DIVERGED"):
        run(observer, samples_of(LOG)).raise_if_failed()


def test_standstill_gives_numbers_and_gradients():
    still = CarSample(np.zeros(20), np.zeros(20), np.zeros(20), np.zeros(20), np.zeros((20, 4)))
    for monitor in MONITORS.values():
        value, slope = jax.value_and_grad(
            lambda gain, monitor=monitor: jnp.sum(
                run(SideSlipObserver(lateral_gain=gain, monitor=monitor()), still).estimate.lateral_speed
            )
        )(1.0)
        assert np.isfinite(value) and np.isfinite(slope)
