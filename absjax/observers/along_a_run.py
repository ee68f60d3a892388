"""The certificate of a run: whether what an observer was told along it is what its proofs ask for.

`certify_run` holds a run to the assumptions under which the adaptive observer converges,

    v_min <= v                                                              (2.3)
    int_t^(t+T) y^2 ds >= mu_0 > 0                                          (3.17)
    dy/dt != 0 wherever y = 0                                               (3.18)
    zeros of y are T_D > 0 apart at least                                   (3.19)
    int_t^(t+T) Psi' Psi ds >= mu_1 I,  mu_1 > 0                            (3.7), Proposition 2

`admissible` to those on a controller under which the switched observers do. In the band |y| < eps

    |u| < beta,  the sign of u constant,  |u| > alpha(v) = eps a max|XBS| / (b v)

so that y crosses the band without turning back, and no zero of y follows another sooner than

    T_D = 2 eps / (b beta + eps a max|XBS| / v_min)

Source: Aguado-Rojas 2019, Assumption 1 and Proposition 2; Hoang 2014 (thesis), Theorem 4.2, in the time dt / v in which
the XBS models have s(y) = y, d = 0 and the control u v. The bound T_D is worked out here from its conditions.
"""

import numpy as np

from absjax.observers.base import Sample
from absjax.observers.certificate import Checked, Condition
from absjax.observers.excitation import dwell_times, excitation
from absjax.plant.wheel import Wheel


def zero_slopes(samples: Sample, period: float) -> np.ndarray:
    """dy/dt at the zeros of y [m/s^3], (zeros,); 0 where y touches zero without crossing, or stays there.

    A zero between two samples has the slope of the line that joins them. y touches zero where three samples have one
    sign, and the parabola through them does not.
    """
    y = np.asarray(samples.y)
    crossing = y[:-1] * y[1:] < 0
    on_it = np.flatnonzero(y[1:-1] == 0) + 1
    before, here, after = y[:-2], y[1:-1], y[2:]
    slope, bend = 0.5 * (after - before), after - 2 * here + before
    nearest = np.abs(here) < np.minimum(np.abs(before), np.abs(after))
    inside = nearest & (before * here > 0) & (here * after > 0)
    vertex = here - slope**2 / (2 * np.where(inside, bend, 1.0))
    touches = np.flatnonzero(inside & (vertex * here <= 0))
    rises = [np.diff(y)[crossing], 0.5 * (y[on_it + 1] - y[on_it - 1]), np.zeros(touches.size)]
    return np.asarray(np.concatenate(rises), float) / period


def certify_run(
    samples: Sample,
    period: float,
    wheel: Wheel,
    window: float = 1.0,
    *,
    energy: float = 0.0,
    slope: float = 0.0,
    dwell: float = 0.0,
    eigenvalue: float = 0.0,
) -> Checked:
    """Hold a run to the assumptions of the adaptive observer.

    Args:
        samples: arrays (samples,).
        period: sampling period, s.
        wheel: as the observer knows it.
        window: T of the integrals, s.
        energy: what mu_0 has to exceed [m^2/s^3].
        slope: what |dy/dt| at a zero has to exceed [m/s^3].
        dwell: what T_D has to exceed [s].
        eigenvalue: what mu_1 has to exceed.

    Raises:
        ValueError: if the window is longer than the run.
    """
    psi = excitation(samples, period, wheel, window)
    length = round(window / period)
    total = np.concatenate([[0.0], np.cumsum(period * np.asarray(samples.y) ** 2)])
    slopes, apart = zero_slopes(samples, period), dwell_times(samples, period).length
    return Checked(
        "what the adaptive observer asks of a run",
        (
            Condition("(2.3): least v [m/s]", float(np.min(samples.speed)), 0.0, np.inf),
            Condition(
                "(3.17): least int y^2 [m^2/s^3]", float((total[length:] - total[:-length]).min()), energy, np.inf
            ),
            Condition("(3.18): least |dy/dt| at a zero [m/s^3]", _least(np.abs(slopes)), slope, np.inf),
            Condition("(3.19): shortest dwell time [s]", _least(apart), dwell, np.inf),
            Condition("(3.7): least eigenvalue of int Psi'Psi", float(psi[:, 0].min()), eigenvalue, np.inf),
        ),
    )


def _least(values: np.ndarray) -> float:
    """The least; 0 of none: a y that never changes its sign is not what is asked for."""
    return float(values.min()) if values.size else 0.0


def admissible(samples: Sample, stiffness, period: float, wheel: Wheel, band: float = 1.0) -> Checked:
    """Hold the controller of a run to the conditions of Theorem 4.2 of [H].

    Args:
        samples: arrays (samples,), from the controller's first switching on.
        stiffness: true XBS, (samples,).
        period: sampling period, s.
        wheel: of the car.
        band: eps, m/s^2. A controller is admissible if there is one for which all hold.

    Raises:
        ValueError: if the band is not positive.
    """
    if not band > 0:
        raise ValueError(f"band = {band:g} m/s^2 must be positive")
    y, speed = np.asarray(samples.y, float), np.asarray(samples.speed, float)
    rate = np.diff(np.asarray(samples.pressure, float)) / period
    # A step in which y passes the whole band counts as inside it.
    inside = (np.minimum(np.abs(y[1:]), np.abs(y[:-1])) < band) | (y[1:] * y[:-1] < 0)
    steep = band * wheel.slip_gain * np.abs(np.asarray(stiffness)).max() / wheel.pressure_gain
    visit = np.cumsum(np.diff(inside.astype(int), prepend=0) == 1)[inside]
    signs = np.sign(rate[inside])
    turned = [k for k in np.unique(visit) if np.ptp(signs[visit == k]) > 0]
    share = np.abs(rate[inside]) * speed[1:][inside] / max(steep, np.finfo(float).tiny)
    beta = float(np.abs(rate).max())
    bound = 2 * band / (wheel.pressure_gain * (beta + steep / speed.min()))
    return Checked(
        f"admissible controller, band {band:g} m/s^2",
        (
            Condition("(i): largest |u|, beta [bar/s]", beta, 0.0, np.inf),
            Condition("(ii): visits of the band", float(np.unique(visit).size), 0.0, np.inf),
            Condition("(ii): visits in which u changes its sign", float(len(turned)), 0.0, 0.0),
            Condition("(ii): least |u| / alpha in the band", _least(share), 1.0, np.inf),
            Condition(
                "shortest dwell time [s], above the bound", _least(dwell_times(samples, period).length), bound, np.inf
            ),
        ),
    )
