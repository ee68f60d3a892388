"""Every controller, under both semantics, against an automaton written by hand: SciPy with events, and a plain loop.

One entry of CASES a controller; nothing here uses the project's controllers but to be compared with.
"""

import dataclasses
from functools import cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.controllers.bosch import BoschLogic
from absjax.controllers.five_phase import FivePhase
from absjax.controllers.production import ProductionLogic
from absjax.controllers.rolling_slip import RollingSlip
from absjax.controllers.slip import SlipControl
from absjax.controllers.stiffness import StiffnessControl
from absjax.controllers.tracking import AccelerationTracking
from absjax.controllers.two_phase import TwoPhase
from absjax.hybrid.rollout import rollout
from absjax.loop._modes import FREE, Mode
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import HELD, FreeRamp
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.stop import Outcome, stop
from absjax.loop.wheel_lock import LOCKED
from absjax.observers.adaptive import AdaptiveObserver
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.results import UNDEFINED
from absjax.tyres.surfaces import SURFACES
from tests.oracles import five_phase
from tests.oracles.automaton import runge_kutta, until_switching
from tests.oracles.quarter_car import GRAVITY, RADIUS, A, B, coefficients, friction, offset

TYRE = SURFACES["wet_asphalt"]
C1, C2, C3 = C = coefficients(TYRE)
SPEED, STEP = 20.0, 5e-4


class Seen(NamedTuple):
    """Signals, worked out by hand from (v, w, distance, P)."""

    t: float
    v: float
    ax: float
    rim: float
    x2: float
    xbs: float
    slip: float


def seen(t, y) -> Seen:
    v, w, _, *pressures = y
    pressure = pressures[-1]
    slip = RADIUS * w / v - 1
    xbs = C1 * C2 * np.exp(-C2 * abs(slip)) - C3
    return Seen(t, v, GRAVITY * friction(v, w, C), RADIUS * w, offset(v, w, pressure, C), xbs, slip)


class Case(NamedTuple):
    """A controller, and the same as functions of what is seen and kept (entry time and one number)."""

    controller: Any
    rate: Any
    """(mode, seen, kept, p) -> bar/s, but for mode 0"""
    edges: Any
    """(mode, seen, kept, p) -> [(guard, following)]"""
    keep: Any
    """(seen, kept, p) -> kept"""
    trained: str
    visited: set
    """switchings (from, to) the case goes through"""
    lag: float | None = None
    duration: float = 0.7
    ramp: float = 6000.0
    """of the published simulations, in mode 0, bar m/s^2"""

    def command(self, mode, s, kept):
        return self.ramp / s.rim if mode == 0 else self.rate(mode, s, kept, self.controller)

    @property
    def loop(self) -> ClosedLoop:
        return loop_of(self.controller, self.ramp, lag=self.lag)


def nothing(s, kept, p):
    return (s.t, s.x2)


def five_rate(mode, s, kept, p):
    return five_phase.rate(mode, s.rim, p)


def five_edges(mode, s, kept, p):
    return five_phase.ways(mode, s.x2, s.t - kept[0], p, s.rim, s.v)


def tracking_rate(mode, s, kept, p):
    if mode in (2, 5):
        return 0.0
    way = 1.2 * ({1: p.eps1, 3: p.eps3, 4: -p.eps4}[mode] - kept[1])
    duration = 1.5 * abs(way) / (B * 750.0)
    q = min((s.t - kept[0]) / duration, 1.0)
    target, slope = kept[1] + way * (3 * q**2 - 2 * q**3), way * 6 * q * (1 - q) / duration
    return -(A / s.v * s.xbs * s.x2 + slope - p.gain * (s.x2 - target)) / B


def two_rate(mode, s, kept, p):
    target = {1: p.zref, 2: -p.zref, 3: p.recovery * p.zref}[mode]
    return (p.gain * (s.x2 - target) - A * s.x2 * s.xbs) / (s.v * B)


