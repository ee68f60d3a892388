"""Screening after UN Regulation 13-H: its formulas by hand, adhesion against the road's peak, courses made by hand, and
a split road under select-low on both axles."""

import dataclasses
import json
import math
from functools import partial
from types import SimpleNamespace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from typer.testing import CliRunner

from absjax.controllers.slip import SlipControl
from absjax.loop.channel import Channel
from absjax.loop.stop import Outcome, stop
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.plant.brake import Brake
from absjax.plant.four_wheel import FourWheel
from absjax.plant.road import UniformRoad
from tuning.cars.car import shipped_cars
from tuning.cars.entry import VehicleEntry
from tuning.cli import app
from tuning.controllers import regulation
from tuning.controllers.config import TuningConfig
from tuning.controllers.regulation import on_car
from tuning.core.config import ConfigError
from tuning.core.files import shipped
from tuning.vehicle.regulation import adhesion, screening, study, tasks
from tuning.vehicle.regulation.course import Course, lateral_share, rise_time, steerability
from tuning.vehicle.regulation.lanes import lanes_of
from tuning.vehicle.regulation.quantities import KMH, Weights, braking_rate, mean_rate, split_demands, time_at
from tuning.vehicle.regulation.surfaces import roads, surfaces

CAR = shipped_cars()["mid_size"]


def test_braking_rate_of_a_constant_deceleration():
    """z = 0.566 / t and 0.849 / t, between points that do not meet the speeds; and its derivative."""
    time = jnp.linspace(0.0, 2.5, 97)

    @jax.jit
    def rate(deceleration, high=40.0, low=20.0):
        return braking_rate(time, 55 * KMH - deceleration * time, high * KMH, low * KMH)

    assert float(rate(6.0)) == pytest.approx(6.0 / 9.81, rel=1e-12)
    assert float(rate(6.0)) == pytest.approx(0.566 / ((40 - 20) / 3.6 / 6.0), rel=1e-3)
    assert float(rate(6.0, 45.0, 15.0)) == pytest.approx(0.849 / (30 / 3.6 / 6.0), rel=1e-3)
    slope = jax.jit(jax.grad(rate))
    assert float(slope(6.0)) == pytest.approx(1 / 9.81, rel=1e-9)
    assert float(rate(1.0)) == 0.0 and float(slope(1.0)) == 0.0
    assert float(jax.jit(time_at)(time, 10.0 - time, 5.0)) == math.inf
    times = np.array([1.0, 1.1, 1.3])
    assert float(mean_rate(jnp.asarray(0.566 / times))) == pytest.approx(0.566 / times.mean())
    assert float(mean_rate(jnp.array([0.5, 0.0, 0.5]))) == 0.0


def test_utilisation_by_hand():
    """A car of 1500 kg, 2.7 m and h = 0.55 m; numbers worked out on paper from the formulas of Appendix 2."""
    weights = Weights.of(adhesion.straight_ahead(CAR, surfaces()["high"], laden=False))
    weight, front, rear = 14715.0, 8175.0, 6540.0
    assert (weights.weight, weights.front, weights.rear) == pytest.approx((weight, front, rear))
    z, ratio = 0.5, 0.55 / 2.7
    moved = ratio * z * weight
    push = 2 * 1.2 / 0.3**2 * z * 9.81
    assert float(weights.adhesion(0, z)) == pytest.approx((z * weight + push) / (front + moved))
    assert float(weights.adhesion(1, z)) == pytest.approx((z * weight + push) / (rear - moved))
    mean = (0.8 * (front + moved) + 0.7 * (rear - moved)) / weight
    assert float(weights.utilisation((0.8, 0.7), z)) == pytest.approx(z / mean)
    assert split_demands(0.8, 0.3) == pytest.approx((0.75 * (4 * 0.3 + 0.8) / 5, 0.3))


