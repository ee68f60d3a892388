"""Controllers on XBS and on tracked acceleration, and observers in the loop."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.controllers.tracking import AccelerationTracking
from absjax.controllers.two_phase import TwoPhase
from absjax.hybrid.rollout import rollout
from absjax.loop._modes import AT_ZERO, FREE, decoded
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import FreeRamp
from absjax.loop.sampled_loop import SampledLoop
from absjax.observers.adaptive import AdaptiveObserver
from absjax.observers.base import Sample
from absjax.observers.run import observe
from absjax.observers.switched import SwitchedObserver, unknown_road
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.test_rig import TestRig
from absjax.plant.wheel import Wheel
from absjax.tyres.surfaces import surface

WHEEL = Wheel()
RIG = TestRig(WHEEL, UniformRoad(surface("dry_asphalt")), 20.0)
CAR = QuarterCar(WHEEL, UniformRoad(surface("dry_asphalt")))
FOUR = SwitchedObserver.placed(unknown_road(WHEEL), [(120.0, 3600.0), (120.0, 3600.0)])
ADAPTIVE = AdaptiveObserver.placed(WHEEL, (160.0, 6400.0), (4e3, 1e3))
BRAKE = Brake()


def signals_of(loop, trajectory):
    return jax.tree.map(np.asarray, jax.vmap(loop.signals)(trajectory.time, trajectory.state, trajectory.mode))


def test_two_phase_approaches_its_target_exponentially():
    """At constant speed the model is the simplified one: z1' = -(kp/v) (z1 - z1*), Aguado-Rojas 2019, section 4.2."""
    loop = ClosedLoop(dataclasses.replace(RIG, speed=12.0), Brake(), TwoPhase(wheel=WHEEL), driver=FreeRamp())
    start, apply = loop.initial_state(jnp.asarray(12.0)), TwoPhase.phases.index("apply")
    result = rollout(loop, start, apply, step=5e-4, steps=1200, save_every=1, save_switches=True)
    count = int(result.events)
    assert count >= 6
    time, instants = np.asarray(result.trajectory.time), np.asarray(result.switches.time)[:count]
    y = signals_of(loop, result.trajectory).acceleration_offset
    expected, z, last = np.empty_like(y), 0.0, 0.0
    for begin, end, target in zip([0.0, *instants], [*instants, np.inf], [-20.0, 20.0] * count):
        inside = (time >= begin) & (time < end)
        expected[inside] = target + (z - target) * np.exp(-500 / 12 * (time[inside] - begin))
        z, last = target + (z - target) * np.exp(-500 / 12 * (min(end, 1.0) - begin)), end
    assert last == np.inf
    np.testing.assert_allclose(y, expected, atol=1e-5)
    stiffness = np.interp(instants, time, signals_of(loop, result.trajectory).stiffness)
    np.testing.assert_allclose(stiffness, np.where(np.arange(count) % 2 == 0, -0.1, 1.0), atol=2e-3)


def test_tracking_follows_the_cubic():
    tracking = AccelerationTracking(eps2=33.0, eps5=25.0, wheel=WHEEL)
    loop = ClosedLoop(RIG, Brake(), tracking)
    result = rollout(
        loop, loop.initial_state(jnp.asarray(20.0)), step=5e-4, steps=1600, save_every=1, save_switches=True
    )
    path, checked = result.trajectory, set()
    y, entry = signals_of(loop, path).acceleration_offset, path.state.controller
    goals = {1: 30.0, 3: 20.0, 4: -20.0}
    for k in range(len(path.time)):
        mode = int(loop.phase(path.mode[k]))
        if mode not in goals:
            continue
        start = float(entry.offset[k])
        way = 1.2 * (goals[mode] - start)
        share = min((float(path.time[k]) - float(entry.time[k])) / (1.5 / 4.375 * abs(way) / 750.0), 1.0)
        assert y[k] == pytest.approx(start + way * share**2 * (3 - 2 * share), abs=1e-4)
        checked.add(mode)
    assert checked == {1, 3, 4} and int(result.state.memory.control.cycles) >= 2


@pytest.mark.parametrize("observer, tolerance", [(FOUR, 2e-3), (ADAPTIVE, 2e-3)], ids=["4 states", "adaptive"])
def test_located_observer_against_the_same_offline(observer, tolerance):
    loop = ClosedLoop(CAR, BRAKE, AccelerationTracking(eps5=25.0, wheel=WHEEL), observer=observer)
    result = rollout(loop, loop.initial_state(jnp.asarray(20.0)), step=2.5e-4, steps=3200, save_every=1)
    told = signals_of(loop, result.trajectory)
    offline = observe(observer, Sample.of(told), 2.5e-4, substeps=1).raise_if_failed()
    scale = np.abs(told.stiffness).max()
    np.testing.assert_allclose(told.stiffness / scale, offline.stiffness / scale, atol=tolerance)
    assert int(result.state.memory.control.cycles) >= 2
    true = np.asarray(jax.vmap(loop.measured)(*result.trajectory[:3]).stiffness)
    assert np.abs(told.stiffness - true)[-400:].max() < 1.0 < np.abs(told.stiffness - true)[0]


