"""Limit cycles: closed form, Lambert's W, rollout and SciPy agree; published numbers; derivatives."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import lambertw

from absjax.controllers._lambert import lambert_w0
from absjax.controllers.five_phase import FivePhase
from absjax.controllers.slip import SlipControl
from absjax.controllers.two_phase import TwoPhase
from absjax.controllers.two_phase_cycle import kappa_of, poincare_map, two_phase_cycle
from absjax.hybrid.rollout import rollout
from absjax.lanes import stacked
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.limit_cycle import CycleStatus, limit_cycle
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.test_rig import TestRig
from absjax.plant.wheel import Wheel
from absjax.tyres.surfaces import SURFACES

DRY = SURFACES["dry_asphalt"]
C, D = 23.99, 12.4748
FIRM = {"zref": 20.0, "gain": 200.0, "chi_a": -0.2, "chi_b": 3.0}
SOFT = {"zref": 20.0, "gain": 20.0, "chi_a": 0.0, "chi_b": 1.0}
SPEED = 20.0


def rig(controller, tyre=DRY, speed=SPEED, **brake):
    return ClosedLoop(TestRig(Wheel(), UniformRoad(tyre), speed), Brake(**brake), controller)


def test_published_numbers_to_six_digits():
    firm, soft = two_phase_cycle(C, D, **FIRM), two_phase_cycle(C, D, **SOFT)
    assert float(firm.kappa) == pytest.approx(-0.00499770, abs=5e-9)
    assert float(firm.offset) == pytest.approx(-17.623182, abs=5e-7)
    assert float(firm.contraction) == pytest.approx(0.00399099, abs=5e-9)
    assert float(firm.period) == pytest.approx(0.027619, abs=5e-7)
    assert float(soft.offset) == pytest.approx(-7.861404, abs=5e-7)
    assert float(soft.contraction) == pytest.approx(0.189815, abs=5e-7)


def test_lambert_against_scipy():
    x = np.concatenate([-np.exp(-1 - np.logspace(-9, 1.2, 40)), [0.0]])
    np.testing.assert_allclose(lambert_w0(x), lambertw(x).real, atol=2e-10)
    assert float(lambert_w0(-np.exp(-1.0))) == pytest.approx(-1.0, abs=1e-7)
    w = float(lambertw(-0.2).real)
    assert float(jax.grad(lambert_w0)(-0.2)) == pytest.approx(1 / (np.exp(w) * (1 + w)), rel=1e-12)
    assert lambert_w0(jnp.float32(-0.2)).dtype == jnp.float32
    assert np.isfinite(float(jax.grad(lambert_w0)(-np.exp(-1.0))))


def one_cycle_by_scipy(z1, zref, gain, chi_a, chi_b):
    """z1 after release and apply, by integration of eq. 4.5."""
    z2 = chi_a
    for target, goal in ((zref, chi_b), (-zref, chi_a)):

        def arrived(s, z, goal=goal):
            return z[1] - goal

        arrived.terminal, arrived.direction = True, 1 if goal == chi_b else -1
        run = solve_ivp(
            lambda s, z, target=target: [-gain * (z[0] - target), (C * z[1] + D) * z[0]],
            (0.0, 10.0),
            [z1, z2],
            "DOP853",
            events=arrived,
            rtol=1e-12,
            atol=1e-12,
            max_step=2e-3,
        )
        z1, z2 = run.y[0, -1], goal
    return z1


@pytest.mark.parametrize("settings", [FIRM, SOFT], ids=["firm", "soft"])
def test_closed_form_lambert_and_scipy_agree(settings):
    cycle = two_phase_cycle(C, D, **settings)
    zeta, gain = float(cycle.offset) / settings["zref"], settings["gain"]
    assert float(poincare_map(zeta, gain, cycle.kappa)) == pytest.approx(zeta, abs=1e-12)
    slope = jax.grad(poincare_map)(zeta, gain, float(cycle.kappa))
    assert float(slope) == pytest.approx(float(cycle.contraction), abs=1e-12)
    for start in (zeta, 0.5 * zeta, 3.0 * zeta):
        mapped = settings["zref"] * float(poincare_map(start, gain, cycle.kappa))
        assert mapped == pytest.approx(one_cycle_by_scipy(settings["zref"] * start, **settings), abs=1e-9)


@jax.jit
def along(settings, direction):
    """Derivatives of the cycle by rollout along a direction of the settings; and the cycle."""

    def rolled(settings):
        cycle = limit_cycle(rig(TwoPhase(**settings)), step=2.5e-4, warm_up=4)
        return {"offset": cycle.offset, "contraction": cycle.contraction}, cycle

    _, slopes, cycle = jax.jvp(rolled, (settings,), (direction,), has_aux=True)
    return slopes, cycle


@pytest.mark.parametrize("settings", [FIRM, SOFT], ids=["firm", "soft"])
def test_rollout_agrees_with_the_closed_form_and_so_do_gradients(settings):
    closed = two_phase_cycle(C, D, **settings)
    found = {name: along(settings, {each: float(each == name) for each in settings}) for name in settings}
    cycle = found["gain"][1]
    assert int(cycle.status) == CycleStatus.FOUND
    assert float(cycle.offset) == pytest.approx(float(closed.offset), abs=1e-9)
    assert float(cycle.contraction) == pytest.approx(float(closed.contraction), abs=1e-9)
    assert float(cycle.period) == pytest.approx(float(closed.period) * SPEED, abs=1e-9)
    assert float(cycle.stiffness) == pytest.approx(settings["chi_a"], abs=1e-9)
    for field in ("offset", "contraction"):
        exact = jax.grad(lambda s, field=field: getattr(two_phase_cycle(C, D, **s), field))(settings)
        for name in settings:
            h = 1e-6 * max(abs(settings[name]), 1.0)
            ends = [getattr(two_phase_cycle(C, D, **{**settings, name: settings[name] + e}), field) for e in (h, -h)]
            assert float(exact[name]) == pytest.approx(float(ends[0] - ends[1]) / (2 * h), rel=1e-6, abs=1e-9)
            assert float(found[name][0][field]) == pytest.approx(float(exact[name]), rel=1e-5, abs=1e-9)


def test_contraction_is_below_one_for_every_gain_and_the_condition_of_the_source_is_only_sufficient():
    gain = np.logspace(-3, 4, 50)
    cycle = two_phase_cycle(C, D, zref=20.0, gain=gain, chi_a=0.0, chi_b=1.0)
    contraction = np.asarray(cycle.contraction)
    assert np.all(np.diff(contraction) < 0) and np.all((contraction > 0) & (contraction < 1))
    m = 1.0
    bound = (np.log(m / (m + 1)) - m / (m + 1) + 1) / float(cycle.kappa[0])
    assert float(cycle.sufficient_gain[0]) == pytest.approx(bound, rel=1e-12)
    assert gain[0] < bound


LIMITS = {"rate_limit": 750.0, "lag": 5e-3}
TUNED = FivePhase(60.0, 13.4, 15.6, 13.5, 10.5, 12.6, 0.53, u1=28600.0, u3=1050.0, u4=850.0)
STUCK = FivePhase(eps1=1e6, eps2=2e6, longest_release=1e6)


def test_five_phase_cycles_by_rollout_against_repeated_cycles():
    """Lanes: one that cycles, one that is stuck in a phase, one that is chaotic. The contraction is what shrinks the
    distance to the fixed point from one cycle to the next."""
    controllers, roads = (TUNED, STUCK, FivePhase()), (DRY, *[SURFACES["dry_concrete"]] * 2)
    lanes = rig(stacked(controllers), stacked(roads), np.full(3, 60 / 3.6), **LIMITS)
    cycle, stuck, chaotic = (jax.tree.map(lambda x, i=i: x[i], limit_cycle(lanes)) for i in range(3))
    assert int(stuck.status) == CycleStatus.NOT_CYCLING
    assert float(stuck.contraction) == float(stuck.period) == np.inf
    assert int(chaotic.status) == CycleStatus.NOT_CONVERGED and float(chaotic.period) == np.inf

    assert int(cycle.status) == CycleStatus.FOUND and 0.1 < float(cycle.contraction) < 1
    assert float(cycle.offset) == pytest.approx(-12.6, abs=1e-8)
    loop = rig(TUNED, DRY, 60 / 3.6, **LIMITS)
    run = rollout(loop, loop.initial_state(jnp.asarray(60 / 3.6)), step=1e-3, steps=5000, save_switches=True)
    source, target = (np.asarray(loop.phase(x)) for x in (run.switches.source, run.switches.target))
    periods = np.diff(np.asarray(run.switches.time)[(target == 1) & (source != 1)])
    assert periods[-1] == pytest.approx(float(cycle.period), abs=1e-5)
    late = np.abs(periods - float(cycle.period))[4:9]
    assert np.median(late[1:] / late[:-1]) == pytest.approx(float(cycle.contraction), rel=0.05)


def test_what_has_no_cycle_is_refused_by_name():
    with pytest.raises(ValueError, match="a TestRig whose acceleration is 0"):
        limit_cycle(dataclasses.replace(rig(TwoPhase()), plant=TestRig(Wheel(), UniformRoad(DRY), 20.0, -1.0)))
    with pytest.raises(ValueError, match="a TestRig whose acceleration is 0"):
        limit_cycle(dataclasses.replace(rig(TwoPhase()), plant=QuarterCar(Wheel(), UniformRoad(DRY))))
    with pytest.raises(ValueError, match=r"gain = 0\.0 must be positive"):
        two_phase_cycle(C, D, **{**FIRM, "gain": 0.0})
    with pytest.raises(ValueError, match=r"c = 0\.0 must be positive"):
        two_phase_cycle(0.0, D, **FIRM)
    with pytest.raises(ValueError, match="SlipControl does not cycle"):
        limit_cycle(rig(SlipControl()))
    with pytest.raises(ValueError, match="stop_speed must be None"):
        limit_cycle(dataclasses.replace(rig(TwoPhase()), stop_speed=1.0))
    with pytest.raises(ValueError, match=r"chi_a = -0\.6 must be above -d/c = -0\.52"):
        kappa_of(C, D, 20.0, -0.6, 1.0)
