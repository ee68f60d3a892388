"""Five phases with predictive tracking in a control unit, by hand: a quarter car, a plain loop over ticks.

`p` has the thresholds, gains and pedal; the predictor's integrals by the trapezoidal rule, rings as lists.
"""

import math
from collections import deque

import numpy as np

from tests.oracles import quarter_car
from tests.oracles.automaton import runge_kutta
from tests.oracles.five_phase import ways

A, B = quarter_car.A, quarter_car.B


class Unit:
    """The controller."""

    def __init__(self, p, ticks, tick):
        self.p, self.ticks, self.tick, self.phase = p, ticks, tick, 0
        self.enter(0.0, 0.0)

    def enter(self, time, x2):
        self.time, self.offset = time, x2
        self.S = self.I1 = self.sigma = self.I2 = 0.0
        self.rates = (0.0,) * 4
        self.rows = deque([None] * self.ticks, self.ticks)

    def target(self, time):
        p = self.p
        goal = {1: p.eps1, 3: p.eps3, 4: -p.eps4}.get(self.phase, 0.0)
        way = (1 + p.beyond) * (goal - self.offset)
        T = 1.5 / B * abs(way) / p.pressure_rate
        s = min(max((time - self.time) / T, 0.0), 1.0) if T > 0 else 1.0
        return self.offset + way * (3 * s**2 - 2 * s**3), way * 6 * s * (1 - s) / T if T > 0 else 0.0

    def predicted(self, now, x2, xbs):
        p, then = self.p, now - self.ticks * self.tick
        error = x2 - self.target(then)[0]
        ahead = error - p.gain * self.S - p.beta1 * self.I1
        growth = math.exp(p.c2 * self.sigma)
        z2 = growth * xbs + (growth - 1) * p.c3 - p.beta2 * self.I2
        return error, ahead, min(max(z2, -p.c3), p.stiffest)

    def advance(self, now, x2, xbs, v):
        row = self.rows[-1]
        if self.phase in (1, 3, 4):
            start = (self.S, self.I1, self.sigma, self.I2)
            for _ in range(2):
                error, ahead, _z2 = self.predicted(now, x2, xbs)
                e, a, z = row if row else (0.0, 0.0, 0.0)
                known = 1.0 if row else 0.0
                before = self.target(now - self.ticks * self.tick)[0] + a
                z1 = self.target(now)[0] + ahead
                rates = error - e, known * (a - error), (z1 - before) / v, known * (z - xbs)
                self.S, self.I1, self.sigma, self.I2 = (
                    s + self.tick / 2 * (r + b) for s, r, b in zip(start, rates, self.rates)
                )
            self.rates = rates
        self.rows.appendleft(self.predicted(now, x2, xbs))

    def command(self, now, x2, xbs, v):
        if self.phase == 0:
            return 1e4
        if self.phase not in (1, 3, 4):
            return 0.0
        error, ahead, z2 = self.predicted(now, x2, xbs)
        target, slope = self.target(now)
        return -(A / v * z2 * (target + ahead) + slope - self.p.gain * error) / B

    def pass_(self, now, x2, xbs, v, rim):
        self.advance(now, x2, xbs, v)
        spent = now - self.time
        for guard, following in ways(self.phase, x2, spent, self.p, rim, v):
            if guard >= 0:
                self.phase = following
                self.enter(now, x2)
                self.sigma = self.ticks * self.tick * self.target(now)[0] / v
                first = self.rows
                first.appendleft(self.predicted(now, x2, xbs))
                if self.phase in (1, 3, 4):
                    self.rates = (x2 - self.offset, 0.0, 0.0, 0.0)
                break
        return max(min(self.command(now, x2, xbs, v), self.p.rate_limit), -self.p.rate_limit)


def run(p, tyre, speed, ticks, tick, end):
    """v, w and pressure at the ticks, (ticks, 3), and the phases; the pedal is a ramp to a pressure never reached."""
    c1, c2, c3 = c = quarter_car.coefficients(tyre)
    unit, time = Unit(p, ticks, tick), 0.0
    y = np.array([speed, speed / quarter_car.RADIUS, 0.0])
    rates = deque([p.rate_limit] * (ticks + 1), ticks + 1)
    free, path, phases = False, [y], [0]
    for k in range(1, round(end / tick) + 1):
        acting = rates[-1]

        def flow(y, rate=acting if free else p.pedal):
            mu = quarter_car.friction(y[0], y[1], c)
            return np.array([quarter_car.GRAVITY * mu, quarter_car.spin(y[0], y[1], y[2], c), rate])

        y, time = runge_kutta(flow, y, tick), k * tick
        x2 = quarter_car.offset(*y, c)
        slip = quarter_car.RADIUS * y[1] / y[0] - 1
        xbs = c1 * c2 * math.exp(-c2 * abs(slip)) - c3
        rates.appendleft(unit.pass_(time, x2, xbs, y[0], quarter_car.RADIUS * y[1]))
        # The pressure leaves the pedal's when the command that acts rises less than the pedal does.
        free = free or (unit.phase > 0 and rates[-1] < p.pedal - 1)
        path.append(y)
        phases.append(unit.phase)
    return np.array(path), np.array(phases)
