"""The loop of many braked cars side by side: Runge-Kutta steps of 0.1 ms, control each 1 ms, arrays (axles, logs)."""

import dataclasses

import numpy as np

from tests.oracles.log_scenarios import GRAVITY, Stop, TwoAxleStop

STEP = 1e-4
TICK = 1e-3
"""s: of control and of what is kept"""
APPLY, RELEASE, HOLD = 0, 1, 2


@dataclasses.dataclass(frozen=True)
class Trace:
    """What happened, each TICK, without sensors: arrays (times,) or (times, axles), to the end of the stop."""

    time: np.ndarray
    speed: np.ndarray
    wheel_speed: np.ndarray
    logged_pressure: np.ndarray
    """behind the valve's lag, bar"""
    acting_pressure: np.ndarray
    """at the brake, bar"""
    acceleration: np.ndarray
    """of the tyres alone, as an accelerometer feels it, m/s^2"""
    friction: np.ndarray
    load: np.ndarray
    starts: np.ndarray
    """(changes, axles): when each next surface begins, inf if it never does"""


class Cars:
    """The constants of a batch of stops of as many axles."""

    def __init__(self, stops: list[Stop] | list[TwoAxleStop]):
        axles = [[s.car] if isinstance(s, Stop) else [s.front, s.rear] for s in stops]

        def each(name):
            return np.array([[getattr(wheel, name) for wheel in wheels] for wheels in axles]).T

        self.inertia, self.radius, self.weight = each("inertia"), each("radius"), each("load")
        self.efficiency = each("brake_efficiency")
        two = len(axles[0]) == 2
        self.sign = np.array([[1.0], [-1.0]]) if two else np.zeros((1, 1))
        self.lever = np.array([s.cg_height / s.wheelbase if isinstance(s, TwoAxleStop) else 0.0 for s in stops])
        self.wheelbase = np.array([s.wheelbase if isinstance(s, TwoAxleStop) else 0.0 for s in stops])
        self.pitch_lag = np.array([s.pitch_lag if isinstance(s, TwoAxleStop) else 0.0 for s in stops])
        self.pitch_rate = np.array([1 / lag if lag > 0 else 0.0 for lag in self.pitch_lag])
        self.mass = self.weight.sum(0) / GRAVITY
        self.downhill = GRAVITY * np.sin([s.road.slope for s in stops])
        self.free = np.array([0.0 if isinstance(s, Stop) and s.rig else 1.0 for s in stops])

    def forces(self, v, w, shift, c):
        """Friction, load and the lagless load shift, for c (3, axles, logs).

        load = weight +- shift, shift = -lever sum(mu load).
        """
        slip = self.radius * w / v - 1
        friction = np.copysign(c[0] * (1 - np.exp(-c[1] * np.abs(slip))), slip) - c[2] * slip
        if len(friction) == 1:
            return friction, self.weight, shift
        still, per_shift = (friction * self.weight).sum(0), (friction * self.sign).sum(0)
        at_once = -self.lever * still / (1 + self.lever * per_shift)
        shift = np.where(self.pitch_lag > 0, shift, at_once)
        target = -self.lever * (still + per_shift * shift)
        return friction, self.weight + self.sign * shift, target

    def rates(self, y, pressure, c):
        """v', w', shift' for rows of v, w and shift; a wheel that stands does not turn backwards."""
        w, shift = y[1:-1], y[-1]
        friction, load, target = self.forces(y[0], w, shift, c)
        force, rates = friction * load, np.empty_like(y)
        rates[0] = self.free * (force.sum(0) / self.mass + self.downhill)
        dw = (-self.radius * force - self.efficiency * pressure) / self.inertia
        dw[(w <= 0) & (dw < 0)] = 0.0
        rates[1:-1], rates[-1] = dw, (target - shift) * self.pitch_rate
        return rates

    def step(self, y, h, pressures, roads):
        """Classical Runge-Kutta; pressures and coefficients at the start, the middle and the end."""
        k1 = self.rates(y, pressures[0], roads[0])
        k2 = self.rates(y + h / 2 * k1, pressures[1], roads[1])
        k3 = self.rates(y + h / 2 * k2, pressures[1], roads[1])
        k4 = self.rates(y + h * k3, pressures[2], roads[2])
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        y[1:-1] = np.maximum(y[1:-1], 0.0)
        return y


