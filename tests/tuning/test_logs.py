"""The log reader: what it reads, and what it refuses, naming file, column and row."""

import numpy as np
import pytest

from tuning.logs.brake_log import parse_columns, read_log
from tuning.logs.tables import LogError

HEADER = ["time_s", "wheel_speed_rad_s", "vehicle_speed_m_s", "brake_pressure_bar", "longitudinal_acceleration_m_s2"]


def table(rows=400):
    time = np.arange(rows) * 1e-3
    speed = 30 - 8 * time
    return {
        "time_s": time,
        "wheel_speed_rad_s": speed / 0.3 * (1 - 0.1 * np.sin(30 * time) ** 2),
        "vehicle_speed_m_s": speed,
        "brake_pressure_bar": 40 + 5 * np.sin(30 * time),
        "longitudinal_acceleration_m_s2": -8 + 0.1 * np.sin(90 * time),
    }


def write(path, columns, header=None):
    names = list(columns) if header is None else header
    lines = [",".join(names)] + [",".join(str(c) for c in row) for row in zip(*columns.values())]
    path.write_text("\n".join(lines) + "\n")
    return path


def altered(column, row, value):
    columns = {name: list(values) for name, values in table().items()}
    columns[column][row] = value
    return columns


def scaled(column, factor):
    return {**table(), column: table()[column] * factor}


def without(column):
    return {name: values for name, values in table().items() if name != column}


