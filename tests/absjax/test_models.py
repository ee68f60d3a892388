"""Roads, plants, the brake and the closed loop."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.controllers.five_phase import FivePhase
from absjax.hybrid.rollout import rollout
from absjax.hybrid.system import Smooth
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.stop import Outcome, stop
from absjax.loop.ticking_loop import TickingLoop
from absjax.parameters import model, parameter, part
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import CarState, QuarterCar
from absjax.plant.road import ChangingRoad, UniformRoad, as_road
from absjax.plant.test_rig import RigState, TestRig
from absjax.plant.wheel import Wheel
from absjax.tyres.burckhardt import Burckhardt
from absjax.tyres.surfaces import SURFACES, surface
from tests.oracles import five_phase
from tests.oracles.automaton import runge_kutta
from tests.oracles.quarter_car import GRAVITY, RADIUS, coefficients, friction, offset, spin
from tests.systems import PARAMETERS, five_phase_loop

DRY, WET, SNOW = (SURFACES[name] for name in ("dry_asphalt", "wet_asphalt", "snow"))


@pytest.mark.parametrize("along", ["time", "distance"])
def test_changing_road_is_each_surface_outside_its_blends(along):
    road = ChangingRoad((DRY, WET, SNOW), (1.0, 2.0), 0.1, along)
    at = {"time": lambda x: (x, 0.0), "distance": lambda x: (0.0, x)}[along]
    for x, tyre in ((0.5, DRY), (1.0, DRY), (1.1, WET), (1.99, WET), (2.2, SNOW)):
        assert float(road.friction(-0.1, *at(x))) == pytest.approx(float(tyre.friction(-0.1)), rel=1e-14)
        assert float(road.stiffness(-0.1, *at(x))) == pytest.approx(float(tyre.stiffness(-0.1)), rel=1e-14)
    half = 0.5 * (DRY.friction(-0.1) + WET.friction(-0.1))
    assert float(road.friction(-0.1, *at(1.05))) == pytest.approx(float(half), rel=1e-12)


def test_peak_friction_is_no_less_than_what_a_blend_offers():
    road = ChangingRoad((DRY, WET, SNOW), (1.0, 2.0), 0.3)
    slip = -np.linspace(0.0, 1.0, 2001)
    for time in (0.5, 1.1, 1.15, 1.2, 1.5, 2.15, 3.0):
        offered = -float(road.friction(slip, time, 0.0).min())
        assert offered <= float(road.peak_friction(time, 0.0)) + 1e-6
        if not 0 < (time - 1.0) % 1.0 < 0.3:
            assert float(road.peak_friction(time, 0.0)) == pytest.approx(offered, rel=1e-5)


def test_roads_are_refused_by_name():
    with pytest.raises(ValueError, match="1 entries for 3 surfaces"):
        ChangingRoad((DRY, WET, SNOW), (1.0,))
    with pytest.raises(ValueError, match="'metre' must be"):
        ChangingRoad((DRY, WET), (1.0,), along="metre")
    with pytest.raises(ValueError, match="surface 'mud' is unknown"):
        surface("mud")
    assert as_road("snow").tyre is SNOW and as_road(DRY).tyre is DRY


def test_rollout_keeps_fourth_order_through_a_surface_change():
    def end(step):
        car = QuarterCar(Wheel(), ChangingRoad((DRY, WET), (0.15,), 0.025))
        driven = ConstantPressure(car, 55.0)
        return rollout(driven, CarState(20.0, 20.0 / 0.3, 0.0), step=step, steps=round(0.3 / step)).state.speed

    errors = [abs(float(end(step) - end(1e-4))) for step in (4e-3, 2e-3, 1e-3)]
    assert errors[1] < errors[0] / 12 and errors[2] < errors[1] / 12


@model
class ConstantPressure(Smooth):
    """A plant under a constant brake pressure."""

    plant: QuarterCar | TestRig = part("plant")
    pressure: jax.Array | float = parameter("bar")

    def flow(self, time, state, mode):
        return self.plant.flow(time, state, self.pressure)


def test_rig_and_car_share_the_wheel():
    road = UniformRoad(DRY)
    rig, car = TestRig(Wheel(), road, 18.0), QuarterCar(Wheel(), road)
    state = CarState(jnp.asarray(18.0), jnp.asarray(55.0), jnp.asarray(0.0))
    on_rig, in_car = rig.flow(0.0, RigState(state.wheel_speed), 40.0), car.flow(0.0, state, 40.0)
    assert float(on_rig.wheel_speed) == pytest.approx(float(in_car.wheel_speed), rel=1e-14)
    signals, rig_signals = car.signals(0.0, state, 40.0), rig.signals(0.0, RigState(state.wheel_speed), 40.0)
    gap = rig_signals.acceleration_offset - signals.acceleration_offset
    assert float(gap) == pytest.approx(float(in_car.speed), rel=1e-12)
    assert float(Wheel().mass) == pytest.approx(254.841997961264, rel=1e-12)


def test_rig_settles_where_brake_and_road_balance():
    rig = ConstantPressure(TestRig(Wheel(load=2850.0), UniformRoad(Burckhardt(1.1794, 27.0, 0.8552)), 18.0), 40.0)
    end = rollout(rig, RigState(60.0), step=2e-3, steps=1000).state
    assert 0.3 * float(rig.plant.force(0.0, end)) == pytest.approx(-17.5 * 40.0, rel=1e-9)


@pytest.mark.parametrize(
    "brake, response",
    [
        (Brake(), lambda t: t),
        (Brake(lag=0.05), lambda t: t - 0.05 * (1 - np.exp(-t / 0.05))),
        (Brake(rate_limit=0.4), lambda t: 0.4 * t),
        (Brake(delay=0.02, lag=0.1), None),
        (Brake(delay=0.02), None),
    ],
    ids=["ideal", "lag", "rate limit", "delay and lag", "delay"],
)
def test_brake_response_to_a_ramp(brake, response):
    system = Ramp(brake)
    result = rollout(system, brake.initial_state(0.0), step=1e-3, steps=400, save_every=10)
    path = np.asarray(jax.vmap(brake.pressure)(result.trajectory.state))
    time = np.asarray(result.trajectory.time)
    if response is None:
        lag = 0.1 if brake.lag else 0.0
        late = np.maximum(time - 0.02, 0)
        expected = late - lag * (1 - np.exp(-late / 0.1)) if lag else late
        np.testing.assert_allclose(path[8:], expected[8:], atol=2e-4)
    else:
        np.testing.assert_allclose(path, response(time), atol=1e-8)


@model
class Ramp(Smooth):
    """A brake asked for 1 bar/s."""

    brake: Brake = part("brake")

    def flow(self, time, state, mode):
        return self.brake.flow(state, self.brake.limit(jnp.ones_like(state.commanded), state))


def sampled_by_hand(loop, speed, step, steps, every, delay):
    """Plain loop in numpy floats: guards tested every so many steps, the rate held and late."""
    p, c = loop.controller, coefficients(loop.plant.road.tyre)
    v, w, s, pressure, mode, switchings = speed, speed / RADIUS, 0.0, 0.0, 0, 0

    def rate(mode, w):
        return five_phase.rate(mode, RADIUS * w, p) if mode else 3 * p.u4 / (RADIUS * w)

    rates = [rate(0, w)] * (delay + 1)
    for k in range(1, steps + 1):
        x = np.array([v, w, s, pressure])

        def flow(x, u=rates[-1]):
            return np.array([GRAVITY * friction(x[0], x[1], c), spin(x[0], x[1], x[3], c), x[0], u])

        v, w, s, pressure = runge_kutta(flow, x, step)
        if k % every:
            continue
        x2 = offset(v, w, pressure, c)
        fired = [following for guard, following in five_phase.edges(mode, x2, p) if guard >= 0]
        if fired:
            mode, switchings = fired[0], switchings + 1
        rates = [rate(mode, w), *rates[:-1]]
    return v, w, s, pressure, mode, switchings


@pytest.mark.parametrize("every, delay", [(1, 0), (4, 0), (2, 3)])
def test_sampled_semantics_against_a_plain_loop(every, delay):
    loop = five_phase_loop(PARAMETERS)
    sampled = SampledLoop(loop, tick_every=every, delay=delay)
    result = rollout(sampled, sampled.initial_state(jnp.asarray(20.0)), step=1e-3, steps=700)
    v, w, s, pressure, mode, switchings = sampled_by_hand(loop, 20.0, 1e-3, 700, every, delay)
    plant = result.state.loop.plant
    np.testing.assert_allclose([plant.speed, plant.wheel_speed, plant.distance], [v, w, s], rtol=1e-9)
    assert float(result.state.loop.brake.commanded) == pytest.approx(pressure, rel=1e-9)
    assert int(result.mode) == mode and switchings > 5


def test_sampled_loop_converges_to_the_located_one():
    loop = five_phase_loop(PARAMETERS, stop_speed=8.0)
    located = stop(loop, 20.0, horizon=2.0, step=1e-3)
    sampled = [stop(SampledLoop(loop), 20.0, horizon=2.0, step=step) for step in (1e-3, 1e-4)]
    errors = [abs(float(s.distance - located.distance)) for s in sampled]
    assert errors[1] < 0.2 * errors[0] and errors[1] < 0.01


def test_stop_reports_distance_friction_and_cycles():
    result = stop(five_phase_loop(PARAMETERS, stop_speed=2.5 / 3.6), 60 / 3.6, horizon=5.0, save_switches=True)
    assert Outcome(int(result.outcome)) is Outcome.STOPPED
    log = result.rollout.switches
    onset, end = float(log.time[0]), float(result.duration)
    count = int(result.rollout.events)
    assert int(result.cycles) == int(np.sum(np.asarray(log.target)[:count] == 1))
    assert float(result.rollout.state.memory.control.onset_time) == onset
    speed = float(result.rollout.state.memory.control.onset_speed)
    assert float(result.mean_friction) == pytest.approx((speed - 2.5 / 3.6) / (9.81 * (end - onset)), rel=1e-9)
    quantity = (60 / 3.6) ** 2 / (2 * 9.81 * float(result.mean_friction))
    assert float(result.published_quantity) == pytest.approx(quantity, rel=1e-12)
    assert 0.97 < float(result.mean_friction) / float(DRY.peak().friction) < 1


PUBLISHED = {
    "dry_asphalt": (12.31, 49.27, 110.87),
    "wet_asphalt": (18.09, 72.38, 162.88),
    "dry_concrete": (13.24, 52.97, 119.27),
}


def test_published_five_phase_distances_within_half_a_percent():
    roads, speeds = list(PUBLISHED), np.array([60.0, 120.0, 180.0]) / 3.6
    tyre = Burckhardt(*(np.repeat([float(getattr(SURFACES[r], c)) for r in roads], 3) for c in ("c1", "c2", "c3")))
    result = stop(five_phase_loop(PARAMETERS, tyre=tyre, stop_speed=2.5 / 3.6), np.tile(speeds, 3), horizon=8.0)
    np.testing.assert_allclose(result.published_quantity.reshape(3, 3), [PUBLISHED[r] for r in roads], rtol=5e-3)


def test_what_inherits_keeps_the_checks():
    with pytest.raises(ValueError, match=r"tick_every = 0 must be >= 1"):
        TickingLoop(five_phase_loop(), tick_every=0)


def test_stop_is_refused_by_name():
    with pytest.raises(ValueError, match="stop_speed is None"):
        stop(five_phase_loop(), 20.0, horizon=1.0)
    with pytest.raises(ValueError, match="above the stop speed"):
        stop(five_phase_loop(stop_speed=5.0), 4.0, horizon=1.0)
    with pytest.raises(ValueError, match="horizon = 0"):
        stop(five_phase_loop(stop_speed=5.0), 20.0, horizon=0.0)
    with pytest.raises(ValueError, match=r"Wheel\.radius = -0\.3 is outside"):
        Wheel(radius=-0.3)
    with pytest.raises(ValueError, match=r"Brake\.lag = 0 is outside"):
        Brake(lag=0.0)
    with pytest.raises(ValueError, match=r"FivePhase\.fallback = 1\.5"):
        FivePhase(fallback=1.5)
    with pytest.raises(ValueError, match="tick_every = 0"):
        SampledLoop(five_phase_loop(), tick_every=0)