def two_edges(mode, s, kept, p):
    if mode == 0:
        return [(-p.eps0 - s.x2, 1)]
    if mode == 1:
        return [(s.xbs - p.chi_b, 2)]
    if mode == 3:
        return [(s.slip - p.slip_limit / 2, 2)]
    return [(p.chi_a - s.xbs, 1), (p.slip_limit - s.slip, 3)]


def stiffness_rate(mode, s, kept, p):
    room = p.c * s.xbs + p.d
    target, slope = -p.rate_gain * s.xbs / room, -p.rate_gain * p.d * s.x2 / room / s.v
    return (-A / s.v * s.x2 * s.xbs + p.gain / s.v * (s.x2 - target) - slope) / B


def slip_rate(mode, s, kept, p):
    return p.gain * (s.x2 - (s.ax * s.slip - p.pull * (s.slip - p.slip))) / (s.v * B)


def driver_edge(mode, s, kept, p):
    return [(-p.eps0 - s.x2, 1)] if mode == 0 else [(-1.0, 1)]


def slip_edges(mode, s, kept, p):
    return [*driver_edge(mode, s, kept, p), *([(1.5 * p.slip - s.slip, 1)] if mode == 0 else [])]


def rolling_rate(mode, s, kept, p):
    return -1e4 if mode == 2 else slip_rate(mode, s, kept, p)


def rolling_edges(mode, s, kept, p):
    spent = s.t - kept[0]
    return slip_edges(mode, s, kept, p) if mode == 0 else [(spent - (p.rolls_every, p.roll_time)[mode - 1], 3 - mode)]


def bosch_rate(mode, s, kept, p):
    return [0.0, 0.0, -p.release, 0.0, p.apply, 0.0, p.step, 0.0][mode] / s.rim


def bosch_edges(mode, s, kept, p):
    acc, spent = s.x2 + s.ax, s.t - kept[0]
    low, high, h = p.minus_a, p.plus_A, p.share
    return [
        [(-low - acc, 1)],
        [((1 - p.lambda1) * (kept[1] - p.gradient * spent) - s.rim, 2), (acc + h * low, 0)],
        [(acc + h * low, 3)],
        [(acc - p.plus_a, 5), (-low - acc, 2), (spent - p.longest_hold, 6)],
        [(p.plus_a + h * (high - p.plus_a) - acc, 5)],
        [(h * p.plus_a - acc, 6), (acc - high, 4)],
        [(-low - acc, 2), (spent - p.pulse, 7)],
        [(-low - acc, 2), (spent - p.pause, 6)],
    ][mode]


def production_rate(mode, s, kept, p):
    return [0.0, 0.0, -p.release, 0.0, p.apply, 0.0, p.through][mode] / s.rim


def production_edges(mode, s, kept, p):
    acc = s.x2 + s.ax
    return [
        [(-p.a1 - acc, 1)],
        [(-p.a2 - acc, 2), (acc + p.share * p.a1, 0)],
        [(acc + p.share * p.a1, 3)],
        [(acc - p.a3, 5), (-p.a1 - acc, 2), (s.t - kept[0] - p.longest_hold, 6)],
        [(p.a3 + p.share * (p.a4 - p.a3) - acc, 5)],
        [(p.share * p.a3 - acc, 6), (acc - p.a4, 4)],
        [(-p.a1 - acc, 2)],
    ][mode]


def bosch_keep(s, kept, p):
    return (s.t, max(s.rim, kept[1] - p.gradient * (s.t - kept[0])))