class Roads:
    """Coefficients and slips of control of a batch, as functions of time: (5, axles, logs)."""

    def __init__(self, stops, axles):
        most = max(len(s.road.surfaces) for s in stops)

        def row(stop):
            values = [
                (s.c1, s.c2, s.c3, release_slip(s, stop.control), stop.control.apply_at * aim(s))
                for s in stop.road.surfaces
            ]
            return values + values[-1:] * (most - len(values))

        table = np.array([row(s) for s in stops]).transpose(1, 2, 0)[:, :, None, :]
        self.first, self.jumps = np.repeat(table[0], axles, 1), np.diff(table, axis=0)
        self.starts = np.full((most - 1, axles, len(stops)), np.inf)
        for i, s in enumerate(stops):
            self.starts[: len(s.road.changes), 0, i] = s.road.changes
        self.travelled = np.full((most - 1, len(stops)), np.inf)
        self.blend = np.array([max(s.road.blend, 1e-9) for s in stops])

    def follow(self, t, distance, wheelbase):
        """The rear axle meets a change when it has rolled a wheelbase from where the front one met it."""
        met = (t >= self.starts[:, 0]) & np.isinf(self.travelled)
        self.travelled = np.where(met, distance, self.travelled)
        reached = np.isinf(self.starts[:, 1]) & (distance >= self.travelled + wheelbase)
        self.starts[:, 1] = np.where(reached, t, self.starts[:, 1])

    def at(self, times):
        """(times, 5, axles, logs)"""
        value = np.repeat(self.first[None], len(times), 0)
        for start, jump in zip(self.starts, self.jumps):
            value = value + jump * np.clip((times[:, None, None, None] - start) / self.blend, 0.0, 1.0)
        return value


def aim(surface):
    """The slip that control works about: the peak's, kept away from standstill and from rolling."""
    return min(max(surface.peak_slip if surface.c3 > 0 else 0.06, 0.04), 0.5)


def release_slip(surface, control):
    return min(control.release_at * aim(surface), aim(surface) + control.release_beyond)


class Lag:
    """y' = (x - y) / tau, exactly for x straight within a step."""

    def __init__(self, tau, step, value):
        self.tau, self.step, self.value, self.before = tau, step, value, value
        self.decay = np.where(tau > 0, np.exp(-step / np.where(tau > 0, tau, 1.0)), 0.0)

    def __call__(self, course):
        """y at the ends of the next steps, for x at them."""
        before = np.concatenate([self.before[None], course[:-1]])
        behind = (course - before) / self.step * self.tau
        settled, found = course - behind, []
        for x, x_before, lag in zip(settled, before, behind):
            self.value = x + (self.value - x_before + lag) * self.decay
            found.append(self.value)
        self.before = course[-1]
        return np.stack(found)


class Delay:
    """x of some half steps before, each log its own."""

    def __init__(self, steps, value):
        self.steps, self.ring, self.now = steps, np.repeat(value[None], steps.max() + 1, 0), 0
        self.columns = np.arange(len(steps))

    def __call__(self, course):
        found = []
        for x in course:
            self.ring[self.now % len(self.ring)] = x
            found.append(self.ring[(self.now - self.steps) % len(self.ring), :, self.columns].T)
            self.now += 1
        return np.stack(found)