def test_adhesion_is_that_of_the_road():
    """Single axles braked until a wheel locks: within 1 % of the peak of the curve, and not above it."""
    found = adhesion.measured_adhesion(
        [adhesion.straight_ahead(CAR, surfaces()[name], laden=True) for name in surfaces()]
    )
    peaks = np.array([float(tyre.peak().friction) for tyre in surfaces().values()])
    share = found / peaks[:, None]
    assert np.all(share > 0.99) and np.all(share < 1 + 1e-6)
    assert peaks == pytest.approx([0.801339, 0.30], abs=1e-5)


def test_tests_that_count_are_the_shortest_within_5_percent():
    times = [1.0, 1.02, 1.04, 1.045, 1.2]
    assert adhesion.mean_of_best([1 / t for t in times] + [0.0]) == pytest.approx(1 / np.mean([1.0, 1.02, 1.04]))
    assert adhesion.mean_of_best([1.0, 1 / 1.04, 1 / 1.06]) == pytest.approx(1 / 1.02)


def course_of(**changes) -> Course:
    sound = {"utilised": 0.6, "rate": 0.6, "lock": 0.1, "slide": 0.2, "steerability": 0.5, "held": 0.4}
    sound |= {"steered_soon": 0.05, "steered": 0.06, "clearance": 0.6, "yaw": 0.02, "yaw_rate": 0.1, "side_slip": 0.01}
    sound |= {"passed": 40 * KMH, "outcome": Outcome.STOPPED}
    return Course(**{**sound, **changes})


def judged(laden, change, limits=screening.FREE):
    """The rows of stops of which each has a course of its own."""
    car = adhesion.straight_ahead(CAR, surfaces()["high"], laden=laden)
    known = screening.Adhesions({laden: Weights.of(car)}, {laden: {"high": (0.8, 0.8), "low": (0.3, 0.3)}})
    lanes = [lane for lane in lanes_of(on_car(TuningConfig(), CAR, laden=laden).driver) if lane.laden == laden]
    found = screening.quantities(laden, [(lane, course_of(**change(lane.stop))) for lane in lanes], known, 0.2, limits)
    return {(row.surface, row.quantity): row for row in (screening.row_of("car", laden, q) for q in found)}


def test_rows_and_their_verdicts():
    rows = judged(True, lambda stop: {"utilised": 0.23, "rate": 0.305} if stop.surface in ("low", "split") else {})
    high, low = rows["high", screening.UTILISED], rows["low", screening.UTILISED]
    assert high.reached == pytest.approx(0.75) and low.reached == pytest.approx(0.23 / 0.3)
    assert low.passed and not low.passed_with_margin and low.margin == pytest.approx(0.0222, abs=1e-3)
    both, lower = (rows["split", name] for name in screening.SPLIT)
    assert (both.demanded, lower.demanded) == pytest.approx((0.3, 0.3))
    assert both.passed and not both.passed_with_margin and lower.passed
    assert rows["split", "steered in 2 s [deg]"].reached == pytest.approx(math.degrees(0.8))
    assert rows["low to high", "time to rise from 50 [s]"].passed is None
    assert all(row.passed is not False for row in rows.values())
    assert not any(name in quantity for _, quantity in judged(False, lambda stop: {}) for name in screening.SPLIT)


def test_limits_of_ours_are_told_and_kept_where_given():
    told = judged(True, lambda stop: {"yaw_rate": 0.2, "side_slip": 0.05})
    assert told["split", "largest yaw rate [deg/s]"].passed is None
    kept = judged(True, lambda stop: {"yaw_rate": 0.2, "side_slip": 0.05}, screening.Limits(10.0, 3.0))
    assert kept["split", "largest yaw rate [deg/s]"].reached == pytest.approx(math.degrees(0.2))
    assert kept["split", "largest yaw rate [deg/s]"].passed is False
    assert kept["split", "largest side-slip [deg]"].passed and kept["split", "largest side-slip [deg]"].demanded == 3.0
    assert kept["low", screening.HELD].passed is None
    held = judged(False, lambda stop: {"held": 0.2 if stop.speed > 55.7 else 0.4}, screening.Limits(held=0.25))
    assert held["low", screening.HELD].reached == 0.2 and held["high", screening.HELD].passed is False
    with pytest.raises(ConfigError, match="largest_yaw_rate is a limit of the screening"):
        VehicleEntry(largest_yaw_rate=10.0)