AROUND = {(0, 1), (1, 2), (2, 4), (4, 5), (5, 1)}
BOSCH = BoschLogic(
    minus_a=12.3673,
    plus_a=5.5591,
    plus_A=11.4391,
    lambda1=0.037,
    gradient=11.8787,
    release=16928.0,
    apply=7489.3,
    step=3002.1,
    pulse=0.0193,
    pause=0.0121,
    share=0.5945,
    longest_hold=0.0242,
)
"""Goes through every switching but 3 -> 2 within a second, behind a brake lag."""
BOSCH_VISITED = {(0, 1), (1, 0), (1, 2), (2, 3), (3, 5), (3, 6), (4, 5), (5, 4), (5, 6), (6, 2), (6, 7), (7, 2), (7, 6)}
PRODUCTION = ProductionLogic(
    a1=13.83,
    a2=27.39,
    a3=14.27,
    a4=22.29,
    release=10858.0,
    apply=4253.0,
    through=5754.0,
    longest_hold=0.0269,
    share=0.676,
)
"""Goes through every switching but 3 -> 2, behind a brake lag."""
PRODUCTION_VISITED = {(0, 1), (1, 0), (1, 2), (2, 3), (3, 5), (3, 6), (4, 5), (5, 4), (5, 6), (6, 2)}
CASES = {
    "five-phase": Case(FivePhase(), five_rate, five_edges, nothing, "eps1", {(2, 3), (3, 4), *AROUND}),
    "five-phase, ways back": Case(
        FivePhase(eps1=40.0, eps2=52.0, u1=20000.0, longest_release=0.012, fallback=0.97),
        five_rate,
        five_edges,
        nothing,
        "longest_release",
        {(1, 4), (5, 4), *AROUND},
    ),
    "five-phase, slip not back": Case(
        FivePhase(eps1=20.0, eps2=22.0, eps3=8.0, eps4=30.0, eps5=40.0, u1=9000.0, recovered_slip=-0.08),
        five_rate,
        five_edges,
        nothing,
        "recovered_slip",
        {(2, 1), (2, 3), (3, 4), *AROUND},
    ),
    "tracking": Case(
        AccelerationTracking(eps1=20.0, eps2=25.0, eps3=12.0, eps5=25.0),
        tracking_rate,
        five_edges,
        nothing,
        "eps1",
        {(2, 3), (3, 4), (5, 4), *AROUND},
    ),
    "two-phase": Case(TwoPhase(chi_a=-0.05), two_rate, two_edges, nothing, "chi_b", {(0, 1), (1, 2), (2, 1)}),
    "two-phase, slip limit": Case(
        TwoPhase(chi_a=-0.3, slip_limit=-0.16), two_rate, two_edges, nothing, "zref", {(0, 1), (1, 2), (2, 3), (3, 2)}
    ),
    "continuous XBS": Case(
        StiffnessControl(c=33.8, d=11.7), stiffness_rate, driver_edge, nothing, "rate_gain", {(0, 1)}
    ),
    "continuous slip": Case(SlipControl(), slip_rate, slip_edges, nothing, "slip", {(0, 1)}),
    "continuous slip, begun by slip": Case(SlipControl(eps0=1e3), slip_rate, slip_edges, nothing, "slip", {(0, 1)}),
    "wheel slip, let roll": Case(
        RollingSlip(rolls_every=0.15, roll_time=0.004),
        rolling_rate,
        rolling_edges,
        nothing,
        "roll_time",
        {(0, 1), (1, 2), (2, 1)},
    ),
    "eight-phase": Case(BOSCH, bosch_rate, bosch_edges, bosch_keep, "release", BOSCH_VISITED, 0.01122, 1.0, 9392.5),
    "production logic": Case(
        PRODUCTION, production_rate, production_edges, nothing, "a2", PRODUCTION_VISITED, 0.008, 0.8, 9e3
    ),
}


def loop_of(controller, ramp=6000.0, **brake) -> ClosedLoop:
    return ClosedLoop(QuarterCar(Wheel(), UniformRoad(TYRE)), Brake(**brake), controller, driver=FreeRamp(ramp))


def begin(case: Case):
    return np.array([SPEED, SPEED / RADIUS, 0.0, 0.0] + ([] if case.lag is None else [0.0]))


def slope(case: Case, t, y, rate):
    """Speeds, distance, commanded pressure, and that behind the lag."""
    s = seen(t, y)
    lagged = [] if case.lag is None else [(y[3] - y[4]) / case.lag]
    return np.array([s.ax, (s.x2 + s.ax) / RADIUS, s.v, rate, *lagged])


