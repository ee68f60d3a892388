"""The hand-written baseline of the benchmarks: located switching in plain numba, for one model.

Five-phase ABS on a quarter car, float64, threads over lanes, each lane a scalar loop. It follows the
scheme of `absjax._lanes`, without derivatives, records or any other model.

The state is v, the rim speed y = R w, the pressure as the rim deceleration it causes
q = R gamma_b Pb / J, and the distance. With a = R^2 Fz / J the flow is

    v' = g mu,   y' = -a mu - q,   q' = strength / y,   x2 = y' - v' = -(a + g) mu - q,

so that a slope is the pair (mu, q').
"""

import math

import numpy as np
from numba import njit, prange

GRAVITY = 9.81
RAMP, FALLBACK = 3.0, 0.9
NEVER = 2.0
LANDING_TOLERANCE = 1e-5
MAX_SWITCHINGS = 200
"""A lane that reaches it ends there."""
OPTIONS = {"fastmath": {"contract", "nsz", "nnan", "ninf"}, "error_model": "numpy"}
"""Measured to be the fastest; reassociation, and inlining by hand other than of the Runge-Kutta step, gain nothing."""


@njit(**OPTIONS)
def _friction(v, y, c1, c2, c3):
    """mu, c1 exp(-c2 |slip|) and y / v."""
    ratio = y / v
    slip = ratio - 1.0
    if slip < 0.0:
        rest = c1 * math.exp(c2 * slip)
        return rest - c1 - c3 * slip, rest, ratio
    rest = c1 * math.exp(-c2 * slip)
    return c1 - rest - c3 * slip, rest, ratio


@njit(**OPTIONS)
def _local(v, y, q, c1, c2, c3, a, strength):
    """mu, q', x2 and x2' at a point."""
    mu, rest, ratio = _friction(v, y, c1, c2, c3)
    dq = strength / y
    x2 = -(a + GRAVITY) * mu - q
    slip_rate = (-a * mu - q - ratio * GRAVITY * mu) / v
    return mu, dq, x2, -(a + GRAVITY) * (c2 * rest - c3) * slip_rate - dq


@njit(inline="always", **OPTIONS)
def _rk4(v, y, q, x, mu1, dq1, h, c1, c2, c3, a, strength):
    """The state a step h on; (mu1, dq1) is the slope at its start."""
    half, sixth = 0.5 * h, h / 6.0
    v2, y2, q2 = v + half * GRAVITY * mu1, y - half * q - half * a * mu1, q + half * dq1
    mu2 = _friction(v2, y2, c1, c2, c3)[0]
    dq2 = strength / y2
    v3, y3, q3 = v + half * GRAVITY * mu2, y - half * q2 - half * a * mu2, q + half * dq2
    mu3 = _friction(v3, y3, c1, c2, c3)[0]
    dq3 = strength / y3
    v4, y4, q4 = v + h * GRAVITY * mu3, y - h * q3 - h * a * mu3, q + h * dq3
    mu4 = _friction(v4, y4, c1, c2, c3)[0]
    mu = sixth * (mu1 + 2.0 * (mu2 + mu3) + mu4)
    return (
        v + GRAVITY * mu,
        y - a * mu - sixth * (q + 2.0 * (q2 + q3) + q4),
        q + sixth * (dq1 + 2.0 * (dq2 + dq3) + strength / y4),
        x + sixth * (v + 2.0 * (v2 + v3) + v4),
    )


@njit(**OPTIONS)
def _crossing(g0, d0, g1, d1):
    """Fraction of the step at which a guard reaches zero, or NEVER; d0, d1 are rates times the step."""
    if g1 < 0.0 and g0 + d0 * (1 / 3) < 0.0 and g1 - d1 * (1 / 3) < 0.0:
        return NEVER
    b, c = 3.0 * (g1 - g0) - 2.0 * d0 - d1, d0 + d1 - 2.0 * (g1 - g0)
    last, top = 1.0, g1
    if g1 < 0.0:
        falling = math.sqrt(max(b * b - 3.0 * c * d0, 0.0)) - b
        last = d0 / falling if falling != 0.0 else -1.0
        if not 0.0 < last < 1.0:
            return NEVER
        top = g0 + last * (d0 + last * (b + last * c))
        if top < 0.0:
            return NEVER
    low, high = 0.0, last
    s = min(max(-g0 / (top - g0), 0.0), 1.0) * last if top > g0 else 0.0
    for _ in range(3):
        value, rate = g0 + s * (d0 + s * (b + s * c)), d0 + s * (2.0 * b + 3.0 * c * s)
        if value < 0.0:
            low = s
        else:
            high = s
        newton = s - value / rate if rate > 0.0 else -1.0
        s = newton if low <= newton <= high else 0.5 * (low + high)
    return s


