"""Vehicle speed from wheels and an accelerometer, as plain loops over floats and matrices, from the equations alone."""

import math

import numpy as np


def kalman(
    acceleration,
    rims,
    period,
    *,
    speed_drift,
    bias_drift,
    bias_deviation,
    rim_noise,
    below,
    above,
    deviation,
    slip,
    unbraked,
    lag=0.02,
    least=0.1,
):
    """(v^, b^) and covariances (samples, 2), (samples, 2, 2): all wheels at once, by the textbook's matrices.

    P = (I - K H) P (I - K H)' + K R K', the form that holds for any gain, with K = P H' (H P H' + R)^-1.
    """
    wheels = rims.shape[1]
    state, P = np.array([rims[0].max(), 0.0]), np.diag([rim_noise**2, bias_deviation**2])
    F, Q = np.array([[1.0, -period], [0.0, 1.0]]), period * np.diag([speed_drift**2, bias_drift**2])
    H = np.stack([np.ones(wheels), np.zeros(wheels)], axis=1)
    lagged = np.full(wheels, rims[0].max())
    states, covariances = [state], [P]
    for a, rim in zip(acceleration[1:], rims[1:]):
        car = a - state[1]
        state = F @ state + np.array([period * a, 0.0])
        P = F @ P @ F.T + Q
        R = np.zeros((wheels, wheels))
        told = np.zeros(wheels)
        for i in range(wheels):
            low, high = sorted((rim[i], rim[i] * (1 - slip * car)))
            told[i] = min(max(state[0], low), high)
            rate = (rim[i] - lagged[i]) / (lag + period)
            lagged[i] += period * rate
            e = told[i] - state[0]
            k = below if e < 0 else above
            brakes = 1 / (1 + (unbraked / car) ** 4) ** 2
            x = brakes * e**2 / (k**2 * (P[0, 0] + rim_noise**2)) + (rate - car) ** 2 / deviation**2
            R[i, i] = rim_noise**2 * (1 + x) ** 2
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        state = state + K @ (told - H @ state)
        left = np.eye(2) - K @ H
        P = left @ P @ left.T + K @ R @ K.T
        state[0] = max(state[0], least)
        states.append(state)
        covariances.append(P)
    return np.array(states), np.array(covariances)


def reference(
    acceleration, rims, period, *, margin, refresh, steadiness, rank=1, refreshed_by=None, nearness=0.1, lag=0.02
):
    """The reference speed (samples,)."""
    speed = lagged = max(rims[0])
    found = [speed]
    for a, rim in zip(acceleration[1:], rims[1:]):
        speed = max(sorted(rim)[-rank], speed - period * (margin + (-a if a < 0 else 0.0)), 0.1)
        if refreshed_by is not None:
            own = rim[refreshed_by]
            rate = (own - lagged) / (lag + period)
            lagged += period * rate
            steady = 1 / (1 + ((rate - a) / steadiness) ** 2) ** 2
            near = 1 / (1 + ((speed - own) / (nearness * speed)) ** 4)
            speed += (own - speed) * (1 - math.exp(-period / refresh * steady * near))
        found.append(speed)
    return np.array(found)
