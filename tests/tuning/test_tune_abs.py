"""Threshold tuning: it descends, respects its limits, goes through JSON, and refuses bad configurations."""

import dataclasses
import json

import matplotlib.pyplot as plt
import numpy as np
import pytest
from typer.testing import CliRunner

from tuning.cli import app
from tuning.controllers.batch import FEW, batch_of, scored
from tuning.controllers.command import run_of
from tuning.controllers.config import TuningConfig
from tuning.controllers.cycles import certify_cycles
from tuning.controllers.demo import limited
from tuning.controllers.figures import HIGHEST, distances
from tuning.controllers.load import load_controller, plot_stop
from tuning.controllers.problem import bounded, problem_of
from tuning.controllers.report import tuning_rows
from tuning.controllers.result import TuningResult
from tuning.controllers.setup import Setup
from tuning.controllers.tune import of_another_step, tune_abs, unstable_stops
from tuning.core.command import configuration
from tuning.core.config import ConfigError
from tuning.core.files import read_json, write_json
from tuning.core.fit import Fitted, fit

SMALL = TuningConfig(
    roads=("dry_asphalt", "wet_asphalt"),
    speeds_kmh=(40.0,),
    objective="worst",
    rate_limit=None,
    lag=None,
    threshold_floor=12.0,
    starts=2,
    screened=4,
    iterations=12,
    learning_rate=0.05,
    refinements=0,
    stop_speed_kmh=8.0,
    largest_contraction=0.6,
    cycle_speeds_kmh=(30.0,),
)


@pytest.fixture(scope="module")
def result():
    seen = []
    tuned = tune_abs(SMALL, progress=lambda i, n, cost: seen.append((i, n, cost)))
    return tuned, seen


def test_tuning_shortens_the_worst_stop(result):
    tuned, seen = result
    worst = {
        name: max(getattr(row, name).distance / row.ideal for row in tuned.rows)
        for name in ("untuned", "tuned", "sampled")
    }
    assert worst["tuned"] < worst["untuned"] - 0.002
    assert tuned.cost == pytest.approx(max(worst["tuned"], worst["sampled"]), abs=1e-9)
    assert [entry[0] for entry in seen] == list(range(1, 13)) and seen[-1][2] < seen[0][2]
    assert len(tuned.history) == 12 and len(tuned.history[0]) == 2


def test_the_command_writes_the_same_and_can_go_on(result, tmp_path):
    config = write_json(tmp_path / "config.json", SMALL.to_json())
    done = CliRunner().invoke(app, ["tune-abs", "--config", str(config), "--out", str(tmp_path / "a")])
    assert done.exit_code == 0, done.output
    assert "12/12" in done.output and "dry asphalt" in done.output
    steps = (
        "located and sampled ...",
        "at half the grid step ...",
        "of the phases ...",
        "limit cycles ...",
        "figures ...",
    )
    places = [done.output.index(step) for step in ("12/12", *steps, "tuned thresholds")]
    assert places == sorted(places)
    figures = {"distances.png", "history.png", "stop.png", "cycles.png"}
    assert {path.name for path in (tmp_path / "a").glob("*.png")} == figures
    assert "limit cycles: 2 of 2" in (tmp_path / "a" / "report.html").read_text()
    assert load_controller(tmp_path / "a" / "result.json") == result[0].controller
    assert TuningResult.from_json(read_json(tmp_path / "a" / "result.json")).parameters == result[0].parameters
    following = TuningConfig.from_json(configuration(tmp_path / "a" / "result.json"))
    assert following.start == result[0].parameters and following.roads == SMALL.roads


def test_rows_of_the_regulation_that_are_breached_are_counted_and_told(result, monkeypatch, tmp_path):
    config = TuningConfig(vehicle={"car": "van", "regulation": True}, setting="sampled")
    found = dataclasses.replace(result[0], breached=["regulation: lock", "regulation: slide"])
    monkeypatch.setattr("tuning.controllers.tune.tune_abs", lambda *args, **options: found)
    monkeypatch.setattr("tuning.controllers.figures.tuning_figures", lambda result, out: [])
    report = run_of(config, tmp_path, "tuned")(None, None)
    assert report.lines[-1] == "screened on van, unladen and laden: 2 rows breached"
    assert report.warnings[-2:] == ["warning: regulation: lock", "warning: regulation: slide"]
    assert TuningResult.from_json(found.to_json()).breached == found.breached