def located_by_scipy(case: Case):
    """End state and number of switchings: DOP853 with terminal events, restarted at every switching."""
    p, y, t, mode, count, visited = case.controller, begin(case), 0.0, 0, 0, set()
    kept = case.keep(seen(t, y), (0.0, SPEED), p)

    def flow(t, y):
        return slope(case, t, y, case.command(mode, seen(t, y), kept))

    def guards(t, y):
        return [guard for guard, _ in case.edges(mode, seen(t, y), kept, p)]

    while True:
        s = seen(t, y)
        opened = [following for guard, following in case.edges(mode, s, kept, p) if guard > 1e-6]
        if opened:
            visited.add((mode, opened[0]))
            mode, kept, count = opened[0], case.keep(s, kept, p), count + 1
            continue
        t, y, fired = until_switching(flow, guards, t, y, case.duration, max_step=5e-3)
        if fired is None:
            return y[:4], count, visited
        s = seen(t, y)
        following = case.edges(mode, s, kept, p)[fired][1]
        visited.add((mode, following))
        mode, kept, count = following, case.keep(s, kept, p), count + 1


def sampled_by_hand(case: Case, step: float, steps: int):
    """End state and number of switchings: Runge-Kutta steps, guards tested at each, the rate held between."""
    p, y, mode, count = case.controller, begin(case), 0, 0
    kept = case.keep(seen(0.0, y), (0.0, SPEED), p)
    rate = case.command(mode, seen(0.0, y), kept)
    for k in range(1, steps + 1):

        def flow(y, rate=rate, k=k):
            return slope(case, k * step, y, rate)

        y = runge_kutta(flow, y, step)
        s = seen(k * step, y)
        for guard, following in case.edges(mode, s, kept, p):
            if guard >= 0:
                mode, kept, count = following, case.keep(s, kept, p), count + 1
                break
        rate = case.command(mode, s, kept)
    return y[:4], count


def end_of(result):
    state = result.state.loop if hasattr(result.state, "loop") else result.state
    return [state.plant.speed, state.plant.wheel_speed, state.plant.distance, state.brake.commanded]


def rolled(case: Case, value, speed):
    """Located, with another value of the trained parameter."""
    loop = loop_of(dataclasses.replace(case.controller, **{case.trained: value}), case.ramp, lag=case.lag)
    steps = round(case.duration / STEP)
    return rollout(loop, loop.initial_state(speed), step=STEP, steps=steps, max_events=120)


@cache
def lanes_of(name):
    """Lanes of three values of the trained parameter, and one of another speed; the values, the slopes of the speed by
    them, and where the lanes end."""
    case = CASES[name]
    value = float(getattr(case.controller, case.trained))
    h = 1e-4 * abs(value)

    @jax.jit
    @partial(jax.grad, has_aux=True)
    def run(values):
        result = rolled(case, values, jnp.array([SPEED, SPEED, SPEED, 15.0]))
        return result.state.plant.speed.sum(), result

    values = jnp.array([value, value + h, value - h, value])
    return values, *run(values)


@pytest.mark.parametrize("name", CASES)
def test_located_against_scipy_and_gradient_against_differences(name):
    case = CASES[name]
    values, slopes, lanes = lanes_of(name)
    h = float(values[1] - values[2]) / 2
    expected, count, visited = located_by_scipy(case)
    assert visited == case.visited
    assert int(lanes.events[0]) == count > 0
    np.testing.assert_allclose([float(x[0]) for x in end_of(lanes)], expected, rtol=2e-5)
    assert abs(float(lanes.state.plant.distance[0]) - expected[2]) < 2e-6
    gradient, speeds = float(slopes[0]), np.asarray(lanes.state.plant.speed)
    assert np.all(np.asarray(lanes.events)[:3] == count)
    assert gradient == pytest.approx((speeds[1] - speeds[2]) / (2 * h), rel=1e-5, abs=1e-9 / h)


