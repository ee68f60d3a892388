"""The hand-written baseline of the benchmarks: located switching in plain numba, for one model.

Five-phase ABS on a quarter car, float64, threads over lanes, each lane a scalar loop. It follows the
scheme of `absjax.hybrid._step`, without derivatives, records or any other model. The state is v, the rim speed
y = R w, the pressure as the rim deceleration it causes q = R gamma_b Pb / J, and the distance. With
a = R^2 Fz / J a slope is the pair (mu, q') of

    v' = g mu,   y' = -a mu - q,   q' = strength / y,   x2 = y' - v' = -(a + g) mu - q.
"""

import numpy as np
from numba import njit, prange

GRAVITY, RAMP, FALLBACK = 9.81, 3.0, 0.9
NEVER, UNUSED = 2.0, -1e30
LANDING_TOLERANCE, MAX_SWITCHINGS = 1e-5, 200
OPTIONS = {"fastmath": {"contract", "nsz", "nnan", "ninf"}, "error_model": "numpy"}
"""Full fastmath, with reassociation, measured 1 to 3 % slower."""


@njit(**OPTIONS)
def _friction(v, y, c1, c2, c3):
    """mu, c1 exp(-c2 |slip|) and y / v."""
    ratio = y / v
    slip = ratio - 1.0
    if slip < 0.0:
        rest = c1 * np.exp(c2 * slip)
        return rest - c1 - c3 * slip, rest, ratio
    rest = c1 * np.exp(-c2 * slip)
    return c1 - rest - c3 * slip, rest, ratio


@njit(**OPTIONS)
def _local(v, y, q, c1, c2, c3, a, strength):
    """mu, q', x2 and x2' at a point."""
    mu, rest, ratio = _friction(v, y, c1, c2, c3)
    dq = strength / y
    slip_rate = (-a * mu - q - ratio * GRAVITY * mu) / v
    return mu, dq, -(a + GRAVITY) * mu - q, -(a + GRAVITY) * (c2 * rest - c3) * slip_rate - dq


@njit(inline="always", **OPTIONS)
def _rk4(v, y, q, x, mu1, dq1, h, c1, c2, c3, a, strength):
    """The state a step h on; (mu1, dq1) is the slope at its start."""
    half, sixth = 0.5 * h, h * (1 / 6)
    v2, y2, q2 = v + half * GRAVITY * mu1, y - half * q - half * a * mu1, q + half * dq1
    mu2, dq2 = _friction(v2, y2, c1, c2, c3)[0], strength / y2
    v3, y3, q3 = v + half * GRAVITY * mu2, y - half * q2 - half * a * mu2, q + half * dq2
    mu3, dq3 = _friction(v3, y3, c1, c2, c3)[0], strength / y3
    v4, y4, q4 = v + h * GRAVITY * mu3, y - h * q3 - h * a * mu3, q + h * dq3
    mu = sixth * (mu1 + 2.0 * (mu2 + mu3) + _friction(v4, y4, c1, c2, c3)[0])
    y_next = y - a * mu - sixth * (q + 2.0 * (q2 + q3) + q4)
    q_next = q + sixth * (dq1 + 2.0 * (dq2 + dq3) + strength / y4)
    return v + GRAVITY * mu, y_next, q_next, x + sixth * (v + 2.0 * (v2 + v3) + v4)


@njit(**OPTIONS)
def _guard(slot, v, mu, x2, r, sign, threshold, fallback, stop):
    """Value and rate of a guard: the threshold that leads on, the fall-back of phase 2, the stop."""
    if slot == 0:
        return sign * x2 - threshold, sign * r
    if slot == 1:
        return fallback - x2, -r
    return stop - v, -GRAVITY * mu


@njit(**OPTIONS)
def _crossing(g0, d0, g1, d1):
    """Fraction of the step at which a guard reaches zero, or NEVER; d0, d1 are rates times the step."""
    if g1 < 0.0 and g0 + d0 * (1 / 3) < 0.0 and g1 - d1 * (1 / 3) < 0.0:
        return NEVER
    b, c = 3.0 * (g1 - g0) - 2.0 * d0 - d1, d0 + d1 - 2.0 * (g1 - g0)
    high, top = 1.0, g1
    if g1 < 0.0:
        falling = np.sqrt(max(b * b - 3.0 * c * d0, 0.0)) - b
        high = d0 / falling if falling != 0.0 else NEVER
        top = g0 + high * (d0 + high * (b + high * c))
        if high <= 0.0 or high >= 1.0 or top < 0.0:
            return NEVER
    low, s = 0.0, min(max(-g0 / (top - g0), 0.0), 1.0) * high if top > g0 else 0.0
    for _ in range(3):
        value, rate = g0 + s * (d0 + s * (b + s * c)), d0 + s * (2.0 * b + 3.0 * c * s)
        low, high = (s, high) if value < 0.0 else (low, s)
        newton = s - value / rate if rate > 0.0 else -1.0
        s = newton if low <= newton <= high else 0.5 * (low + high)
    return s


