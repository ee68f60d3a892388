"""Formats of logs: written by the libraries people use, read as the plain log, or refused by the file's name."""

import csv
import io
import sys

import h5py
import numpy as np
import pandas as pd
import pytest
from asammdf import MDF, Signal
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from tests.fuzz.mutate import ACCELERATION, PRESSURE, TIME, VEHICLE, WHEEL, original
from tuning.logs.brake_log import read_log
from tuning.logs.recording import numbers
from tuning.logs.tables import LogError, read_recording

SIGNALS = {"wheel_speed": WHEEL, "vehicle_speed": VEHICLE, "brake_pressure": PRESSURE, "acceleration": ACCELERATION}
QUICK = settings(
    max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def test_columns_of_parquet(tmp_path):
    original().to_parquet(tmp_path / "log.parquet")
    check_plain(tmp_path / "log.parquet")


def test_instants_of_parquet(tmp_path):
    table = original()
    table[TIME] = pd.Timestamp("2024-05-05 12:00") + pd.to_timedelta(table[TIME], unit="s")
    table.to_parquet(tmp_path / "log.parquet")
    assert "time is absolute; counted from the first row" in check_plain(tmp_path / "log.parquet").notes


@pytest.mark.parametrize("version", ["4", "5"])
def test_vectors_of_matlab(tmp_path, version):
    table = original()
    savemat(tmp_path / "log.mat", {name: table[name].to_numpy()[:, None] for name in table}, format=version)
    check_plain(tmp_path / "log.mat")


def test_structures_of_matlab_have_their_own_instants(tmp_path):
    table, every = original(), 10
    savemat(
        tmp_path / "log.mat",
        {
            "Wheel_Speed_FL": {"Time": table[TIME], "Value": table[WHEEL], "Units": "rad/s"},
            "Ground_Speed": {"Time": table[TIME][::every], "Value": 3.6 * table[VEHICLE][::every], "Units": "km/h"},
            "Brake_Pressure": {"Time": table[TIME][3:], "Value": table[PRESSURE][3:], "Units": "bar"},
            "Driver": "somebody",
        },
    )
    check_rates(read_log(tmp_path / "log.mat"), table, every)


def test_matrices_of_tyre_rigs_bring_their_units_beside(tmp_path):
    table = original()
    columns = {"ET": table[TIME], "V": 3.6 * table[VEHICLE], "N": table[WHEEL] * 30 / np.pi, "FX": -2500.0, "FZ": -2.5}
    values = {name: np.broadcast_to(column, len(table))[:, None] for name, column in columns.items()}
    values["FX"] = values["FX"] + 100 * table[ACCELERATION].to_numpy()[:, None]
    names = np.array(list(columns), object)
    units = np.array(["sec", "kph", "rpm", "N", "kN"], object)
    savemat(tmp_path / "run.mat", {**values, "channel": {"name": names, "units": units}, "tireid": "a tyre"})
    log = read_log(tmp_path / "run.mat")
    np.testing.assert_allclose(log.vehicle_speed, table[VEHICLE], rtol=1e-12)
    np.testing.assert_allclose(log.wheel_speed, table[WHEEL], rtol=1e-12)
    assert (log.load == 2500).all() and log.brake_pressure is None
    assert "load turned: all of it is negative, as in SAE axes" in log.notes
    assert "load is column 'FZ' in kN (as the file says)" in log.notes


def test_matlab_7_3(tmp_path):
    table = original()
    with h5py.File(tmp_path / "log.mat", "w", userblock_size=512) as file:
        for name in table:
            file[name] = table[name].to_numpy()[None, :]
        file["#refs#/a"] = np.arange(3.0)
    check_plain(tmp_path / "log.mat")


def test_groups_of_mdf_have_their_own_instants(tmp_path):
    table, every = original(), 20
    time, slow = table[TIME].to_numpy(), table[TIME].to_numpy()[::every]
    file = MDF(version="4.10")
    file.append([Signal(table[WHEEL].to_numpy(), time, name="WheelSpeed_FL", unit="rad/s")])
    file.append([Signal(3.6 * table[VEHICLE].to_numpy()[::every], slow, name="VehicleSpeed", unit="km/h")])
    file.append([Signal(table[PRESSURE].to_numpy()[3:], time[3:], name="BrakePressure", unit="bar")])
    file.append([Signal(np.arange(len(slow)) % 4, slow, name="Gear", unit="")])
    file.save(tmp_path / "log.mf4")
    file.close()
    check_rates(read_log(tmp_path / "log.mf4"), table, every)


def check_plain(path):
    log, table = read_log(path), original()
    for signal, column in SIGNALS.items():
        np.testing.assert_allclose(getattr(log, signal), table[column], rtol=1e-12)
        assert log.measured[signal].all()
    np.testing.assert_allclose(log.time, table[TIME], atol=1e-12)
    return log


def check_rates(log, table, every):
    """Against NumPy's interpolation of what was written."""
    np.testing.assert_allclose(log.time[[0, 1]], [0.003, 0.004], atol=1e-12)
    np.testing.assert_allclose(log.wheel_speed, table[WHEEL][3 : 3 + len(log.time)], rtol=1e-12)
    np.testing.assert_allclose(log.brake_pressure, table[PRESSURE][3 : 3 + len(log.time)], rtol=1e-12)
    slow = np.interp(log.time, table[TIME][::every], table[VEHICLE][::every])
    np.testing.assert_allclose(log.vehicle_speed, slow, rtol=1e-12)
    steps = np.round(log.time / 1e-3).astype(int)
    np.testing.assert_array_equal(log.measured["vehicle_speed"], steps % every == 0)
    assert log.acceleration is None and any("interpolated" in note for note in log.notes)


@pytest.mark.parametrize(
    "ending, library, message",
    [
        ("parquet", "pyarrow", r"log\.parquet: Parquet need pyarrow: pip install 'absjax\[formats\]'"),
        ("mat", "h5py", r"log\.mat: MATLAB files of version 7\.3 need h5py: pip install 'absjax\[formats\]'"),
        ("mf4", "asammdf", r"log\.mf4: MDF files need asammdf: pip install 'absjax\[mdf\]'"),
    ],
)
def test_a_library_that_is_missing_is_named(tmp_path, monkeypatch, ending, library, message):
    (tmp_path / f"log.{ending}").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(LogError, match=message):
        read_log(tmp_path / f"log.{ending}")


@pytest.mark.parametrize("ending", ["parquet", "mat", "mf4", "mdf", "csv", "txt"])
@QUICK
@given(data=st.binary(max_size=300) | st.binary(max_size=60).map(lambda b: b"\x89HDF\r\n\x1a\n" + b))
def test_any_bytes_are_refused_by_the_name_of_the_file(ending, data, tmp_path):
    (tmp_path / f"some.{ending}").write_bytes(data)
    with pytest.raises(LogError, match=rf"some\.{ending}"):
        read_log(tmp_path / f"some.{ending}")


names = st.text(st.characters(codec="latin-1", exclude_categories=["Cc", "Zs"]), min_size=1, max_size=8)


@QUICK
@given(
    separator=st.sampled_from(",;\t|"),
    decimal=st.sampled_from(".,"),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    quoting=st.sampled_from([csv.QUOTE_MINIMAL, csv.QUOTE_NONNUMERIC, csv.QUOTE_ALL]),
    ending=st.sampled_from(["\n", "\r\n", "\r"]),
    values=st.lists(st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3), min_size=12, max_size=20),
    header=st.lists(names.filter(lambda n: any(c.isalpha() for c in n)), min_size=3, max_size=3, unique=True),
)
def test_a_table_in_any_dialect_is_read_as_it_stands(
    separator, decimal, encoding, quoting, ending, values, header, tmp_path
):
    """Every cell comes back, however the table is written, or the file is refused by name."""
    if any(mark in name for name in header for mark in '"#%/'):
        return
    text = io.StringIO(newline="")
    writer = csv.writer(text, delimiter=separator, quoting=quoting, lineterminator=ending)
    writer.writerow(header)
    for row in values:
        writer.writerow([repr(x).replace(".", decimal) for x in row])
    path = tmp_path / "some.csv"
    path.write_bytes(text.getvalue().encode(encoding))
    recording = read_recording(path)
    assert recording.names == [name.strip() for name in header]
    for channel, column in zip(recording.channels, zip(*values)):
        np.testing.assert_array_equal(numbers(path, channel), column)