class Control:
    """Three phases per wheel; see `AntiLock`."""

    def __init__(self, stops, shape):
        settings = [s.control for s in stops]
        self.set = {f.name: np.array([getattr(x, f.name) for x in settings]) for f in dataclasses.fields(settings[0])}
        self.phase = np.full(shape, APPLY)
        self.too_much = np.full(shape, np.inf)
        """pressure at the last release"""

    def __call__(self, t, pressure, slip, x2, release_at, apply_at):
        """Rates of the commanded pressure [bar/s] for the coming tick."""
        s, old = self.set, self.phase
        beyond, back = slip < -release_at, slip > -apply_at
        let_go = beyond & ((old == APPLY) | ((old == HOLD) & (x2 <= 0)))
        self.too_much = np.where(let_go & (old == APPLY), pressure, self.too_much)
        hold = (old == RELEASE) & ((x2 > s["recovery"]) | back)
        again = (old == HOLD) & ~let_go & (back | (x2 <= 0))
        self.phase = np.select([let_go, hold, again], [RELEASE, HOLD, APPLY], old)
        rise = np.where(pressure < s["fast_until"] * self.too_much, s["fast_rate"], s["slow_rate"])
        rise = np.where(np.isinf(self.too_much), np.where(t >= s["pedal_at"], s["pedal_rate"], 0.0), rise)
        rate = np.select([self.phase == APPLY, self.phase == RELEASE], [rise, -s["release_rate"]], 0.0)
        return (np.clip(pressure + rate * TICK, 0.0, s["pedal_pressure"]) - pressure) / TICK


def drive(stops: list) -> list[Trace]:
    """Runs `Stop`s, or `TwoAxleStop`s, all together."""
    cars = Cars(stops)
    shape = cars.weight.shape
    axles, logs = shape
    roads, control = Roads(stops, axles), Control(stops, shape)
    valve = Lag(control.set["lag"], STEP / 2, np.zeros(shape))
    brake = Lag(np.array([s.brake.lag for s in stops]), STEP / 2, np.zeros(shape))
    delay_steps = np.array([round(2 * s.brake.delay / STEP) for s in stops])
    delay = Delay(delay_steps, np.zeros(shape)) if delay_steps.any() else lambda course: course
    v = np.array([s.speed for s in stops])
    y = np.vstack([v, v / cars.radius, np.zeros(logs)])
    end_speed = np.array([s.logging.end_speed for s in stops])
    duration = np.array([s.logging.duration for s in stops])
    commanded, logged, acting = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    distance, road = np.zeros(logs), roads.at(np.zeros(1))[0]
    steps = round(TICK / STEP)
    halves, ends = np.arange(1, 2 * steps + 1)[:, None, None] / 2, np.arange(1, steps + 1)
    kept = []
    length = np.zeros(logs, int)
    for tick in range(round(duration.max() / TICK) + 1):
        t = tick * TICK
        runs = (y[0] > end_speed) & (t <= duration + TICK / 2)
        if not runs.any():
            break
        length += runs
        friction, load, _ = cars.forces(y[0], y[1:-1], y[-1], road[:3])
        felt = cars.free * (friction * load).sum(0) / cars.mass
        kept.append((y[0], y[1:-1], logged, acting, felt, friction, load))
        if axles == 2:
            roads.follow(t, distance, cars.wheelbase)
        dv, *dw, _ = cars.rates(y, acting, road[:3])
        slip = cars.radius * y[1:-1] / y[0] - 1
        rate = control(t, commanded, slip, cars.radius * dw - dv, road[3], road[4])
        h = STEP * runs
        behind_valve = valve(commanded + rate * halves * STEP)
        pressures = np.concatenate([acting[None], brake(delay(behind_valve))])
        course = np.concatenate([road[None], roads.at(t + ends * STEP)])
        curves = course[:, :3]
        middles = (curves[:-1] + curves[1:]) / 2
        for i in range(steps):
            before = y[0]
            y = cars.step(y, h, pressures[2 * i : 2 * i + 3], (curves[i], middles[i], curves[i + 1]))
            distance = distance + h * (before + y[0]) / 2
        logged, acting, road = behind_valve[-1], pressures[-1], course[-1]
        commanded = commanded + rate * TICK
    columns = [np.stack(x) for x in zip(*kept)]
    time = np.arange(len(kept)) * TICK
    return [
        Trace(time[:n], *(x[:n, ..., i] for x in columns), starts=roads.starts[: len(s.road.changes), :, i])
        for i, (s, n) in enumerate(zip(stops, length))
    ]