@njit(parallel=True, **OPTIONS)
def _run(c1s, c2s, c3s, v0s, strengths, signs, thresholds, fallbacks, a, h, steps, stop, out):
    for lane in prange(c1s.size):
        c1, c2, c3 = c1s[lane], c2s[lane], c3s[lane]
        v = y = v0s[lane]
        q, x, left = 0.0, 0.0, h
        mode = index = switchings = 0
        while index < steps and switchings < MAX_SWITCHINGS:
            strength, sign, threshold, fallback = strengths[mode], signs[mode], thresholds[mode], fallbacks[mode]
            mu, dq, x2, r = _local(v, y, q, c1, c2, c3, a, strength)
            slot = 3
            for i in range(2, -1, -1):
                slot = i if _guard(i, v, mu, x2, r, sign, threshold, fallback, stop)[0] >= 0.0 else slot
            while slot == 3 and index < steps:
                vn, yn, qn, xn = _rk4(v, y, q, x, mu, dq, left, c1, c2, c3, a, strength)
                mun, dqn, x2n, rn = _local(vn, yn, qn, c1, c2, c3, a, strength)
                first = NEVER
                for i in range(3):
                    g0, d0 = _guard(i, v, mu, x2, r, sign, threshold, fallback, stop)
                    g1, d1 = _guard(i, vn, mun, x2n, rn, sign, threshold, fallback, stop)
                    at = _crossing(g0, left * d0, g1, left * d1)
                    if at < first:
                        first, slot = at, i
                if slot == 3:
                    v, y, q, x, mu, dq, x2, r = vn, yn, qn, xn, mun, dqn, x2n, rn
                    index, left = index + 1, h
                    continue
                dt = first * left
                for _ in range(2):
                    v, y, q, x = _rk4(v, y, q, x, mu, dq, dt, c1, c2, c3, a, strength)
                    left -= dt
                    mu, dq, x2, r = _local(v, y, q, c1, c2, c3, a, strength)
                    g, rate = _guard(slot, v, mu, x2, r, sign, threshold, fallback, stop)
                    dt = -g / rate if rate > 0.0 and abs(g) <= rate * h else 0.0
                    if abs(dt) <= LANDING_TOLERANCE * h:
                        break
                v, y, q, x = v + dt * GRAVITY * mu, y - dt * (a * mu + q), q + dt * dq, x + dt * v
                left -= dt
            switchings += slot < 3
            if slot >= 2:
                break
            mode = 4 if slot == 1 else 1 if mode == 5 else mode + 1
        out[0, lane], out[1, lane], out[2, lane], out[3, lane] = v, x, (index + 1) * h - left, switchings


def stops(c1, c2, c3, v0, eps, u, step, steps, stop_speed, J=1.2, R=0.3, Fz=2500.0, gamma=17.5):
    """Brake from free rolling at v0 [m/s] until stop_speed (<= 0: never), or for `steps` steps of `step` s.

    c1, c2, c3, v0 are arrays (lanes,), eps = (eps0..eps5), u = (u1, u3, u4). Returns speed, distance, time
    and switchings as arrays (lanes,); the stop counts as a switching,
    and a lane of MAX_SWITCHINGS ends there.
    """
    lanes = [np.ascontiguousarray(values, float) for values in (c1, c2, c3, v0)]
    strengths = np.array([RAMP * u[2], -u[0], 0.0, u[1], u[2], 0.0]) * (R * gamma / J)
    signs = np.array([-1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    thresholds = np.asarray(eps, float) * np.array([1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
    fallbacks = np.array([UNUSED, UNUSED, FALLBACK * eps[1], UNUSED, UNUSED, UNUSED])
    stop = float(stop_speed) if stop_speed > 0 else UNUSED
    out = np.empty((4, lanes[0].size))
    _run(*lanes, strengths, signs, thresholds, fallbacks, R * R * Fz / J, float(step), int(steps), stop, out)
    return out[0], out[1], out[2], out[3].astype(np.int64)
