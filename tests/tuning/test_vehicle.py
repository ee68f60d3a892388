"""Whole vehicles in tuning: cars, entries, parameters of axles, the loop of a batch, what is told of the scenario."""

import dataclasses
import json
from types import SimpleNamespace

import jax
import numpy as np
import pytest

from absjax.lanes import taken
from absjax.loop.stop import Outcome, stop
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.observers.base import Sample
from absjax.observers.clamped import Clamped
from absjax.observers.designs import Adaptive
from absjax.observers.run import observe
from absjax.plant.road import as_road
from absjax.plant.wheel import Wheel
from absjax.speed import KalmanSpeed
from tuning.cars.car import car_entry, shipped_cars
from tuning.cars.entry import WIRINGS, VehicleEntry, of_axle
from tuning.cars.lifting import lifting
from tuning.controllers.batch import batch_of
from tuning.controllers.config import TuningConfig
from tuning.controllers.loops import in_control_unit, loop_of_lanes
from tuning.controllers.problem import problem_of
from tuning.controllers.result import TuningResult
from tuning.controllers.rows import rows_of
from tuning.controllers.setup import Setup
from tuning.core.config import ConfigError
from tuning.vehicle import distances
from tuning.vehicle.scenario import BLEND, CHANGES, PERIOD, SUBSTEPS, Ride, figures_of, stiffness_along

OWN = {
    "controller": "five_phase",
    "vehicle": {"car": "small", "sets": "own", "speed": "kalman"},
    "roads": ["dry_asphalt", "snow"],
    "speeds_kmh": [30.0],
    "stop_speed_kmh": 15.0,
    "start": {"rear.eps0": 44.0},
}


@pytest.mark.parametrize("name", ["small", "mid_size", "van"])
@pytest.mark.parametrize("laden", [False, True])
def test_cars_stand_on_their_wheels(name, laden):
    """Loads at rest add up to the weight; braked at 0.9 g no axle lifts; laden it is heavier, most of it behind."""
    car = shipped_cars()[name]
    for model, wheels in (("two_axle", 2), ("four_wheel", 4)):
        vehicle = car.vehicle(model, (as_road("dry_asphalt"),) * wheels, laden=laden)
        loads = [float(wheel.load) for wheel in vehicle.wheels]
        assert sum(loads) == pytest.approx(float(vehicle.mass) * 9.81, rel=1e-9)
        assert min(float(load) for load in vehicle.known_loads(-0.9 * 9.81, 0.0)) > 0.05 * sum(loads) / wheels
    shares = [car.unladen.to_front, car.laden.to_front]
    assert car.laden.mass > car.unladen.mass and shares[1] > shares[0]


def test_a_vehicle_makes_the_loop_of_a_batch_with_sets_of_its_axles():
    config = TuningConfig.from_json(OWN)
    assert TuningConfig.from_json(config.to_json()) == config
    setup = Setup.of(config)
    assert setup.initial["rear.eps0"] == 44.0 and setup.initial["front.eps0"] == 50.0
    box = setup.box()
    assert {"front.u1", "rear.u1"} <= set(box.names) and ("front.eps4", "front.eps5") in {o[:2] for o in box.ordered}
    batch = batch_of(setup)
    assert isinstance(batch.loop, VehicleLoop) and isinstance(batch.speedometer.estimator, KalmanSpeed)
    own = {"front.eps1": np.array([21.0, 22.0, 23.0, 24.0]), "rear.eps1": np.array([31.0, 32.0, 33.0, 34.0])}
    lanes = loop_of_lanes(batch.loop, own, batch.rows)
    front, rear = (channel.controller for channel in lanes.channels)
    np.testing.assert_array_equal(front.eps1, own["front.eps1"])
    np.testing.assert_array_equal(rear.eps1, own["rear.eps1"])
    assert lanes.vehicle.roads[0].tyre.c1.shape == (4,)
    unit = in_control_unit(lanes, 1, 1, 1e-3, None, batch.speedometer)
    assert unit.speed is batch.speedometer.estimator and unit.accelerometer.bias == 0.5
    first = dataclasses.replace(unit, loop=taken(unit.loop, 0))
    begun, at_once = (
        one.initial_state(np.float64(20.0)).unit.speed for one in (first, dataclasses.replace(first, rolling=0))
    )
    assert begun.bias == pytest.approx(0.5, abs=0.05) and at_once.bias == 0.0, "two seconds of rolling tell the bias"
    assert np.all(np.isfinite(batch.ideal)) and batch.ideal[1] > 2 * batch.ideal[0]


