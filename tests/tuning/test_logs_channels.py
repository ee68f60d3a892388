"""Which channel is which signal: declared on the command line or in a map, or known by its name; units and signs."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.fuzz.mutate import ACCELERATION, PRESSURE, TIME, VEHICLE, WHEEL, csv, original
from tuning.logs.brake_log import parse_columns, read_log
from tuning.logs.channel_map import declarations, read_channel_map
from tuning.logs.tables import LogError
from tuning.logs.units import is_unit, unit_of

RADIUS = 0.3
WHEEL_UNITS = {
    "rpm": 30 / np.pi,
    "1/min": 30 / np.pi,
    "rev/s": 1 / (2 * np.pi),
    "deg/s": 180 / np.pi,
    "km/h": 3.6 * RADIUS,
    "m/s": RADIUS,
    "mph": RADIUS * 3600 / 1609.344,
}


def log_of(tmp_path, table, columns=None, **options):
    (tmp_path / "log.csv").write_bytes(csv(table))
    return read_log(tmp_path / "log.csv", columns, **options)


@pytest.mark.parametrize("unit", WHEEL_UNITS)
def test_wheel_speed_in_other_units(tmp_path, unit):
    table = original()
    log = log_of(
        tmp_path, table.assign(**{WHEEL: table[WHEEL] * WHEEL_UNITS[unit]}), {"wheel_speed": f"{WHEEL}:{unit}"}
    )
    np.testing.assert_allclose(log.wheel_speed, table[WHEEL], rtol=1e-12)
    said = "wheel_speed: speed of the rim, divided by the radius 0.3 m" in log.notes
    assert said == (unit in ("km/h", "m/s", "mph"))


@pytest.mark.parametrize(
    "signal, text, factor",
    [
        ("vehicle_speed", "knots", 1852 / 3600),
        ("vehicle_speed", "kph", 1 / 3.6),
        ("brake_pressure", "psi", 4.4482216152605 / 0.0254**2 / 1e5),
        ("brake_pressure", "MPA", 10.0),
        ("acceleration", "G", 9.81),
        ("acceleration", "ft/s^2", 0.3048),
        ("force", "lbf", 4.4482216152605),
        ("load", "kg", 9.81),
        ("time", "µs", 1e-6),
        ("wheel_speed", "°/s", np.pi / 180),
    ],
)
def test_units_against_their_definitions(signal, text, factor):
    unit = unit_of(signal, text)
    assert unit is not None and unit.factor == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("signal, text", [("force", "V"), ("vehicle_speed", "bar"), ("time", "m"), ("load", "9**9**9")])
def test_what_is_no_unit_of_a_signal(signal, text):
    assert unit_of(signal, text) is None


def test_a_row_of_units_is_told_from_names():
    assert all(map(is_unit, ["s", "rad/s", "km/h", "bar", "g", "%", "[m/s^2]", "°C"]))
    assert not any(map(is_unit, ["Time", "WheelSpdFL", "vCar", "FX", "time_s", "m//((", "1/0"]))


def test_a_pulse_train_needs_its_teeth(tmp_path):
    table = original()
    pulses = table.assign(**{WHEEL: table[WHEEL] * 48 / (2 * np.pi)})
    (tmp_path / "map.toml").write_text(f'[wheel_speed]\ncolumn = "{WHEEL}"\nunit = "Hz"\nteeth = 48\n')
    log = log_of(tmp_path, pulses, read_channel_map(tmp_path / "map.toml"))
    np.testing.assert_allclose(log.wheel_speed, table[WHEEL], rtol=1e-12)
    with pytest.raises(LogError, match=r"wheel_speed in Hz needs the teeth of the encoder"):
        log_of(tmp_path, pulses, {"wheel_speed": f"{WHEEL}:Hz"})


def test_slip_stands_for_wheel_speed(tmp_path):
    table = original()
    table["SL"] = RADIUS * table[WHEEL] / table[VEHICLE] - 1
    log = log_of(tmp_path, table.drop(columns=WHEEL), {"wheel_speed": "SL:slip"})
    np.testing.assert_allclose(log.wheel_speed, table[WHEEL], rtol=1e-12)


def test_a_map_says_unit_sign_delay_offset_and_factor(tmp_path):
    table = original()
    changed = table.rename(columns={PRESSURE: "p: front, left"})
    changed["p: front, left"] = 12 - 100 * table[PRESSURE] / 2
    changed[VEHICLE] = table[VEHICLE].shift(20)
    (tmp_path / "map.toml").write_text(
        '[brake_pressure]\ncolumn = "p: front, left"\nunit = "kPa"\nsign = -1\noffset = 12\nfactor = 2\n'
        f'[vehicle_speed]\ncolumn = "{VEHICLE}"\ndelay = 0.02\n'
    )
    log = log_of(tmp_path, changed, declarations(f"acceleration={ACCELERATION}:m/s^2", tmp_path / "map.toml"))
    count = len(table) - 20
    np.testing.assert_allclose(log.time, table[TIME][:count], atol=1e-12)
    np.testing.assert_allclose(log.brake_pressure, table[PRESSURE][:count], atol=1e-9)
    np.testing.assert_allclose(log.vehicle_speed, table[VEHICLE][:count], rtol=1e-12)
    assert "vehicle_speed: moved 0.02 s earlier, as declared" in log.notes
    assert "brake_pressure: turned, 12 taken off its cells, its cells times 2, as declared" in log.notes


@pytest.mark.parametrize(
    "text, message",
    [
        ("[wheel]\n", r"map\.toml, wheel: channel map: 'wheel' is unknown"),
        ("[wheel_speed]\nunits = 'rpm'\n", r"map\.toml, wheel_speed: .*'units' is unknown.* did you mean unit"),
        ("[wheel_speed]\nsign = 2\n", r"map\.toml, wheel_speed: sign"),
        ("[wheel_speed]\nfactor = 0\n", r"map\.toml, wheel_speed: factor"),
        ("wheel_speed = 3\n", r"map\.toml, wheel_speed: a configuration is a dictionary"),
        ("wheel_speed", r"map\.toml: not a TOML file"),
    ],
)
def test_a_map_with_a_mistake_is_refused_by_file_and_entry(tmp_path, text, message):
    (tmp_path / "map.toml").write_text(text)
    with pytest.raises(LogError, match=message):
        read_channel_map(tmp_path / "map.toml")


def test_declarations_of_odd_names(tmp_path):
    assert parse_columns('time=t,brake_pressure="a, b: c":psi') == {"time": "t", "brake_pressure": '"a, b: c":psi'}
    table = original()
    odd = table.rename(columns={WHEEL: "Wheel:FL", PRESSURE: 'p, "q"'})
    odd["Wheel:FL"] *= 30 / np.pi
    log = log_of(tmp_path, odd, {"wheel_speed": "Wheel:FL:rpm", "brake_pressure": 'p, "q"'})
    np.testing.assert_allclose(log.wheel_speed, table[WHEEL], rtol=1e-12)
    log = log_of(tmp_path, odd, parse_columns('wheel_speed="Wheel:FL":rpm,brake_pressure='))
    assert log.brake_pressure is None and log.acceleration is not None


EXPORTS = {
    "AiM": ("Time [s]", "Wheel Speed FL [rad/s]", "GPS Speed [km/h]", "Brake Press [bar]", "InlineAcc [g]"),
    "MoTeC": ("Time [s]", "Wheel Speed FL [rpm]", "Ground Speed [km/h]", "Brake Pres Front [psi]", "G Force Long [G]"),
    "OBD": ("timestamp (ms)", "Wheel Speed RR (km/h)", "Speed (OBD)(km/h)", "Brake Pressure(kPa)", "Ax(m/s²)"),
    "CAN": ("t_ms", "nWheel_FL_rpm", "VehSpd_mph", "pBrake_FL_bar", "LongAcc_m_s2"),
}


@pytest.mark.parametrize("export", EXPORTS)
def test_names_of_common_exports_are_known_and_said(tmp_path, export):
    table, names = original(), EXPORTS[export]
    signals = ("time", "wheel_speed", "vehicle_speed", "brake_pressure", "acceleration")
    from tuning.logs.names import stated

    changed = {}
    for signal, name, column in zip(signals, names, (TIME, WHEEL, VEHICLE, PRESSURE, ACCELERATION)):
        unit = stated(signal, name)[1]
        assert unit is not None
        changed[name] = table[column] / (unit.factor / (RADIUS if unit.kind == "rim" else 1))
    log = log_of(tmp_path, pd.DataFrame(changed))
    for signal, column in zip(signals, (TIME, WHEEL, VEHICLE, PRESSURE, ACCELERATION)):
        np.testing.assert_allclose(getattr(log, signal), table[column], rtol=1e-9, atol=1e-9)
    for signal, name in zip(signals, names):
        assert any(note.startswith(f"{signal} is column {name!r} in ") for note in log.notes)


def test_what_is_ambiguous_or_states_no_unit_is_not_guessed(tmp_path):
    table = original()
    two = table.rename(columns={VEHICLE: "GPS Speed [m/s]"}).assign(**{"Ground Speed [km/h]": 3.6 * table[VEHICLE]})
    with pytest.raises(
        LogError, match=r"'GPS Speed \[m/s\]', 'Ground Speed \[km/h\]' may each be vehicle_speed; declare"
    ):
        log_of(tmp_path, two)
    assert log_of(tmp_path, two, {"vehicle_speed": "Ground Speed [km/h]"}).vehicle_speed[0] == table[VEHICLE][0]
    with pytest.raises(
        LogError, match=r"column 'vCar' may be vehicle_speed, but states no unit; declare it as vehicle_sp"
    ):
        log_of(tmp_path, table.rename(columns={VEHICLE: "vCar"}))
    log = log_of(tmp_path, table.rename(columns={ACCELERATION: "ax"}))
    assert log.acceleration is None
    assert "column 'ax' may be acceleration, but states no unit; left out" in log.notes
    with pytest.raises(LogError, match=r"its unit 'V' is none of brake_pressure, as bar"):
        text = csv(table).decode().replace("\n", "\ns,rad/s,m/s,V,m/s2\n", 1)
        (tmp_path / "log.csv").write_text(text)
        read_log(tmp_path / "log.csv")


def test_signs_that_are_beyond_doubt_are_turned_and_declared_ones_obeyed(tmp_path):
    table = original()
    noise = np.random.default_rng(0).standard_normal(len(table))
    table["vertical_load_n"] = -2500 + 20 * noise
    table["longitudinal_force_n"] = -2500 * table[ACCELERATION] / 9.81
    log = log_of(tmp_path, table)
    np.testing.assert_allclose(log.load, -table["vertical_load_n"])
    np.testing.assert_allclose(log.force, -table["longitudinal_force_n"])
    assert "load turned: all of it is negative, as in SAE axes" in log.notes
    assert any(note.startswith("force turned: ") for note in log.notes)
    (tmp_path / "map.toml").write_text("[load]\nsign = 1\n")
    with pytest.raises(LogError, match=r"row 2: vertical load is -24\d\d"):
        log_of(tmp_path, table, read_channel_map(tmp_path / "map.toml"))


@pytest.mark.parametrize("radius, unit", [(0.3, "km/h"), (0.33, "km/h"), (0.3, "mph")])
def test_a_unit_that_would_fit_is_named(tmp_path, radius, unit):
    table = original()
    factor = radius * {"km/h": 3.6, "mph": 3600 / 1609.344}[unit]
    rim = table.assign(**{WHEEL: table[WHEEL] * RADIUS / radius * factor})
    with pytest.raises(LogError, match=rf"it would be (1\.00|0\.99)\d with wheel_speed={WHEEL}:{unit}"):
        log_of(tmp_path, rim, radius=radius)


def test_an_empty_channel_is_left_out(tmp_path):
    log = log_of(tmp_path, original().assign(longitudinal_force_n=np.nan))
    assert log.force is None and "force: column 'longitudinal_force_n' is empty; left out" in log.notes


def test_the_map_that_is_shown_is_taken(tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "commands" / "describe.md").read_text()
    (tmp_path / "map.toml").write_text(re.findall(r"```toml\n(.*?)```", page, re.DOTALL)[0])
    shown = read_channel_map(tmp_path / "map.toml")
    assert shown["wheel_speed"].teeth == 48 and shown["acceleration"].sign == -1
