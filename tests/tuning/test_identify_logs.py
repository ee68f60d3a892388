"""Identification of logs that are not as a car file has them, from a simulator that shares no code with the project."""

import collections
import dataclasses
import functools
from itertools import pairwise

import numpy as np
import pytest

from absjax.plant.wheel import Wheel
from absjax.tyres.burckhardt import Burckhardt
from tests.oracles.log_scenarios import (
    SURFACES,
    Brake,
    Car,
    Logging,
    RigSweep,
    Sensors,
    Stop,
    on_two_axles,
    random_stops,
)
from tests.oracles.log_simulator import simulate
from tuning.logs.brake_log import BrakeLog, read_log
from tuning.logs.car import CarError, car_from
from tuning.logs.tables import LogError
from tuning.road.curve import Curve
from tuning.road.identify import identify
from tuning.road.output_error import CAR, NUISANCE, lagged, shooting
from tuning.road.together import identify_together

NAMES = ("c1", "c2", "c3", "peak_friction", "peak_slip")
DRY = SURFACES["dry_asphalt"]
LOGGING = Logging(duration=1.6)
STOP = Stop(speed=33.3, logging=LOGGING)


RANDOM = random_stops(8, seed=11)
OFF = {
    "radius": (Car(radius=0.306), {}, 0.306),
    "brake_efficiency": (Car(brake_efficiency=14.0), {}, 14.0),
    "pressure_zero": (Car(), {"brake_pressure": {"bias": 8.0}}, 8.0),
    "speed_delay": (Car(), {"vehicle_speed": {"delay": 0.1}}, 0.1),
    "acceleration_bias": (Car(), {"acceleration": {"bias": 0.6}}, 0.6),
}


def off(quantity):
    car, channels, _ = OFF[quantity]
    sensors = Sensors()
    for name, changes in channels.items():
        sensors = dataclasses.replace(sensors, **{name: dataclasses.replace(getattr(sensors, name), **changes)})
    return dataclasses.replace(STOP, car=car, logging=dataclasses.replace(LOGGING, sensors=sensors, declared=Car()))


LAGGING = dataclasses.replace(STOP, brake=Brake(lag=0.004))
WIDER = dataclasses.replace(STOP, car=Car(radius=0.303), logging=dataclasses.replace(LOGGING, declared=Car()))
SLOW = dataclasses.replace(STOP, logging=dataclasses.replace(LOGGING, sensors=Sensors().gps()))
TWO_AXLES = dataclasses.replace(
    on_two_axles(dataclasses.replace(STOP, speed=30.0)),
    logging=Logging((*LOGGING.columns, "load"), duration=1.6),
)
SWEEP = RigSweep(slip=(-0.5, 0.3), logging=Logging(("wheel_speed", "vehicle_speed", "force", "load"), duration=3.0))
RIG = dataclasses.replace(
    STOP,
    rig=True,
    speed=18.0,
    logging=Logging(("wheel_speed", "vehicle_speed", "brake_pressure", "force"), duration=3.0),
)
ONE_CAR = [
    dataclasses.replace(STOP, car=Car(radius=0.303, brake_efficiency=16.0), logging=logging)
    for logging in (dataclasses.replace(LOGGING, duration=0.35, declared=Car()), LOGGING)
]
BRIEF = dataclasses.replace(STOP, logging=Logging(duration=0.6))
SCENARIOS = [*RANDOM, *map(off, OFF), STOP, LAGGING, WIDER, SLOW, TWO_AXLES, SWEEP, RIG, *ONE_CAR, BRIEF]


@functools.cache
def records():
    """Of all of them, simulated side by side, which takes as long as one."""
    return dict(zip(SCENARIOS, simulate(SCENARIOS)))


def log_of(record, folder, **columns) -> BrakeLog:
    path = folder / "log.csv"
    record.write_csv(path)
    return read_log(path, **columns)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("logs")


def identified(stop, folder, car=None, change=lambda log: log):
    return identify(change(log_of(records()[stop], folder)), car)


def inside(segment, surface) -> list[bool]:
    return [low <= getattr(surface, name) <= high for name in NAMES for low, high in [segment.ci95[name]]]


def dry(result, within=0.005):
    assert len(result.segments) == 1
    assert result.segments[0].peak_friction == pytest.approx(DRY.peak_friction, rel=within)
    assert result.segments[0].peak_slip == pytest.approx(DRY.peak_slip, abs=0.004)


def said(result, *words):
    assert result.verdict == "doubtful"
    text = " ".join(result.reasons)
    assert all(word in text for word in words), text


