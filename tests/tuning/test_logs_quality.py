"""What samples are worth, and the grid: against signals whose instants, steps and faults are known."""

import numpy as np
import pandas as pd
import pytest

import tuning
from tests.fuzz.mutate import ACCELERATION, PRESSURE, TIME, VEHICLE, WHEEL, csv, original
from tuning.logs.brake_log import read_log
from tuning.logs.quality import hold_length, quality_of
from tuning.logs.tables import LogError

TIMES = np.arange(2000) * 1e-3


def noisy(seed=0, noise=0.1):
    """A signal that falls and swings, of 2 s at 1 kHz, with noise."""
    return 60 - 20 * TIMES + 5 * np.sin(20 * TIMES) + noise * np.random.default_rng(seed).standard_normal(2000)


def log_of(tmp_path, table):
    (tmp_path / "log.csv").write_bytes(csv(table))
    return read_log(tmp_path / "log.csv")


@pytest.mark.parametrize("period, phase", [(10, 0), (20, 7), (9.7, 3), (33.3, 0), (2, 0), (3, 1)])
def test_messages_of_a_held_signal_are_found(period, phase):
    values = noisy()
    sent = np.round(phase + period * np.arange(-1, 2000 / period)).astype(int)
    latest = np.searchsorted(sent, np.arange(2000), side="right") - 1
    held = values[np.maximum(sent[latest], 0)]
    quality = quality_of("vehicle_speed", TIMES, held)
    assert quality.held == pytest.approx(period, abs=0.5)
    inside = sent[(sent > 0) & (sent < 2000)]
    np.testing.assert_array_equal(np.flatnonzero(quality.taken[1:]) + 1, inside)
    assert not quality.stuck and not quality.clipped