def test_several_cars_are_rows_of_one_batch_and_each_is_braked_as_alone():
    """Their lanes are the loops of the single cars: wheels, loads, and what observers know of them."""
    vehicle = {"car": ["small", "van"], "laden": [False, True]}
    several = {**OWN, "vehicle": vehicle, "roads": ["dry_asphalt"], "start": {}, "observer": "adaptive"}
    config = TuningConfig.from_json(several)
    assert TuningConfig.from_json(json.loads(json.dumps(config.to_json()))) == config
    rows, problem = rows_of(config), problem_of(config)
    batch, each = problem.batch, config.vehicle.each
    assert [one.name for one in each] == ["small", "small laden", "van", "van laden"]
    assert [row.which for row in rows] == [0, 1, 2, 3]
    for i, row in enumerate(rows):
        setup = Setup.of(dataclasses.replace(config, vehicle=each[row.which]))
        road, lane = batch.loop.vehicle.roads[0], taken(batch.loop, i)
        own = taken(setup.loop_of(None, road, np.full(1, 400.0)), 0)
        jax.tree.map(np.testing.assert_array_equal, lane, dataclasses.replace(own, vehicle=lane.vehicle))
        jax.tree.map(np.testing.assert_array_equal, lane.vehicle.wheels, own.vehicle.wheels)
        observer = lane.channels[1].observer
        assert observer.relaxation == each[row.which].cars[0].relaxation
        assert observer.wheel.load == pytest.approx(lane.vehicle.wheels[1].load, rel=1e-12)
    alone = batch_of(Setup.of(dataclasses.replace(config, vehicle=each[3])))
    assert batch.ideal[3] == pytest.approx(alone.ideal[0], rel=1e-12) and np.ptp(batch.ideal) > 0.1
    some = problem.on(np.array([1, 2]))
    assert some.members == some.batch.rows == 2
    np.testing.assert_array_equal(some.batch.ideal, batch.ideal[[1, 2]])
    lanes = loop_of_lanes(some.batch.loop, {"eps1": np.array([21.0, 22.0, 23.0, 24.0])}, 2)
    np.testing.assert_array_equal(lanes.vehicle.mass, [1480.0, 1480.0, 1980.0, 1980.0])
    np.testing.assert_array_equal(lanes.channels[0].observer.wheel.radius, [0.285, 0.285, 0.34, 0.34])


def test_one_set_serves_all_channels_of_every_wiring():
    for name, wirings in WIRINGS.items():
        for wheels, wiring in wirings.items():
            model = "two_axle" if wheels == 2 else "four_wheel"
            entry = VehicleEntry.from_json({"model": model, "wiring": name})
            setup = Setup.of(TuningConfig(vehicle=entry))
            loop = setup.loop_of({"eps1": 33.0, "eps2": 40.0})
            assert loop.wheels_of == wiring and {c.controller.eps1 for c in loop.channels} == {33.0}
    assert of_axle({"front.a": 1.0, "rear.a": 2.0, "b": 3.0}, 1) == {"a": 2.0, "b": 3.0}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"vehicle": {"car": "medium"}}, "car: 'medium' is unknown.*mid_size"),
        ({"vehicle": {"car": ["small", "vans"]}}, "car: 'vans' is unknown.*mean van"),
        ({"vehicle": {"car": []}}, "vehicle.car = 0 must be 1 to 20 cars"),
        ({"vehicle": {"laden": [True, True]}}, "vehicle.laden = 2 must be each once"),
        ({"vehicle": {"wiring": "select_low"}}, "needs the model four_wheel"),
        ({"vehicle": {"speed": "gps"}}, "vehicle.speed: 'gps' is unknown"),
        ({"vehicle": {}, "wheel": {"radius": 0.3}}, "without plant and wheel"),
        ({"vehicle": {}, "largest_contraction": 0.9}, "limit cycles are those of one wheel"),
        ({"vehicle": {}, "start": {"front.eps0": 40.0}}, "start: 'front.eps0' is unknown"),
    ],
)
def test_what_cannot_be_is_refused_by_name(changes, message):
    with pytest.raises(ConfigError, match=message):
        TuningConfig.from_json(changes)