def test_a_tuning_that_finds_nothing_says_so_and_what_its_cost_is(result, monkeypatch):
    """The charge once, with the first cost that has it."""
    tuned, said = result[0], []

    def nothing(problem, search, *, progress, journal):
        for done, cost in enumerate((1.1, 10.2, 10.1)):
            progress(done + 1, 3, cost)
        point = problem.given[0]
        return Fitted(point, {n: float(v) for n, v in problem.box.values(point).items()}, 10.1, [[10.1]], [], False)

    monkeypatch.setattr("tuning.controllers.tune.fit", nothing)
    found = tune_abs(SMALL, say=said.append)
    assert found.warnings[:2] == [
        "no better set was found than the start",
        "no set was found without a charge: the cost of 10.1000 has one in it, for a limit cycle beyond "
        "largest_contraction",
    ]
    assert not {*found.warnings[:2]} & {*tuned.warnings}
    assert [told for told in said if "charge" in told] == [
        "a cost from 10 on has a charge in it, for a limit cycle beyond largest_contraction: any set without is better"
    ]


def test_a_bar_that_is_higher_than_the_axis_has_its_value(result):
    def values_in(rows):
        figure = distances(dataclasses.replace(result[0], rows=rows))
        found = [text.get_text().strip() for axes in figure.axes for text in axes.texts]
        highest = [(max(bar.get_height() for bar in axes.patches), axes.get_ylim()[1]) for axes in figure.axes]
        plt.close(figure)
        assert all(bars <= min(HIGHEST, end) for bars, end in highest)
        return found

    rows = result[0].rows
    far = dataclasses.replace(rows[0].untuned, distance=1.473 * rows[0].ideal)
    assert values_in(rows) == []
    assert values_in([dataclasses.replace(rows[0], untuned=far), *rows[1:]]) == ["47"]


def test_the_limit_on_contraction_is_reached_by_its_gradient(result):
    before = {row.road: row.contraction for row in certify_cycles(Setup.of(SMALL), Setup.of(SMALL).initial)}
    assert max(before.values()) > 0.7
    assert all(row.certified and row.contraction < 0.61 for row in result[0].cycles)


def test_the_gradient_of_cost_and_contraction_against_differences():
    """Of the very program that descends: distances, and what the contraction of every cycle is charged."""
    problem = problem_of(SMALL)
    box = problem.box
    at = box.valid(np.repeat(problem.given, 2, axis=0))
    direction = np.where(np.array(box.names) == "eps1", 1.0, np.where(np.array(box.names) == "u1", -0.7, 0.0))

    def costs(shift):
        values, gradients = problem.costs_and_gradients(at + shift * direction, None)
        return np.asarray(values)[0], np.asarray(gradients)[0] @ direction

    h = 1e-6
    value, slope = costs(0.0)
    assert value > 1.1 and slope == pytest.approx((costs(h)[0] - costs(-h)[0]) / (2 * h), rel=1e-4)


def test_limits_hold(result):
    names, low, high, _ = Setup.of(SMALL).box()
    values = np.array([result[0].parameters[name] for name in names])
    assert np.all(values >= np.multiply(low, 1 - 1e-9)) and np.all(values <= np.multiply(high, 1 + 1e-9))
    least = dict(zip(names, low))
    assert all(least[f"eps{i}"] == 12.0 for i in (0, 1, 3, 4)) and least["eps2"] == least["eps5"] == pytest.approx(14.1)
    eps = [result[0].parameters[f"eps{i}"] for i in range(6)]
    assert eps[2] >= max(eps[1], eps[3]) + 2 and eps[5] >= eps[4] + 2 and result[0].parameters["fallback"] == 0.9


