"""Threshold tuning: it descends, respects its limits, goes through JSON, and refuses bad configurations."""

import dataclasses
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from absjax.road import SURFACES
from tuning.batch import build, judge
from tuning.cli import app, configuration
from tuning.config import ConfigError, TuningConfig
from tuning.cycles import certify_cycles
from tuning.demo import limited
from tuning.files import read_json, write_json
from tuning.report import tuning_table
from tuning.tune_abs import TuningResult, tune_abs

SMALL = TuningConfig(
    roads=("dry_asphalt", "wet_asphalt"),
    speeds_kmh=(30.0,),
    rate_limit=None,
    lag=None,
    threshold_floor=12.0,
    starts=2,
    screened=4,
    iterations=12,
    refinements=0,
    stop_speed_kmh=8.0,
    largest_contraction=0.3,
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
        name: max(getattr(row, name) / row.ideal for row in tuned.rows) for name in ("untuned", "tuned", "sampled")
    }
    assert worst["tuned"] < worst["untuned"] - 0.004
    assert tuned.cost == pytest.approx(max(worst["tuned"], worst["sampled"]), abs=1e-9)
    assert [entry[0] for entry in seen] == list(range(1, 13)) and seen[-1][2] < seen[0][2]
    assert len(tuned.history) == 12 and len(tuned.history[0]) == 2


def test_the_command_writes_the_same_and_can_go_on(result, tmp_path):
    config = write_json(tmp_path / "config.json", SMALL.to_json())
    done = CliRunner().invoke(app, ["tune-abs", "--config", str(config), "--out", str(tmp_path / "a")])
    assert done.exit_code == 0, done.output
    assert "12/12" in done.output and "dry asphalt" in done.output
    assert {path.name for path in (tmp_path / "a").glob("*.png")} == {"distances.png", "history.png", "cycles.png"}
    assert TuningResult.from_json(read_json(tmp_path / "a" / "result.json")).parameters == result[0].parameters
    following = TuningConfig.from_json(configuration(tmp_path / "a" / "result.json"))
    assert following.start == result[0].parameters and following.roads == SMALL.roads


def test_the_limit_on_contraction_is_reached_by_its_gradient(result):
    before = {row.road: row.contraction for row in certify_cycles(SMALL, SMALL.initial())}
    assert max(before.values()) > 0.5
    assert all(row.certified and row.contraction < 0.31 for row in result[0].cycles)


def test_limits_hold(result):
    names, low, high = SMALL.box()
    values = np.array([result[0].parameters[name] for name in names])
    assert np.all(values >= np.multiply(low, 1 - 1e-9)) and np.all(values <= np.multiply(high, 1 + 1e-9))
    assert all(low[i] == 12.0 for i, name in enumerate(names) if name.startswith("eps"))
    assert result[0].parameters["ramp"] == 3.0


def test_result_goes_through_json_and_can_be_gone_on_from(result):
    tuned = result[0]
    data = json.loads(json.dumps(tuned.to_json(), allow_nan=False))
    again = TuningResult.from_json(data)
    assert again == tuned
    follow = TuningConfig.from_json({**data["config"], "start": data["parameters"]})
    assert follow.base_controller() == tuned.controller


def test_a_stop_that_never_slows_down_is_written_as_none(tmp_path, result):
    rows = [dataclasses.replace(result[0].rows[0], published=12.0, tuned=None)]
    assert rows[0].reached is False
    failed = dataclasses.replace(result[0], rows=rows)
    write_json(tmp_path / "result.json", failed.to_json())
    assert TuningResult.from_json(read_json(tmp_path / "result.json")) == failed
    tuning_table(failed, "failed")


def test_judging_in_chunks_and_by_mean():
    problem = build(dataclasses.replace(SMALL, objective="mean"))
    sets = {"eps2": np.linspace(38, 42, 70)}
    judged = judge(problem, sets)
    assert judged.costs.shape == (70,) and judged.distances.shape == (2, 70)
    assert np.std(judged.costs) > 0
    one = judge(problem, {"eps2": sets["eps2"][66:67]})
    np.testing.assert_allclose(one.costs, judged.costs[66:67], rtol=1e-12)


def test_a_controller_that_sticks_is_charged():
    config = dataclasses.replace(SMALL, speeds_kmh=(120.0,), roads=("dry_asphalt",), lag=0.005, rate_limit=750.0)
    sticking = {"eps0": 29.4, "eps1": 24.1, "eps2": 66.0, "eps3": 31.5, "eps4": 10.0, "eps5": 14.5}
    sticking |= {"u1": 2637.0, "u3": 3457.0, "u4": 2812.0, "ramp": 0.47, "fallback": 0.5}
    judged = judge(build(config), {name: np.array([value]) for name, value in sticking.items()})
    assert judged.cycles[0, 0] <= 2 and judged.longest_cycles[0, 0] > 2
    peak = float(SURFACES["dry_asphalt"].peak().friction)
    ratio = judged.distances[0, 0] / ((120 / 3.6) ** 2 / (2 * 9.81 * peak))
    assert judged.costs[0] == pytest.approx(ratio + 0.05 * (judged.longest_cycles[0, 0] - 1.0), rel=1e-9)


