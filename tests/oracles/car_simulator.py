"""A car on four wheels in plain NumPy, with tyres of another kind than the observer's: logs with their truth.

Tyres follow Pacejka's shape over the slip angle; driving and braking forces are shared out, and the wheels turn with
the slip these forces need. The accelerometers sit on a body that rolls and pitches.
"""

import numpy as np

G = 9.81
CAR = {
    "mass": 1250.0,
    "yaw_inertia": 1600.0,
    "to_front": 1.0,
    "to_rear": 1.5,
    "track_front": 1.4,
    "track_rear": 1.42,
    "height": 0.55,
    "radius": 0.32,
    "driven_front": 1.0,
    "driven_rear": 0.0,
}
COLUMNS = (
    "longitudinal_acceleration_m_s2",
    "lateral_acceleration_m_s2",
    "yaw_rate_rad_s",
    "steering_angle_rad",
    *(f"wheel_speed_{wheel}_rad_s" for wheel in ("fl", "fr", "rl", "rr")),
)


def drive(steering, friction, speed, duration, *, push=None, bank=None, car=CAR, noise=1.0, bias=0.0, seed=0, rate=100):
    """Columns of a log by name, `COLUMNS` and the truth `true_...` beside.

    Args:
        steering: angle at the road wheels over time [rad], a function.
        friction: largest friction over time, a function.
        speed: at the start [m/s].
        push: acceleration asked of the driven wheels over time [m/s^2], a function.
        bank: of the road over time [rad], positive where the left side is the higher one.
        noise: of the sensors, as a factor.
        bias: of the lateral accelerometer [m/s^2].
    """
    push, bank = push or (lambda t: 0.0 * t), bank or (lambda t: 0.0 * t)
    m, a, b = car["mass"], car["to_front"], car["to_rear"]
    x = np.array([a, a, -b, -b])
    y = np.array([1, -1, 0, 0]) * car["track_front"] / 2 + np.array([0, 0, 1, -1]) * car["track_rear"] / 2
    driven = np.array([car["driven_front"]] * 2 + [car["driven_rear"]] * 2)
    static = m * G * np.array([b, b, a, a]) / (a + b) / 2
    substeps, rng = 10, np.random.default_rng(seed)
    step, rows = 1 / rate / substeps, []
    vx, vy, r, ax, ay = speed, 0.0, 0.0, 0.0, 0.0
    for k in range(round(duration * rate) * substeps):
        t = k * step
        mu, delta = friction(t), np.array([1, 1, 0, 0]) * steering(t)
        load = static - m * car["height"] * (ay * np.sign(y) / (2 * np.abs(y)) / 2 + ax * np.sign(x) / (a + b) / 2)
        load = np.maximum(load, 0.02 * m * G)
        ux, uy = vx - r * y, vy + r * x
        wx, wy = np.cos(delta) * ux + np.sin(delta) * uy, np.cos(delta) * uy - np.sin(delta) * ux
        asked = push(t)
        share = driven / driven.sum() if asked > 0 else np.full(4, 0.25)
        along = np.clip(m * asked * share, -0.8 * mu * load, 0.8 * mu * load)
        left = np.sqrt((mu * load) ** 2 - along**2)
        across = -left * np.sin(1.35 * np.arctan(18.0 / mu**0.5 * wy / np.maximum(wx, 1.0)))
        turn = wx * (1 + np.arctanh(along / (1.02 * mu * load)) * mu / 26.0) / car["radius"]
        fx = np.sum(np.cos(delta) * along - np.sin(delta) * across)
        fy_each = np.sin(delta) * along + np.cos(delta) * across
        moment = np.sum(x * fy_each - y * (np.cos(delta) * along - np.sin(delta) * across))
        ax, ay = fx / m, np.sum(fy_each) / m
        if k % substeps == 0:
            told = [ax * (1 + 0.005 * G), ay * (1 + 0.015 * G) + bias, r, delta[0], *turn]
            told += noise * rng.normal(size=8) * [0.1, 0.1, 0.004, 0.0005, 0.1, 0.1, 0.1, 0.1]
            rows.append([t, *told, vx, vy, r, mu, bank(t)])
        slope = ax + r * vy, ay - r * vx - G * np.sin(bank(t)), moment / car["yaw_inertia"]
        vx, vy, r = vx + step * slope[0], vy + step * slope[1], r + step * slope[2]
    truth = ("true_vx_m_s", "true_vy_m_s", "true_yaw_rate_rad_s", "true_friction", "true_bank_rad")
    return dict(zip(("time_s", *COLUMNS, *truth), np.array(rows).T))


def slalom(duration=12.0, *, friction=0.35, speed=16.0, amplitude=0.06, seed=0, **options):
    """A slalom after a second straight on, on one road."""
    return drive(
        lambda t: amplitude * np.sin(2 * np.pi * 0.4 * max(t - 1.0, 0.0)),
        lambda t: friction,
        speed,
        duration,
        seed=seed,
        **options,
    )