def test_result_goes_through_json_and_can_be_gone_on_from(result):
    tuned = result[0]
    data = json.loads(json.dumps(tuned.to_json(), allow_nan=False))
    again = TuningResult.from_json(data)
    assert again == tuned
    follow = TuningConfig.from_json({**data["config"], "start": data["parameters"]})
    assert Setup.of(follow).controller() == tuned.controller


def test_a_stop_that_does_not_end_is_written_as_none(tmp_path, result):
    first = result[0].rows[0]
    moving = dataclasses.replace(first.tuned, distance=None, published_quantity=None, outcome="STILL_MOVING")
    rows = [dataclasses.replace(first, published=12.0, tuned=moving)]
    assert rows[0].reached is False
    failed = dataclasses.replace(result[0], rows=rows)
    write_json(tmp_path / "result.json", failed.to_json())
    assert TuningResult.from_json(read_json(tmp_path / "result.json")) == failed
    (row,) = tuning_rows(failed)
    assert (row["tuned"], row["above ideal [%]"], row["<= published"]) == ("still moving", "-", "no")


OLD_ROW = {
    "road": "dry_asphalt",
    "speed_kmh": 60.0,
    "ideal": 12.1,
    "published": 12.31,
    "untuned": 12.5,
    "tuned": 12.2,
    "sampled": None,
    "cycles": 20,
    "longest_cycle": 0.2,
    "outcome": "STOPPED",
    "sampled_outcome": "LOCKED",
}


def test_a_result_of_an_earlier_version_is_read_with_a_warning(result, tmp_path):
    data = json.loads(json.dumps(result[0].to_json()))
    data["config"] = {k: v for k, v in data["config"].items() if not k.startswith(("pedal", "foot", "longest_lock"))}
    data["config"]["start"] = {"eps1": 20.0, "eps2": 12.25, "ramp": 1.28}
    data |= {"rows": [OLD_ROW], "version": "0.1.0"}
    del data["warnings"]
    with pytest.warns(UserWarning) as said:
        old = TuningResult.from_json(data)
    assert [str(w.message).split(" ")[0] for w in said] == ["ramp", "eps2"]
    assert old.config.start == {"eps1": 20.0, "eps2": 22.0} and old.config.pedal_rate == 400.0
    (row,) = old.rows
    assert (row.ideal, row.tuned.distance) == (None, None)
    assert (row.published_ideal, row.tuned.published_quantity) == (12.1, 12.2)
    assert tuning_rows(old)[0]["tuned quantity"] == "12.20" and row.sampled.outcome == "LOCKED"


def test_a_stop_of_a_result_is_drawn(result):
    figure = plot_stop(result[0], [0.8, 12.0, 0.0], 20.0)
    titles = [axes.get_title() for axes in figure.axes]
    assert sum("untuned" in title for title in titles) == 1 and sum(", tuned" in title for title in titles) == 1


def test_what_a_search_began_with_is_untuned_where_it_is_the_default_set_alone(result):
    going_on = dataclasses.replace(result[0].config, start=result[0].parameters)
    for config, name in ((result[0].config, "untuned"), (going_on, "start")):
        told = dataclasses.replace(result[0], config=config)
        assert list(tuning_rows(told)[0])[4:6] == [name, "tuned"] and f"{name} quantity" in tuning_rows(told)[0]
        figure = distances(told)
        assert figure.axes[0].get_legend_handles_labels()[1] == [name, "tuned", "tuned, sampled"]
        plt.close(figure)


def test_scoring_in_chunks_and_some_of_the_rows():
    setup = Setup.of(SMALL)
    batch, names = batch_of(setup), setup.box().names
    sets = {name: np.full(10, setup.initial[name]) for name in names} | {"eps2": np.linspace(38, 42, 10)}
    every = scored(batch, sets, chunk=FEW)
    assert every.losses.shape == every.stops.distance.shape == (2, 10) and np.all(np.std(every.losses, axis=1) > 0)
    last = {name: values[9:] for name, values in sets.items()}
    np.testing.assert_allclose(scored(batch, last).losses, every.losses[:, 9:], rtol=1e-12)
    # As many rows as there are: a program less.
    second = scored(batch.of(np.array([1, 1])), last)
    np.testing.assert_allclose(second.losses, every.losses[[1, 1], 9:], rtol=1e-12)


