"""The four-wheel car: against a car written by hand, against the two-axle car, by its symmetries and its energy.

The oracle is SciPy's DOP853, restarted at every switching; it uses no model of the project.
"""

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from absjax.controllers.five_phase import FivePhase
from absjax.hybrid.rollout import rollout
from absjax.hybrid.system import HybridSystem, Smooth
from absjax.lanes import stacked
from absjax.loop.channel import Channel
from absjax.loop.driver import Driver
from absjax.loop.stop import Outcome, stop
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.parameters import model, parameter, part
from absjax.plant.brake import Brake
from absjax.plant.four_wheel import FRONT, REAR, FourWheel
from absjax.plant.road import ChangingRoad, UniformRoad
from absjax.plant.steering import SteeringTable, YawDriver
from absjax.plant.two_axle import TwoAxle
from absjax.plant.wheel import Wheel
from absjax.tyres.magic_formula import MagicFormula
from absjax.tyres.surfaces import SURFACES
from tests.oracles import four_wheel as by_hand

DRY, WET, SNOW = (SURFACES[name] for name in ("dry_asphalt", "wet_asphalt", "snow"))
CONTROLLER = FivePhase()
CHANNEL = Channel(Brake(), CONTROLLER)
TIMES, LANE_CHANGE = (0.0, 0.1, 0.3, 0.5), (0.0, 0.04, -0.03, 0.0)
STEP = 1e-3
PRESSURE = (30.0, 40.0, 25.0, 15.0)


def coefficients(tyre):
    return [float(c) for c in (tyre.c1, tyre.c2, tyre.c3)]


def roads(left, right):
    return tuple(map(UniformRoad, (left, right, left, right)))


def car(left=DRY, right=DRY, angles=LANE_CHANGE, **fields):
    return FourWheel(roads(left, right), steering=SteeringTable(TIMES, angles), **fields)


def angle(time):
    return np.interp(time, TIMES, LANE_CHANGE)


def loop(car, end, channels=(CHANNEL,) * 4, **fields):
    return VehicleLoop(car, channels, end, Driver(), **fields)


@pytest.fixture(scope="module")
def stops():
    """A straight stop on one road, and a short steered one on split mu and its mirror image; one program."""
    straight = loop(car(angles=(0.0,) * 4), 4.0)
    split = loop(car(DRY, WET), 9.0)
    mirrored = loop(car(WET, DRY, tuple(-x for x in LANE_CHANGE)), 9.0)
    speeds = jnp.array([30.0, 14.0, 14.0])
    return stop(stacked([straight, split, mirrored]), speeds, horizon=5.0, step=STEP, save_switches=True)


def test_straight_on_one_road_it_is_the_two_axle_car(stops):
    axles = tuple(
        Wheel(2 * float(w.inertia), w.radius, 2 * float(w.load), 2 * float(w.brake_efficiency)) for w in (FRONT, REAR)
    )
    two = TwoAxle(roads(DRY, DRY)[:2], axles, suspension=None)
    alone = stop(VehicleLoop(two, (CHANNEL,) * 2, 4.0, Driver()), 30.0, horizon=5.0, step=STEP, save_switches=True)
    assert Outcome(int(alone.outcome)) is Outcome.STOPPED and int(alone.cycles) > 3
    assert float(stops.distance[0]) == pytest.approx(float(alone.distance), abs=1e-9)
    assert int(stops.rollout.grazes[0]) == 0
    # Left and right switch in the same instant: each instant of the two-axle car is there twice.
    own, other = np.asarray(alone.rollout.log.time), np.asarray(stops.rollout.log.time[0])
    count, events = int(alone.rollout.events), int(stops.rollout.events[0])
    pedal = events - 2 * (events - count)  # of the foot, the end
    assert events == 2 * count - pedal and pedal == 3
    np.testing.assert_allclose(np.unique(other[:events].round(8)), np.unique(own[:count].round(8)), atol=2e-8)


