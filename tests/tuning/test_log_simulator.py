"""The simulator that identification is judged on: against SciPy, balances, and what it says of itself."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid, solve_ivp
from scipy.optimize import minimize_scalar

from tests.oracles.log_scenarios import (
    GRAVITY,
    SURFACES,
    Brake,
    Car,
    Channel,
    Logging,
    RigSweep,
    Road,
    Scatter,
    Sensors,
    Stop,
    on_two_axles,
    random_stops,
)
from tests.oracles.log_simulator import COLUMNS, simulate

SHIPPED = Path(__file__).parents[2] / "tuning/data/stop_dry_wet.csv"
DRY, WET, SNOW = (SURFACES[name] for name in ("dry_asphalt", "wet_asphalt", "snow"))
SILENT = Sensors().scaled(0.0)
SHORT = Logging(duration=0.8, seed=5)
CHANGING = Stop(road=Road((DRY, WET), (0.45,), slope=0.05), logging=SHORT)
LAGGING = Stop(car=Car(1.1, 0.31, 2700.0, 16.0), brake=Brake(0.006, 0.01), road=Road(slope=0.03), logging=SHORT)
OTHER_SEED = dataclasses.replace(CHANGING, logging=dataclasses.replace(SHORT, seed=6))
STOPS = [CHANGING, LAGGING, Stop(rig=True, logging=SHORT), OTHER_SEED]
DRAWN = dict(n=60, seed=11, surfaces=(1, 2), speeds=(15.0, 18.0), logging=Logging(duration=1.4))
RANDOM = random_stops(**DRAWN, scatter=Scatter(radius=0.02, load=0.05, brake_lag=0.003, pressure_zero=2.0))


@pytest.fixture(scope="module")
def records():
    return simulate([*STOPS, *RANDOM])


def friction(slip, surface):
    return np.sign(slip) * (surface.c1 * (1 - np.exp(-surface.c2 * abs(slip))) - surface.c3 * abs(slip))


def pedal(t, control):
    """Pressure behind the valve for a ramp from pedal_at: rate (t - tau + tau exp(-t / tau))"""
    since = max(t - control.pedal_at, 0.0)
    return control.pedal_rate * (since - control.lag + control.lag * np.exp(-since / control.lag))


def check_ramp(record, flow, y, until=0.2):
    """State (v, w, ...) of the log's first part, before control releases, against SciPy."""
    kept = record.truth.signals
    times = kept["time"][kept["time"] <= until]
    run = solve_ivp(flow, (0, until), y, "LSODA", times, rtol=1e-10, atol=1e-10, max_step=1e-3)
    assert len(times) > 150 and abs(kept["slip"][len(times) - 1]) > 0.03
    np.testing.assert_allclose(kept["vehicle_speed"][: len(times)], run.y[0], atol=1e-6)
    np.testing.assert_allclose(kept["wheel_speed"][: len(times)], run.y[1], atol=1e-5)


def test_quarter_car_with_lag_delay_and_slope_against_scipy(records):
    record, stop, car = records[1], LAGGING, LAGGING.car

    def flow(t, y):
        v, w, acting = y
        mu = friction(car.radius * w / v - 1, DRY)
        spin = (-car.radius * car.load * mu - car.brake_efficiency * acting) / car.inertia
        arriving = pedal(t - stop.brake.delay, stop.control)
        return GRAVITY * (mu + np.sin(0.03)), spin, (arriving - acting) / stop.brake.lag

    check_ramp(record, flow, [stop.speed, stop.speed / car.radius, 0.0], until=0.22)