def test_what_nobody_should_buy_is_charged():
    """A wheel locked for long above 15 km/h and let go of slowly, a stop that does not end, a controller that rests."""
    config = dataclasses.replace(SMALL, objective="mean")
    setup = Setup.of(config)
    batch = batch_of(setup).of(np.array([1, 1]))
    release = setup.initial["u1"]
    sets = {"eps0": [400.0, 30.0, 50.0], "u1": [5.0, release, release]}
    sets |= {"eps4": [20.0, 20.0, 20.0], "eps5": [30.0, 500.0, 30.0]}
    judged = scored(batch, {name: np.array(sets.get(name, 3 * [setup.initial[name]])) for name in setup.box().names})
    distance, lock, slide = judged.stops.distance[0], judged.stops.longest_lock[0][0], judged.stops.slide_time[0][0]
    assert lock[0] > 1.0 > config.longest_lock > lock[2] and slide[0] > lock[0] > config.slide_time > slide[2]
    ratios = distance / batch.ideal[0]
    idle = np.maximum(judged.stops.longest_cycle[0] - config.longest_cycle, 0.0)
    expected = ratios + 0.05 * idle + 2.0 * np.maximum(lock - config.longest_lock, 0.0)
    expected += 2.0 * np.maximum(slide - config.slide_time, 0.0)
    ended = judged.stops.outcome[0] == 0
    np.testing.assert_allclose(judged.losses[0][ended], expected[ended], rtol=1e-9)
    assert ended[0] and ended[2]


