"""Ensembles: lanes against a loop, tiles and devices, vmap, recording, no recompilation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.hybrid import rollout as engine
from absjax.hybrid.rollout import Status, rollout
from absjax.lanes import lane_axes
from absjax.tyres.burckhardt import Burckhardt
from tests.systems import Decay, Level, Relay, five_phase_loop

DRIVES = np.linspace(1.5, 2.5, 11)


def relay(drive, **options):
    return rollout(Relay(drive), Level(jnp.asarray(0.0)), step=0.05, steps=40, max_events=6, **options)


def test_lanes_against_a_loop_and_vmap():
    lanes = relay(DRIVES, save_every=5, save_switches=True)
    single = [relay(drive, save_every=5, save_switches=True) for drive in DRIVES]
    looped = jax.tree.map(lambda *leaves: np.stack(leaves), *single)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-13), lanes, looped)
    mapped = jax.vmap(lambda drive: relay(drive, save_every=5, save_switches=True))(jnp.asarray(DRIVES))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-13), lanes, mapped)


@pytest.mark.parametrize("tile", [1, 3, 4, 11])
def test_tiles_shared_out_over_devices_change_nothing(tile):
    assert len(jax.local_devices()) == 2
    whole, cut = relay(DRIVES, tile=16), relay(DRIVES, tile=tile)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-13), whole, cut)

    def total(drives, tile):
        return jnp.sum(relay(drives, tile=tile).state.x)

    drives = jnp.asarray(DRIVES)
    np.testing.assert_allclose(jax.grad(total)(drives, tile), jax.grad(total)(drives, 16), rtol=1e-10)


def test_gradient_with_respect_to_a_shared_parameter_sums_over_lanes():
    def total(high, drives):
        system = Relay(drives, high)
        return jnp.sum(rollout(system, Level(jnp.asarray(0.0)), step=0.05, steps=40, max_events=6, tile=4).state.x)

    shared = jax.grad(total)(jnp.asarray(1.0), jnp.asarray(DRIVES))
    each = jax.grad(lambda high: total(high, jnp.asarray(DRIVES)))(jnp.full(11, 1.0))
    np.testing.assert_allclose(shared, each.sum(), rtol=1e-10)


def test_sizes_that_differ_are_refused_by_name():
    with pytest.raises(ValueError, match=r"high has 4 lanes, others have 3"):
        rollout(Relay(np.ones(3), np.ones(4)), Level(jnp.asarray(0.0)), step=0.1, steps=3)
    with pytest.raises(ValueError, match=r"state\.x has 2 lanes"):
        rollout(Relay(np.ones(3)), Level(jnp.zeros(2)), step=0.1, steps=3)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"steps": 0}, "steps = 0"),
        ({"steps": 2.5}, "steps = 2.5"),
        ({"step": -1e-3}, "step = -0.001"),
        ({"step": float("nan")}, "step = nan"),
        ({"max_events": -1}, "max_events = -1"),
        ({"tile": -4}, "tile = -4"),
        ({"save_every": 11}, "save_every = 11 exceeds steps"),
    ],
)
def test_bad_options_are_refused_by_name(options, message):
    with pytest.raises(ValueError, match=message):
        rollout(Decay(), Level(jnp.asarray(1.0)), **{"step": 0.1, "steps": 10, **options})


def test_values_do_not_recompile():
    relay(jnp.asarray(2.0), tile=7)
    before = engine._rollout._cache_size()
    for drive in (1.9, np.float64(1.8), jnp.asarray(1.7)):
        rollout(Relay(jnp.asarray(drive)), Level(jnp.asarray(0.1)), step=0.05, steps=40, max_events=6, tile=7)
    assert engine._rollout._cache_size() == before


def over(steps, **options):
    return rollout(Relay(1.9), Level(jnp.asarray(0.1)), step=0.05, steps=steps, **options)


def test_another_horizon_finds_its_program_and_ends_where_it_did():
    """Against rollouts that keep a point, whose program is one of their own length."""
    over(380)
    before = engine._rollout._cache_size()
    ends = over(375), over(350), over(375, max_events=198)
    assert engine._rollout._cache_size() == before
    exact = over(375, save_every=375)
    assert float(ends[0].time) == 375 * 0.05 and float(ends[1].time) == 350 * 0.05
    np.testing.assert_allclose([ends[0].state.x, ends[2].state.x], exact.state.x, rtol=1e-12)


def test_room_that_a_horizon_does_not_need_is_not_used(monkeypatch):
    monkeypatch.setattr(engine, "_scan_of", lambda iterations: (2, 64))
    monkeypatch.setattr(engine, "_with_room", lambda segments, length: (8, length))
    end = over(381)
    assert int(end.status) == Status.BUDGET_EXHAUSTED
    assert 1.0 < float(end.time) < 128 * 0.05


def test_lane_axes_follow_the_declared_number_of_axes():
    loop = five_phase_loop(tyre=Burckhardt(np.ones(5), 24.0, np.ones(5)))
    axes = lane_axes(loop)
    assert (axes.plant.road.tyre.c1, axes.plant.road.tyre.c2, axes.controller.eps0) == (0, -1, -1)
    assert axes.brake.lag is None


def test_recording_repeats_the_end_of_a_lane():
    loop = five_phase_loop(stop_speed=8.0)
    result = rollout(
        loop, loop.initial_state(jnp.asarray(10.0)), step=2e-3, steps=400, save_every=100, save_switches=True
    )
    path = result.trajectory
    assert 0.2 < float(result.time) < 0.8
    assert path.valid.tolist() == [t <= float(result.time) for t in (0.0, 0.2, 0.4, 0.6, 0.8)]
    assert float(path.time[-1]) == float(result.time)
    assert float(path.state.plant.speed[-1]) == pytest.approx(8.0, abs=1e-9)
    assert int(result.switches.target[int(result.events) - 1]) == -1


def test_single_precision_keeps_its_type_through_values_and_gradients():
    drives = jnp.asarray(DRIVES, jnp.float32)
    start = Level(jnp.float32(0.0))

    def end(drives):
        return rollout(Relay(drives), start, step=0.05, steps=40, max_events=6).state.x

    assert end(drives).dtype == jnp.float32
    gradient = jax.grad(lambda d: jnp.sum(end(d)))(drives)
    assert gradient.dtype == jnp.float32
    np.testing.assert_allclose(gradient, jax.grad(lambda d: jnp.sum(relay(d).state.x))(jnp.asarray(DRIVES)), rtol=2e-4)
