"""A two-axle car with five-phase logic on both axles by hand, and its stop by DOP853 restarted at every switching."""

import numpy as np

from tests.oracles import five_phase
from tests.oracles.automaton import until_switching
from tests.oracles.quarter_car import GRAVITY

MASS, BASE, AHEAD, HEIGHT, PITCH = 1500.0, 2.7, 1.2, 0.55, 2400.0
SPRINGS, DAMPERS, SIGMA = (50e3, 46e3), (4.4e3, 4.0e3), 0.25
INERTIA, RADIUS, BRAKES = 2.4, 0.3, (35.0, 17.0)
ARMS = AHEAD, AHEAD - BASE
AT_REST = MASS * GRAVITY * (BASE - AHEAD) / BASE, MASS * GRAVITY * AHEAD / BASE


def friction(slip, c):
    """Burckhardt's."""
    c1, c2, c3 = c
    return np.sign(slip) * c1 * (1 - np.exp(-c2 * abs(slip))) - c3 * slip


class ByHand:
    """y = v, x, z, z', q, q', pedal, then of both axles w, P, lagged, l."""

    def __init__(self, controllers, driver, c, rate_limit, lag, end):
        self.p, self.d, self.c, self.rate_limit, self.lag, self.end = controllers, driver, c, rate_limit, lag, end
        self.phase, self.on_pedal, self.foot = [0, 0], [True, True], "off"
        self.entered, self.events = [0.0, 0.0], 0

    def axle(self, y, i):
        return y[7 + 4 * i : 11 + 4 * i]

    def motion(self, y):
        """v', z'', q'', (w'_f, w'_r)."""
        _, _, z, dz, q, dq = y[:6]
        springs = [-k * (z - x * q) - d * (dz - x * dq) for k, d, x in zip(SPRINGS, DAMPERS, ARMS)]
        forces = [
            max(rest + s, 0.0) * friction(self.axle(y, i)[3], self.c)
            for i, (rest, s) in enumerate(zip(AT_REST, springs))
        ]
        pitching = -HEIGHT * sum(forces) - sum(x * s for x, s in zip(ARMS, springs))
        turning = [
            (-RADIUS * force - brake * self.axle(y, i)[2]) / INERTIA
            for i, (force, brake) in enumerate(zip(forces, BRAKES))
        ]
        return sum(forces) / MASS, sum(springs) / MASS, pitching / PITCH, turning

    def rate(self, y, i):
        rim = max(RADIUS * self.axle(y, i)[0], 0.5)
        asked = five_phase.rate(self.phase[i], rim, self.p[i]) if self.phase[i] else 1e4
        return np.clip(asked, -self.rate_limit, self.rate_limit)

    def slope(self):
        return self.d.rate if self.foot == "pressing" else 0.0

    def flow(self, t, y):
        slowing, heaving, pitching, turning = self.motion(y)
        found = [slowing, y[0], y[3], heaving, y[5], pitching, self.slope()]
        for i in range(2):
            w, pressure, lagged, slip = self.axle(y, i)
            moving = self.slope() if self.on_pedal[i] else self.rate(y, i)
            found += [
                turning[i],
                moving,
                (pressure - lagged) / self.lag,
                (RADIUS * w - y[0] - abs(y[0]) * slip) / SIGMA,
            ]
        return found

    def edges(self, t, y):
        slowing, _, _, turning = self.motion(y)
        found = [(("stop",), self.end - y[0])]
        for i in range(2):
            x2 = RADIUS * turning[i] - slowing
            if self.phase[i] > 0 or self.foot != "off":
                rim = RADIUS * self.axle(y, i)[0]
                ways = five_phase.ways(self.phase[i], x2, t - self.entered[i], self.p[i], rim, y[0])
                found += [(("to", i, following), guard) for following, guard in ((f, g) for g, f in ways)]
            ahead = self.rate(y, i) - self.slope()
            if self.on_pedal[i]:
                found.append((("leaves", i), -ahead - 1.0))
            elif ahead > 0:
                found.append((("on pedal", i), self.axle(y, i)[1] - y[6]))
        if self.foot == "off":
            found.append((("press",), t - self.d.delay))
        if self.foot == "pressing":
            found.append((("held",), y[6] - self.d.largest))
        return found

    def guards(self, t, y):
        return [guard for _, guard in self.edges(t, y)]

    def jump(self, t, y, what, i=0, following=0):
        self.events += 1
        if what == "to":
            self.phase[i], self.on_pedal[i], self.entered[i] = following, False, t
        elif what == "on pedal":
            self.on_pedal[i] = True
            y[8 + 4 * i] = y[6]
        elif what == "leaves":
            self.on_pedal[i] = False
        else:
            self.foot = "pressing" if what == "press" else "held"

    def run(self, speed):
        """Time and y at the stop."""
        y, t = np.zeros(15), 0.0
        y[0], y[7], y[11] = speed, speed / RADIUS, speed / RADIUS
        while True:
            opened = [name for name, guard in self.edges(t, y) if guard > 1e-7]
            if opened:
                self.jump(t, y, *opened[0])
                continue
            t, y, fired = until_switching(self.flow, self.guards, t, y, 9.0, max_step=4e-3)
            name = self.edges(t, y)[fired][0]
            if name == ("stop",):
                return t, y
            self.jump(t, y, *name)