def test_random_stops_of_a_known_car(folder):
    held = collections.defaultdict(list)
    for record in map(records().get, RANDOM):
        if record.truth.locks:
            continue
        result = identify(log_of(record, folder))
        assert result.verdict == "sound" and not result.reasons
        assert len(result.segments) == len(record.truth.surfaces)
        for segment, surface in zip(result.segments, record.truth.surfaces):
            assert segment.peak_friction == pytest.approx(surface.peak_friction, rel=0.02)
            for name, holds in zip(NAMES, inside(segment, surface)):
                held[name].append(holds)
            for low, high in segment.profile.values():
                assert 0.8 < low < 1.25 and 0.8 < high < 1.25
        for change, true in zip(result.changes, record.truth.starts[1:]):
            assert abs(change - true) < 0.03
    count = len(held["c1"])
    assert count >= 12
    for name, holds in held.items():
        assert sum(holds) >= count - 3, (name, holds)


@pytest.mark.parametrize("quantity", OFF)
def test_a_quantity_that_is_not_as_known_is_found_and_said(quantity, folder):
    result, true = identified(off(quantity), folder), OFF[quantity][2]
    dry(result)
    said(result, quantity.replace("_", " "))
    found = result.quantities[quantity]
    assert found.value == pytest.approx(true, abs=max(4 * found.spread, 0.003 * abs(true)))


def test_pressure_before_a_lag(folder):
    result = identified(LAGGING, folder)
    dry(result)
    said(result, "pressure lag")
    assert result.quantities["pressure_lag"].value == pytest.approx(0.004, abs=2e-4)


def test_pressure_in_another_unit_is_suspected(folder):
    result = identified(
        STOP, folder, change=lambda log: dataclasses.replace(log, brake_pressure=0.1 * log.brake_pressure)
    )
    dry(result)
    said(result, "pressure in MPa?")


def test_what_the_car_file_says_of_its_own_precision_is_used(folder):
    result = identified(WIDER, folder, car_from({"radius": {"value": 0.3, "sd": 0.003}}))
    dry(result)
    assert result.verdict == "sound"
    assert result.quantities["radius"].value == pytest.approx(0.303, rel=1e-3)


def test_a_slow_and_late_speed_comes_from_the_acceleration(folder):
    result = identified(SLOW, folder)
    dry(result, within=0.01)
    assert result.quantities["speed_delay"].value == pytest.approx(0.1, abs=0.02)
    assert any("comes from the acceleration" in note for note in result.notes)


def test_load_transfer_is_reckoned_logged_or_refuted(folder):
    log = log_of(records()[TWO_AXLES], folder)
    wheel = {"load": 4280.0, "brake_efficiency": 40.0}
    place = {"wheelbase": 2.7, "cg_height": 0.55, "cg_to_front": 2.7 * 3080 / (3080 + 4280), "axle": "front"}
    without = dataclasses.replace(log, load=None)
    for result in (identify(log, car_from(wheel)), identify(without, car_from({**wheel, **place}))):
        dry(result, within=0.01)
        assert result.verdict == "sound"
    blind = identify(without, car_from(wheel))
    assert blind.verdict == "refuted" and not any(blind.segments[0].identifiable.values())
    assert any("wheelbase" in reason for reason in blind.reasons)


def test_a_sweep_that_drives_and_brakes_has_two_curves(folder):
    result = identified(SWEEP, folder, Wheel())
    assert [segment.side for segment in result.segments] == ["braking", "driving"]
    for segment in result.segments:
        assert segment.peak_friction == pytest.approx(DRY.peak_friction, rel=0.01)


@pytest.mark.parametrize(
    "factor, zero, verdict, words", [(1e-3, 0.0, "refuted", "kN"), (1.0, 300.0, "doubtful", "force zero")]
)
def test_force_is_held_against_brake_torque(factor, zero, verdict, words, folder):
    result = identified(RIG, folder, change=lambda log: dataclasses.replace(log, force=factor * log.force + zero))
    assert result.verdict == verdict and any(words in reason for reason in result.reasons)
    if verdict == "doubtful":
        assert result.segments[0].peak_friction == pytest.approx(DRY.peak_friction, rel=0.02)


def test_friction_from_deceleration_needs_neither_pressure_nor_load(folder):
    result = identified(STOP, folder, change=lambda log: dataclasses.replace(log, brake_pressure=None))
    dry(result, within=0.01)
    assert result.segments[0].method == "curve fit"