BAD = {
    "missing column": (
        without("vehicle_speed_m_s"),
        r"no column 'vehicle_speed_m_s' for vehicle_speed; there are time_s",
    ),
    "nothing that tells of braking": (
        {name: table()[name] for name in HEADER[:3]},
        r"none of brake_pressure, acceleration, force .*; there are time_s, wheel_speed_rad_s",
    ),
    "text in a cell": (
        altered("vehicle_speed_m_s", 7, "fast"),
        r"column 'vehicle_speed_m_s', row 9: 'fast' is not a finite",
    ),
    "infinity": (altered("brake_pressure_bar", 5, "inf"), r"row 7: 'inf' is not a finite number"),
    "duplicate time": (altered("time_s", 50, 0.049), r"column 'time_s', row 52: 0\.049 s repeats the time"),
    "time runs back": (altered("time_s", 50, 0.01), r"row 52: 0\.01 s goes back in time"),
    "a gap": (
        {**table(), "time_s": table()["time_s"] + 0.2 * (np.arange(400) >= 300)},
        r"row 302: a gap of 0\.201 s in wheel_speed; .* Use the log up to 0\.299 s, or from 0\.5 s on",
    ),
    "time in ms": (scaled("time_s", 1e3), r"sampling period 1 s; 10 us to 50 ms can be used"),
    "speed in km/h": (scaled("vehicle_speed_m_s", 3.6), r"R w / v near 1, here it is 0\.27"),
    "speed in mm/s": (
        scaled("vehicle_speed_m_s", 1e3),
        r"30000 is not plausible for vehicle_speed in m/s; is it in km/h or mph",
    ),
    "wheel speed in rpm": (
        scaled("wheel_speed_rad_s", 9.549),
        r"is not plausible for wheel_speed in rad/s; is it in rpm",
    ),
    "pressure in kPa": (scaled("brake_pressure_bar", 100), r"not plausible for brake_pressure in bar; is it in kPa"),
    "acceleration in g": (scaled("longitudinal_acceleration_m_s2", 1 / 9.81), r"integrates to 0\.3.* is it in g\?"),
    "acceleration of the wrong sign": (
        {**scaled("longitudinal_acceleration_m_s2", -1), "vehicle_speed_m_s": 30 + table()["time_s"]},
        r"mostly positive; acceleration must be negative",
    ),
    "pressure of the wrong sign": (
        scaled("brake_pressure_bar", -1),
        r"mostly negative; braking pressure must be positive",
    ),
    "too few samples": ({k: v[:150] for k, v in table().items()}, r"150 samples, 200 needed"),
    "hardly any of it in motion": (
        {**table(), "vehicle_speed_m_s": np.maximum(table()["vehicle_speed_m_s"] - 28.5, 0)},
        r"63 samples in a row in which the vehicle is faster than 1 m/s, 200 needed",
    ),
    "negative wheel speed": (altered("wheel_speed_rad_s", 30, -2.0), r"row 32: wheel_speed is -2 at 0\.03 s"),
    "a dead sensor": (scaled("brake_pressure_bar", 0), r"brake_pressure never changes from 0; is the sensor connected"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_logs_are_refused(tmp_path, case):
    columns, message = BAD[case]
    path = write(tmp_path / "brake.csv", columns)
    with pytest.raises(LogError, match=message) as error:
        read_log(path)
    assert "brake.csv" in str(error.value)


def test_files_that_are_no_logs_are_refused(tmp_path):
    with pytest.raises(LogError, match=r"nothing\.csv: no such file"):
        read_log(tmp_path / "nothing.csv")
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(LogError, match=r"empty\.csv: the file is empty"):
        read_log(tmp_path / "empty.csv")
    (tmp_path / "header.csv").write_text(",".join(HEADER) + "\n")
    with pytest.raises(LogError, match="a header and no samples"):
        read_log(tmp_path / "header.csv")
    (tmp_path / "ragged.csv").write_text("a,b\n1,2\n1,2,3\n")
    with pytest.raises(LogError, match=r"row 3: not a table of separated values: 3 cells, the header has 2"):
        read_log(tmp_path / "ragged.csv")
    twice = write(tmp_path / "twice.csv", table(), header=[*HEADER[:4], HEADER[3]])
    with pytest.raises(LogError, match="'brake_pressure_bar' stands twice"):
        read_log(twice)


def test_a_good_log_and_its_window(tmp_path):
    log = read_log(write(tmp_path / "good.csv", table()), start=0.1, end=0.35)
    assert log.time[0] == 0.1 and log.time[-1] == pytest.approx(0.349, abs=2e-3)
    assert log.force is None and log.period == pytest.approx(1e-3)
    assert log.notes == ("grid of 0.001 s, 250 samples from 0.1 s to 0.349 s",) and not log.doubts
    assert log.signals == ("wheel_speed", "vehicle_speed", "brake_pressure", "acceleration")
    for name in log.signals:
        assert log.measured[name].all() and log.measured[name].shape == log.time.shape and log.resolution[name] == 0
    with pytest.raises(LogError, match=r"101 samples between 0\.1 s and 0\.2 s, 200 needed"):
        read_log(tmp_path / "good.csv", start=0.1, end=0.2)


def test_a_stop_to_rest_is_cut_and_a_locked_wheel_is_not(tmp_path):
    columns = table(700)
    speed = np.maximum(8 - 14 * columns["time_s"], 0)
    locked = np.where(columns["time_s"] > 0.1, 0.0, speed / 0.3)
    log = read_log(
        write(
            tmp_path / "rest.csv",
            {
                **columns,
                "vehicle_speed_m_s": speed,
                "wheel_speed_rad_s": locked,
                "longitudinal_acceleration_m_s2": np.where(speed > 0, -14.0, 0.0),
            },
        )
    )
    assert log.time[-1] == pytest.approx(0.5) and log.vehicle_speed[-1] == pytest.approx(1.0)
    assert any("cut to 0 to 0.5 s: elsewhere the vehicle is slower than 1 m/s" in note for note in log.notes)
    assert (log.wheel_speed[101:] == 0).all() and log.measured["wheel_speed"].all()


def test_other_names_and_units(tmp_path):
    columns = table()
    path = write(
        tmp_path / "theirs.csv",
        {
            "t": columns["time_s"] * 1e3,
            "n": columns["wheel_speed_rad_s"] / 0.10471975511965977,
            "v": columns["vehicle_speed_m_s"] * 3.6,
            "p": columns["brake_pressure_bar"] / 10,
            "a": columns["longitudinal_acceleration_m_s2"] / 9.81,
        },
    )
    declared = "time=t:ms,wheel_speed=n:rpm,vehicle_speed=v:km/h,brake_pressure=p:MPa,acceleration=a:g"
    log, plain = read_log(path, parse_columns(declared)), read_log(write(tmp_path / "ours.csv", columns))
    for name in ("time", "wheel_speed", "vehicle_speed", "brake_pressure", "acceleration"):
        np.testing.assert_allclose(getattr(log, name), getattr(plain, name), rtol=1e-12)
    with pytest.raises(LogError, match=r"unit 'volts' is unknown; vehicle_speed may be in m/s, km/h, mph"):
        read_log(path, {"vehicle_speed": "v:volts"} | parse_columns("time=t:ms,wheel_speed=n:rpm,brake_pressure=p"))


@pytest.mark.parametrize(
    "declared, message", [("speed=v", "signal 'speed' is unknown"), ("time", "must read SIGNAL=COLUMN")]
)
def test_bad_declarations_are_refused(declared, message):
    with pytest.raises(LogError, match=message):
        parse_columns(declared)
