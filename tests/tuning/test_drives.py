"""Logs of whole drives: brakings found, each identified or refused by name."""

import numpy as np
import pytest

from tests.oracles.drive_simulator import drive, steadily
from tests.oracles.log_scenarios import SURFACES, Logging, Road, Stop
from tests.oracles.log_simulator import COLUMNS
from tuning.logs.brake_log import BrakeLog, read_brakings, read_log
from tuning.logs.car import Car
from tuning.logs.drive import brakings
from tuning.logs.tables import LogError
from tuning.road.drive import drive_report, identify_brakings
from tuning.road.identify import identify

DRY, SNOW = SURFACES["dry_asphalt"], SURFACES["snow"]


def stop_on(surface, speed):
    return Stop(speed=speed, road=Road((surface,)), logging=Logging(duration=1.2))


def written(signals, folder):
    path = folder / "drive.csv"
    header = ",".join(["time_s", *(COLUMNS[name] for name in signals if name != "time")])
    np.savetxt(path, np.column_stack(list(signals.values())), "%.4f", ",", header=header, comments="")
    return path


def profile(*legs, period=0.01):
    """Time, speed and acceleration of legs (duration, acceleration), from rest."""
    rate = np.concatenate([np.full(round(duration / period), a) for duration, a in legs])
    return np.arange(len(rate)) * period, np.concatenate([[0.0], np.cumsum(rate[:-1]) * period]), rate


@pytest.mark.parametrize("with_acceleration", [True, False])
def test_brakings_lie_between_speeding_up_and_rest(with_acceleration):
    legs = (5, 3.0), (1, 0.0), (2, -5.0), (1, 0.0), (3, 2.0), (2, 0.0), (1, -6.0), (1, -0.1), (1, -3.0), (2, 0.0)
    time, speed, rate = profile(*legs)
    found = brakings(time, speed, rate if with_acceleration else None, slowest=1.0, shortest=0.5)
    # The pedal let go in between is one braking.
    assert len(found) == 2
    for window, begins, ends in zip(found, (6.0, 14.0), (8.0, 17.0)):
        assert begins - 0.9 < window.start < begins - 0.2 and abs(window.end - ends) < 0.3


def test_a_stop_is_no_drive():
    time, speed, rate = profile((1, 0.0), (3, -8.0))
    assert brakings(time, 30 + speed, rate, slowest=1.0, shortest=0.5) == []
    time, speed, rate = profile((5, 4.0), (2, 0.0))
    assert brakings(time, speed, rate, slowest=1.0, shortest=0.5) == []


def test_every_braking_of_a_drive_has_its_road(tmp_path, monkeypatch):
    stops = [stop_on(DRY, 22.0), stop_on(SNOW, 12.0)]
    signals, spans = drive(stops, rest=1.0)
    path = written(signals, tmp_path)
    logs = read_brakings(path)
    assert len(logs) == 2 and any("somebody brakes after speeding up" in note for note in read_log(path).notes)
    for log, (begins, ends) in zip(logs, spans):
        assert isinstance(log, BrakeLog) and begins - 0.5 < log.time[0] < begins and log.time[-1] > ends - 0.1
    gone = LogError("braking 3: a gap")
    found, refused = identify_brakings([*logs, gone], Car(), "burckhardt", progress=lambda said: None)
    assert refused == {3: "braking 3: a gap"} and [braking.number for braking in found] == [1, 2]
    for braking, surface in zip(found, (DRY, SNOW)):
        (segment,) = braking.result.segments
        assert braking.result.verdict == "sound"
        assert segment.peak_friction == pytest.approx(surface.peak_friction, rel=0.01)
        assert segment.peak_slip == pytest.approx(surface.peak_slip, abs=0.005)
    titles = []

    def figures(result, log, car, folder, shown):
        titles.append(shown)
        return [folder]

    monkeypatch.setattr("tuning.road.drive.identification_figures", figures)
    report = drive_report(found, refused, Car(), tmp_path / "out")
    (rows,) = (table for title, table in report.tables.items() if "friction" in title)
    assert [row["braking"] for row in rows] == ["1", "2"] and report.verdict == "sound"
    assert any("braking 3 tells no road" in line for line in report.lines)
    assert [path.name for path in report.written] == ["braking_1", "braking_2", "result.json"]
    for number, (title, log) in enumerate(zip(titles, logs), 1):
        assert title == f"drive.csv, braking {number}, {log.time[0]:.2f} to {log.time[-1]:.2f} s"
    with pytest.raises(LogError, match="1 brakings, and none tells a road; braking 3: a gap"):
        identify_brakings([gone], Car(), "burckhardt", progress=lambda said: None)


def test_one_slip_does_not_tell_a_curve():
    rng, stop = np.random.default_rng(0), stop_on(DRY, 25.0)
    held = steadily(stop, np.arange(25.0, 21.0, -4e-3), -4.0, rng)
    rolling = steadily(stop, np.full(200, 25.0), 0.0, rng)
    signals = {name: np.concatenate([rolling[name], held[name]]) for name in held}
    time = np.arange(len(signals["acceleration"])) * 1e-3
    result = identify(BrakeLog("held", time, **signals))
    (segment,) = result.segments
    assert not segment.identifiable["peak_friction"] and not segment.identifiable["peak_slip"]