def test_cars_of_one_tuning_all_relax_or_none_does():
    stiff = {**dataclasses.asdict(car_entry("small")), "relaxation": None}
    with pytest.raises(ConfigError, match="all cars or none must have a relaxation length"):
        Setup.of(TuningConfig.from_json({"vehicle": {"car": ["van", stiff]}}))


def test_a_car_of_impossible_figures_is_refused():
    figures = dataclasses.asdict(car_entry("mid_size"))
    car = car_entry({**figures, "unladen": {**figures["unladen"], "to_front": 3.0}})
    with pytest.raises(ConfigError, match="to_front"):
        car.vehicle("two_axle", (as_road("dry_asphalt"),) * 2)


def test_estimates_of_the_scenario_are_read_at_the_load_they_are_reckoned_with():
    """An axle whose load is known to be 1.3 times that at rest is an axle with that load."""
    wheel, design = Wheel(), Adaptive(gain_c=10.0, gain_d=10.0)
    heavy = dataclasses.replace(wheel, load=1.3 * wheel.load)
    time = np.arange(0.0, 0.035, PERIOD)  # where nothing is projected
    samples = Sample(20 * np.cos(40 * time), 25 - 8 * time, 60 + 20 * np.sin(50 * time))
    found = stiffness_along(design.observer(wheel), samples, np.full_like(time, 1.3))
    whole = observe(Clamped(design.observer(heavy)), samples, PERIOD, substeps=SUBSTEPS).stiffness
    np.testing.assert_allclose(found[1:], whole[1:], rtol=1e-9)
    assert np.ptp(whole) > 0.1


def test_what_is_told_of_the_scenario():
    """Of an estimate that is late by 20 ms and takes 0.3 s after each change, and a speed 10 % too low."""
    time = np.arange(0.0, 7.0, 1e-3)
    wave = np.sin(2 * np.pi * time)
    late = np.sin(2 * np.pi * (time - 0.02))
    for change in CHANGES:
        late = np.where((time >= change) & (time < change + BLEND + 0.3), 5.0, late)
    both, speed = np.stack([wave, wave]), np.full_like(time, 20.0)
    active = np.stack([time > 1.0] * 2)
    ride = Ride(
        time,
        speed,
        0.9 * speed,
        both,
        both,
        1e3 + 0 * both,
        1.03e3 + 0 * both,
        both,
        np.stack([late] * 2),
        both,
        active,
    )
    told = figures_of(ride, 0)
    assert told["speed error [%]"] == pytest.approx(10.0) and told["load error [%]"] == pytest.approx(3.0)
    assert told["on snow [s]"] == pytest.approx(0.3, abs=2e-3) and told["on wet [s]"] == pytest.approx(0.3, abs=2e-3)
    assert told["apart, median [ms]"] == pytest.approx(20.0, abs=0.5) and 80 < told["found [%]"] <= 100


def test_a_car_whose_rear_wheels_lift_is_told_of():
    """lf / h = 1.05 / 1.15 on dry asphalt, not on wet; none of the cars that are shipped."""
    mine = shipped_cars()["small"].to_json() | {"note": "mine"}
    mine["unladen"] = {**mine["unladen"], "to_front": 1.05, "height": 1.15}
    (told,) = lifting(VehicleEntry(car=["van", mine], laden=[False, True]), ["dry_asphalt", "wet_asphalt"])
    assert told.startswith("mine: its rear wheels lift from 0.91 g on, and there is more friction on dry_asphalt;")
    assert lifting(None, ["dry_asphalt"]) == lifting(VehicleEntry(car=list(shipped_cars())), ["dry_asphalt"]) == []