@pytest.mark.parametrize(
    "entries, message",
    [
        ({"road": ["snow"]}, r"configuration: 'road' is unknown; there are .*; did you mean roads\?"),
        ({"roads": ["mud"]}, r"roads\[0\] = 'mud': surface 'mud' is unknown"),
        ({"roads": [[1.0, -2.0, 0.1]]}, r"roads\[0\] = .*: Burckhardt\.c2 = -2"),
        ({"roads": [[0.0, 1.0, 0.0]]}, r"c = \(0\.0, 1\.0, 0\.0\) has a peak friction of 0"),
        ({"roads": []}, r"roads = \[\]: must have 1 entry at least, not 0"),
        ({"roads": "snow"}, r"roads = 'snow': must be a list$"),
        ({"roads": [{"tyre": "michelin"}]}, r"tyre: 'michelin' is unknown; there are burckhardt, exponential_basis"),
        ({"roads": [{"tyre": "burckhardt", "parameters": {"c4": 1}}]}, r"parameters: 'c4' is unknown"),
        ({"speeds_kmh": [1.0]}, r"speeds_kmh = 1\.0 must be above stop_speed_kmh"),
        ({"rate_limit": -5}, r"rate_limit = -5: must be greater than 0"),
        ({"rate_limit": True}, r"rate_limit = True: must be a valid number"),
        ({"lag": "slow"}, r"lag = 'slow': must be a valid number"),
        ({"lag": float("nan")}, r"lag = nan: must be a finite number"),
        ({"seed": -1}, r"seed = -1: must be greater than or equal to 0"),
        ({"starts": 0}, r"starts = 0: must be greater than or equal to 1"),
        ({"iterations": 2.5}, r"iterations = 2\.5: must be a valid integer"),
        ({"iterations": True}, r"iterations = True: must be an integer, not a boolean"),
        ({"objective": "best"}, r"objective = 'best': must be 'mean', 'worst', 'balanced', 'cvar', 'mean_and_cvar' or"),
        ({"reference": "published", "roads": ["snow"]}, r"no distance is published for snow from 60 km/h"),
        ({"controller": "six_phase"}, r"controller: 'six_phase' is unknown; there are five_phase"),
        ({"controller": "nowhere:Phase"}, r"controller: 'nowhere:Phase' cannot be imported: No module named 'nowhere'"),
        ({"controller": "json:JSONDecoder"}, r"controller: JSONDecoder lacks title, grid_step, phases"),
        ({"controller": "two_phase", "roads": ["snow"]}, r"start: chi_a = -0\.1 must be above -0\.0646"),
        ({"observer": "seven"}, r"observer: 'seven' is unknown"),
        ({"observer_parameters": {"ratio": 1}}, r"observer_parameters = .* must be empty without observer"),
        ({"observer": "adaptive", "observer_parameters": {"pole": 1}}, r"observer_parameters: 'pole' is unknown"),
        ({"plant": "bicycle"}, r"plant: 'bicycle' is unknown; there are quarter_car, test_rig"),
        ({"plant": "test_rig"}, r"plant: .*speed"),
        ({"sensor": "noisy", "sensor_parameters": {"noise": -1}}, r"sensor_parameters: NoisySensor\.noise = -1"),
        ({"largest_contraction": 0}, r"largest_contraction = 0: must be greater than 0"),
        ({"start": {"eps9": 1}}, r"start: 'eps9' is unknown"),
        ({"start": {"eps1": -1}}, r"start: FivePhase\.eps1 = -1"),
        ({"limits": {"eps1": [5, 2]}}, r"limits\.eps1|start\.eps1"),
        ({"limits": {"eps1": [40, 50]}}, r"start\.eps1 = 30\.0 must be in \[40, 50\], its limits"),
        ({"sampled_period": 0}, r"sampled_period = 0: must be greater than 0"),
        ({"cycle_speeds_kmh": []}, r"cycle_speeds_kmh = \[\]: must have 1 entry at least"),
        ({"controller": "slip", "largest_contraction": 0.9}, r"largest_contraction = 0\.9 must be null: "),
        (
            {"controller": "slip", "start": {"slip": -0.2}, "tune": ["slip"], "limits": {"slip": [-2, 0]}},
            r"limits\.slip",
        ),
        (
            {"controller": "two_phase", "limits": {"chi_a": [-0.6, 0.0]}},
            r"limits: chi_a = -0\.6 must be above -0\.1204, the least XBS of road wet_cobblestones",
        ),
        ({"controller": "two_phase", "start": {"chi_a": 0.1}}, r"start: TwoPhase\.chi_a = 0\.1 is outside"),
        ({"controller": "two_phase", "roads": ["ice"]}, r"start: slip_limit = -1 must be above -1: on road ice"),
        ({"start": {"eps1": 20.0, "eps2": 12.2}}, r"start: FivePhase\.eps2 = 12\.2 must be at least eps1 \+ 2"),
        ({"pedal_rate": 0}, r"pedal_rate = 0: must be greater than 0"),
        ({"roads": [{"surfaces": ["snow"], "changes": [3.0]}]}, r"roads\[0\] = .*: changes = \(3\.0,\) must be empty"),
        (
            {"roads": ["ice", {"surfaces": ["ice", "snow"], "changes": [3.0, 9.0]}]},
            r"roads\[1\] = .*: changes = \(3\.0, 9\.0\) must be 1 place, one between each two of the 2 surfaces",
        ),
        (
            {"roads": [{"surfaces": ["ice", "snow", "ice"], "changes": [9.0, 3.0]}]},
            r"roads\[0\] = .*: changes = \(9\.0, 3\.0\) must be above 0, each beyond the one before",
        ),
        (
            {"roads": [{"surfaces": ["ice", "snow"]}]},
            r"^roads\[0\] = \{'surfaces': \['ice', 'snow'\]\}: changes is missing, a list of numbers$",
        ),
        ({"limits": {"eps1": [5]}}, r"^limits\.eps1\[1\] is missing$"),
        ({"limits": {"eps1": [5, 6, 7]}}, r"limits\.eps1 = \[5, 6, 7\]: must have 2 entries at most, not 3"),
        ({"vehicle": 3}, r"vehicle = 3: a configuration is a dictionary, not int"),
        ({"vehicle": {"laden": "yes"}}, r"vehicle = .*: laden = 'yes': must be true, false or both$"),
        ({"vehicle": {"car": {"unladen": 3}}}, r"car = .*unladen = 3: a configuration is a dictionary, not int; laden"),
        ({"roads": [{"surface": "snow"}]}, r"'surface' is unknown; there are surfaces, changes, speeds_kmh"),
        ({"screened": 1}, r"screened = 1 must be at least as many as starts"),
        ({"starts": 1, "screened": 4, "known": [{"eps1": 20.0}]}, r"starts = 1 must be more than the known sets"),
        ({"batch": 99}, r"batch = 99 must be at most the 15 members"),
        ({"wheel": {"spokes": 5}}, r"wheel: 'spokes' is unknown; there are inertia, radius"),
        ([], r"a configuration is a dictionary, not list"),
    ],
)
def test_bad_configurations_are_refused(entries, message):
    with pytest.raises(ConfigError, match=message):
        config = TuningConfig.from_json(entries)
        fit(problem_of(config), config)