@pytest.mark.parametrize("lag", [0.0, 0.05])
def test_two_axles_against_scipy(lag):
    stop = on_two_axles(Stop(logging=Logging(duration=0.25)), pitch_lag=lag)
    wheels, lever = (stop.front, stop.rear), stop.cg_height / stop.wheelbase
    mass = sum(wheel.load for wheel in wheels) / GRAVITY

    def flow(t, y):
        v, *speeds, shift = y
        mu = [friction(wheel.radius * w / v - 1, DRY) for wheel, w in zip(wheels, speeds)]
        if not lag:
            for _ in range(60):
                shift = -lever * (mu[0] * (stop.front.load + shift) + mu[1] * (stop.rear.load - shift))
        loads = stop.front.load + shift, stop.rear.load - shift
        total = mu[0] * loads[0] + mu[1] * loads[1]
        pressure = pedal(t, stop.control)
        spins = [
            (-wheel.radius * m * load - wheel.brake_efficiency * pressure) / wheel.inertia
            for wheel, m, load in zip(wheels, mu, loads)
        ]
        return total / mass, *spins, (-lever * total - shift) / lag if lag else 0.0

    start = [stop.speed, *(stop.speed / wheel.radius for wheel in wheels), 0.0]
    (record,) = simulate([stop])
    check_ramp(record, flow, start)
    kept = record.truth.signals
    assert kept["load"][200] > 1.1 * stop.front.load
    if not lag:
        expected = stop.front.load - mass * lever * kept["acceleration"]
        np.testing.assert_allclose(kept["load"], expected, rtol=1e-9)


def test_rear_axle_meets_the_change_a_wheelbase_later():
    stop = Stop(road=Road((DRY, SNOW), (0.1,)), logging=Logging(duration=0.3))
    front, rear = simulate([on_two_axles(stop, logged_axle=axle) for axle in ("front", "rear")])
    assert front.truth.starts == (0.0, 0.1)
    since = (rear.time >= 0.1) & (rear.time <= rear.truth.starts[1])
    rolled = np.trapezoid(rear.truth.signals["vehicle_speed"][since], rear.time[since])
    assert rolled == pytest.approx(2.7, abs=0.04)


def test_momentum_and_energy_over_switchings_and_a_change_of_road(records):
    record, car = records[0], CHANGING.car
    kept, mass = record.truth.signals, CHANGING.car.load / GRAVITY
    time, v, w, force = (kept[name] for name in ("time", "vehicle_speed", "wheel_speed", "force"))

    def total(rate):
        return cumulative_trapezoid(rate, time, initial=0)

    pull = mass * GRAVITY * np.sin(0.05)
    torque = -car.radius * force - car.brake_efficiency * kept["acting_pressure"]
    np.testing.assert_allclose(mass * (v - v[0]), total(force + pull), atol=0.05)
    np.testing.assert_allclose(car.inertia * (w - w[0]), total(torque), atol=0.02)
    energy = mass * v**2 / 2 + car.inertia * w**2 / 2
    lost = force * v * -kept["slip"] - car.brake_efficiency * kept["acting_pressure"] * w + pull * v
    np.testing.assert_allclose(energy - energy[0], total(lost), atol=1e-4 * energy[0])
    on = [time < 0.45, time > 0.475]
    for i, surface in enumerate(record.truth.surfaces):
        np.testing.assert_allclose(kept["friction"][on[i]], friction(kept["slip"][on[i]], surface), atol=1e-12)
    assert np.sum(np.diff(np.sign(np.diff(kept["brake_pressure"]))) < 0) >= 2


@pytest.mark.parametrize("name", SURFACES)
def test_peak_against_a_numeric_maximum(name):
    surface = SURFACES[name]
    found = minimize_scalar(lambda s: -friction(s, surface), bounds=(0, 1), method="bounded", options={"xatol": 1e-9})
    assert surface.peak_friction == pytest.approx(-found.fun, abs=1e-9)
    if surface.c3:
        assert surface.peak_slip == pytest.approx(found.x, abs=1e-6)


def test_noise_is_that_of_the_shipped_log(records):
    shipped = np.genfromtxt(SHIPPED, delimiter=",", names=True)
    for name in CHANGING.logging.columns:
        level, true = (
            np.median(abs(np.diff(x, 4))) / 0.6745 / np.sqrt(70)
            for x in (records[0].signals[name], shipped[COLUMNS[name]])
        )
        assert level == pytest.approx(true, rel=0.15)
        error = records[0].signals[name] - records[0].truth.signals[name]
        channel = getattr(Sensors(), name)
        assert abs(error.mean()) < 4 * channel.noise / np.sqrt(len(error))
        assert error.std() == pytest.approx(channel.noise, rel=0.1)


