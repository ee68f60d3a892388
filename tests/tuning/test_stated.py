"""What the car file states of zeros, delays and the radius counts before any fit: signs and units are judged by it."""

import dataclasses
import json

import numpy as np
import pytest

from tests.oracles.log_scenarios import SURFACES, Logging, Road, Sensors, Stop
from tests.oracles.log_simulator import COLUMNS, simulate
from tuning.logs.brake_log import BrakeLog, read_log
from tuning.logs.car import car_from
from tuning.logs.describe import described
from tuning.logs.quality import quality_of
from tuning.logs.quantities import Prior
from tuning.logs.stated import zero_of
from tuning.logs.tables import LogError
from tuning.road import conditions
from tuning.road.identify import identify

STONES = SURFACES["wet_cobblestones"]
SENSORS = Sensors()
ZERO, BIAS, DELAY = -60.0, 4.6, 0.04


@pytest.fixture(scope="module")
def stop():
    """On wet stones, by sensors whose zeros are off by more than what they measure, and a speed that is late."""
    sensors = dataclasses.replace(
        SENSORS,
        brake_pressure=dataclasses.replace(SENSORS.brake_pressure, bias=ZERO),
        acceleration=dataclasses.replace(SENSORS.acceleration, bias=BIAS),
        vehicle_speed=dataclasses.replace(SENSORS.vehicle_speed, delay=DELAY),
    )
    return simulate([Stop(speed=20.0, road=Road((STONES,)), logging=Logging(sensors=sensors, duration=1.3))])[0]


def stating(**entries):
    return car_from({name: {"value": value, "sd": sd} for name, (value, sd) in entries.items()})


ALL = stating(pressure_zero=(ZERO + 1, 1.0), acceleration_bias=(BIAS + 0.1, 0.1), speed_delay=(DELAY, 0.0))


def written(path, stop, *without, **other):
    """The log without some of its signals, and with others in the place of its own."""
    signals = {name: values for name, values in (stop.signals | other).items() if name not in without}
    kept = {"time_s": stop.time} | {COLUMNS[name]: values for name, values in signals.items()}
    np.savetxt(path, np.column_stack(list(kept.values())), "%.5f", ",", header=",".join(kept), comments="")
    return path


def test_a_stop_whose_zeros_are_stated_has_its_road(stop, tmp_path):
    path = tmp_path / "log.csv"
    stop.write_csv(path)
    with pytest.raises(LogError, match=r"mostly negative; braking pressure must be positive.*pressure_zero"):
        read_log(path)
    result = identify(read_log(path, stated=ALL.stated), ALL)
    assert result.verdict == "sound", result.reasons
    (segment,) = result.segments
    assert segment.peak_friction == pytest.approx(STONES.peak_friction, rel=0.02)
    assert segment.ci95["peak_friction"][0] < STONES.peak_friction < segment.ci95["peak_friction"][1]
    assert result.quantities["pressure_zero"].value == pytest.approx(ZERO, abs=1.0)
    assert result.quantities["acceleration_bias"].value == pytest.approx(BIAS, abs=0.1)
    assert "speed_delay" not in result.quantities


def test_a_car_file_is_used_by_the_commands(stop, tmp_path):
    path, car = tmp_path / "log.csv", tmp_path / "car.json"
    stop.write_csv(path)
    car.write_text(json.dumps({"pressure_zero": {"value": ZERO, "sd": 1.0}, "acceleration_bias": BIAS}))
    assert any("brake_pressure" in line for line in described(path, tmp_path, car=car).lines)
    with pytest.raises(LogError, match=r"mostly negative"):
        described(path, tmp_path)