def test_long_locks_and_slides_fail_by_name():
    locked = judged(False, lambda stop: {"lock": 0.21} if (stop.name, stop.at) == ("passage", 120.0) else {})
    failed = [key for key, row in locked.items() if row.passed is False]
    assert failed == [("high to low", "lock from 120 [s]")]
    slid = judged(False, lambda stop: {"slide": 0.51} if (stop.surface, stop.at) == ("low", 40.0) else {})
    assert [key for key, row in slid.items() if row.passed is False] == [("low", "slide from 40 [s]")]
    lost = judged(False, lambda stop: {"lock": math.inf, "outcome": Outcome.DIVERGED} if stop.name == "split" else {})
    row = lost["split", "lock from 50 [s]"]
    assert row.passed is False and row.reached is None and row.note == "diverged"
    assert tasks.verdict(list(lost.values())) == (
        "rows failed, car",
        [
            "car: 1 of 26 rows failed: lock from 50 (split, unladen)",
            "car: not by 5 %: utilisation of adhesion (high, unladen)",
        ],
    )
    good = judged(False, lambda stop: {"utilised": 0.7 if stop.surface == "high" else 0.28})
    assert tasks.verdict(list(good.values())) == ("every row passed, car", [])


def test_a_set_on_a_car_is_a_line_of_its_worst_rows():
    rows = [
        *judged(True, lambda stop: {"lock": 0.3, "utilised": 0.3} if stop.surface == "low" else {}).values(),
        *judged(False, lambda stop: {"slide": 0.7, "utilised": 0.29} if stop.surface == "low" else {}).values(),
    ]
    told = study.line(rows)
    assert (told["car"], told["rows failed"], told["narrow"]) == ("car", 4, 2)
    assert (told["longest lock [s]"], told["longest slide [s]"]) == ("0.30", "0.70")
    assert float(told["epsilon low"]) == pytest.approx(0.29 / 0.3, abs=0.01)
    lost = judged(False, lambda stop: {"lock": math.inf} if stop.name == "split" else {})
    assert study.line(list(lost.values()))["longest lock [s]"] == "undefined"


def test_of_every_controller_the_sets_that_are_shipped():
    found = study.sets_of("five_phase", wiring="select_low_rear")
    assert list(found) == ["untuned", "tuned", "of the car"] and list(
        study.sets_of("no_control", wiring="select_low")
    ) == ["untuned"]
    assert {name: config.vehicle.sets for name, config in found.items()} == dict(zip(found, ("one", "one", "own")))
    assert all((c.vehicle.wiring, c.vehicle.speed) == ("select_low_rear", None) for c in found.values())
    with pytest.raises(ConfigError, match="--controllers: 'abs' is unknown"):
        study.chosen(["abs"])
    assert "predictive_tracking" not in study.chosen(None)


def test_what_a_unit_is_told_needs_a_unit_that_estimates():
    told = {"--bias": None, "--gain": 0.05, "--slope": None, "--rolling": 0.0}
    assert study.estimation("kalman", False, told) == {"accelerometer_gain": 0.05, "rolling": 0.0}
    assert study.estimation(None, True, dict.fromkeys(told)) == {}
    with pytest.raises(ConfigError, match="--errors: of a unit that estimates the speed; needs --speed"):
        study.estimation(None, False, dict.fromkeys(told), True)
    with pytest.raises(ConfigError, match="--gain, --rolling: of a unit that estimates the speed; needs --speed"):
        study.estimation(None, False, told)
    with pytest.raises(ConfigError, match=r"--speed: .* with --located there is none"):
        study.estimation("kalman", True, dict.fromkeys(told))
    with pytest.raises(ConfigError, match=r"rolling = 1000000000\.0"):
        VehicleEntry(rolling=1e9)