def test_a_steered_stop_on_split_mu_against_scipy(stops):
    tyres = [coefficients(tyre) for tyre in (DRY, WET, DRY, WET)]
    hand = by_hand.ByHand(tyres, angle, controller=CONTROLLER)
    time, y = hand.stop(14.0, 9.0)
    final = stops.rollout.state
    switches = np.asarray(stops.rollout.log.time[1])[: int(stops.rollout.events[1])]
    phases = [t for t, _, _ in hand.log if t]
    assert len({wheel for _, wheel, _ in hand.log}) == 4 and len(phases) > 12
    for t in phases:
        assert np.abs(switches - t).min() < 1e-6
    assert float(stops.rollout.time[1]) == pytest.approx(time, abs=1e-6)
    motion = [float(x[1]) for x in final.vehicle.motion]
    np.testing.assert_allclose(motion, y[:5], atol=1e-6)
    np.testing.assert_allclose([float(w[1]) for w in final.vehicle.wheel_speeds], y[5:9], atol=1e-5)
    assert abs(y[2]) > 0.01


def test_the_mirror_image_turns_the_other_way(stops):
    one, other = (jax.tree.map(lambda leaf, i=i: float(leaf[i]), stops.rollout.state.vehicle) for i in (1, 2))
    assert other.motion.yaw_rate == pytest.approx(-one.motion.yaw_rate, abs=1e-12)
    assert other.motion.lateral == pytest.approx(-one.motion.lateral, abs=1e-12)
    assert stops.distance[2] == pytest.approx(float(stops.distance[1]), abs=1e-12)
    np.testing.assert_allclose([other.wheel_speeds[i] for i in (1, 0, 3, 2)], one.wheel_speeds, atol=1e-10)


@model
class Manoeuvre(Smooth):
    """A car under pressures that rise to `PRESSURE` in a tenth of a second."""

    car: FourWheel = part("what is driven")
    share: Any = parameter("of the pressures", default=1.0)

    def flow(self, time, state, mode):
        ramp = self.share * jnp.tanh(30.0 * time)
        return self.car.flow(time, state, tuple(ramp * pressure for pressure in PRESSURE))


@functools.partial(jax.jit, static_argnums=1)
def driven(manoeuvre, steps=600):
    start = manoeuvre.car.initial_state(0.0 * manoeuvre.car.mass + 25.0)
    return rollout(manoeuvre, start, step=STEP, steps=steps).state


