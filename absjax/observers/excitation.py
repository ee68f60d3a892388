"""What a run offers an observer: dwell times between sign changes, decay of the error, persistency of excitation.

The convergence of a switched observer needs sign changes of y that are a dwell time apart; that of the
adaptive one needs, besides, a regressor Psi with

    int_t^(t+T) Psi' Psi ds >= mu I,  mu > 0

Source: Aguado-Rojas 2019, Assumption 1 and eq. 3.7, Fig. 3.1.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from absjax.observers.base import Sample
from absjax.observers.gains import lyapunov
from absjax.observers.switched import SwitchedObserver
from absjax.plant.wheel import Wheel


class Dwell(NamedTuple):
    """Stretches between two sign changes of y; arrays (stretches,). The first and last of a run are left out."""

    begin: np.ndarray
    """s"""
    length: np.ndarray
    """s"""
    scaled: np.ndarray
    """the same in scaled time, int |y|/v dt"""


def dwell_times(samples: Sample, period: float) -> Dwell:
    """Dwell times of sign(y) along a run; sign changes are interpolated linearly.

    Args:
        samples: arrays (samples,).
        period: sampling period, s.
    """
    y, v = np.asarray(samples.y), np.asarray(samples.speed)
    k = np.flatnonzero(np.sign(y[:-1]) * np.sign(y[1:]) < 0)
    instants = period * (k + y[k] / (y[k] - y[k + 1]))
    rate = np.abs(y) / v
    clock = np.concatenate([[0.0], np.cumsum(0.5 * period * (rate[1:] + rate[:-1]))])
    scaled = np.interp(instants, period * np.arange(len(y)), clock)
    return Dwell(instants[:-1], np.diff(instants), np.diff(scaled))


def regressor(samples: Sample, period: float, wheel: Wheel) -> np.ndarray:
    """Psi of the adaptive observer, (samples, 2, 2): [[y^2/v, 0], [-(b/a) u, y/v]]."""
    y, v = np.asarray(samples.y), np.asarray(samples.speed)
    u = np.gradient(np.asarray(samples.pressure), period)
    psi = np.zeros((len(y), 2, 2))
    psi[:, 0, 0], psi[:, 1, 0], psi[:, 1, 1] = y**2 / v, -wheel.pressure_gain / wheel.slip_gain * u, y / v
    return psi


def excitation(samples: Sample, period: float, wheel: Wheel, window: float = 1.0) -> np.ndarray:
    """Eigenvalues of the windowed integral of Psi' Psi, ascending, (samples - window, 2).

    Raises:
        ValueError: if the window is longer than the run.
    """
    psi, length = regressor(samples, period, wheel), round(window / period)
    if not 0 < length < len(psi):
        raise ValueError(f"window = {window:g} s must be positive and shorter than the run of {len(psi) * period:g} s")
    total = np.concatenate([np.zeros((1, 2, 2)), np.cumsum(period * np.swapaxes(psi, 1, 2) @ psi, axis=0)])
    return np.linalg.eigvalsh(total[length:] - total[:-length])


def decay_along(observer: SwitchedObserver, samples: Sample, period: float) -> float:
    """Rate at which every error decays along a run, at least [1/s], in the norm e' P e of the common P.

    The error is multiplied by exp(A+ s) or exp(A- s) over every stretch of scaled length s between two sign
    changes of y. The poles of A+ and A- do not say how fast that product falls: it can be far slower than
    either factor.

    Raises:
        ValueError: if y changes its sign less than twice.
    """
    dwell = dwell_times(samples, period)
    if not len(dwell.length):
        raise ValueError("y changes its sign once at most; twice is needed")
    A, C = np.asarray(observer.A), np.eye(len(observer.B))[0]
    matrices = A - np.outer(observer.plus, C), -A + np.outer(observer.minus, C)
    root = np.linalg.cholesky(np.asarray(lyapunov(matrices[0], np.outer(C, C)))).T
    y = np.asarray(samples.y)
    product, logarithm = np.eye(len(C)), 0.0
    for begin, length, scaled in zip(*dwell):
        positive = y[round((begin + 0.5 * length) / period)] > 0
        product = expm(matrices[0 if positive else 1] * scaled) @ product
        size = np.abs(product).max()
        product, logarithm = product / size, logarithm + np.log(size)
    largest = np.linalg.norm(root @ product @ np.linalg.inv(root), 2)
    return float(-(logarithm + np.log(largest)) / dwell.length.sum())