def test_a_long_header_block_and_a_line_that_names_the_separator(tmp_path):
    block = "".join(f"Channel {k};calibrated;{k}.5\n" for k in range(700))
    text = original().to_csv(index=False, sep=";", decimal=",")
    (tmp_path / "log.csv").write_text(f"sep=;\n{block}\n{text}")
    check_plain(tmp_path / "log.csv")


def test_rows_are_the_lines_of_the_file(tmp_path):
    lines = ["time_s,wheel_speed_rad_s,vehicle_speed_m_s,brake_pressure_bar"]
    lines += [f"{k / 1000},{90 - k / 100},{27 - k / 300},{k / 10}" for k in range(400)]
    lines[300] = "0.299,x,26.0,29.9"
    for blank in (250, 20, 1):
        lines.insert(blank, "")
    (tmp_path / "log.csv").write_text("\n".join(lines))
    with pytest.raises(LogError, match=r"column 'wheel_speed_rad_s', row 304: 'x' is not a finite number"):
        read_log(tmp_path / "log.csv")
    lines[303] = "0.299,60,26.0"
    (tmp_path / "log.csv").write_text("\n".join(lines))
    with pytest.raises(LogError, match="row 304: not a table of separated values: 3 cells, the header has 4"):
        read_log(tmp_path / "log.csv")
