"""Switchings against closed forms, and the cases in which locating them is delicate."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.hybrid.rollout import Status, rollout
from absjax.parameters import model, parameter
from absjax.results import RolloutError
from tests.systems import Decay, Explosion, Level, Oscillator, Race, Relay, Swing, Twins

START = Level(jnp.asarray(0.0))


def relay_exact(p, time):
    """x(time) of the relay from x = 0, by its switching instants; p = (drive, high, low)."""
    drive, high, low = p
    x, clock, up = 0.0, 0.0, True
    while True:
        target = drive if up else -drive
        end = high if up else -low
        lasts = jnp.log((target - x) / (target - end))
        if clock + lasts > time:
            return target + (x - target) * jnp.exp(-(time - clock))
        x, clock, up = end, clock + lasts, not up


def relay_rolled(p, step=0.01, time=4.003, **options):
    result = rollout(Relay(p[0], p[1], p[2]), START, step=step, steps=round(time / step), max_events=12, **options)
    return result.state.x + 0 * result.time


def test_relay_against_its_closed_form():
    p = jnp.array([2.0, 1.0, 0.7])
    steps, step = 400, 4.003 / 400
    result = rollout(Relay(*p), START, step=step, steps=steps, max_events=12, save_switches=True)
    assert abs(float(result.state.x - relay_exact(p, 4.003))) < 1e-9
    rising, falling = np.log(2.7 / 1.0), np.log(3.0 / 1.3)
    expected = np.log(2.0) + np.cumsum(np.tile([falling, rising], 6))
    instants = np.asarray(result.switches.time)[: int(result.events)]
    np.testing.assert_allclose(instants, np.concatenate([[np.log(2.0)], expected])[: len(instants)], atol=1e-9)
    assert np.asarray(result.switches.source)[:3].tolist() == [0, 1, 0]
    assert np.asarray(result.switches.target)[:3].tolist() == [1, 0, 1]
    assert np.all(np.asarray(result.switches.source)[int(result.events) :] == -9)


def vmapped(function):
    """The second of two gradients; the decisions of the others are not its own."""
    return lambda p: jax.vmap(jax.grad(function))(jnp.stack([1.1 * p, p]))[1]


@pytest.mark.parametrize("derivative", [jax.grad, jax.jacfwd, vmapped], ids=["reverse", "forward", "vmapped reverse"])
def test_relay_gradient_against_its_closed_form(derivative):
    p = jnp.array([2.0, 1.0, 0.7])
    rolled = derivative(lambda p: relay_rolled(p, step=4.003 / 400))(p)
    exact = jax.grad(lambda p: relay_exact(p, 4.003))(p)
    np.testing.assert_allclose(rolled, exact, rtol=1e-6)


def test_second_derivative_against_the_closed_form():
    p = jnp.array([2.0, 1.0, 0.7])
    rolled = jax.jacfwd(jax.grad(lambda p: relay_rolled(p, step=4.003 / 400)))(p)
    exact = jax.hessian(lambda p: relay_exact(p, 4.003))(p)
    np.testing.assert_allclose(rolled, exact, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("phase", np.linspace(0, 0.1, 7))
@pytest.mark.parametrize("level, events", [(1 - 1e-3, 1), (1 - 1e-6, 1), (1 + 1e-3, 0)])
def test_a_guard_that_rises_and_falls_within_one_step_is_seen(phase, level, events):
    start = Swing(jnp.asarray(np.sin(phase)), jnp.asarray(np.cos(phase)))
    result = rollout(Oscillator(level), start, step=0.1, steps=30, max_events=3, save_switches=True)
    assert int(result.events) == events
    if events and level < 1 - 1e-5:
        np.testing.assert_allclose(result.switches.time[0], np.arcsin(level) - phase, atol=2e-5)


def test_grazing_is_finite_and_counted():
    def end(level, **options):
        start = Swing(jnp.asarray(0.0), jnp.asarray(1.0))
        return rollout(Oscillator(level), start, step=np.pi / 2 / 200, steps=400, max_events=3, **options)

    # The swing turns at a grid point, so that this level is touched there, at zero rate, and not crossed.
    top = jnp.max(end(jnp.asarray(2.0), save_every=1).trajectory.state.x)
    touched = end(top)
    assert int(touched.events) == int(touched.grazes) == 1
    for level in (top, top - 1e-12, top - 1e-9, top + 1e-12):
        result = end(level)
        gradient = jax.grad(lambda level: end(level).state.x + end(level).time)(level)
        assert np.isfinite(float(result.state.x)) and np.isfinite(float(gradient))
        assert int(result.status) == Status.COMPLETED


def test_the_earliest_of_two_guards_wins_and_open_guards_fire_at_once():
    result = rollout(Race(), Level(jnp.asarray(0.0)), step=0.1, steps=10, save_switches=True, max_events=5)
    assert int(result.mode) == 2 and int(result.events) == 2
    np.testing.assert_allclose(result.switches.time[:2], [0.52, 0.52], atol=1e-12)
    swapped = rollout(Race(0.52, 0.55), Level(jnp.asarray(0.0)), step=0.1, steps=10, max_events=5)
    assert int(swapped.mode) == 5


def test_a_guard_open_at_the_start_fires_at_the_start():
    result = rollout(Relay(), Level(jnp.asarray(1.5)), step=0.01, steps=10, save_switches=True, max_events=4)
    assert float(result.switches.time[0]) == 0.0 and int(result.events) == 1


def test_an_exhausted_budget_is_said_and_finite():
    def run(p):
        return rollout(Relay(p[0], p[1], p[2]), START, step=0.01, steps=400, max_events=8)

    chattering = jnp.array([2.0, 0.01, -0.0099])
    result = run(chattering)
    assert int(result.status) == Status.BUDGET_EXHAUSTED
    assert 0 < float(result.time) < 4
    assert np.isfinite(float(result.state.x))
    assert np.all(np.isfinite(jax.grad(lambda p: run(p).state.x)(chattering)))
    with pytest.raises(RolloutError, match="BUDGET_EXHAUSTED"):
        result.raise_if_failed()


def test_divergence_is_said_and_finite():
    def run(rate):
        return rollout(Explosion(rate), Level(jnp.asarray(1.0)), step=0.05, steps=100)

    result = run(jnp.asarray(1.0))
    assert int(result.status) == Status.DIVERGED
    assert np.isfinite(float(result.state.x)) and 0.9 < float(result.time) < 1.6
    assert np.isfinite(float(jax.grad(lambda r: run(r).state.x)(jnp.asarray(1.0))))
    with pytest.raises(RolloutError, match="DIVERGED"):
        result.raise_if_failed()


@pytest.mark.parametrize("what", ["step", "start"])
def test_no_derivative_with_respect_to_the_grid(what):
    def end(value):
        options = {"step": 0.01, "start": 0.0, what: value}
        return rollout(Relay(), START, steps=10, max_events=4, **options).state.x

    with pytest.raises(TypeError, match="no derivative with respect to `step` and `start`"):
        jax.grad(end)(0.01)


def test_smooth_system_against_its_solution():
    def end(rate):
        return rollout(Decay(rate), Level(jnp.asarray(3.0)), step=0.02, steps=100, save_every=10)

    result = end(jnp.asarray(0.8))
    np.testing.assert_allclose(
        result.trajectory.state.x, 3 * np.exp(-0.8 * np.asarray(result.trajectory.time)), rtol=1e-9
    )
    np.testing.assert_allclose(result.trajectory.time, np.arange(11) * 0.2, rtol=1e-14)
    gradient = jax.grad(lambda rate: end(rate).state.x)(jnp.asarray(0.8))
    np.testing.assert_allclose(gradient, -2 * 3 * np.exp(-1.6), rtol=1e-8)
    path_gradient = jax.grad(lambda rate: jnp.sum(end(rate).trajectory.state.x))(jnp.asarray(0.8))
    t = np.asarray(result.trajectory.time)
    np.testing.assert_allclose(path_gradient, np.sum(-t * 3 * np.exp(-0.8 * t)), rtol=1e-8)


def test_two_guards_that_mean_the_same_switch_once():
    result = rollout(Twins(), Level(jnp.asarray(0.0)), step=0.3, steps=20, max_events=20)
    assert (int(result.status), int(result.events)) == (Status.COMPLETED, 5)
    np.testing.assert_allclose(float(result.state.x), 1.0, atol=1e-6)


def test_strain_adds_up_local_errors_and_says_when_the_step_is_too_large():
    step, steps = 0.01, 20
    rates = np.array([1.0, 20.0, 60.0, 400.0])
    result = rollout(Decay(rates), Level(jnp.ones(4)), step=step, steps=steps)
    z = -rates * step
    after = 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24
    last = z * (1 + z + z**2 / 2 + z**3 / 4)
    share = np.abs(last - z * after) / 6 / (1 + np.abs(after) + np.abs(last) + np.abs(z * after))
    np.testing.assert_allclose(result.strain, steps * share, rtol=1e-4, atol=1e-5)
    assert list(np.asarray(result.status)) == [Status.COMPLETED] * 3 + [Status.STEP_TOO_LARGE]
    with pytest.raises(RolloutError, match="lane 3: it reached its end, but its flow is too fast"):
        result.raise_if_failed()


@model
class Flat:
    """x' = 1 until top - (x - 0.4)^4 rises through zero, then x' = -1."""

    top: Any = parameter("largest value of the guard", default=0.01)

    def flow(self, time, state, mode):
        return Level(jnp.where(mode == 0, 1.0, -1.0) + 0.0 * state.x)

    def guards(self, time, state, mode):
        return (jnp.where(mode == 0, self.top - (state.x - 0.4) ** 4, -1.0),)

    def jump(self, time, state, mode, slot):
        return state, mode + 1


def test_a_hump_that_only_the_interpolant_has_is_not_crossed():
    """The interpolant of the first step rises to 0.06 above the guard. Crossed at x = 0.4 - top^(1/4), if at all."""
    top = jnp.array([-0.03, -1e-3, 1e-3, 0.01])

    def ends(top):
        return rollout(Flat(top), Level(jnp.zeros(4)), step=1.0, steps=2, max_events=2)

    result = ends(top)
    assert np.asarray(result.events).tolist() == [0, 0, 1, 1] and not np.any(result.grazes)
    turns = 0.4 - jnp.maximum(top, 0.0) ** 0.25
    np.testing.assert_allclose(result.state.x, jnp.where(top < 0, 2.0, 2 * turns - 2.0), atol=1e-8)
    slopes = jax.grad(lambda top: ends(top).state.x.sum())(top)
    np.testing.assert_allclose(slopes[:2], 0.0)
    np.testing.assert_allclose(slopes[2:], -0.5 * top[2:] ** -0.75, rtol=1e-5)
