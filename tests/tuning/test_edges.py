"""Edges as pickups give them: speed and acceleration against the motion they were made of, and what is refused."""

import numpy as np
import pandas as pd
import pytest

from tests.fuzz.edges import judged
from tests.oracles.edge_simulator import WHEELS, Pickup, Profile
from tuning.encoder import tasks
from tuning.encoder.chains import edge_chain
from tuning.logs.brake_log import read_log
from tuning.logs.edge_speed import EdgeStudy, study_of
from tuning.logs.edges import read_edges
from tuning.logs.tables import LogError

OVERFLOW = 4292.967296
"""s, two before 32 bits of microseconds overflow"""
DISTURBED: dict[str, dict] = {
    "nothing": {},
    "1 % doubled": {"doubled": 0.01},
    "1 % missed": {"missed": 0.01},
    "dropout": {"dropout": 0.1},
    "16 bits": {"bits": 16},
    "32 bits": {"bits": 32, "begin": OVERFLOW},
    "both edges": {"both": 0.4},
    "both edges, nearly alike": {"both": 0.46},
    "uneven teeth": {"tolerance": 0.01},
}
ALL = {"doubled": 0.01, "missed": 0.01, "dropout": 0.1, "both": 0.4, "tolerance": 0.002}
DISTURBED |= {"all, 16 bits": {**ALL, "bits": 16}, "all, 32 bits": {**ALL, "bits": 32, "begin": OVERFLOW}}


def studied(pickup: Pickup, folder, text: str | None = None, **options) -> EdgeStudy:
    path = folder / "edges.csv"
    path.write_text(pickup.text() if text is None else text)
    return study_of(read_edges(path, **{"teeth": pickup.teeth, **options}))


def errors(pickup: Pickup, study: EdgeStudy) -> tuple[float, float]:
    """Rms of speed and acceleration where they are valid."""
    turning, valid = study.turning, study.turning.valid
    first = np.floor((pickup.begin + pickup.edges()[0]) / pickup.clock) * pickup.clock
    speed, acceleration = pickup.truth(turning.time - turning.time[0] + first)
    pairs = ((turning.speed, speed), (turning.acceleration, acceleration))
    rms = [float(np.sqrt(np.mean((a - b)[valid] ** 2))) for a, b in pairs]
    return rms[0], rms[1]


@pytest.mark.parametrize("wheel", WHEELS)
def test_speed_and_acceleration_of_disturbed_edges(wheel, tmp_path):
    for name, about in DISTURBED.items():
        pickup = Pickup(wheel, seed=3, **about)
        study = studied(pickup, tmp_path)
        speed, acceleration = errors(pickup, study)
        assert study.verdict == "sound", (name, study.reasons)
        assert study.passings.pattern.name == wheel, name
        assert speed < 0.05 and acceleration < 5.0, name
        assert study.turning.valid.mean() > 0.9, name
        assert study.passings.cuts == (pickup.dropout > 0), name
        time = study.turning.time - study.turning.time[0]
        gap = (time > 0.4 * pickup.duration + 0.005) & (time < 0.4 * pickup.duration + 0.095)
        assert not (pickup.dropout and study.turning.valid[gap].any()), name


def test_repaired_edges_are_counted_and_not_trusted(tmp_path):
    pickup = Pickup("48", seed=1)
    stamps = pickup.stamps()
    lines = [*stamps[:1000], stamps[999] + 60, *stamps[1000:2000], *stamps[2001:]]
    study = studied(pickup, tmp_path, "edge_tick\n" + "\n".join(map(str, lines)))
    assert (study.passings.doubled, study.passings.missed) == (1, 1)
    assert errors(pickup, study)[0] < 0.01
    ticks = study.turning.time / 1e-6
    for low, high in ((stamps[999], stamps[1000]), (stamps[1999], stamps[2001])):
        inside = (ticks > low) & (ticks < high)
        assert inside.any() and not study.turning.valid[inside].any()
    assert study.turning.valid.sum() > len(ticks) - 30


def test_time_is_that_of_the_log(tmp_path):
    pickup = Pickup("60", begin=1234.0)
    study = studied(pickup, tmp_path)
    assert study.turning.time[0] == pytest.approx(pickup.stamps()[0] * 1e-6, abs=1e-9)
    assert study.filled.stamps[-1] == pickup.stamps()[-1]


def test_formats_say_the_same(tmp_path):
    pickup = Pickup("60-2", seed=2, duration=2.0)
    wanted, stamps = studied(pickup, tmp_path).turning, pickup.stamps()
    texts = {
        "seconds": "Time[s]\n" + "\n".join(f"{x * 1e-6:.6f}" for x in stamps),
        "decimal commas": "Zeit [s];Nr\n"
        + "\n".join(f"{x * 1e-6:.6f};{i}".replace(".", ",") for i, x in enumerate(stamps)),
        "milliseconds": "time_ms\n" + "\n".join(f"{x * 1e-3:.3f}" for x in stamps),
        "periods": "period_us\n" + "\n".join(map(str, np.diff(stamps))),
        "levels": "Time [s], Channel 0\n" + "\n".join(f"{x * 1e-6:.6f}, 1\n{x * 1e-6 + 3e-4:.6f}, 0" for x in stamps),
    }
    for name, text in texts.items():
        found = studied(pickup, tmp_path, text).turning
        np.testing.assert_allclose(found.speed, wanted.speed, atol=2e-3, err_msg=name)
        start = 0.0 if name == "periods" else wanted.time[0]
        assert found.time[0] == pytest.approx(start, abs=1e-9), name