@pytest.mark.parametrize("name", ["tracking", "eight-phase"])
def test_one_lane_as_one_of_many(name):
    values, _, many = lanes_of(name)
    one = rolled(CASES[name], values[0], jnp.asarray(SPEED))
    for lanes, single in zip(jax.tree.leaves(many.state), jax.tree.leaves(one.state)):
        assert float(lanes[0]) == pytest.approx(float(single), rel=1e-11, abs=1e-11)
    assert many.events[0] != many.events[3]


@pytest.mark.parametrize("name", CASES)
def test_sampled_against_a_plain_loop(name):
    case, step, steps = CASES[name], 1e-3, 600
    sampled = SampledLoop(case.loop)
    result = rollout(sampled, sampled.initial_state(jnp.asarray(SPEED)), step=step, steps=steps)
    expected, count = sampled_by_hand(case, step, steps)
    np.testing.assert_allclose([float(x) for x in end_of(result)], expected, rtol=1e-8)
    assert count > 0 and float(result.state.loop.memory.control.onset_time) > 0
    if name in ("tracking", "eight-phase"):
        coarse = rollout(sampled, sampled.initial_state(jnp.asarray(SPEED, jnp.float32)), step=step, steps=steps)
        assert end_of(coarse)[0].dtype == jnp.float32
        assert float(end_of(coarse)[0]) == pytest.approx(expected[0], rel=2e-3)


def test_continuous_control_of_xbs_reaches_the_peak_and_says_when_it_is_not_defined():
    controller = StiffnessControl(c=C2, d=C2 * C3)
    loop = dataclasses.replace(loop_of(controller), stop_speed=8.0)
    result = stop(loop, SPEED, horizon=3.0, step=1e-3)
    assert Outcome(int(result.outcome)) is Outcome.STOPPED
    assert (
        float(result.mean_friction) > 0.99 * float(TYRE.peak().friction)
        and float(result.longest_cycle) == 0.0
        and int(result.cycles) == 0
    )
    narrow = dataclasses.replace(loop, controller=StiffnessControl(c=C2, d=1.0))
    assert Outcome(int(stop(narrow, SPEED, horizon=3.0, step=1e-3).outcome)) is Outcome.CONTROL_UNDEFINED
    sampled = SampledLoop(dataclasses.replace(loop_of(StiffnessControl(c=C2, d=1.0)), stop_speed=8.0))
    assert Outcome(int(stop(sampled, SPEED, horizon=3.0, step=1e-3).outcome)) is Outcome.CONTROL_UNDEFINED
    observer = AdaptiveObserver.placed(Wheel(), (160.0, 6400.0), (4e4, 1e4))
    blind = dataclasses.replace(loop_of(controller), observer=observer)
    start = blind.braking(jnp.asarray(25.0), TYRE.slip_at(8.0), -100.0)
    failed = rollout(blind, start, 1, step=1.25e-4, steps=2000)
    assert int(failed.mode) == UNDEFINED and float(failed.time) < 0.2
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(failed.state))


def test_a_loop_starts_where_it_is_told_to():
    state = loop_of(TwoPhase()).braking(jnp.asarray(SPEED), TYRE.slip_at(1.5), -30.0)
    signals = loop_of(TwoPhase()).signals(0.0, state, 1)
    assert float(signals.acceleration_offset) == pytest.approx(-30.0, rel=1e-12)
    assert float(signals.stiffness) == pytest.approx(1.5, rel=1e-12)
    lagging = loop_of(TwoPhase(), lag=5e-3, delay=1e-3)
    same = lagging.signals(0.0, lagging.braking(jnp.asarray(SPEED), TYRE.slip_at(1.5), -30.0), 1)
    assert float(same.acceleration_offset) == pytest.approx(-30.0, rel=1e-12)


def test_a_wheel_that_drops_again_is_released_again():
    signals = loop_of(BOSCH).signals(0.0, loop_of(BOSCH).braking(jnp.asarray(SPEED), TYRE.slip_at(-0.1), -30.0), 3)
    guards = BOSCH.guards(signals, BOSCH.initial_state(signals), 3)
    assert [float(g) > 0 for g in guards] == [False, True, False]
    assert int(BOSCH.switch(signals, BOSCH.initial_state(signals), 3, 1)[1]) == 2