def test_every_set_is_screened_under_every_error_on_all_cars(monkeypatch, tmp_path):
    """A line for each set and error: rows failed by car, and the worst of all cars."""

    def screened(config, car, figures):
        slid = 0.6 if config.vehicle.accelerometer_slope < 0 and car == "van" else 0.1
        unable = 0.2 if config.vehicle.rolling == 0 and config.start else 0.5
        rows = judged(True, lambda stop: {"slide": slid if stop.name == "split" else 0.0, "steerability": unable})
        return SimpleNamespace(rows=[dataclasses.replace(row, car=car) for row in rows.values()])

    monkeypatch.setattr(study, "screening_of", screened)
    cars = {car: shipped_cars()[car] for car in ("small", "van")}
    (report,) = study.study_of_errors(cars, ("slip",), tmp_path, speed="kalman")
    (lines,) = report.tables.values()
    found = {(row["told"], row["set"]): tuple(row[name] for name in list(row)[2:]) for row in lines}
    assert len(found) == len(lines) == 15 and [path.name for path in report.files] == ["screening.csv"]
    assert found["a slope of 3 % downwards begins", "untuned"] == ("0, 1", "0.75", "0.60", "0.50", "0.40")
    assert found["turned on by the pedal", "of the car"] == ("2, 2", "0.75", "0.10", "0.20", "0.40")
    assert found["scale 5 % too large", "tuned"] == ("0, 0", "0.75", "0.10", "0.50", "0.40")


def test_too_good_a_utilisation_doubts_the_adhesion():
    rows = judged(False, lambda stop: {"utilised": 0.9} if stop.surface == "high" else {})
    assert "above 1.1" in rows["high", screening.UTILISED].note


def test_lateral_force_that_is_left():
    """Of a locked wheel, of one that rolls, and halfway against the curve by hand."""
    road, ly = roads(("high", "high"), ("high", "high"))[0], math.sin(math.radians(4.0))
    shares = list(map(float, jax.jit(lateral_share)(road, jnp.array([0.0, -0.12, -1.0]), 0.0, 0.0)))
    tyre = surfaces()["high"]

    def mu(slip):
        return tyre.c1 * (1 - math.exp(-tyre.c2 * slip)) - tyre.c3 * slip

    by_hand = [mu(math.hypot(lx, ly)) / math.hypot(lx, ly) * ly / mu(ly) for lx in (0.0, 0.12, 1.0)]
    assert shares == pytest.approx(by_hand, rel=1e-12)
    assert shares[0] == 1.0 and shares[1] > 0.45 and shares[2] < 0.06


class Motion(NamedTuple):
    longitudinal: Any
    distance: Any


class Slipping(NamedTuple):
    motion: Motion
    slips: Any


@pytest.mark.parametrize("deep", [0, 2])
def test_steerability_is_that_of_the_axle_with_less_left(deep):
    """Either axle; only between 45 and 15 km/h, and in the half second that has least, however many points it has."""
    slips = np.full((5, 4), -0.05)
    slips[:, deep : deep + 2] = [[-1.0, -1.0], [-0.3, -0.1], [-0.2, -0.25], [0.0, 0.0], [-1.0, -1.0]]
    states = Slipping(Motion(np.array([20.0, 12.0, 8.0, 5.0, 3.0]), np.zeros(5)), slips)
    road = roads(("high", "high"), ("high", "high"))[0]
    car: Any = SimpleNamespace(roads=(road,) * 4, slips=lambda time, state: [(slip, 0.0) for slip in state.slips])
    left = [float(lateral_share(road, slip, 0.0, 0.0)) for slip in (-0.3, -0.1, -0.2, -0.25, 0.0, 0.0)]
    for finer in (1, 2):
        time = 0.25 / finer * np.arange(5 * finer)
        often = jax.tree.map(lambda values, times=finer: np.repeat(values, times, axis=0), states)
        mean, least = jax.jit(partial(steerability, car))(time, often)
        assert float(mean) == pytest.approx(np.mean(left), rel=1e-12)
        assert float(least) == pytest.approx(np.mean(left[:4]), rel=1e-12)