def test_the_sampled_grid_divides_the_period():
    two = TuningConfig(controller="two_phase", observer="adaptive", sampled_period=1.5e-3)
    step, ticks = Setup.of(two).sampled_grid()
    assert (step * ticks, ticks) == (pytest.approx(1.5e-3), 2) and step <= two.kind.grid_step
    five = Setup.of(TuningConfig())
    assert five.sampled_grid() == (1e-3, 1) and five.sampled_grid(4e-3) == (2e-3, 2)


def test_ranges_contain_the_start_and_stay_reachable():
    config = TuningConfig(
        controller="two_phase",
        roads=("ice", "snow"),
        start={"chi_a": -0.01, "slip_limit": -0.6},
        tune=("chi_a", "slip_limit"),
    )
    box = Setup.of(config).box()
    assert box.low == (pytest.approx(-0.9 * 0.0646), -1.0) and box.high == (0.0, -0.05)


def test_every_point_is_a_valid_set():
    setup = Setup.of(TuningConfig())
    box = setup.box()
    points = np.random.default_rng(3).normal(size=(200, len(box.names))) * 2 + box.point(setup.initial)
    for values in zip(*box.values(box.valid(points)).values()):
        setup.controller({name: float(f"{v:.4g}") for name, v in zip(box.names, values)})
    fixed = Setup.of(TuningConfig(tune=("eps1", "eps3"))).box()
    assert max(fixed.high) < 38.0 and fixed.ordered == ()


def test_the_demo_begins_with_the_default_set_but_for_a_growth():
    config = limited()
    assert config.began == "start"
    assert config.known == () and set(config.start) == {"eps0_growth"}
    assert (config.pedal_rate, config.rate_limit, config.lag, config.threshold_floor) == (400.0, 750.0, 0.005, 10.0)


def test_unstable_stops_and_those_of_another_step_are_named_and_pull_no_harder_than_others(result):
    rows = [dataclasses.replace(result[0].rows[0], growth=value) for value in (2.1, -16.0, None)]
    said = unstable_stops(rows)
    assert len(said) == 2 and "16 times as much, the other way" in said[0] and "beyond all bounds" in said[1]
    assert all(row.growth is not None and abs(row.growth - 2) < 1 for row in result[0].rows)
    other = [dataclasses.replace(result[0].rows[0], at_half_step=value) for value in (None, 41.5)]
    assert [row.at_half_step for row in result[0].rows] == [None] * len(result[0].rows)
    (said,) = of_another_step(other)
    assert "at half the grid step" in said and "41.500 for" in said
    long = np.array([[3.0, 4.0], [3e5, 4e5], [np.inf, 1.0]])
    np.testing.assert_allclose(bounded(long), [[3.0, 4.0], [6.0, 8.0], [0.0, 0.0]], rtol=1e-12)
