"""The four-wheel car driven by a log of another car, and what split-mu studies count."""

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

from absjax.sideslip.car import Car
from tests.oracles.car_simulator import CAR, drive
from tuning.core.config import ConfigError
from tuning.logs.vehicle_log import read_vehicle_log
from tuning.vehicle.drive_log import Variant
from tuning.vehicle.drive_log import drive as driven_by
from tuning.vehicle.split_mu import checked, largest


def test_a_car_driven_by_the_log_of_another_finds_its_friction_and_its_motion(tmp_path):
    """The simulator's tyres are of another kind; its road has less friction than the curve the fit begins with."""
    columns = drive(lambda t: 0.04 * np.sin(1.5 * t), lambda t: 0.6, 20.0, 6.0)
    path = tmp_path / "slalom.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    log = read_vehicle_log(path, Car(**CAR))
    found = driven_by(log, Car(**CAR), (Variant("Burckhardt, wet"), Variant("Burckhardt, wet", 0.5)))
    errors = found[0].errors(log)
    assert 0.5 < found[0].friction < 0.75
    assert errors["yaw rate rms [rad/s]"] < 0.01 and errors["side-slip rms [deg]"] < 0.3
    assert np.sqrt(np.mean(log.true_side_slip**2)) > np.radians(1.0)
    assert found[1].cost > found[0].cost


def test_the_smooth_maximum_is_the_maximum():
    values = jnp.asarray(np.random.default_rng(0).normal(size=(3, 500)))
    np.testing.assert_allclose(largest(values), np.abs(values).max(axis=1), rtol=0.02)
    assert np.all(np.asarray(largest(values)) <= np.abs(values).max(axis=1) + 1e-6)
    h, direction = 1e-6, jnp.ones_like(values)
    ends = [largest(values + e * direction) for e in (h, -h)]
    _, exact = jax.jvp(largest, (values,), (direction,))
    np.testing.assert_allclose(exact, (ends[0] - ends[1]) / (2 * h), rtol=1e-6)
    assert np.isfinite(jax.grad(largest)(jnp.zeros(5))).all()


@pytest.mark.parametrize(
    "right, speed, share, said",
    [
        ("mud", 100.0, 1.0, "'mud' is unknown"),
        ("snow", 10.0, 1.0, "above 14.4 km/h"),
        ("snow", 17.0, 0.8, "above 18 km/h"),
    ],
)
def test_a_study_of_no_surface_or_speed_is_refused(right, speed, share, said):
    with pytest.raises(ConfigError, match=said):
        checked(right, speed, share)