@pytest.mark.parametrize(
    ("pickup", "teeth", "message"),
    [
        (Pickup("36-1"), 60, "60 teeth declared, but the gaps repeat after 36 pitches, as those of a 36-1 wheel"),
        (Pickup("48", tolerance=0.005), 47, "47 teeth declared, but the errors of the edges repeat after 48"),
        (Pickup("48", clock=1e-3), 48, "2 ticks from edge to edge, 4 needed"),
        (Pickup("48", both=0.4, tolerance=0.005), 60, "60 teeth declared, but the errors of the edges repeat after 48"),
    ],
)
def test_teeth_and_clock_are_refused_with_the_numbers(pickup, teeth, message, tmp_path):
    with pytest.raises(LogError, match=message):
        studied(pickup, tmp_path, teeth=teeth, clock=pickup.clock)


def test_declared_teeth_are_corrected_where_it_is_certain(tmp_path):
    pickup = Pickup("36-1")
    study = studied(pickup, tmp_path, teeth=35)
    assert "35 teeth and 1 missing: a 36-1 wheel, 36 pitches in a revolution" in study.notes
    assert errors(pickup, study)[0] < 0.05
    pickup = Pickup("48", both=0.4, tolerance=0.005)
    study = studied(pickup, tmp_path, teeth=96)
    assert any("96 declared, but errors repeat after 48" in note for note in study.notes)
    assert errors(pickup, study)[0] < 0.05
    study = studied(Pickup("48", tolerance=0.005), tmp_path, teeth=96)
    assert study.verdict == "doubtful" and "repeat after 48 already" in study.reasons[0]


def test_a_gap_that_may_hide_an_overflow_is_not_trusted_behind(tmp_path):
    """At constant speed no lap of the counter fits better than another where a wheel has no mark."""
    pickup = Pickup("60", profile=Profile(swing=0.0), bits=16, dropout=0.1)
    study = studied(pickup, tmp_path)
    assert study.verdict == "doubtful" and "as the counter overflows" in study.reasons[0]
    assert errors(pickup, study)[0] < 0.05
    assert not study.turning.valid[study.turning.time > study.turning.time[0] + 2.2].any()


def test_noise_is_no_wheel(tmp_path):
    stamps = np.sort(np.random.default_rng(0).integers(0, 10_000_000, 5000))
    with pytest.raises(LogError, match="edges come too irregularly to be counted"):
        studied(Pickup(), tmp_path, "edge_tick\n" + "\n".join(map(str, stamps)))


@pytest.mark.parametrize("first", range(0, 200, 50))
def test_mutated_logs(first, tmp_path):
    """A part of `python -m tests.fuzz.edges`."""
    outcomes = [judged(seed, tmp_path) for seed in range(first, first + 8)]
    assert not [outcome for outcome in outcomes if outcome.word.isupper()]


def test_compensation_that_makes_worse_is_switched_off(tmp_path, monkeypatch):
    pickup = Pickup("48", duration=2.0, tolerance=0.005)
    study = studied(pickup, tmp_path)
    chain = edge_chain(48, 15, 4)
    worse = lambda study, signal, compensated, teeth: 1.0 + (compensated and signal == "speed")  # noqa: E731
    monkeypatch.setattr(tasks, "periodic_part", worse)
    result = tasks.study_edges(study, tmp_path, chain, 1e-3).results[tmp_path / "result.json"]
    table = pd.read_csv(tmp_path / "wheel_speed.csv")
    assert result["verdict"] == study.verdict and "compensation of the speed made it worse" in str(result["notes"])
    assert (table.compensated_wheel_speed_rad_s == table.measured_wheel_speed_rad_s).all()
    assert (table.compensated_wheel_acceleration_rad_s2 != table.measured_wheel_acceleration_rad_s2).any()


def test_a_brake_log_takes_its_wheel_speed_from_edges(tmp_path):
    pickup = Pickup("60-2", begin=0.0, duration=3.0, missed=0.01)
    time = np.arange(0, 3.0, 1e-3)
    speed, _ = pickup.truth(time)
    table = pd.DataFrame(
        {"time_s": time, "vehicle_speed_m_s": 0.3 * speed / 0.95, "brake_pressure_bar": 50 + 5 * np.sin(time)}
    )
    table.to_csv(tmp_path / "stop.csv", index=False)
    with pytest.raises(LogError, match="no column 'wheel_speed_rad_s'"):
        read_log(tmp_path / "stop.csv")
    log = read_log(tmp_path / "stop.csv", edges=studied(pickup, tmp_path))
    known = log.measured["wheel_speed"]
    error = log.wheel_speed - pickup.truth(log.time)[0]
    assert log.period == pytest.approx(1e-3) and 0.3 < known.mean() < 1
    assert np.sqrt(np.mean(error[known] ** 2)) < 0.1
    assert any("wheel_speed is made of" in note for note in log.notes)
    refuted = studied(pickup, tmp_path)._replace(verdict="refuted", reasons=("not the edges of one wheel",))
    with pytest.raises(LogError, match="not the edges of one wheel"):
        read_log(tmp_path / "stop.csv", edges=refuted)