def test_each_zero_counts_for_its_signal(stop, tmp_path):
    path = written(tmp_path / "log.csv", stop, "brake_pressure")
    with pytest.raises(LogError, match="mostly positive; acceleration must be negative"):
        read_log(path)
    for car in (stating(acceleration_bias=(BIAS, 0.0)), stating(acceleration_bias=(BIAS - 0.5, 0.3))):
        log = read_log(path, stated=car.stated)
        assert not any("turned" in note for note in log.notes) and log.acceleration.mean() > 0
    # Counted the other way round, it is turned for all its zero.
    other_way = written(path, stop, "brake_pressure", acceleration=-stop.signals["acceleration"])
    turned = read_log(other_way, stated=car.stated)
    np.testing.assert_allclose(turned.acceleration, log.acceleration, atol=1e-9)
    force = 2500.0 * (stop.signals["acceleration"] - BIAS) / 9.81 + 1500.0
    unsaid = read_log(written(path, stop, "brake_pressure", "acceleration", force=force))
    np.testing.assert_allclose(unsaid.force, -force, atol=1e-4)
    log = read_log(path, stated=stating(force_zero=(1500.0, 5.0)).stated)
    np.testing.assert_allclose(log.force, force, atol=1e-4)


def test_a_radius_that_is_hardly_known_is_no_wrong_unit(stop, tmp_path):
    faster = 1.1 * stop.signals["wheel_speed"]
    pressure = stop.signals["brake_pressure"] - ZERO
    path = written(tmp_path / "log.csv", stop, "acceleration", wheel_speed=faster, brake_pressure=pressure)
    assert not read_log(path, stated=stating(radius=(0.3, 0.015)).stated).doubts
    for car in (car_from({}), stating(radius=(0.3, 0.001))):
        with pytest.raises(LogError, match=r"it would be 1\.02\d with wheel_speed"):
            read_log(path, stated=car.stated)


def test_a_delay_that_is_stated_counts_without_an_acceleration_too():
    time = np.arange(1000) * 1e-3
    speed = np.where(time < 0.5, 20.0, 20.0 - 8 * (time - 0.5))
    log = BrakeLog("late", time, speed / 0.3, np.interp(time - 0.05, time, speed), 40 * np.ones(1000))
    start = conditions.begin(log, stating(speed_delay=(0.05, 0.0)))
    np.testing.assert_allclose(start.log.vehicle_speed[:900], speed[:900])
    assert start.values["speed_delay"] == pytest.approx(0.05) and not start.log.measured["vehicle_speed"][-50:].any()
    assert conditions.begin(log, car_from({})).log is log
    # What is certain stays as it is, whatever a rolling wheel says.
    rolling = dataclasses.replace(log, vehicle_speed=np.where(time < 0.5, 21.0, speed + 1))
    assert conditions.begin(rolling, car_from({})).values["radius"] == pytest.approx(0.315)
    assert conditions.begin(rolling, stating(radius=(0.3, 0.0))).values["radius"] == 0.3


def test_a_slope_that_is_stated_is_no_braking():
    time = np.arange(600) * 1e-3
    speed = 20.0 - 1.0 * time
    log = BrakeLog("uphill", time, speed * (1 - 0.005 * time) / 0.3, speed)
    uphill = car_from({"slope": -0.1})
    assert np.median(conditions.deceleration_of(log, car_from({}))) == pytest.approx(1.0, abs=1e-6)
    assert np.median(conditions.deceleration_of(log, uphill)) == pytest.approx(1.0 - 0.981, abs=1e-6)
    with pytest.raises(LogError, match="no braking"):
        conditions.require_braking(log, uphill)


def test_a_brake_that_is_not_pressed_stands_still_at_its_zero():
    rng = np.random.default_rng(0)
    time = np.arange(400) * 1e-3
    pressed = np.where(time < 0.1, 0.0, 60 + rng.normal(0, 2.0, 400))
    assert quality_of("brake_pressure", time, pressed).stuck == ()
    zero = zero_of("brake_pressure", {"pressure_zero": Prior(-9.0, 0.0, True)})
    assert (
        quality_of("brake_pressure", time, pressed - 9.0).stuck
        or quality_of("brake_pressure", time, pressed - 9.0).clipped
    )
    quality = quality_of("brake_pressure", time, pressed - 9.0, zero)
    assert quality.stuck == () and quality.clipped == () and quality.trusted.all()