def test_a_held_signal_that_stays_does_not_become_a_ramp(tmp_path):
    """Pressure at zero for half a second, told every 20 ms: it stays there until the last message that says so."""
    table = original()
    pressure = np.maximum(table[PRESSURE].to_numpy(), 0.5)
    pressure = np.concatenate([np.zeros(500), pressure])[:1600][np.arange(1600) // 20 * 20]
    log = log_of(tmp_path, table.assign(**{PRESSURE: pressure}))
    assert (log.brake_pressure[:481] == 0).all() and log.brake_pressure[490] > 0
    assert any(note.startswith("brake_pressure: each value held for 0.02 s") for note in log.notes)


@pytest.mark.parametrize("step", [0.05, 1 / 3.6, 1.0])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_quantised_signal_is_not_a_held_one(step, noise):
    values = (
        np.round(
            (33 - 9 * TIMES - 0.4 * np.sin(8 * TIMES) + noise * np.random.default_rng(1).standard_normal(2000)) / step
        )
        * step
    )
    quality = quality_of("vehicle_speed", TIMES, values.round(4))
    assert quality.held == 1 and quality.taken.all() and quality.trusted.all()
    assert quality.resolution == pytest.approx(step, rel=2e-3)
    ramp = np.round((30 - 10 * TIMES) / step) * step
    assert hold_length(ramp) == 1


@pytest.mark.parametrize("step, seen", [(0.01, False), (0.04, False), (0.3, True)])
def test_steps_within_the_noise_are_not_seen(step, seen):
    quality = quality_of("wheel_speed", TIMES, np.round(noisy() / step) * step)
    assert quality.resolution == (pytest.approx(step, rel=1e-6) if seen else 0)


def test_where_a_signal_is_stuck_clipped_spiked_or_lost():
    stuck = noisy()
    stuck[700:900] = stuck[700]
    quality = quality_of("wheel_speed", TIMES, stuck)
    assert quality.stuck == ((700, 899),)
    np.testing.assert_array_equal(np.flatnonzero(~quality.trusted), np.arange(701, 900))
    assert quality.taken.all()

    clipped = np.maximum(noisy(), 35.0)
    quality = quality_of("wheel_speed", TIMES, clipped)
    assert quality.clipped == (35.0,) and not quality.stuck
    np.testing.assert_array_equal(quality.trusted, clipped > 35)

    spiked, at = noisy(), np.array([100, 500, 1500])
    spiked[at] += [15, -20, 12]
    quality = quality_of("wheel_speed", TIMES, spiked)
    np.testing.assert_array_equal(quality.spikes, at)
    np.testing.assert_array_equal(np.flatnonzero(~quality.taken), at)

    lost = noisy()
    lost[1000:1030] = 0
    quality = quality_of("wheel_speed", TIMES, lost)
    assert quality.lost == ((1000, 1029),)
    np.testing.assert_array_equal(np.flatnonzero(~quality.taken), np.arange(1000, 1030))


def test_no_wolf_is_cried():
    """A locked wheel, a brake not pressed, a simulated log without noise, one channel at rest."""
    locked = np.where((TIMES > 0.5) & (TIMES < 0.9), 0.0, np.minimum(noisy(), 100 * np.abs(TIMES - 0.7)))
    assert not quality_of("wheel_speed", TIMES, np.maximum(locked, 0)).clipped
    resting = np.where((TIMES > 0.4) & (TIMES < 1.2), np.maximum(noisy(2, 0.2), 0), 0.0)
    assert not quality_of("brake_pressure", TIMES, resting).clipped
    plateaus = np.clip(80 * np.sin(12 * TIMES), 10, 50)
    for signal, values in {
        "brake_pressure": plateaus,
        "vehicle_speed": np.minimum(30, 34 - 10 * TIMES),
        "wheel_speed": np.minimum(100, 120 - 40 * TIMES).round(2),
        "acceleration": np.maximum(-9, -20 * TIMES),
        "force": (-2000 - 0.02 * np.cos(7 * TIMES) - 500 * np.maximum(TIMES - 1.5, 0) ** 3).round(2),
    }.items():
        quality = quality_of(signal, TIMES, values)
        assert quality.held == 1 and quality.trusted.all() and quality.taken.all(), signal


@pytest.mark.parametrize("name", ["stop_dry_wet", "rig_65kmh"])
def test_nothing_is_doubted_about_the_shipped_logs(name):
    from pathlib import Path

    log = read_log(Path(tuning.__file__).parent / "data" / f"{name}.csv")
    assert log.doubts == () and all(mask.all() for mask in log.measured.values())
    assert set(log.resolution.values()) == {0.0} and len(log.notes) == 1


def test_fast_channels_are_averaged_over_blocks(tmp_path):
    """Against a plain loop: samples nearest to each instant of a grid of 0.5 ms."""
    rng = np.random.default_rng(3)
    time = np.arange(4000) * 1e-4
    speed = 30 - 8 * time
    table = pd.DataFrame({TIME: time.round(4), WHEEL: speed / 0.33 + rng.standard_normal(4000), VEHICLE: speed})
    table[PRESSURE] = 40 + rng.standard_normal(4000)
    log = log_of(tmp_path, table)
    assert log.period == pytest.approx(5e-4) and len(log.time) == 800
    for k in (1, 17, 400, 798):
        near = [i for i in range(4000) if abs(time[i] - log.time[k]) < 2.4e-4]
        assert len(near) == 5
        assert log.wheel_speed[k] == pytest.approx(np.mean([table[WHEEL][i] for i in near]), rel=1e-12)


def test_jittered_instants_are_resampled(tmp_path):
    """Against the smooth signals that were sampled at those instants."""
    rng = np.random.default_rng(4)
    time = np.sort(np.arange(1500) * 1e-3 + 0.3e-3 * rng.standard_normal(1500)).round(6)
    speed = 30 - 8 * time
    table = pd.DataFrame({TIME: time, WHEEL: speed / 0.3 * (0.95 + 0.05 * np.cos(30 * time)), VEHICLE: speed})
    table[PRESSURE] = 40 + 5 * np.sin(30 * time)
    log = log_of(tmp_path, table.drop_duplicates(TIME))
    assert log.period == pytest.approx(1e-3, rel=1e-6) and np.ptp(np.diff(log.time)) < 1e-9
    np.testing.assert_allclose(log.brake_pressure, 40 + 5 * np.sin(30 * log.time), atol=0.01)
    assert any("jitter by 3" in note and "resampled" in note for note in log.notes)


def test_gaps_up_to_50_ms_are_bridged_and_longer_ones_refused(tmp_path):
    table = original()
    log = log_of(tmp_path, pd.concat([table.iloc[:700], table.iloc[749:]]))
    assert len(log.time) == 1600 and not log.measured["wheel_speed"][700:749].any()
    assert log.measured["wheel_speed"].sum() == 1600 - 49
    line = np.interp(np.arange(700, 749), [699, 749], table[WHEEL][[699, 749]])
    np.testing.assert_allclose(log.wheel_speed[700:749], line, rtol=1e-9)
    assert any("1 gaps bridged, the longest 0.05 s" in note for note in log.notes)
    with pytest.raises(LogError, match=r"row 702: a gap of 0\.052 s .* up to 0\.699 s, or from 0\.751 s on"):
        log_of(tmp_path, pd.concat([table.iloc[:700], table.iloc[751:]]))
    holes = table.copy()
    holes.loc[600:680, ACCELERATION] = np.nan
    with pytest.raises(LogError, match=r"column 'longitudinal_acceleration_m_s2', row 683: a gap of 0\.082 s"):
        log_of(tmp_path, holes)


def test_a_window_cuts_the_masks_too(tmp_path):
    table = original()
    log = log_of(tmp_path, table.drop(index=[500, 900]))
    cut = log.window(0.45, 0.95)
    assert len(cut.time) == 501 and cut.notes == log.notes and cut.resolution == log.resolution
    np.testing.assert_array_equal(np.flatnonzero(~cut.measured["vehicle_speed"]), [50, 450])