def test_without_switchings_against_scipy_lanes_and_single_precision():
    tyres = [coefficients(tyre) for tyre in (DRY, SNOW, DRY, SNOW)]
    hand = by_hand.ByHand(tyres, angle, pressures=lambda t: np.tanh(30.0 * t) * np.array(PRESSURE))
    y = hand.start(25.0)
    for begin, end in zip(TIMES, (*TIMES[1:], 0.6)):
        if end > begin:
            y = solve_ivp(hand.flow, (begin, end), y, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    one, softer = Manoeuvre(car(DRY, SNOW)), Manoeuvre(car(DRY, SNOW, height=0.4), 0.5)
    final = driven(one)
    np.testing.assert_allclose(np.array(final.motion), y[:5], atol=2e-8)
    np.testing.assert_allclose(np.array(final.wheel_speeds), y[5:9], atol=2e-7)
    np.testing.assert_allclose(np.array([final.along, final.across]), y[9:17].reshape(2, 4), atol=2e-8)
    lanes = driven(stacked([one, softer]))
    for i, alone in enumerate((final, driven(softer))):
        jax.tree.map(lambda a, b, i=i: np.testing.assert_allclose(a[i], b, atol=1e-11), lanes, alone)
    single = driven(jax.tree.map(jnp.float32, one))
    assert all(leaf.dtype == jnp.float32 for leaf in jax.tree.leaves(single))
    np.testing.assert_allclose(np.array(single.motion), y[:5], atol=2e-3)


@model
class Relay(HybridSystem):
    """One pressure for all wheels that falls when the front left wheel slips, and rises when it grips again."""

    car: FourWheel = part("what is braked")
    low: Any = parameter("lx at which the pressure begins to fall")
    high: Any = parameter("lx at which it begins to rise")

    def flow(self, time, state, mode):
        car, pressure = state
        return self.car.flow(time, car, (pressure,) * 4), jnp.where(mode == 0, 400.0, -600.0)

    def guards(self, time, state, mode):
        slip, _ = self.car.slips(time, state[0])[0]
        return (jnp.where(mode == 0, self.low - slip, slip - self.high),)

    def jump(self, time, state, mode, slot):
        return state, 1 - mode


def test_gradient_through_switchings_on_split_mu():
    """By h, sigma, roll split and both thresholds."""

    def how_it_ends(shift):
        vehicle = car(DRY, WET, height=0.55 + shift[0], relaxation=0.25 + shift[1], roll_split=0.55 + shift[2])
        relay = Relay(vehicle, -0.06 + shift[3], -0.03 + shift[4])
        start = vehicle.initial_state(20.0 + 0.0 * shift[0])
        result = rollout(relay, (start, 0.0 * shift[0]), step=2 * STEP, steps=300)
        motion = result.state[0].motion
        return motion.distance + motion.longitudinal + 10.0 * motion.yaw_rate, result.events

    # One program: five lanes with a tangent each, and their neighbours on both sides.
    h, none = np.array([1e-5, 1e-5, 1e-5, 1e-7, 1e-7]), np.zeros((5, 5))
    shifts = np.concatenate([none, np.diag(h), -np.diag(h)]).T
    tangents = np.concatenate([np.eye(5), none, none]).T
    values, exact, events = jax.jit(lambda x, dx: jax.jvp(how_it_ends, (x,), (dx,), has_aux=True))(shifts, tangents)
    differences = (np.asarray(values)[5:10] - np.asarray(values)[10:]) / (2 * h)
    assert np.all(np.abs(differences) > 1e-5) and np.all(np.asarray(events) > 3)
    np.testing.assert_allclose(np.asarray(exact)[:5], differences, rtol=1e-4)


def states(car, count=200, seed=0):
    """Of a car that brakes and turns hard."""
    rng = np.random.default_rng(seed)
    state = jax.tree.map(lambda leaf: np.full(count, leaf), car.initial_state(20.0))
    spread = jax.tree.map(lambda leaf: rng.uniform(-0.3, 0.3, count), state)
    motion = state.motion._replace(lateral=5 * spread.motion.lateral, yaw_rate=2 * spread.motion.yaw_rate)
    wheels = tuple(w * (1 + s) for w, s in zip(state.wheel_speeds, spread.wheel_speeds))
    return spread._replace(motion=motion, wheel_speeds=wheels)


def energy(car, state):
    motion = state.motion
    turning = sum(wheel.inertia * w**2 for wheel, w in zip(car.corners, state.wheel_speeds))
    return (
        car.mass * (motion.longitudinal**2 + motion.lateral**2) + car.yaw_inertia * motion.yaw_rate**2 + turning
    ) / 2


def test_energy_goes_into_brakes_and_sliding_tyres_only():
    """dE/dt = sum Fx (wx - R w) + Fy wy - gamma P w, which is negative where slip is not relaxed."""
    vehicle = car(DRY, SNOW, relaxation=None)
    pressures = (20.0, 30.0, 10.0, 5.0)

    def balance(state):
        slope = vehicle.flow(0.1, state, pressures)
        _, rate = jax.jvp(lambda s: energy(vehicle, s), (state,), (slope,))
        braking = sum(w.brake_efficiency * p * v for w, p, v in zip(vehicle.corners, pressures, state.wheel_speeds))
        sliding = sum(
            load * (at.used.along * (at.over_ground - wheel.radius * w) + at.used.across * at.sideways)
            for load, at, wheel, w in zip(
                vehicle.loads(0.1, state), vehicle.contacts(0.1, state), vehicle.corners, state.wheel_speeds
            )
        )
        return rate, sliding - braking, sliding

    rate, told, sliding = jax.vmap(balance)(states(vehicle))
    np.testing.assert_allclose(rate, told, rtol=1e-11)
    assert np.all(np.asarray(sliding) < 0)


def test_loads_add_up_and_a_wheel_that_lifts_gives_finite_numbers():
    flat, tall = car(), car(height=2.5)
    among = states(flat)
    loads = np.array(jax.vmap(lambda s: jnp.stack(flat.loads(0.1, s)))(among))
    np.testing.assert_allclose(loads.sum(axis=1), 1500.0 * 9.81, rtol=1e-12)

    def numbers(state, height):
        tipping = dataclasses.replace(tall, height=height)
        lifted, loads = tipping.lifted(0.1, state), tipping.loads(0.1, state)
        slope = tipping.flow(0.1, state, (10.0,) * 4)
        return sum(map(jnp.sum, jax.tree.leaves(slope))), jnp.stack(loads), jnp.stack(lifted)

    value, loads, lifted = jax.vmap(lambda s: numbers(s, 2.5))(among)
    gradient = jax.vmap(jax.grad(lambda s: numbers(s, 2.5)[0]))(among)
    assert np.any(lifted) and not np.all(lifted)
    assert np.all(np.isfinite(value)) and np.all(np.asarray(loads) >= 0)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(gradient))
    assert np.all(np.asarray(loads)[np.asarray(lifted)] == 0)