def test_time_to_a_high_deceleration():
    time = np.arange(0.0, 3.0, 5e-3)
    slowing = np.where(time < 1.5, 2.5, 7.0)
    speed = 15.0 - np.cumsum(slowing) * 5e-3
    distance = np.cumsum(speed) * 5e-3
    passed, told = float(np.interp(1.2, time, distance)), jax.jit(rise_time)
    found = float(told(time, speed, distance, passed, 7.0 / 9.81))
    # nine tenths of the rise over a window of 0.1 s, from 0.3 s behind the passage
    assert found == pytest.approx(0.3 + 0.1 * (0.9 * 7.0 - 2.5) / 4.5, abs=6e-3)
    assert float(told(time, speed, distance, passed, 8.0 / 9.81)) == math.inf


def test_select_low_on_both_axles_misses_the_split_row():
    """Each axle brakes as its wheel on the low side can: the mean adhesion of both sides is not used."""
    high, low = (UniformRoad(surfaces()[name]) for name in ("high", "low"))
    car = CAR.vehicle("four_wheel", (high, low, high, low), laden=True)
    assert isinstance(car, FourWheel)
    car = dataclasses.replace(car, relaxation=None)
    channel = Channel(Brake(), SlipControl(**shipped("controllers.json")["slip"]))
    loop = VehicleLoop(car, (channel, channel), 14 * KMH, wiring=((0, 1), (2, 3)))
    found = stop(loop, 50 * KMH, horizon=5.0, step=1e-3, max_events=100, save_every=4)
    assert Outcome(int(found.outcome)) is Outcome.STOPPED
    path = found.rollout.path
    rate = float(braking_rate(path.time, path.state.vehicle.motion.longitudinal, 40 * KMH, 20 * KMH))
    rows = judged(True, lambda stop: {"rate": rate} if stop.name == "split" else {})
    assert 0.25 < rate < 0.3
    assert [rows["split", name].passed for name in screening.SPLIT] == [False, False]


def test_sets_that_breach_a_row_are_worse_than_all_that_do_not(monkeypatch):
    """The best few are screened, and more if all of them breach; these are charged, and the others are out."""
    monkeypatch.setattr(regulation, "FINALISTS", 3)
    passes = object.__new__(regulation.Regulation)
    monkeypatch.setattr(passes, "breaches", lambda sets: np.where(sets["a"] < 2.5, 0.25, 0.0))
    costs, sets = np.array([4.0, 2.0, 1.0, 3.0]), {"a": np.array([4.0, 2.0, 1.0, 3.0])}
    np.testing.assert_allclose(passes.judged(costs, sets, 10.0), [24.0, 12.25, 11.25, 3.0])
    monkeypatch.setattr(regulation, "FINALISTS", 2)
    np.testing.assert_allclose(passes.judged(costs, sets, 10.0), [4.0, 12.25, 11.25, 3.0])
    monkeypatch.setattr(passes, "breaches", lambda sets: 1.0 + 0.0 * sets["a"])
    np.testing.assert_allclose(passes.judged(costs, sets, 10.0), costs + 11.0)
    assert regulation.regulation_of(TuningConfig(vehicle={"car": "van"})) is None


class Told(NamedTuple):
    """What a fake run tells of its lanes."""

    speed: jax.Array
    set_point: jax.Array


