"""The notch filter in the loop: the oscillation and what takes it off, and where five phases stick behind it."""

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from scipy.signal import TransferFunction

from tuning.encoder import notching, sticking


def test_the_bode_plot_is_that_of_the_filter():
    ratio = np.geomspace(0.1, 10.0, 50)
    for depth, width in ((0.001, 0.1), (0.0, 0.5)):
        expected = TransferFunction([1.0, 2 * depth, 1.0], [1.0, 2 * width, 1.0]).freqresp(ratio)[1]
        np.testing.assert_allclose(notching.transfer(ratio, depth, width), expected, rtol=1e-12)
    assert abs(notching.transfer([1.0], 0.001, 0.1)[0]) == pytest.approx(0.01, rel=1e-12)


@pytest.fixture(scope="module")
def runs():
    return notching.slip_runs(("not filtered", "notch filter at w"))


def test_the_manoeuvre_and_its_oscillation(runs):
    """Speed held, changed, held; x2 = R w' - v'; an oscillation with the angle the wheel has turned by."""
    run = runs["not filtered"]
    time, signals = run.time, run.signals
    expected = np.interp(time, [0.0, 1.0, 6.0, 7.0], np.array([150.0, 150.0, 80.0, 80.0]) / 3.6)
    np.testing.assert_allclose(signals.vehicle_speed, expected, rtol=1e-12)
    rate = np.gradient(run.slip * signals.vehicle_speed, time)
    smooth = np.abs(time[:, None] - np.array([0.0, 1.0, 6.0, 7.0])).min(axis=1) > 0.01
    assert np.quantile(np.abs(rate - signals.acceleration_offset)[smooth], 0.95) < 0.15
    angle = cumulative_simpson(signals.wheel_speed, x=time, initial=0.0)
    oscillation = notching.SLIP_AMPLITUDE * np.sin(angle)
    np.testing.assert_allclose(run.offset[1:] - signals.acceleration_offset[1:], oscillation[1:], atol=0.02)


def test_the_filter_takes_the_oscillation_off_at_any_speed_of_the_wheel(runs):
    """Hoang 2014, Figs 8.2 and 8.3."""
    raw, filtered = notching.slip_rows(runs)
    for name in raw:
        if name.startswith("x2 off"):
            assert raw[name] == pytest.approx(notching.SLIP_AMPLITUDE / np.sqrt(2), rel=0.03) and filtered[name] < 0.15
    assert filtered["dPb/dt, rms [bar/s]"] < 0.1 * raw["dPb/dt, rms [bar/s]"]


def test_five_phases_stick_where_the_cycle_is_as_quick_as_the_wheel():
    """With nothing to filter: far above that speed they cycle behind either filter, near it behind none."""
    rows = {row["km/h"]: row for row in sticking.frequency_rows()}
    truth = {kmh: row["cycles [1/s], told the truth"] for kmh, row in rows.items()}
    assert truth[30.0] > rows[30.0]["wheel [1/s]"] and truth[55.0] < rows[55.0]["wheel [1/s]"]
    for width in (0.1, 0.5):
        cycles = {kmh: row[f"cycles [1/s], notch filter, zd = {width:g}"] for kmh, row in rows.items()}
        assert cycles[43.0] == cycles[55.0] == "sticks" and cycles[130.0] > 1.5 and cycles[100.0] > 1.5


def test_at_130_kmh_the_filter_brings_the_cycle_back():
    """Hoang 2014, Fig. 8.4."""
    used = [row["friction used [%]"] for row in notching.cycle_rows(notching.cycle_runs(notching.TOLD[:3]))]
    assert used[1] < 95.0 < 97.0 < used[2] < used[0]
