"""Whatever is given to a reader: it is read as it stands and comes back unchanged, or is refused by name."""

import json
import math
from functools import partial

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tuning.controllers.config import TuningConfig
from tuning.core.config import ConfigError
from tuning.encoder.config import EncoderConfig
from tuning.logs.brake_log import read_log
from tuning.logs.car import CarError, wheel_from
from tuning.logs.edges import read_edges
from tuning.logs.tables import LogError
from tuning.observers.config import ObserverConfig

CONFIGS = (TuningConfig, ObserverConfig, EncoderConfig)
QUICK = settings(
    max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)

plain = st.one_of(st.none(), st.booleans(), st.integers(-3, 300), st.floats(), st.text(max_size=6))
anything = st.recursive(
    plain, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3)
)


def names_of(config) -> list[str]:
    return sorted(config().to_json())


@pytest.mark.parametrize("config", CONFIGS)
@QUICK
@given(data=st.data())
def test_a_configuration_of_anything_is_read_or_refused(config, data):
    names = st.sampled_from(names_of(config)) | st.text(max_size=8)
    entries = data.draw(st.dictionaries(names, anything, max_size=4))
    try:
        read = config.from_json(entries)
    except ConfigError as error:
        assert any(name in str(error) for name in entries) or "configuration" in str(error) or "start" in str(error)
        return
    again = config.from_json(json.loads(json.dumps(read.to_json(), allow_nan=False)))
    assert again == read


@pytest.mark.parametrize("config", CONFIGS)
@QUICK
@given(entries=anything)
def test_no_configuration_at_all_is_refused(config, entries):
    if isinstance(entries, dict):
        return
    with pytest.raises(ConfigError):
        config.from_json(entries)


@QUICK
@given(
    entries=st.dictionaries(
        st.sampled_from(["wheel_inertia", "radius", "load", "brake_efficiency", "source"]), anything, max_size=5
    )
)
def test_a_car_of_anything_is_read_or_refused(entries):
    try:
        wheel = wheel_from(entries)
    except CarError as error:
        assert any(name.removeprefix("wheel_") in str(error) for name in entries)
        return
    for name in set(entries) & {"radius", "load"}:
        assert getattr(wheel, name) == entries[name] > 0 and math.isfinite(entries[name])


cell = st.one_of(st.floats(), st.integers(-10, 10), st.sampled_from(["", " ", "nan", "1,5", "x", '"', "1e400", "-"]))
HEADER = "time_s,wheel_speed_rad_s,vehicle_speed_m_s,brake_pressure_bar"


@QUICK
@given(text=st.text(max_size=200) | st.lists(st.lists(cell, max_size=6), max_size=8))
def test_any_file_is_a_log_or_an_error_with_its_name(text, tmp_path):
    if not isinstance(text, str):
        text = "\n".join([HEADER, *(",".join(map(str, row)) for row in text)])
    file = tmp_path / "some.csv"
    file.write_text(text, encoding="utf-8")
    for read in (read_log, partial(read_edges, teeth=48)):
        with pytest.raises(LogError, match=r"some\.csv"):
            read(file)


def smooth_log():
    time = np.arange(300) * 1e-3
    signals = {"time_s": time, "wheel_speed_rad_s": 60.0 - 20 * time, "vehicle_speed_m_s": 20.0 - 5 * time}
    return {k: [f"{x:.6g}" for x in v] for k, v in {**signals, "brake_pressure_bar": 50.0 + 100 * time}.items()}


def written_to(file, cells):
    file.write_text("\n".join([HEADER, *(",".join(c) for c in zip(*cells.values()))]))
    return file


@QUICK
@given(
    row=st.integers(1, 298),
    column=st.sampled_from(HEADER.split(",")),
    written=st.sampled_from(["inf", "-1e3", "1e9", "text"]),
)
def test_one_bad_cell_among_good_ones_is_named(row, column, written, tmp_path):
    cells = smooth_log()
    cells[column][row] = written
    with pytest.raises(LogError, match=column):
        read_log(written_to(tmp_path / "one.csv", cells))


@QUICK
@given(
    row=st.integers(1, 298),
    column=st.sampled_from(HEADER.split(",")),
    written=st.sampled_from(["nan", "", "NaN", "n/a"]),
)
def test_one_empty_cell_among_good_ones_is_bridged(row, column, written, tmp_path):
    """On a line through its neighbours, and not measured; without its instant, nothing of a row is measured."""
    cells = smooth_log()
    whole = read_log(written_to(tmp_path / "whole.csv", cells))
    cells[column][row] = written
    log = read_log(written_to(tmp_path / "one.csv", cells))
    np.testing.assert_allclose(log.time, whole.time, rtol=1e-12)
    for name, own in zip(log.signals, HEADER.split(",")[1:]):
        np.testing.assert_allclose(getattr(log, name), getattr(whole, name), atol=2e-3)
        missing = np.flatnonzero(~log.measured[name]).tolist()
        assert missing == ([row] if column in (own, "time_s") else [])


damage = st.tuples(
    st.integers(0, 10**6),
    st.integers(0, 30),
    st.sampled_from([b"", b",", b"\n", b'"', b"-", b"\xff", b"x", b";", b"0"]),
)


@QUICK
@given(damages=st.lists(damage, min_size=1, max_size=5))
def test_a_damaged_log_is_read_in_finite_numbers_or_refused_by_its_name(damages, tmp_path):
    """Bytes taken out of a good log, and others put in their place."""
    data = bytearray("\n".join([HEADER, *(",".join(c) for c in zip(*smooth_log().values()))]).encode())
    for place, count, instead in damages:
        at = place % len(data)
        data[at : at + count] = instead
    (tmp_path / "damaged.csv").write_bytes(data)
    try:
        log = read_log(tmp_path / "damaged.csv")
    except LogError as error:
        assert "damaged.csv" in str(error)
        return
    assert np.ptp(np.diff(log.time)) < 1e-3 * log.period
    for name in log.signals:
        assert np.isfinite(getattr(log, name)).all() and log.measured[name].shape == log.time.shape
