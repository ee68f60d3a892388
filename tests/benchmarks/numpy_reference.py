"""The encoder chain by hand in NumPy, one sample after the other: what the benchmark compares with."""

import numpy as np

TEETH, PERIOD = 60, 1e-3
PITCH = 2 * np.pi / TEETH


def compensated(ages, count, events: int, harmonics: int, forgetting=0.1, gain=1000.0, cutoff=5.0):
    """Wheel speed and acceleration of one encoder from its edges; ages (samples, capacity) in s.

    A parabola through the last edges by normal equations, and the law of `absjax.encoder.harmonics`, on a wheel that
    turns steadily: nothing is looked after but the arithmetic.
    """
    k = np.repeat(np.arange(1, harmonics + 1), 2)
    laws = []
    for power in (1, 2):
        start = gain * 2 * forgetting * np.sum(k[::2] ** (2.0 * power))
        laws.append([power, np.zeros(k.size), start * np.eye(k.size), None, None])
    warped, growth = np.tan(np.pi * cutoff * PERIOD), np.exp(forgetting * PERIOD)
    stamps, edges, path = np.zeros(events), 0, np.zeros((len(ages), 2))
    for i in range(len(ages)):
        now = i * PERIOD
        for j in range(count[i]):
            stamps[:-1], stamps[-1] = stamps[1:], now - ages[i, j]
            edges += 1
        if edges < events:
            continue
        span = stamps[-1] - stamps[0]
        basis = np.vander((stamps - stamps[0]) / span, 3)
        fit = np.linalg.solve(basis.T @ basis, basis.T @ np.arange(1 - events, 1))
        s = (now - stamps[0]) / span
        angle = PITCH * (edges - 1 + np.polyval(fit, s))
        speed, acceleration = PITCH * (2 * fit[0] * s + fit[1]) / span, PITCH * 2 * fit[0] / span**2
        cosine, sine = np.cos(k[::2] * angle), np.sin(k[::2] * angle)
        for law, signal in zip(laws, (speed, acceleration)):
            power, theta, covariance, before, passed = law
            if power == 1:
                phi = np.stack([cosine * speed, -sine * speed], -1).ravel()
            else:
                a = acceleration / k[::2]
                phi = np.stack([cosine * a - sine * speed**2, -sine * a - cosine * speed**2], -1).ravel()
            both = np.append(phi, signal)
            if before is None:
                passed = np.zeros_like(both)
            else:
                passed = (both - before + (1 - warped) * passed) / (1 + warped)
                x, zeta = passed[:-1], passed[-1]
                gx = covariance @ x
                step = PERIOD / (1 + np.sum(k ** (2.0 * power) * x * x) + PERIOD * x @ gx)
                theta = theta + step * gx * (zeta - x @ theta)
                covariance = growth * (covariance - step * np.outer(gx, gx))
            law[1:] = theta, covariance, both, passed
            path[i, power - 1] = signal - phi @ theta
    return path