@njit(parallel=True, **OPTIONS)
def _run(c1s, c2s, c3s, v0s, strengths, signs, thresholds, fallback, a, h, steps, stop, out):
    for lane in prange(c1s.size):
        c1, c2, c3 = c1s[lane], c2s[lane], c3s[lane]
        v = y = v0s[lane]
        q = x = 0.0
        mode = index = switchings = 0
        left = h
        strength, sign, threshold = strengths[0], signs[0], thresholds[0]
        mu, dq, x2, r = _local(v, y, q, c1, c2, c3, a, strength)
        while index < steps and switchings < MAX_SWITCHINGS:
            slot = -1
            if sign * (x2 - threshold) >= 0.0:
                slot = 0
            elif mode == 2 and fallback - x2 >= 0.0:
                slot = 1
            elif stop - v >= 0.0:
                slot = 2
            if slot < 0:
                vn, yn, qn, xn = _rk4(v, y, q, x, mu, dq, left, c1, c2, c3, a, strength)
                mun, dqn, x2n, rn = _local(vn, yn, qn, c1, c2, c3, a, strength)
                first = _crossing(sign * (x2 - threshold), left * sign * r, sign * (x2n - threshold), left * sign * rn)
                slot = 0
                if mode == 2:
                    at = _crossing(fallback - x2, -left * r, fallback - x2n, -left * rn)
                    if at < first:
                        first, slot = at, 1
                at = _crossing(stop - v, -left * GRAVITY * mu, stop - vn, -left * GRAVITY * mun)
                if at < first:
                    first, slot = at, 2
                if first == NEVER:
                    v, y, q, x, mu, dq, x2, r = vn, yn, qn, xn, mun, dqn, x2n, rn
                    index += 1
                    left = h
                    continue
                dt = first * left
                for _ in range(2):
                    v, y, q, x = _rk4(v, y, q, x, mu, dq, dt, c1, c2, c3, a, strength)
                    left -= dt
                    mu, dq, x2, r = _local(v, y, q, c1, c2, c3, a, strength)
                    if slot == 0:
                        guard, rate = sign * (x2 - threshold), sign * r
                    elif slot == 1:
                        guard, rate = fallback - x2, -r
                    else:
                        guard, rate = stop - v, -GRAVITY * mu
                    dt = -guard / rate if rate > 0.0 and abs(guard) <= rate * h else 0.0
                    if abs(dt) <= LANDING_TOLERANCE * h:
                        break
                v, y, q, x = v + dt * GRAVITY * mu, y - dt * (a * mu + q), q + dt * dq, x + dt * v
                left -= dt
            switchings += 1
            if slot == 2:
                break
            mode = 4 if slot == 1 else 1 if mode == 5 else mode + 1
            strength, sign, threshold = strengths[mode], signs[mode], thresholds[mode]
            mu, dq, x2, r = _local(v, y, q, c1, c2, c3, a, strength)
        out[0, lane], out[1, lane], out[2, lane], out[3, lane] = v, x, (index + 1) * h - left, switchings


def stops(c1, c2, c3, v0, eps, u, step, steps, stop_speed, J=1.2, R=0.3, Fz=2500.0, gamma=17.5):
    """Brake from free rolling at v0 until stop_speed (<= 0: never) or for `steps` grid steps.

    c1, c2, c3, v0 are arrays (lanes,), eps = (eps0..eps5), u = (u1, u3, u4). Returns arrays (lanes,):
    speed, distance, time, and switchings, in which the stop counts as one.
    """
    c1, c2, c3, v0 = (np.ascontiguousarray(values, float) for values in (c1, c2, c3, v0))
    u1, u3, u4 = u
    strengths = np.array([RAMP * u4, -u1, 0.0, u3, u4, 0.0]) * (R * gamma / J)
    signs = np.array([-1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    thresholds = np.asarray(eps, float) * signs * np.array([1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
    stop = float(stop_speed) if stop_speed > 0 else -1e30
    out = np.empty((4, c1.size))
    _run(c1, c2, c3, v0, strengths, signs, thresholds, FALLBACK * eps[1], R * R * Fz / J, step, steps, stop, out)
    return out[0], out[1], out[2], out[3].astype(np.int64)
