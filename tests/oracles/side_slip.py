"""The side-slip observer of Grip et al. 2008 as a plain loop over scalars, written from the equations alone."""

import math

import numpy as np

G = 9.81


def observe(car, log, *, lateral_gain=1.0, friction_gain=4.0, yaw_gain=40.0, coupling=0.1, adapts=True, period=0.01):
    """Estimates vx, vy, r, theta and whether the monitor is low, (samples, 5).

    Args:
        car: numbers by name, as `absjax.sideslip.car.Car` has them.
        log: columns ax, ay, r, delta (samples,) and w (samples, 4).
    """
    m, inertia, a, b = car["mass"], car["yaw_inertia"], car["to_front"], car["to_rear"]
    h, radius, stiffness, base = car["height"], car["radius"], 26.0, a + b
    tracks = (car["track_front"], car["track_rear"])
    places = [(a, tracks[0] / 2), (a, -tracks[0] / 2), (-b, tracks[1] / 2), (-b, -tracks[1] / 2)]
    driven = [car["driven_front"]] * 2 + [car["driven_rear"]] * 2
    kvy, g1, g2 = lateral_gain / m, friction_gain, coupling / inertia
    vx, vy, r, theta = radius * sum(log["w"][0]) / 4, 0.0, log["r"][0], 1.0
    axf = log["ax"][0] / (1 + 0.005 * G)
    slow = before = share_lp = None
    share_var = ay_var = ay_power = 0.0
    ay_lp = log["ay"][0] / (1 + 0.015 * G)
    rows = []
    for k in range(len(log["ax"])):
        ax, ay = log["ax"][k] / (1 + 0.005 * G), log["ay"][k] / (1 + 0.015 * G)
        rm, delta, w = log["r"][k], log["delta"][k], log["w"][k]
        fy = fyp = fr = frp = 0.0
        for i, (x, y) in enumerate(places):
            d = delta if i < 2 else 0.0
            c, s = math.cos(d), math.sin(d)
            wx, wy = c * (vx - r * y) + s * (vy + r * x), -s * (vx - r * y) + c * (vy + r * x)
            speed = math.sqrt(wx * wx + wy * wy + 1)
            lx, ly = (w[i] * radius - wx) / speed, -wy / speed
            slip = math.sqrt(lx * lx + ly * ly + 1e-8)
            axle = m * ((b * G - h * ax) if i < 2 else (a * G + h * ax)) / base
            load = max(axle * (0.5 + (-1) ** (i + 1) * h * ay / (G * tracks[i // 2])), 0.02 * m * G)
            mu = math.tanh(stiffness * slip)
            ratio = mu / slip
            v_d = (wx * s + wy * c) / speed
            lx_d, ly_d = -s / speed - lx / speed * v_d, -c / speed - ly / speed * v_d
            slip_d = (lx * lx_d + ly * ly_d) / slip
            ratio_d = (stiffness * (1 - mu * mu) - ratio) / slip * slip_d
            f1, f2 = load * ratio * lx, load * ratio * ly
            d1, d2 = load * (ratio_d * lx + ratio * lx_d), load * (ratio_d * ly + ratio * ly_d)
            fy, fyp = fy + s * f1 + c * f2, fyp + s * d1 + c * d2
            fr += x * (s * f1 + c * f2) - y * (c * f1 - s * f2)
            frp += x * (s * d1 + c * d2) - y * (c * d1 - s * d2)
        residual = m * ay - theta * fy
        xi = min(fyp, -5 * abs(fy)) if abs(m * ay) > abs(theta * fy) else fyp
        scale = min(max(1 / math.hypot(xi, fy), 1e-6), 1e6)
        slow = residual if slow is None else slow
        k_slope = 0.5 * max(vx, 3.0) / stiffness * fyp
        share = k_slope / math.hypot(k_slope, fy)
        share_lp = share if share_lp is None else share_lp
        low = share_var < 0.0005 or ay_var < 0.2 * (ay_power + 0.05)
        rows.append((vx, vy, r, theta, float(low)))

        slip_mean = min(max(axf / (G * stiffness * max(theta, 0.2)), -0.15), 0.15)
        now, pulled = [], 0.0
        for i, (x, y) in enumerate(places):
            d = delta if i < 2 else 0.0
            v = ((w[i] * radius - math.sin(d) * (vy + rm * x)) / math.cos(d) + rm * y) / (1 + slip_mean)
            change = ax + rm * vy if before is None else (v - before[i]) / period
            trust = 1 / (1 + ((v - vx) / 0.25) ** 2) / (1 + ((change - axf - rm * vy) / 2) ** 2) / (1 + (axf / 3) ** 2)
            gain = 3 * max(0.01, trust) * (0.2 if driven[i] and axf > 0.2 else 1.0)
            pulled += gain * (v - vx)
            now.append(v)
        before = now
        if not adapts:
            theta_d = 0.0
        elif low:
            theta_d = (1 - theta) / 0.1
        else:
            theta_d = g1 * kvy * scale * fy * (residual - slow) + g2 * fr * (rm - r)
        vx_d = ax + rm * vy + pulled
        vy_d = ay - rm * vx + kvy * scale * xi * residual + g2 / g1 * frp * (rm - r)
        r_d = theta * fr / inertia + yaw_gain * (rm - r)

        axf += period / 0.1 * (ax - axf)
        slow += period * 0.25 * (residual - slow)
        share_var += period / 5 * ((share - share_lp) ** 2 - share_var)
        share_lp += period * (share - share_lp)
        ay_var += period / 5 * ((ay - ay_lp) ** 2 - ay_var)
        ay_power += period / 5 * (ay * ay - ay_power)
        ay_lp += period / 2 * (ay - ay_lp)
        vx, vy, r = vx + period * vx_d, vy + period * vy_d, r + period * r_d
        theta = min(max(theta + period * theta_d, 0.1), 1.0)
    return np.array(rows)