def test_sampled_observer_is_the_offline_one():
    loop = ClosedLoop(CAR, BRAKE, AccelerationTracking(eps5=25.0, wheel=WHEEL), observer=FOUR)
    sampled = SampledLoop(loop, tick_every=2, substeps=3)
    result = rollout(sampled, sampled.initial_state(jnp.asarray(20.0)), step=5e-4, steps=1000, save_every=2)
    path = result.trajectory
    measured = jax.vmap(loop.measured)(path.time, path.state.loop, path.mode)
    offline = observe(FOUR, Sample.of(measured), 1e-3, substeps=3)
    estimates = np.asarray(jax.vmap(loop.with_estimate)(measured, path.state.loop).stiffness)
    np.testing.assert_allclose(estimates, offline.stiffness, rtol=1e-8, atol=1e-8)
    assert int(result.state.loop.memory.control.cycles) >= 1


def test_gain_sets_as_lanes_against_single_runs():
    factors = jnp.array([60.0, 100.0])
    lanes = jax.vmap(lambda b: SwitchedObserver.placed(unknown_road(WHEEL), [(2 * b, b**2)] * 2))(factors)
    loop = ClosedLoop(CAR, BRAKE, AccelerationTracking(eps5=25.0, wheel=WHEEL), observer=lanes)
    together = rollout(loop, loop.initial_state(jnp.asarray([20.0, 20.0])), step=1e-3, steps=400)
    for i in range(2):
        alone = dataclasses.replace(loop, observer=jax.tree.map(lambda x, i=i: x[i], lanes))
        single = rollout(alone, alone.initial_state(jnp.asarray(20.0)), step=1e-3, steps=400)
        np.testing.assert_allclose(together.state.observer[1][i], single.state.observer[1], rtol=1e-9)
        assert int(together.events[i]) == int(single.events)


@pytest.mark.parametrize("sampled", [False, True], ids=["located", "sampled"])
def test_gradient_through_observer_and_controller_against_differences(sampled):
    def cost(x):
        observer = SwitchedObserver.placed(unknown_road(WHEEL), [(2 * x[0], x[0] ** 2), (2 * x[1], x[1] ** 2)])
        tracking = AccelerationTracking(eps1=x[2], eps5=25.0, wheel=WHEEL, gain=x[3])
        loop = ClosedLoop(CAR, BRAKE, tracking, observer=observer)
        loop, step = (SampledLoop(loop), 1e-3) if sampled else (loop, 5e-4)
        state = rollout(loop, loop.initial_state(jnp.asarray(20.0)), step=step, steps=round(0.45 / step)).state
        return (state.loop if sampled else state).plant.wheel_speed

    x, both = jnp.array([60.0, 70.0, 30.0, 100.0]), jax.jit(jax.value_and_grad(cost))
    gradient = np.asarray(both(x)[1])
    assert np.abs(gradient).min() > 0
    for i in range(x.size):
        h = 2e-6 * float(x[i])
        difference = float(both(x.at[i].add(h))[0] - both(x.at[i].add(-h))[0]) / (2 * h)
        assert gradient[i] == pytest.approx(difference, rel=1e-5, abs=1e-9)


def test_single_precision_in_the_loop():
    loop, ends = ClosedLoop(CAR, BRAKE, AccelerationTracking(eps5=25.0, wheel=WHEEL), observer=FOUR), []
    for dtype in (jnp.float32, jnp.float64):
        start = jax.tree.map(lambda x, t=dtype: jnp.asarray(x, t), loop.initial_state(jnp.asarray(20.0, dtype)))
        ends.append(rollout(loop, start, step=1e-3, steps=400))
    assert ends[0].state.observer[1].dtype == jnp.float32
    np.testing.assert_allclose(ends[0].state.plant.speed, ends[1].state.plant.speed, rtol=1e-4)
    np.testing.assert_allclose(ends[0].state.observer[1], ends[1].state.observer[1], atol=0.02)


def test_pressure_leaves_its_limit_when_asked_to():
    """On snow the two-phase controller asks for less than no pressure, and later for more again."""
    rig = TestRig(WHEEL, UniformRoad(surface("snow")), 15.0, -1.96)
    loop = ClosedLoop(rig, BRAKE, TwoPhase(wheel=WHEEL, zref=40.0, chi_a=-0.03, chi_b=5.0))
    start, apply = loop.initial_state(jnp.asarray(15.0)), TwoPhase.phases.index("apply")
    result = rollout(loop, start, apply, step=1e-3, steps=800, save_every=1, save_switches=True)
    source, target = (np.asarray(x)[: int(result.events)] for x in (result.switches.source, result.switches.target))
    commanded = np.asarray(result.trajectory.state.brake.commanded)
    assert commanded.min() > -1e-6
    before, after = (np.asarray(decoded(x, len(TwoPhase.phases)).pressure) for x in (source, target))
    rests, leaves = (after == AT_ZERO) & (before == FREE), (before == AT_ZERO) & (after == FREE)
    assert rests.sum() >= 3 and leaves.sum() >= 3
    assert int(result.events) < 60


def test_two_phase_is_refused_by_name():
    with pytest.raises(ValueError, match=r"TwoPhase\.chi_a = 2 is outside"):
        TwoPhase(chi_a=2.0)
    with pytest.raises(ValueError, match=r"SampledLoop\.substeps = 0"):
        SampledLoop(ClosedLoop(CAR, BRAKE, TwoPhase()), substeps=0)