def test_sets_are_screened_together_on_every_car(monkeypatch):
    """Each set's own stops on each car, whatever chunk it is in, against a loop over them by hand; epsilon by 5 %."""

    def told(loops, lanes, clocked, *, sets):
        assert clocked(loops)[0].rolling == 2000 and sets == 8
        speeds = jnp.repeat(jnp.array([lane.stop.speed for lane in lanes]), sets)
        return Told(speeds, loops.channels[2].controller.slip * loops.vehicle.mass)

    def rows(loops, lanes, stops, known, limits):
        assert limits == (None, 4.0, None)
        found = {"demanded": 50.0, "outcomes": ()}
        for i in (0, len(lanes) - 1):
            yield (
                False,
                screening.Quantity("high", "ab", stops.speed[i] + stops.set_point[i], **found, with_margin=True),
            )
            yield True, screening.Quantity("low", "c", loops.channels[0].controller.slip[i], **found, at_least=False)
            yield True, screening.Quantity("low", "told", 1.0, None, ())

    monkeypatch.setattr(regulation, "run", told)
    monkeypatch.setattr(regulation, "all_quantities", rows)
    monkeypatch.setattr(regulation, "adhesions_of", lambda figures: 0.0)
    vehicle = {"car": ["small", "van"], "sets": "own", "regulation": True, "largest_side_slip": 4.0, "speed": "kalman"}
    passes = regulation.regulation_of(TuningConfig(controller="slip", vehicle=vehicle))
    sets = {"front.slip": -0.01 * np.arange(1.0, 12.0), "rear.slip": -0.002 * np.arange(11.0, 0.0, -1.0)}
    lanes = lanes_of(on_car(TuningConfig(), CAR, laden=False).driver)
    by_hand = []
    for car in ("small", "van"):
        for lane in (lanes[0], lanes[-1]):
            mass = getattr(shipped_cars()[car], "laden" if lane.laden else "unladen").mass
            by_hand.append((lane.stop.speed + mass * sets["rear.slip"] - 50.0) / 50.0 - 0.05)
            by_hand.append((50.0 - sets["front.slip"]) / 50.0)
    by_hand = np.array(by_hand)
    assert by_hand.min() < -0.1 < by_hand.max()
    np.testing.assert_allclose(passes.breaches(sets), np.clip(-by_hand, 0, 1).sum(axis=0), rtol=1e-12)


def test_two_axles_are_screened_on_four_wheels_as_cars_are_wired():
    """A model without sides cannot tell how they are wired; one with them has it as it says."""
    wired = {
        entry.model: on_car(TuningConfig(vehicle=entry), CAR, laden=True).config.vehicle
        for entry in (VehicleEntry(sets="own"), VehicleEntry(model="four_wheel"))
    }
    assert [wired[m].wiring for m in ("two_axle", "four_wheel")] == ["select_low_rear", "independent"]
    assert wired["two_axle"].model == "four_wheel" and wired["two_axle"].sets == "own" and wired["two_axle"].laden


def test_what_cannot_be_screened_is_said(tmp_path):
    with pytest.raises(ConfigError, match="--cars: 'lorry' is unknown"):
        tasks.cars_of(TuningConfig(), ["lorry"])
    assert list(tasks.cars_of(TuningConfig(vehicle={"car": "van"}), ["own", "small"])) == ["van", "small"]
    higher = {load: {**getattr(CAR, load).to_json(), "height": 0.6} for load in ("unladen", "laden")}
    lower = {load: {**getattr(CAR, load).to_json(), "height": 0.5} for load in ("unladen", "laden")}
    cars = [{**CAR.to_json(), "note": "mine", **one} for one in (higher, lower)]
    assert list(tasks.cars_of(TuningConfig(vehicle={"car": ["van", *cars]}), None)) == ["van", "mine 2", "mine 3"]
    assert list(tasks.cars_of(TuningConfig(), None)) == list(shipped_cars())
    with pytest.raises(ConfigError, match="--cars: 'own' is unknown"):
        tasks.cars_of(TuningConfig(), ["own"])
    with pytest.raises(ConfigError, match="one of --config and --controller is needed"):
        tasks.config_of(None, None)
    with pytest.raises(ConfigError, match="controller: 'abs' is unknown"):
        tasks.config_of(None, "abs")
    with pytest.raises(ConfigError, match="predictive_tracking predicts over a delay, for one wheel"):
        tasks.config_of(None, "predictive_tracking")
    wrong = tmp_path / "wrong.json"
    wrong.write_text(json.dumps({"controller": "five_phase", "start": {"eps9": 1.0}}))
    said = CliRunner().invoke(app, ["regulation", "--config", str(wrong), "--out", str(tmp_path / "out")])
    assert said.exit_code == 2 and "eps9" in said.output and not (tmp_path / "out").exists()
