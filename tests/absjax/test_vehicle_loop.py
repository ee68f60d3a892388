"""Several channels in one loop: one of them against the quarter car, two axles by hand, limits, lanes, gradients."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.controllers.five_phase import FivePhase
from absjax.controllers.two_phase import TwoPhase
from absjax.lanes import stacked
from absjax.loop.channel import Channel
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import Driver
from absjax.loop.ideal import ideal_distance
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.sampled_vehicle import SampledVehicle
from absjax.loop.stop import Outcome, stop
from absjax.loop.vehicle_ideal import vehicle_ideal_distance
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.plant.brake import Brake
from absjax.plant.one_wheel import OneWheel
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.two_axle import FRONT_AXLE, REAR_AXLE, Suspension, TwoAxle
from absjax.plant.wheel import Wheel
from absjax.tyres.surfaces import SURFACES
from tests.oracles import two_axle
from tests.oracles.quarter_car import coefficients

WET = SURFACES["wet_asphalt"]
BRAKE = Brake(rate_limit=750.0, lag=5e-3)
DRIVER = Driver(rate=600.0, delay=0.02)
FRONT, REAR = FivePhase(), FivePhase(eps0=40.0, eps1=25.0, eps3=15.0, u1=5000.0)
SPEED, END, HORIZON = 16.0, 8.0, 12.0
STEPS, EVENTS = 6000, 400
"""One number of grid points for every step, as in the documentation: one program, which ends with its last lane."""


def loop_of(front=FRONT, rear=REAR, road=WET, driver=DRIVER, **car) -> VehicleLoop:
    vehicle = TwoAxle((UniformRoad(road), UniformRoad(road)), **car)
    return VehicleLoop(vehicle, (Channel(BRAKE, front), Channel(BRAKE, rear)), END, driver)


def stopped(loop, speed=SPEED, step=2e-3, **options):
    return stop(loop, speed, horizon=STEPS * step, step=step, max_events=EVENTS, **options)


@pytest.mark.parametrize("sampled", [False, True], ids=["located", "sampled"])
def test_one_channel_is_the_quarter_car(sampled):
    """The pedal is lifted and pressed again, the wheel locks."""
    driver = Driver(rate=900.0, delay=0.03, largest=60.0, changes=(0.6, 0.7), release_rate=900.0)
    car, controller = QuarterCar(Wheel(), UniformRoad(WET)), FivePhase(eps0=90.0, eps4=60.0, eps5=90.0, u1=3000.0)
    one = ClosedLoop(car, BRAKE, controller, 4.0, driver=driver)
    many = VehicleLoop(OneWheel(car), (Channel(BRAKE, controller),), 4.0, driver)
    systems = (SampledLoop(one), SampledVehicle(many)) if sampled else (one, many)
    alone, together = (stopped(system, save_switches=True) for system in systems)
    assert Outcome(int(alone.outcome)) is Outcome.STOPPED and int(alone.cycles) > 1 and int(alone.locks) > 0
    for name in alone._fields[:-1]:
        one_of, other = getattr(alone, name), getattr(together, name)
        np.testing.assert_allclose(other, one_of, rtol=1e-12, atol=1e-12, err_msg=name)
    np.testing.assert_allclose(together.rollout.log.time, alone.rollout.log.time, atol=1e-12)


@pytest.fixture(scope="module")
def by_hand():
    hand = two_axle.ByHand((FRONT, REAR), DRIVER, coefficients(WET), 750.0, 5e-3, END)
    return hand, *hand.run(SPEED)


def test_two_axles_against_scipy(by_hand):
    hand, time, y = by_hand
    result = stopped(loop_of(), step=5e-4)
    assert Outcome(int(result.outcome)) is Outcome.STOPPED
    assert all(int(control.cycles) >= 2 for control in result.rollout.state.memory.control)
    assert int(result.rollout.events) == hand.events + 1
    assert float(result.rollout.time) == pytest.approx(time, abs=1e-7)
    assert float(result.distance) == pytest.approx(y[1] - DRIVER.delay * SPEED, abs=1e-6)


def test_of_each_axle_how_long_it_slides():
    """Against the instants with a slip below -0.8: the front wheels lock now and then, the rear ones do not."""
    late = FivePhase(eps0=90.0, eps4=60.0, eps5=90.0, u1=3000.0)
    result = stopped(loop_of(late), step=1e-3, save_every=1)
    path = result.rollout.path
    speed = np.asarray(path.state.vehicle.speed)
    for wheel, turning, slid in zip(loop_of().vehicle.wheels, path.state.vehicle.wheel_speeds, result.slide_time):
        deep = np.asarray(path.valid) & (wheel.radius * np.asarray(turning) < 0.2 * speed)
        assert float(slid) == pytest.approx(1e-3 * deep.sum(), abs=1e-3 * np.abs(np.diff(deep)).sum())
    assert float(result.slide_time[0]) > float(result.lock_time[0]) > 0.05 > float(result.slide_time[1])


def test_fourth_order_with_two_channels(by_hand):
    exact = by_hand[2][1] - DRIVER.delay * SPEED
    # At 4 ms some steps are taken in parts, and the error is that of shorter ones.
    coarse, fine = (abs(float(stopped(loop_of(), step=h).distance) - exact) for h in (2e-3, 1e-3))
    assert fine < 1e-5 and coarse > 8 * fine


ANGLE = np.array([0.5, -0.4, 0.6, 0.3, 0.7])


def along(shift, height, road):
    """Distance plus longest cycle as a function of one number that moves thresholds of both axles, h, sigma and m."""
    front, rear, higher, sigma, mass = (1 + shift * a for a in ANGLE)
    loop = loop_of(
        dataclasses.replace(FRONT, eps5=FRONT.eps5 * front),
        dataclasses.replace(REAR, eps1=REAR.eps1 * rear),
        road,
        height=height * higher,
        relaxation=0.25 * sigma,
        mass=1500.0 * mass,
    )
    result = stopped(loop)
    return result.distance + result.longest_cycle


@pytest.fixture(scope="module")
def slope():
    return jax.jit(jax.value_and_grad(along))


def test_gradient_by_both_axles_and_the_car_against_differences(slope):
    h = 1e-6
    ahead, behind = (float(slope(shift, 0.55, WET)[0]) for shift in (h, -h))
    exact = float(slope(0.0, 0.55, WET)[1])
    assert abs(exact) > 0.1
    assert exact == pytest.approx((ahead - behind) / (2 * h), rel=1e-5)


def test_lanes_are_single_runs_in_single_precision_too(by_hand):
    exact = by_hand[2][1] - DRIVER.delay * SPEED
    both = stacked([loop_of(), loop_of(height=0.4)])
    lanes = stopped(both, np.full(2, SPEED))
    np.testing.assert_allclose(lanes.distance[0], stopped(loop_of()).distance, atol=1e-10)
    single = stopped(jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), both), jnp.full(2, SPEED, jnp.float32))
    assert single.distance.dtype == single.longest_cycle.dtype == jnp.float32
    np.testing.assert_allclose(single.distance, lanes.distance, atol=5e-3)
    assert float(lanes.distance[0]) == pytest.approx(exact, abs=2e-4)


def test_a_stiff_suspension_is_the_algebraic_load():
    stiff = Suspension((2e8, 2e8), (3e5, 3e5))
    soft, hard, rigid = (stopped(loop_of(suspension=s), step=2.5e-4) for s in (Suspension(), stiff, None))
    apart = [float(abs(result.distance - rigid.distance)) for result in (soft, hard)]
    assert apart[1] < 1e-3 < apart[0]


def test_without_transfer_it_is_two_quarter_cars_and_without_relaxation_the_slip_is_algebraic():
    """No height, equal axles, the centre of gravity midway."""
    axle = dataclasses.replace(FRONT_AXLE, load=1.0)
    even = {"height": 0.0, "to_front": 1.35, "axles": (axle, axle), "relaxation": None}
    quarter = QuarterCar(dataclasses.replace(axle, load=750.0 * 9.81), UniformRoad(WET))
    one = stopped(ClosedLoop(quarter, BRAKE, FRONT, END, driver=DRIVER))
    both = stopped(loop_of(FRONT, FRONT, **even))
    assert float(both.distance) == pytest.approx(float(one.distance), abs=1e-9)
    assert int(both.rollout.events) > 1.5 * int(one.rollout.events)
    short = stopped(loop_of(FRONT, FRONT, **{**even, "relaxation": 1e-3}), step=1e-4)
    none = stopped(loop_of(FRONT, FRONT, **even), step=1e-4)
    assert float(short.distance) == pytest.approx(float(none.distance), abs=2e-2)


def test_select_low_goes_by_the_wheel_that_turns_slower():
    """One channel on both axles: the front one, braked harder, is the slower."""
    vehicle = TwoAxle((UniformRoad(WET), UniformRoad(WET)))
    loop = VehicleLoop(vehicle, (Channel(BRAKE, FRONT),), END, DRIVER, wiring=((0, 1),))
    result = stopped(loop, save_every=1)
    assert Outcome(int(result.outcome)) is Outcome.STOPPED and int(result.cycles) >= 2
    path = result.rollout.path
    front, rear = (np.asarray(w) for w in path.state.vehicle.wheel_speeds)
    chosen = np.asarray(loop.parts(path.mode).chosen[0])
    apart = np.abs(front - rear) > 0.05
    assert apart.sum() > 50
    np.testing.assert_array_equal(chosen[apart], (rear < front)[apart])
    first, second = loop.pressures(jax.tree.map(lambda leaf: leaf[100], path.state))
    assert float(first) == float(second) > 0


def test_controllers_wait_for_their_instants_and_follow_the_load():
    waiting = dataclasses.replace(loop_of(), begins=(0.17, 0.2))
    at_once, later = (stopped(loop).rollout.state.memory.control for loop in (loop_of(), waiting))
    assert all(float(own.onset_time) < begins for own, begins in zip(at_once, waiting.begins))
    np.testing.assert_allclose([float(own.onset_time) for own in later], waiting.begins, atol=1e-9)
    told = TwoPhase(wheel=FRONT_AXLE)
    known, unknown = (
        stopped(dataclasses.replace(loop_of(told, REAR), follows_load=follows)).distance for follows in (True, False)
    )
    assert float(known) != float(unknown)
    with pytest.raises(ValueError, match="begins has 1 entries for 2 channels"):
        dataclasses.replace(loop_of(), begins=(0.4,))


def test_the_ideal_stop_of_a_vehicle():
    """Of one wheel that of the quarter car; of two axles what equal use of the friction gives, once the pedal asks."""
    car = QuarterCar(Wheel(), UniformRoad(WET))
    one = VehicleLoop(OneWheel(car), (Channel(BRAKE, FRONT),), END, DRIVER)
    alone = ideal_distance(ClosedLoop(car, BRAKE, FRONT, END, driver=DRIVER), SPEED, horizon=HORIZON)
    assert float(vehicle_ideal_distance(one, SPEED, horizon=HORIZON)) == pytest.approx(float(alone), abs=2e-5)
    loop = loop_of(driver=Driver(rate=1e6, largest=200.0))
    peak = float(WET.peak().friction)
    found = float(vehicle_ideal_distance(loop, SPEED, horizon=HORIZON))
    assert found == pytest.approx((SPEED**2 - END**2) / (2 * 9.81 * peak), abs=5e-3)
    assert float(stopped(loop_of()).distance) > float(vehicle_ideal_distance(loop_of(), SPEED, horizon=HORIZON))


def test_what_cannot_be_is_refused_and_a_lifted_axle_stays_finite(slope):
    roads = (UniformRoad(WET), UniformRoad(WET))
    with pytest.raises(ValueError, match=r"TwoAxle\.roads has 1 entries; a car has two axles"):
        TwoAxle(roads[:1])
    with pytest.raises(ValueError, match=r"TwoAxle\.wheelbase = 2\.7 must be at least to_front"):
        TwoAxle(roads, to_front=2.8)
    with pytest.raises(ValueError, match=r"Wheel\.brake_efficiency = 0 is outside"):
        dataclasses.replace(REAR_AXLE, brake_efficiency=0.0)
    with pytest.raises(ValueError, match="must name each of the 2 wheels once"):
        VehicleLoop(TwoAxle(roads), (Channel(BRAKE, FRONT),), END)
    with pytest.raises(ValueError, match=r"SampledVehicle\.rolling = 5 must be >= 0, and needs the period"):
        SampledVehicle(loop_of(), rolling=5)
    with pytest.raises(ValueError, match=r"a tick every 0\.002 s; the loop's period is 0.001 s"):
        stopped(SampledVehicle(loop_of(), rolling=5, period=1e-3))
    value, by_shift = slope(0.0, 1.6, SURFACES["dry_asphalt"])
    assert np.isfinite(value) and np.isfinite(by_shift)
