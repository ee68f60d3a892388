"""The predictor's loop of one, two or three states by hand: Heun's method with the limits on both sides of every step.

`drift(x)` is f_n; f_i = 0 before. The input has been zero until time 0.
"""

import numpy as np


def _law(x, past, state, ref, gains, drift, defined):
    """u, what is kept, and the rates of S, I, T."""
    alpha, beta = gains
    n, (S, J, T) = len(x), state
    targets, errors, predicted, _ = past
    e = x - targets[:n]
    p = defined * (predicted - e)
    P = np.zeros(n)
    for i in reversed(range(n)):
        P[i] = e[i] - alpha[i] * S[i] - beta[i] * J[i] + (T[i] if i < n - 1 else 0.0)
    dT = np.append(P[1:] - predicted[1:], 0.0)
    # Targets x_i*, then the rates that are needed h later: x_1*', x_1*'', x_2*'.
    star = np.zeros(n)
    star[0] = ref[0]
    delayed = targets[n:]
    extra = np.zeros(3)
    extra[:2] = ref[1], ref[2] if n > 1 else 0.0
    if n == 1:
        last = ref[1]
    if n >= 2:
        star[1] = -alpha[0] * e[0] + ref[1]
        star2_rate = -alpha[0] * (x[1] - delayed[0]) + ref[2]
        extra[2] = star2_rate
        last = star2_rate
    if n == 3:
        star[2] = -alpha[1] * e[1] + star2_rate
        star2_bend = -alpha[0] * (x[2] - delayed[1]) + ref[3]
        last = -alpha[1] * (x[2] - delayed[2]) + star2_bend
    u = -drift(star + P) - alpha[-1] * e[-1] + last
    return (np.concatenate([star, extra]), e, P, u), np.stack([e - errors, p, dT])


def run(x, delay, gains, drift, end, step, level=lambda t: 0.0, Tf=0.25):
    """x_1 on the grid of `step`, which divides the delay."""
    n, m, steps = len(x), round(delay / step), round(end / step)
    gains = tuple(np.asarray(g, float) for g in gains)
    nothing = (np.zeros(n + 3), np.zeros(n), np.zeros(n), 0.0)
    right, left = [], [None]
    x, state, ref = np.array(x, float), np.zeros((3, n)), np.zeros(n + 1)
    binomial = {1: (1, 2), 2: (1, 3, 3), 3: (1, 4, 6, 4)}[n]

    def rates(x, state, ref, past, defined, wave):
        kept, change = _law(x, past, state, ref, gains, drift, defined)
        own = np.append(x[1:], drift(x) + past[3])
        top = (wave - sum(c * Tf**k * r for k, (c, r) in enumerate(zip(binomial, ref)))) / Tf ** (n + 1)
        return kept, (own, change, np.append(ref[1:], top))

    path = [x[0]]
    for k in range(steps):
        wave = level((k + 0.5) * step)
        past = right[k - m] if k >= m else nothing
        kept, first = rates(x, state, ref, past, float(k >= m), wave)
        right.append(kept)
        guess = [value + step * d for value, d in zip((x, state, ref), first)]
        past = left[k + 1 - m] if k + 1 > m else nothing
        _, second = rates(*guess, past, float(k + 1 > m), wave)
        x, state, ref = (value + step / 2 * (a + b) for value, a, b in zip((x, state, ref), first, second))
        left.append(rates(x, state, ref, past, float(k + 1 > m), wave)[0])
        path.append(x[0])
    return np.array(path)
