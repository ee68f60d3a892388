"""A steered four-wheel car by hand, the plane as complex numbers (forward + 1j left), loads from four linear equations.

y = v (real, imaginary), r, yaw, distance, w (4), lx (4), ly (4), P (4), pedal.
"""

import numpy as np

from tests.oracles import five_phase
from tests.oracles.automaton import until_switching

MASS, YAW_INERTIA, BASE, FRONT, TRACK, HEIGHT = 1500.0, 2600.0, 2.7, 1.2, 1.55, 0.55
INERTIA, RADIUS, SIGMA, GRAVITY = 1.2, 0.3, 0.25, 9.81
BRAKES = np.array([17.5, 17.5, 8.5, 8.5])
AT = np.array([FRONT, FRONT, FRONT - BASE, FRONT - BASE]) + 0.5j * TRACK * np.array([1, -1, 1, -1])
LEFT, TO_FRONT = np.sign(AT.imag), np.sign(AT.real)
ROLL = 0.55
ROLL_SHARES = np.where(TO_FRONT > 0, ROLL, 1 - ROLL)


class ByHand:
    """A car on Burckhardt's curves `tyres` (4, 3), the front wheels turned by `angle(t)`.

    Without `controller` the pressures are `pressures(t)`; with one, each wheel has its own five-phase automaton, and
    the driver presses at `pedal_rate`.
    """

    def __init__(self, tyres, angle, *, pressures=None, controller=None, pedal_rate=400.0, largest=150.0):
        self.tyres, self.angle, self.given, self.p = np.asarray(tyres), angle, pressures, controller
        self.pedal_rate, self.largest = pedal_rate, largest
        self.phases, self.entered, self.log = [0] * 4, [0.0] * 4, []

    @staticmethod
    def start(speed):
        return np.concatenate([[speed, 0, 0, 0, 0], np.full(4, speed / RADIUS), np.zeros(13)])

    def friction(self, s):
        c1, c2, c3 = self.tyres.T
        return c1 * (1 - np.exp(-c2 * s)) - c3 * s

    def mechanics(self, t, y, pressures):
        """Slope of the first 17 entries, and over the wheels, along them, the speed and v'."""
        v, r, w, slip = complex(y[0], y[1]), y[2], y[5:9], y[9:13] + 1j * y[13:17]
        h = 1e-6
        turned, before, after = (np.exp(1j * np.where(TO_FRONT > 0, self.angle(x), 0.0)) for x in (t, t - h, t + h))
        over = (v + 1j * r * AT) / turned
        s = np.abs(slip)
        per_load = self.friction(s) * slip / np.where(s > 0, s, 1.0)
        plane = per_load * turned
        rest = MASS * GRAVITY * np.where(TO_FRONT > 0, BASE - FRONT, FRONT) / BASE / 2
        moves = -MASS * HEIGHT / BASE / 2 * np.outer(TO_FRONT, plane.real) / MASS
        moves -= MASS * HEIGHT / TRACK * np.outer(LEFT * ROLL_SHARES, plane.imag) / MASS
        loads = np.linalg.solve(np.eye(4) - moves, rest)
        forces = loads * plane
        acceleration = forces.sum() / MASS - 1j * r * v
        yawing = (np.conj(AT) * forces).imag.sum() / YAW_INERTIA
        spin = -(RADIUS * loads * per_load.real + BRAKES * pressures) / INERTIA
        slipping = (RADIUS * w - over - np.abs(over.real) * slip) / SIGMA
        turning = (1 / after - 1 / before) / (2 * h)
        along = ((acceleration + 1j * yawing * AT) / turned + (v + 1j * r * AT) * turning).real
        slope = [acceleration.real, acceleration.imag, yawing, r, abs(v), *spin, *slipping.real, *slipping.imag]
        return np.array(slope), over.real, along

    def rates(self, y):
        asked = [five_phase.rate(phase, max(RADIUS * w, 0.5), self.p) for phase, w in zip(self.phases, y[5:9])]
        return np.where(np.array(self.phases) == 0, self.pedal(y), asked)

    def pedal(self, y):
        return self.pedal_rate if y[21] < self.largest - 1e-9 else 0.0

    def flow(self, t, y):
        pressures = self.given(t) if self.p is None else y[17:21]
        rest = np.zeros(5) if self.p is None else [*self.rates(y), self.pedal(y)]
        return np.concatenate([self.mechanics(t, y, pressures)[0], rest])

    def edges(self, t, y):
        """(wheel, following phase, guard); wheel None where the pedal arrives."""
        slope, speeds, along = self.mechanics(t, y, y[17:21])
        found = []
        for i, (phase, x2) in enumerate(zip(self.phases, RADIUS * slope[5:9] - along)):
            spent, rim = t - self.entered[i], RADIUS * y[5 + i]
            ways = five_phase.ways(phase, x2, spent, self.p, rim, speeds[i])
            found += [(i, following, guard) for guard, following in ways]
        return [*found, (None, None, y[21] - self.largest if self.pedal(y) else -1.0)]

    def stop(self, speed, end):
        """Time and state where the car is down to `end`; the switchings are in `log`."""
        t, y = 0.0, self.start(speed)

        def guards(t, y):
            return [guard for _, _, guard in self.edges(t, y)] + [end - y[0]]

        while True:
            opened = [edge for edge in self.edges(t, y) if edge[2] > 1e-7]
            if not opened:
                t, y, fired = until_switching(self.flow, guards, t, y, 9.0, max_step=4e-3)
                if fired == len(guards(t, y)) - 1:
                    return t, y
                opened = [self.edges(t, y)[fired]]
            wheel, following, _ = opened[0]
            if wheel is None:
                y[21] = self.largest
                continue
            self.phases[wheel], self.entered[wheel] = following, t
            self.log.append((t, wheel, following))
            assert np.all(y[17:21] <= y[21] + 1e-9) and np.all(y[17:21] >= 0) and np.all(y[5:9] > 0)