@pytest.mark.parametrize(
    "entries, message",
    [
        ({"road": ["snow"]}, r"configuration: 'road' is unknown"),
        ({"roads": ["mud"]}, r"roads: surface 'mud' is unknown"),
        ({"roads": [[1.0, -2.0, 0.1]]}, r"roads: Burckhardt\.c2 = -2"),
        ({"roads": [[0.0, 1.0, 0.0]]}, r"roads: c = \(0\.0, 1\.0, 0\.0\) has a peak friction of 0"),
        ({"roads": []}, r"roads = \(\) must be one road at least"),
        ({"roads": "snow"}, r"roads = 'snow' is not of the kind"),
        ({"speeds_kmh": [1.0]}, r"speeds_kmh = 1\.0 must be above stop_speed_kmh"),
        ({"rate_limit": -5}, r"Brake\.rate_limit = -5"),
        ({"lag": "slow"}, r"lag = 'slow' is not of the kind"),
        ({"starts": 0}, r"starts = 0 must be an integer >= 1"),
        ({"iterations": 2.5}, r"iterations = 2\.5 is not of the kind"),
        ({"objective": "best"}, r"objective: 'best' is unknown; there are worst, mean"),
        ({"reference": "published", "roads": ["snow"]}, r"no distance is published for snow from 60 km/h"),
        ({"controller": "six_phase"}, r"controller: 'six_phase' is unknown"),
        ({"controller": "two_phase", "roads": ["snow"]}, r"start\.chi_a = -0\.1 must be above -c3 = -0\.0646"),
        ({"observer": "seven"}, r"observer: 'seven' is unknown"),
        ({"observer_parameters": {"ratio": 1}}, r"observer_parameters = .* must be empty without an observer"),
        ({"observer": "adaptive", "observer_parameters": {"pole": 1}}, r"observer_parameters: 'pole' is unknown"),
        ({"largest_contraction": 0}, r"largest_contraction = 0\.0 must be positive, or null"),
        ({"start": {"eps9": 1}}, r"start: 'eps9' is unknown"),
        ({"start": {"eps1": -1}}, r"start: FivePhase\.eps1 = -1"),
        ({"limits": {"eps1": [5, 2]}}, r"limits\.eps1 = \(5\.0, 2\.0\) must be"),
        ({"sampled_period": 0}, r"sampled_period = 0\.0 must be positive"),
        ({"cycle_speeds_kmh": []}, r"cycle_speeds_kmh = \(\) must be one speed at least"),
        ({"controller": "slip", "largest_contraction": 0.9}, r"largest_contraction = 0\.9 must be null: slip does not"),
        (
            {"controller": "slip", "start": {"slip": -0.2}, "tune": ["slip"], "limits": {"slip": [-2, 0]}},
            r"limits\.slip",
        ),
        (
            {"controller": "two_phase", "start": {"chi_a": 0.1}, "limits": {"chi_a": [-0.6, 0.2]}},
            r"limits\.chi_a = -0\.6 must be above -c3 = -0\.1204, the least XBS of road wet_cobblestones",
        ),
        ({"screened": 1}, r"screened = 1 must be at least as many as starts"),
        ({"wheel": {"spokes": 5}}, r"spokes"),
        ([], r"a configuration is a dictionary, not list"),
    ],
)
def test_bad_configurations_are_refused(entries, message):
    with pytest.raises(ConfigError, match=message):
        config = TuningConfig.from_json(entries)
        config.box()
        build(config)


def test_the_sampled_grid_divides_the_period():
    two = TuningConfig(controller="two_phase", observer="adaptive", sampled_period=1.5e-3)
    step, ticks = two.sampled_grid()
    assert (step * ticks, ticks) == (pytest.approx(1.5e-3), 2) and step <= two.kind.step
    assert TuningConfig().sampled_grid() == (1e-3, 1) and TuningConfig(sampled_period=4e-3).sampled_grid() == (2e-3, 2)


def test_ranges_contain_the_start_and_stay_reachable():
    box = TuningConfig(
        controller="two_phase", roads=("ice",), start={"chi_a": 0.05, "slip_limit": -0.6}, tune=("chi_a", "slip_limit")
    ).box()
    assert box.low == (0.01, -1.0) and box.high == (0.5, -0.05)


def test_shipped_parameters_reach_every_published_row():
    config = limited()
    judged = [
        judge(build(config), {k: np.array([v]) for k, v in config.known[0].items()}, *grid)
        for grid in ((), config.sampled_grid())
    ]
    published = build(config).reference
    assert all(np.all(j.distances[:, 0] <= published) for j in judged)
    assert judged[0].longest_cycles.max() < 1.2 and judged[0].cycles.min() >= 5