def test_accelerometers_of_the_body_tell_the_loads():
    """vx' - r vy and vy' + r vx, not what happens over one wheel."""
    vehicle = car(DRY, SNOW)

    def numbers(state):
        accelerations = vehicle.accelerations(0.1, state, vehicle.flow(0.1, state, PRESSURE))
        known, lifted = vehicle.known_loads(*accelerations), vehicle.lifted(0.1, state)
        return jnp.stack(known), jnp.stack(vehicle.loads(0.1, state)), jnp.stack(lifted).any()

    known, loads, lifted = map(np.asarray, jax.vmap(numbers)(states(vehicle)))
    assert (~lifted).sum() > 100 and np.ptp(loads, axis=0).min() > 1000
    np.testing.assert_allclose(known[~lifted], loads[~lifted], rtol=1e-10)


def test_a_driver_holds_a_car_that_braking_turns():
    """More friction on the left turns the car to the left."""
    drivers = YawDriver(0.0, 0.0), YawDriver(yaw_gain=0.6, lag=0.05)
    cars = stacked([Manoeuvre(FourWheel(roads(DRY, SNOW), steering=driver)) for driver in drivers])
    held, steered = np.asarray(driven(cars).motion.yaw)
    assert held > 0.02 and 0 < steered < 0.7 * held


def test_a_tyre_with_a_curve_of_its_own_across_the_wheel():
    narrow = MagicFormula(8.0, 1.3, 0.5, -1.0)
    tyre = MagicFormula(10.0, 1.65, 1.0, 0.6, narrow)
    blended = ChangingRoad((tyre, DRY), (50.0,), 10.0, "distance")
    at_ends = [float(blended.across.friction(0.05, 0.0, x)) for x in (0.0, 70.0)]
    np.testing.assert_allclose(at_ends, [narrow.friction(0.05), DRY.friction(0.05)], rtol=1e-12)
    assert UniformRoad(DRY).across is None
    vehicle = car(tyre, tyre, relaxation=None)
    state = vehicle.initial_state(20.0)
    state = state._replace(motion=state.motion._replace(lateral=-1.0))
    at = vehicle.contacts(0.0, state)[2]
    np.testing.assert_allclose([at.used.along, at.used.across], [0.0, narrow.friction(0.05)], rtol=1e-9, atol=1e-12)


def test_what_is_no_car_is_refused():
    with pytest.raises(ValueError, match=r"FourWheel\.track_front = 0 is outside"):
        car(track_front=0.0)
    with pytest.raises(ValueError, match=r"FourWheel\.wheelbase = 2\.7 must be at least to_front"):
        car(to_front=2.8)
    with pytest.raises(ValueError, match=r"FourWheel\.roads has 2 entries; a car has four wheels"):
        FourWheel(roads(DRY, DRY)[:2])
    with pytest.raises(ValueError, match=r"FourWheel\.roll_split = 1\.2 is outside"):
        car(roll_split=1.2)
    with pytest.raises(ValueError, match="3 times for 4 angles"):
        SteeringTable((0.0, 1.0, 2.0), LANE_CHANGE)
    with pytest.raises(ValueError, match="must rise"):
        SteeringTable((0.0, 1.0, 1.0, 2.0), LANE_CHANGE)
    with pytest.raises(ValueError, match=r"MagicFormula\.shape_factor = 2\.5 is outside"):
        MagicFormula(10.0, 2.5, 1.0, 0.5)