def test_thresholds_out_of_order_are_refused():
    with pytest.raises(ValueError, match=r"ProductionLogic\.a2 = 45\.0 must be at least a1 \+ 2 = 46\.0"):
        ProductionLogic(a1=44.0)
    with pytest.raises(ValueError, match=r"BoschLogic\.plus_A = 40\.0 must be at least plus_a \+ 2 = 52\.0"):
        BoschLogic(plus_a=50.0)


def guard_of(controller, speed, slip, pedal=1.0):
    """The second way out of driver braking."""
    loop = loop_of(controller)
    signals = loop.signals(0.1, loop.braking(jnp.asarray(speed), slip, 1.0), 0)._replace(pedal=pedal)
    return float(controller.guards(signals, controller.initial_state(signals._replace(time=0.0)), 0)[1])


def test_slip_control_begins_where_the_slip_is_far_beyond_its_set_point():
    slip = SlipControl(slip=-0.12)
    assert guard_of(slip, 30.0, -0.19) == pytest.approx(0.01) and guard_of(slip, 30.0, -0.17) == pytest.approx(-0.01)
    assert guard_of(slip, 30.0, -0.19, pedal=0.0) < 0


def test_five_phases_let_go_of_a_wheel_that_has_come_to_stand_under_the_driver():
    """To a deceleration that it never had, above 15 km/h; below, and as published, it is left to him."""
    never = FivePhase(eps0=1e4)
    assert guard_of(never, 30.0, -1.0) > 0 > guard_of(never, 30.0, -0.9)
    assert guard_of(never, 4.0, -1.0) < 0 and guard_of(never, 30.0, -1.0, pedal=0.0) < 0
    assert guard_of(FivePhase(eps0=1e4, ways_back=False), 30.0, -1.0) < 0
    loop = loop_of(never)
    state = loop.braking(30.0, -1.0, 1.0)._replace(brake=loop.brake.initial_state(60.0))
    mode = Mode(0, FREE, LOCKED, FREE).encoded(len(FivePhase.phases))
    end = rollout(loop, state, mode, step=2e-3, steps=60, max_events=50)
    assert not bool(loop.locked(end.mode))


SNOW = UniformRoad(SURFACES["snow"])


def on_snow(phase, pressed, **thresholds):
    """A second from 30 m/s, the wheel standing at 60 bar: where it stands, and its slip, every 2 ms."""
    brake = Brake(rate_limit=750.0, lag=5e-3)
    loop = ClosedLoop(QuarterCar(Wheel(), SNOW), brake, FivePhase(**thresholds))
    state = loop.braking(30.0, -1.0, 1.0)._replace(brake=brake.initial_state(60.0))
    mode = Mode(phase, FREE, LOCKED, pressed).encoded(len(FivePhase.phases))
    path = rollout(loop, state, mode, step=2e-3, steps=500, max_events=100, save_every=1).path
    car = path.state.plant
    return np.asarray(loop.locked(path.mode)), np.asarray(loop.plant.wheel.slip(car.wheel_speed, car.speed))


def test_five_phases_let_go_of_a_wheel_that_stands():
    """In the slow apply. As published the acceleration that ends it never comes."""
    for ways_back, lets_go in ((True, True), (False, False)):
        locked, _ = on_snow(4, HELD, ways_back=ways_back)
        assert locked[:5].all() and locked[100:].any() != lets_go


def test_five_phases_apply_no_pressure_before_the_slip_is_back():
    """Let go of at walking pace the wheel has the accelerations of one that comes back over the peak."""
    for recovered_slip, recovers in ((-0.3, True), (-1.0, False)):
        _, slip = on_snow(1, FREE, recovered_slip=recovered_slip, eps1=15.0, eps2=30.0, u1=12000.0)
        assert (slip.max() > -0.31) == recovers