def test_drawn_stops_are_told_of_each_vehicle_and_of_all_together(monkeypatch):
    """Each draw of a row with its own vehicle, road and ideal distance; together as if all were of one vehicle."""
    vehicle = {"car": ["small", "van"], "laden": [False, True], "sets": "own", "speed": "kalman"}
    entries = {"roads": ("snow", "dry_asphalt"), "speeds_kmh": (40.0, 90.0), "checked": 3, "setting": "sampled"}
    config, sets = TuningConfig(controller="slip", vehicle=vehicle, **entries), distances.sets_of("slip", axles=True)
    rows = [row for row in rows_of(config) for _ in range(3)]
    lanes = np.arange(1.0, 1 + len(rows))

    def judged(batch, values, step, ticks):
        factor = np.stack([lanes + 100 * slip for slip in values["rear.slip"]], axis=1)
        ends = np.where(lanes == 5.0, Outcome.STILL_MOVING, Outcome.STOPPED)[:, None] + 0 * values["rear.slip"].astype(
            int
        )
        wheels = factor, 2 * factor
        stops = SimpleNamespace(distance=2 * factor, outcome=ends, longest_lock=(3 * factor,), slide_time=wheels)
        return SimpleNamespace(stops=stops)

    monkeypatch.setattr(distances, "scattered", lambda setup, split: SimpleNamespace(ideal=2 * lanes))
    monkeypatch.setattr(distances, "scored", judged)
    found = distances.drawn(config, sets)
    assert len(found) == 4 * len(sets)
    van = next(one for one in found if (one.vehicle, one.set) == ("van laden", "car"))
    mine = np.array([row.which == 3 for row in rows])
    slip = sets["car"]["rear.slip"]
    np.testing.assert_allclose(van.excess, np.where(lanes == 5.0, np.nan, 100 * slip / lanes)[mine])
    np.testing.assert_allclose(van.slide_time[1], 2 * (lanes + 100 * slip)[mine])
    assert van.names[:3] == ("dry_asphalt, 40 km/h",) * 3 and van.setting == distances.DRAWN
    pooled = {one.set: one for one in distances.together(found)}["car"]
    assert pooled.vehicle == distances.ALL and pooled.row()["do not end"] == 1
    assert pooled.row()["longest lock [s]"] == pytest.approx(3 * (lanes.max() + 100 * slip), abs=1e-3)
    assert pooled.row()["mean above ideal [%]"] == pytest.approx(
        1e4 * slip * np.mean(1 / lanes[lanes != 5.0]), abs=1e-2
    )
    assert pooled.row()["on"].startswith("snow, 90 km/h, van laden")


def test_controllers_of_two_axles_are_not_given_as_one():
    config = TuningConfig.from_json(OWN)
    result = TuningResult({"rear.eps0": 77.0}, [], [], 1.0, [], [], config)
    with pytest.raises(ValueError, match="a controller for each axle"):
        _ = result.controller
    assert result.setup.controller(result.parameters, 1).eps0 == 77.0


def test_rear_wheels_that_roll_now_and_then_keep_the_estimate_of_a_car_that_comes_to_a_slope():
    """Up or down: of wheels held at a slip all the way, nothing tells the unit of the 0.6 m/s^2."""
    vehicle = {"car": "small", "sets": "own", "speed": "kalman"}
    found = {}
    for slope in (-0.6, 0.6):
        config = {"controller": "rolling_slip", "vehicle": {**vehicle, "accelerometer_slope": slope}}
        setup = Setup.of(TuningConfig.from_json({**config, "roads": ["snow"], "speeds_kmh": [45.0]}))
        batch = batch_of(setup)
        rolls = {"rear.rolls_every": np.array([0.5, 60.0]), "rear.roll_time": np.full(2, 0.2)}
        lanes = loop_of_lanes(batch.loop, rolls, batch.rows)
        unit = in_control_unit(lanes, 1, 1, 1e-3, None, batch.speedometer)
        ended = stop(unit, 12.5, horizon=3.0, step=1e-3).rollout.state
        found[slope] = np.asarray(ended.unit.speed.speed / ended.loop.vehicle.speed) - 1
    assert all(np.abs(one[0]) < 0.05 for one in found.values()), found
    assert found[-0.6][1] < -0.15 and found[0.6][1] > 0.15, found
