"""Logs as people report and export them, made of the shipped ones: what reading says to each."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tuning
from tests.fuzz.mutate import ACCELERATION, PRESSURE, TIME, VEHICLE, WHEEL, csv, held, original
from tuning.logs.brake_log import read_log
from tuning.logs.tables import LogError

FORCE = "longitudinal_force_n"
SIGNALS = {"wheel_speed": WHEEL, "vehicle_speed": VEHICLE, "brake_pressure": PRESSURE, "acceleration": ACCELERATION}


def rig():
    return pd.read_csv(Path(tuning.__file__).parent / "data" / "rig_65kmh.csv").iloc[:1500]


def of(content, tmp_path, **options):
    path = tmp_path / "case.csv"
    path.write_bytes(content if isinstance(content, bytes) else csv(content))
    return read_log(path, **options)


def check_same(log):
    table = original()
    for signal, column in SIGNALS.items():
        there = log.measured[signal]
        np.testing.assert_allclose(getattr(log, signal)[there], table[column][there], rtol=1e-3, atol=6e-3)
    assert log.doubts == ()


def test_read_as_the_plain_log(tmp_path):
    table = original()
    check_same(of(csv(table, sep=";", decimal=","), tmp_path))
    brackets = ["Time [s]", "nWheelFL [rad/s]", "vCar [m/s]", "pBrake [bar]", "ax [m/s^2]"]
    check_same(of(table.set_axis(brackets, axis=1), tmp_path))
    rim = table.assign(**{WHEEL: (1.08 * table[WHEEL]).round(3), VEHICLE: (3.6 * table[VEHICLE]).round(3)})
    rim = rim.set_axis(["t_s", "WheelSpd_FL_kmh", "VehSpd_kmh", "BrkP_bar", "Ax_ms2"], axis=1)
    check_same(of(rim, tmp_path))
    log = of(table.drop(index=700), tmp_path)
    check_same(log)
    assert np.flatnonzero(~log.measured["wheel_speed"]) == [700]


def test_the_export_of_a_racing_logger(tmp_path):
    table = original()
    lines = ['"Format","Logger CSV"', '"Vehicle","test car"', '"Sample Rate","1000"', '"Segment","1"', ""]
    lines += ['"Time","WheelSpdFL","GPS Speed","BrakePress","InlineAcc"', '"s","rad/s","km/h","bar","g"', ""]
    for t, w, v, p, a in table.to_numpy():
        lines.append(f'"{t:.4f}","{w:.4f}","{3.6 * v:.4f}","{p:.4f}","{a / 9.81:.5f}"')
    log = of("\n".join(lines).encode(), tmp_path)
    check_same(log)
    assert "vehicle_speed is column 'GPS Speed' in km/h (as the file says)" in log.notes


def test_a_tyre_rig_in_sae_axes(tmp_path):
    time = np.arange(700) / 100
    slip = -0.15 * (1 - np.cos(2 * np.pi * time / 3.5))
    rng = np.random.default_rng(0)
    table = pd.DataFrame({"ET": time, "V": 40.3 + 0.02 * rng.standard_normal(700)})
    table["N"] = (1 + slip) * table["V"] / 3.6 / 0.2242 * 30 / np.pi
    table["FX"] = 2140 * 1.2 * np.tanh(20 * slip) + 15 * rng.standard_normal(700)
    table["FZ"] = -2140 + 8 * rng.standard_normal(700)
    log = of(table, tmp_path, radius=0.2242)
    np.testing.assert_allclose(log.force, table["FX"])
    np.testing.assert_allclose(log.load, -table["FZ"])
    np.testing.assert_allclose(0.2242 * log.wheel_speed / log.vehicle_speed - 1, slip, atol=1e-12)
    assert log.brake_pressure is None and log.doubts == ()
    assert "load turned: all of it is negative, as in SAE axes" in log.notes
    assert "vehicle_speed is column 'V' in km/h (as tyre rigs write it)" in log.notes
    slipping = of(table.drop(columns="N").assign(SL=slip), tmp_path, radius=0.2242)
    np.testing.assert_allclose(slipping.wheel_speed, log.wheel_speed, rtol=1e-12)
    assert "wheel_speed is column 'SL' in slip (as tyre rigs write it)" in slipping.notes


def test_what_was_not_measured_is_known(tmp_path):
    table = original()
    slow = table.assign(**{name: held(table[name], 10) for name in (WHEEL, VEHICLE, ACCELERATION)})
    log = of(slow.assign(**{PRESSURE: held(table[PRESSURE], 20)}), tmp_path)
    for signal, every in dict.fromkeys(SIGNALS, 10).items() | {("brake_pressure", 20)}:
        if (signal, every) != ("brake_pressure", 10):
            expected = np.arange(1600) % every == 0
            assert np.mean(log.measured[signal] == expected) > 0.998
    assert "wheel_speed, vehicle_speed, acceleration: each value held for 0.01 s: sampled at 100 Hz" in log.notes
    log = of(table.assign(**{ACCELERATION: held(table[ACCELERATION], 50)}), tmp_path)
    assert log.measured["acceleration"].sum() == 32 and log.measured["wheel_speed"].all()
    jitter = np.random.default_rng(5).normal(0, 3e-4, 1600)
    log = of(table.assign(**{TIME: np.maximum.accumulate(table[TIME] + jitter) + 1e-9 * np.arange(1600)}), tmp_path)
    assert np.ptp(np.diff(log.time)) < 1e-9 and any("jitter" in note for note in log.notes)


@pytest.mark.parametrize(
    "change, doubt",
    [
        ({ACCELERATION: lambda t: t[ACCELERATION].clip(lower=-8)}, "acceleration: sits at -8 m/s^2 in "),
        (
            {WHEEL: lambda t: t[WHEEL].where((t.index < 600) | (t.index >= 800), t[WHEEL][600])},
            "wheel_speed: is stuck at",
        ),
        ({WHEEL: lambda t: t[WHEEL].clip(lower=50.123)}, "wheel_speed: sits at 50.123 rad/s in "),
        ({VEHICLE: lambda t: (t[VEHICLE] * 3.6).round() / 3.6}, "vehicle_speed: is quantised in steps of 0.278 m/s"),
        ({VEHICLE: lambda t: t[VEHICLE].round()}, "vehicle_speed: is quantised in steps of 1 m/s"),
        ({VEHICLE: lambda t: t[VEHICLE].shift(100).bfill()}, "vehicle_speed: is stuck at 33.3272 m/s for 0.1 s at 0 s"),
    ],
)
def test_what_looks_wrong_is_doubted(tmp_path, change, doubt):
    log = of(original().assign(**change), tmp_path)
    assert len(log.doubts) == 1 and log.doubts[0].startswith(doubt)


def test_a_force_at_the_end_of_its_range(tmp_path):
    table = rig()
    log = of(table.assign(**{FORCE: table[FORCE].clip(lower=-2200)}), tmp_path)
    assert len(log.doubts) == 1 and log.doubts[0].startswith("force: sits at -2200 N in ")
    np.testing.assert_array_equal(log.measured["force"], table[FORCE] > -2200)
    log = of(table.assign(**{FORCE: (table[FORCE] / 1e3).round(1)}), tmp_path)
    assert log.doubts == ("force: is quantised in steps of 0.1 N",)


def test_what_only_the_car_can_tell_is_read_as_it_stands(tmp_path):
    """Pressure in another unit or with an offset, force with one: the reader knows no car."""
    table = original()
    for pressure in (table[PRESSURE] / 10, table[PRESSURE] + 8, table[PRESSURE] - 20):
        log = of(table.assign(**{PRESSURE: pressure.round(3)}), tmp_path)
        np.testing.assert_allclose(log.brake_pressure, pressure, atol=6e-4)
        assert log.doubts == ()
    np.testing.assert_allclose(of(rig().assign(**{FORCE: rig()[FORCE] + 300}), tmp_path).force, rig()[FORCE] + 300)


def test_a_load_that_is_logged(tmp_path):
    load = 4280 + 1500 * np.linspace(0, 1, 1600)
    np.testing.assert_allclose(of(original().assign(vertical_load_n=load), tmp_path).load, load)


def test_a_speedometer_that_is_off_without_braking(tmp_path):
    time = np.arange(1000) * 0.02
    speed = 6 + 3 * np.sin(0.3 * time) + 0.002 * np.random.default_rng(0).standard_normal(1000)
    table = pd.DataFrame({TIME: time.round(2), WHEEL: speed / 0.3, VEHICLE: (28.8 * speed / 1.045).round() / 28.8})
    log = of(table.assign(**{PRESSURE: 1 + 0.1 * np.sin(time)}), tmp_path)
    assert any("R w / v is 1.0" in doubt and "above 1" in doubt for doubt in log.doubts)
    assert log.resolution["vehicle_speed"] == pytest.approx(1 / 28.8, rel=1e-3)


def test_the_rim_in_km_h_is_refused_with_the_unit_that_fits(tmp_path):
    table = original()
    with pytest.raises(
        LogError, match=r"case\.csv, columns 'wheel_speed_rad_s' and .* with wheel_speed=wheel_speed_rad_s:km/h"
    ):
        of(table.assign(**{WHEEL: 1.08 * table[WHEEL]}), tmp_path)


def test_a_bad_cell_is_named_by_its_line(tmp_path):
    lines = csv(original()).decode().split("\n")
    lines[601] = lines[601].replace(lines[601].split(",")[2], "x")
    lines[300:300] = ["", ""]
    with pytest.raises(LogError, match=r"case\.csv, column 'vehicle_speed_m_s', row 604: 'x' is not a finite number"):
        of("\n".join(lines).encode(), tmp_path)
