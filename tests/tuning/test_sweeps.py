"""Slip sweeps of a quiet rig: one surface whatever its c2, and curves through few points."""

import numpy as np
import pytest

from absjax.tyres.burckhardt import Burckhardt
from tuning.road.arrow_fit import Prior
from tuning.road.changes import find_stretches
from tuning.road.curve import Curve
from tuning.road.curve_fit import BLOCK, fit_curve
from tuning.road.samples import FrictionSamples

TIME = np.arange(700) / 100
SLIP = -0.075 * (1 - np.cos(2 * np.pi * TIME / 3.5))


def friction(c1, c2, c3):
    noise = 0.006 * np.random.default_rng(1).normal(size=len(TIME))
    return -(c1 * (1 - np.exp(-c2 * np.abs(SLIP))) - c3 * np.abs(SLIP)) + noise


@pytest.mark.parametrize("c2", [21.5, 22.0, 22.5, 23.0, 23.5, 24.0])
def test_a_sweep_is_one_surface(c2):
    found = find_stretches(FrictionSamples(TIME, SLIP, friction(1.45, c2, 0.3), "force"))
    assert [(stretch.first, stretch.last) for stretch in found] == [(0, len(TIME))]


def test_a_curve_through_fewer_points_than_a_block():
    few = slice(130, 130 + BLOCK - 2)
    known = Prior(np.array([0.25]), np.array([0.0])), Prior(np.array([0.0]), np.array([0.0]))
    curve, start = Curve(Burckhardt), np.array([1.2, 25.0, 0.5])
    given = (1 + SLIP[few]) / 0.25, friction(1.45, 23.0, 0.3)[few], np.full(BLOCK - 2, 1e-4)
    fit = fit_curve(curve, *given, start, radius=known[0], zero=known[1])
    spread = np.sqrt(np.diag(fit.covariance))
    assert np.all(np.isfinite(spread)) and np.all(np.abs(fit.shared[:3] - [1.45, 23.0, 0.3]) < 3 * spread[:3] + 1e-9)