def test_channels_hold_come_late_and_are_off():
    sensors = dataclasses.replace(
        SILENT,
        vehicle_speed=Channel(period=0.1, delay=0.1),
        brake_pressure=Channel(bias=-3.0, quantum=0.5),
    )
    (record,) = simulate([Stop(logging=Logging(sensors=sensors, duration=0.5, period=2e-3))])
    true, seen = record.truth.signals, record.signals
    assert len(record.time) == 251 and record.time[1] == 2e-3
    np.testing.assert_array_equal(seen["wheel_speed"], true["wheel_speed"])
    held = seen["vehicle_speed"][:250].reshape(5, 50)
    assert np.all(held == held[:, :1])
    np.testing.assert_allclose(held[1:, 0], true["vehicle_speed"][0:200:50])
    assert np.all(seen["brake_pressure"] % 0.5 == 0)
    assert np.max(abs(seen["brake_pressure"] + 3 - true["brake_pressure"])) <= 0.2501


def test_a_seed_makes_the_same_log_in_any_company(records):
    first, other = records[0], records[3]
    (again,) = simulate([CHANGING])
    for name, values in first.signals.items():
        np.testing.assert_allclose(again.signals[name], values, rtol=1e-9)
        assert np.mean(values == other.signals[name]) < 0.5
        np.testing.assert_array_equal(first.truth.signals[name], other.truth.signals[name])
    assert random_stops(**DRAWN) == random_stops(**DRAWN) != random_stops(**{**DRAWN, "seed": 12})


def test_random_stops_pass_the_peak_of_every_surface(records):
    passed = [
        slips.min() < 0.7 * surface.peak_slip and slips.max() > 1.3 * surface.peak_slip
        for record in records[len(STOPS) :]
        for i, surface in enumerate(record.truth.surfaces)
        for slips in [-record.truth.slips(i)]
    ]
    assert len(passed) > len(RANDOM) and np.mean(passed) > 0.95
    assert np.mean([record.truth.locks for record in records[len(STOPS) :]]) < 0.1


def test_cars_are_scattered_about_their_file(records):
    made = records[len(STOPS) :]
    assert all(record.declared == Car() for record in made)
    for name, relative in (("radius", 0.02), ("load", 0.05), ("inertia", 0.0)):
        off = [getattr(record.truth.car, name) / getattr(Car(), name) - 1 for record in made]
        assert np.std(off) == pytest.approx(relative, rel=0.3)
    quiet = [record.signals["brake_pressure"][:40].mean() for record in made]
    assert np.std(quiet) == pytest.approx(2.0, rel=0.3)


def test_rigs(records):
    drum = records[2].truth.signals
    assert np.ptp(drum["vehicle_speed"]) == 0 and drum["slip"].min() < -DRY.peak_slip
    sweep = RigSweep(slip=(-0.5, 0.3), load_swing=0.2, logging=Logging((*COLUMNS,), SILENT))
    (record,) = simulate([sweep])
    kept = record.truth.signals
    assert kept["slip"].min() == pytest.approx(-0.5) and kept["slip"].max() == pytest.approx(0.3)
    np.testing.assert_allclose(kept["force"], kept["load"] * friction(kept["slip"], DRY), atol=1e-9)
    spin = np.gradient(kept["wheel_speed"], kept["time"])
    braked = kept["brake_pressure"] > 1.0
    torque = -sweep.car.radius * kept["force"] - sweep.car.inertia * spin
    expected = (torque / sweep.car.brake_efficiency)[braked][1:-1]
    np.testing.assert_allclose(kept["brake_pressure"][braked][1:-1], expected, atol=0.1)


def test_log_and_car_as_files(records, tmp_path):
    records[4].write_csv(tmp_path / "stop.csv")
    table = np.genfromtxt(tmp_path / "stop.csv", delimiter=",", names=True)
    assert table.dtype.names == ("time_s", *(COLUMNS[name] for name in records[4].signals))
    np.testing.assert_allclose(table["wheel_speed_rad_s"], records[4].signals["wheel_speed"], atol=6e-5)
    assert Car(**json.loads((tmp_path / "stop.json").read_text())) == Car() != records[4].truth.car