def test_logs_of_one_car_tell_each_other_of_it(folder):
    logs = [log_of(records()[stop], folder) for stop in ONE_CAR]
    car = car_from({"radius": {"value": 0.3, "sd": 0.006}, "brake_efficiency": {"value": 17.5, "sd": 2.0}})
    alone, (first, second) = identify(logs[0], car), identify_together(logs, car)
    assert first.quantities["brake_efficiency"].spread < 0.5 * alone.quantities["brake_efficiency"].spread
    assert first.quantities["brake_efficiency"].value == pytest.approx(16.0, rel=0.01)
    assert first.verdict == second.verdict == "sound"
    strange = dataclasses.replace(logs[0], wheel_speed=1.02 * logs[0].wheel_speed)
    assert any("not the same car" in reason for reason in identify_together([strange, logs[1]], car)[0].reasons)
    with pytest.raises(ValueError, match="'colour' is no quantity"):
        identify_together(logs, car, shared=("colour",))


def test_nobody_brakes(folder):
    rng = np.random.default_rng(0)
    time = np.arange(3000) * 2e-3
    speed = 8 + 0.3 * np.sin(time)
    log = BrakeLog("drive", time, 1.045 * speed / 0.3, speed, 1.0 + 0.02 * rng.standard_normal(3000))
    with pytest.raises(LogError, match=r"drive: the log holds no braking .*deceleration at most 0\..*pressure at most"):
        identify(log)


@pytest.mark.parametrize(
    "entries, message",
    [
        ({"radius": {"value": 0.3, "sd": -1}}, r"car: radius: sd = -1 must be a finite number >= 0"),
        ({"radius": {"mean": 0.3}}, r"car: radius has 'value' and perhaps 'sd', not 'mean'"),
        ({"wheelbase": 2.6}, r"wheelbase without cg_height; load transfer needs"),
        ({"wheelbase": 2.6, "cg_height": 0.5, "cg_to_front": 3.0, "axle": "front"}, r"cg_to_front = 3 must be between"),
        ({"wheelbase": 2.6, "cg_height": 0.5, "cg_to_front": 1.2, "axle": "left"}, r"axle = 'left' must be 'front' or"),
        ({"pressure_zero": "no"}, r"pressure_zero = 'no' must be a finite number"),
    ],
)
def test_cars_are_refused_by_name(entries, message):
    with pytest.raises(CarError, match=message):
        car_from(entries)


def test_lag_against_a_fine_integration():
    rng = np.random.default_rng(0)
    pressure = np.interp(np.arange(200.0), [0, 50, 100, 199], [2, 2, 60, 20]) + rng.standard_normal(200)
    for lag in (3e-4, 4e-3, 2e-2):
        x, expected = pressure[0], [pressure[0]]
        for a, b in pairwise(pressure):
            for k in range(400):
                u = a + (b - a) * (k + 0.5) / 400
                x = u + (x - u) * np.exp(-1e-3 / 400 / lag)
            expected.append(x)
        np.testing.assert_allclose(lagged(pressure, 1e-3, lag), expected, atol=1e-5)


@pytest.mark.parametrize("imposed", [False, True])
def test_derivatives_of_the_residuals_against_differences(imposed, folder):
    log = log_of(records()[BRIEF], folder)
    share = np.linspace(1.0, 1.2, len(log.time)) ** 2 if imposed else None
    errors = np.linspace(-0.02, 0.03, len(log.time) * len(NUISANCE)).reshape(-1, len(NUISANCE))
    early = log.time < 0.3
    problem = shooting(Curve(Burckhardt), log, [early, ~early], 0.3, share, errors)
    assert set(problem.surface) == {0, 1}
    surfaces, car = (1.2, 25.0, 0.5, 1.1, 30.0, 0.4), (0.301, 1.25, 17.0, 2400.0, 0.4, 3e-3, 0.02, 0.01, 0.05, 2e-3)
    shared = np.array([*surfaces, *car, *[0.7] * len(NUISANCE)])
    assert len(shared) == 6 + len(CAR) + len(NUISANCE)
    # The delay of a speed that is imposed is never free.
    held = "speed_delay" if imposed else "load"
    free = np.array([name != held for name in [*"123123", *CAR, *NUISANCE]])
    evaluate, own = problem.evaluate(2, free), problem.start()
    _, by_shared, by_own = evaluate(shared, own)
    assert by_shared.shape[2] == free.sum()
    for i, at in enumerate(np.flatnonzero(free)):
        width = 1e-5 * max(abs(shared[at]), 1e-2)
        step = np.zeros(len(shared))
        step[at] = width
        difference = (evaluate(shared + step, own)[0] - evaluate(shared - step, own)[0]) / (2 * width)
        np.testing.assert_allclose(
            by_shared[..., i], difference, rtol=2e-3, atol=2e-4 * np.abs(difference).max() + 1e-9
        )
    step = np.zeros_like(own)
    step[:, 0] = 1e-4
    difference = (evaluate(shared, own + step)[0] - evaluate(shared, own - step)[0]) / 2e-4
    np.testing.assert_allclose(by_own[..., 0], difference, rtol=1e-4, atol=1e-5 * np.abs(difference).max())
