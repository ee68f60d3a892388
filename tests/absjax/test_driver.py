"""The pedal is given: limits, lock, a pedal lifted and pressed anew, against a car written by hand; the ideal stop.

The oracle is SciPy's DOP853 with terminal events, restarted at every switching; it uses no model of the project.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.controllers.five_phase import FivePhase
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import Driver, FreeRamp
from absjax.loop.ideal import ideal_distance
from absjax.loop.memory import DEEP_SLIP, LOCK_SPEEDS
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.stop import Outcome, stop
from absjax.loop.wheel_lock import SLIDING, deep, guard
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import ChangingRoad, UniformRoad
from absjax.plant.wheel import Wheel
from absjax.tyres.surfaces import SURFACES
from tests.oracles import five_phase
from tests.oracles.automaton import until_switching
from tests.oracles.quarter_car import BRAKE, GRAVITY, LOAD, RADIUS, coefficients, friction, spin

RATE_LIMIT, LAG = 750.0, 5e-3
WET = SURFACES["wet_asphalt"]
COEFFICIENTS = coefficients(WET)
CONTROLLER = FivePhase(eps0=90.0, eps4=60.0, eps5=90.0, u1=3000.0)
DRIVER = Driver(rate=900.0, delay=0.03, largest=60.0, changes=(1.0, 1.25), release_rate=900.0)
SPEED, END = 18.0, 4.0
ANGLE = np.array([0.4, 0.9, -0.3, 0.2])


def loop_of(controller=CONTROLLER, driver=DRIVER, road=None, **brake) -> ClosedLoop:
    car = QuarterCar(Wheel(), UniformRoad(WET) if road is None else road)
    return ClosedLoop(car, Brake(**{"rate_limit": RATE_LIMIT, "lag": LAG, **brake}), controller, END, driver=driver)


def above_limits(time, speed, began, from_speed):
    """How much of what began at a time and speed was above each of `LOCK_SPEEDS` [s]."""
    return (time - began) * np.clip((from_speed - np.array(LOCK_SPEEDS)) / (from_speed - speed), 0.0, 1.0)


class ByHand:
    """What the foot, the pressure, the wheel and the controller do; y = v, w, x, P, lagged, pedal."""

    def __init__(self, controller=CONTROLLER, driver=DRIVER):
        self.p, self.d = controller, driver
        self.phase, self.pressure, self.locked, self.foot, self.moves = 0, "pedal", False, "off", 0
        self.entered = 0.0
        self.lock_began, self.lock_time, self.locks, self.seen = None, np.zeros(2), 0, set()
        self.slide_began, self.slide_time = None, 0.0

    def spin(self, y):
        return spin(y[0], y[1], min(max(y[4], 0.0), y[5]), COEFFICIENTS)

    def x2(self, y):
        return (0.0 if self.locked else RADIUS * self.spin(y)) - GRAVITY * friction(y[0], y[1], COEFFICIENTS)

    def rate(self, y):
        rim = max(RADIUS * y[1], 0.5)
        asked = five_phase.rate(self.phase, rim, self.p) if self.phase else 1e4
        return np.clip(asked, -RATE_LIMIT, RATE_LIMIT)

    def slope(self):
        return {"off": 0.0, "pressing": self.d.rate, "held": 0.0, "lifting": -self.d.release_rate}[self.foot]

    def flow(self, t, y):
        moving = {"pedal": self.slope(), "free": self.rate(y), "zero": 0.0}[self.pressure]
        turning = 0.0 if self.locked else self.spin(y)
        return [GRAVITY * friction(y[0], y[1], COEFFICIENTS), turning, y[0], moving, (y[3] - y[4]) / LAG, self.slope()]

    def edges(self, t, y):
        """(name, guard value); a guard fires where it rises through zero."""
        x, found = self.x2(y), [("stop", END - y[0])]
        bound = (1 + DEEP_SLIP) * y[0] / RADIUS
        if self.locked:
            found.append(("free", self.spin(y)))
        elif self.slide_began is None:
            found.append(("slide", bound - y[1]))
        else:
            found += [("lock", -y[1]), ("turns", y[1] - 1.001 * bound)]
        if self.phase > 0 or self.foot != "off":
            ways = five_phase.ways(self.phase, x, t - self.entered, self.p, RADIUS * y[1], y[0])
            found += [(f"to {following}", guard) for guard, following in ways]
        instants = (self.d.delay, *self.d.changes)
        if self.moves < len(instants):
            found.append(("foot", t - instants[self.moves]))
        if self.foot == "pressing":
            found.append(("arrives", y[5] - self.d.largest))
        if self.foot == "lifting":
            found.append(("arrives", -y[5]))
        rate, ahead = self.rate(y), self.rate(y) - self.slope()
        if self.pressure == "free":
            if ahead > 0:
                found.append(("on pedal", y[3] - y[5]))
            if rate < 0:
                found.append(("at zero", -y[3]))
        else:
            found.append(("leaves", (-ahead if self.pressure == "pedal" else rate) - 1.0))
        return found

    def guards(self, t, y):
        return [guard for _, guard in self.edges(t, y)]

    def jump(self, name, t, y):
        self.seen.add(name)
        if name.startswith("to "):
            self.phase, self.pressure, self.entered = int(name[3:]), "free", t
        elif name == "lock":
            self.locked, self.lock_began, self.locks, y[1] = True, (t, y[0]), self.locks + 1, 0.0
        elif name == "free":
            self.locked, y[1] = False, 1e-6
            self.lock_time += above_limits(t, y[0], *self.lock_began)
        elif name == "slide":
            self.slide_began = t, y[0]
        elif name == "turns":
            self.slide_time += above_limits(t, y[0], *self.slide_began)[0]
            self.slide_began = None
        elif name == "foot":
            self.foot = "lifting" if self.moves % 2 else "pressing"
            self.moves += 1
        elif name == "arrives":
            if self.foot == "lifting":
                self.phase, self.pressure, y[3] = 0, "pedal", 0.0
            self.foot = "held" if self.foot == "pressing" else "off"
        elif name == "on pedal":
            self.pressure, y[3] = "pedal", y[5]
        elif name == "at zero":
            self.pressure, y[3] = "zero", 0.0
        elif name == "leaves":
            self.pressure = "free"

    def run(self):
        y, t = np.array([SPEED, SPEED / RADIUS, 0.0, 0.0, 0.0, 0.0]), 0.0
        while True:
            opened = [name for name, guard in self.edges(t, y) if guard > 1e-7]
            if opened:
                self.jump(opened[0], t, y)
                continue
            t, y, fired = until_switching(self.flow, self.guards, t, y, 9.0, max_step=2e-3)
            name = self.edges(t, y)[fired][0]
            if name == "stop":
                if self.locked:
                    self.lock_time += above_limits(t, y[0], *self.lock_began)
                if self.slide_began is not None:
                    self.slide_time += above_limits(t, y[0], *self.slide_began)[0]
                return t, y
            self.jump(name, t, y)


@pytest.fixture(scope="module")
def by_hand():
    """What it went through, the time of the stop, and the state then."""
    hand = ByHand()
    return hand, *hand.run()


def test_a_stop_with_lock_and_a_pedal_pressed_twice_against_scipy(by_hand):
    hand, time, y = by_hand
    assert hand.seen >= {"lock", "free", "foot", "arrives", "on pedal", "leaves", "to 1", "to 2"} and hand.locks > 1
    result = stop(loop_of(), SPEED, horizon=8.0, step=5e-4)
    assert Outcome(int(result.outcome)) is Outcome.STOPPED
    assert float(result.rollout.time) == pytest.approx(time, abs=2e-6)
    assert float(result.distance) == pytest.approx(y[2] - 0.03 * SPEED, abs=2e-5)
    assert int(result.locks) == hand.locks
    np.testing.assert_allclose([float(x) for x in result.lock_time], hand.lock_time, atol=5e-6)
    assert hand.seen >= {"slide", "turns"} and hand.slide_time > hand.lock_time[0] + 0.01
    assert float(result.slide_time[0]) == pytest.approx(hand.slide_time, abs=5e-6)


@pytest.fixture(scope="module")
def neighbours():
    """Stops a little before and after in one direction of four parameters, and the gradient along it, under jit."""

    def total(shift):
        eps4, rate, delay, c3 = (1 + shift * a for a in ANGLE)
        driver = dataclasses.replace(DRIVER, rate=900.0 * rate, delay=0.03 * delay)
        road = UniformRoad(dataclasses.replace(WET, c3=WET.c3 * c3))
        result = stop(
            loop_of(FivePhase(eps0=90.0, eps4=60.0 * eps4, eps5=90.0, u1=3000.0), driver, road), SPEED, horizon=8.0
        )
        return jnp.stack([result.distance, result.lock_time[0], result.slide_time[0]], axis=-1), result

    @jax.jit
    def with_slopes(shifts):
        values, pull, result = jax.vjp(total, shifts, has_aux=True)
        return values, jax.vmap(pull)(jnp.broadcast_to(jnp.eye(3)[:, None], (3, *values.shape)))[0], result

    h = 1e-6
    values, exact, result = with_slopes(jnp.array([h, -h, 0.0]))
    return np.asarray(exact)[:, 2], np.asarray(values[0] - values[1]) / (2 * h), result


def test_gradient_through_lock_limits_and_pedal(neighbours, by_hand):
    exact, difference, result = neighbours
    np.testing.assert_allclose(result.distance, by_hand[2][2] - 0.03 * SPEED, atol=1e-3)
    assert np.all(np.asarray(result.locks) > 1) and np.all(np.abs(exact) > 1e-3)
    np.testing.assert_allclose(exact, difference, rtol=2e-5)


def test_single_precision_keeps_its_type(by_hand):
    single = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), loop_of())
    result = stop(single, jnp.float32(SPEED), horizon=8.0)
    assert result.distance.dtype == result.lock_time[0].dtype == jnp.float32
    assert float(result.distance) == pytest.approx(by_hand[2][2] - 0.03 * SPEED, abs=5e-3)
    assert int(result.locks) == by_hand[0].locks


def pressures(system, speed, steps):
    """Time, pressure at the wheel, and pressure as commanded, ahead of lag and delay, (points,)."""
    result = stop(system, speed, horizon=steps * 1e-3, step=1e-3, save_every=1)
    path, valid = result.rollout.trajectory, np.asarray(result.rollout.trajectory.valid)
    loop = system.loop if isinstance(system, SampledLoop) else system
    state = path.state.loop if isinstance(system, SampledLoop) else path.state
    found = path.time, loop.wheel_pressure(state), state.brake.commanded
    return [np.asarray(x)[valid] for x in found]


def reached_by_foot(time):
    """Of DRIVER, written down."""
    pressed = np.clip(900.0 * (time - 0.03), 0.0, 60.0)
    lifted = np.clip(60.0 - 900.0 * (time - 1.0), 0.0, 60.0)
    again = np.clip(900.0 * (time - 1.25), 0.0, 60.0)
    return np.where(time < 1.0, pressed, np.where(time < 1.25, lifted, again))


@pytest.mark.parametrize("sampled", [False, True], ids=["located", "sampled"])
def test_the_pressure_is_never_above_the_foot_nor_below_zero(sampled):
    """Releases are long enough to end at zero, and one is still asked for when the foot is off."""
    greedy = FivePhase(eps0=30.0, eps1=50.0, eps2=60.0, u1=9e4, u3=9e4, u4=9e4, longest_release=0.1)
    loop = loop_of(greedy, delay=8e-3)
    time, pressure, commanded = pressures(SampledLoop(loop) if sampled else loop, SPEED, 2500)
    assert time[-1] > 1.5
    for bounded in (pressure, commanded):
        assert bounded.min() >= -1e-9 and np.all(bounded <= reached_by_foot(time) + 1e-9)
    assert np.any(commanded[(time > 0.1) & (time < 1.0)] == 0.0)
    assert np.any(pressure > 10.0) and pressure[(time > 1.1) & (time < 1.25)].max() < 1e-9


def test_what_a_foot_cannot_do_is_refused():
    with pytest.raises(ValueError, match=r"Driver\.changes = \(2\.0, 1\.0\) must rise"):
        Driver(changes=(2.0, 1.0))
    with pytest.raises(ValueError, match=r"Driver\.rate = 0 is outside"):
        Driver(rate=0.0)
    with pytest.raises(ValueError, match="must be at least eps1 \\+ 2"):
        FivePhase(eps1=20.0, eps2=12.2)
    with pytest.raises(ValueError, match="needs a loop with a stop_speed and a Driver"):
        ideal_distance(loop_of(driver=FreeRamp()), SPEED, horizon=3.0)


def by_quadrature(driver, peak, speed, step=2e-5):
    """The ideal stop by small explicit steps; `peak(t, x)`."""
    v, x, t = speed, 0.0, 0.0
    while v > END:
        pedal = min(max(float(driver.rate) * (t + step / 2), 0.0), float(driver.largest))
        a = GRAVITY * min(BRAKE * pedal / (RADIUS * LOAD), peak(t, x))
        x, v, t = x + step * (v - a * step / 2), v - a * step, t + step
    return x


def test_the_ideal_stop_follows_the_pedal_then_the_road():
    driver = Driver(rate=150.0, delay=0.2, largest=50.0)
    constant = float(ideal_distance(loop_of(driver=driver), SPEED, horizon=8.0))
    wet = float(WET.peak().friction)
    assert constant == pytest.approx(by_quadrature(driver, lambda t, x: wet, SPEED), abs=2e-4)
    soft = dataclasses.replace(driver, largest=20.0)
    limited = float(ideal_distance(loop_of(driver=soft), SPEED, horizon=20.0))
    assert limited == pytest.approx(by_quadrature(soft, lambda t, x: wet, SPEED), abs=2e-4)
    ice = SURFACES["ice"]
    patch = ChangingRoad((WET, ice, WET), (5.0, 9.0), 0.5, "distance")
    slippery = float(ice.peak().friction)

    def peak(t, x):
        into, out = (np.clip((x - change) / 0.5, 0.0, 1.0) for change in (5.0, 9.0))
        share = [z**4 * (35 - 84 * z + 70 * z**2 - 20 * z**3) for z in (into, out)]
        return wet + (share[0] - share[1]) * (slippery - wet)

    at_once = dataclasses.replace(driver, delay=0.0)
    changing = float(ideal_distance(loop_of(driver=at_once, road=patch), SPEED, horizon=8.0))
    assert changing == pytest.approx(by_quadrature(driver, peak, SPEED), abs=2e-4)
    assert float(ideal_distance(loop_of(driver=soft), SPEED, horizon=0.5)) == np.inf


def test_a_wheel_whose_slip_just_touches_that_of_a_slide_does_not_begin_and_end_it_for_ever():
    """These touched it, one to a few ulp apart; each switched to and fro in one instant until the budget was spent."""
    controller = FivePhase(eps1=np.linspace(20.0, 38.0, 512)[496:504])
    loop = dataclasses.replace(loop_of(controller, Driver(rate=400.0, largest=150.0)), stop_speed=0.7)
    stopped = stop(loop, 120 / 3.6, horizon=12.0)
    assert (np.asarray(stopped.outcome) == Outcome.STOPPED).all() and int(stopped.events.max()) < 360
    bound = deep(30.0, 0.3)
    assert guard(SLIDING, bound, -1.0, bound) < 0 < guard(SLIDING, 1.002 * bound, -1.0, bound)
