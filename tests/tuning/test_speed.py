"""Simulated stops of a car on two axles, estimators of its speed tuned on them, and the study."""

import json

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from absjax.speed import ReferenceSpeed
from absjax.speed.kalman import KalmanSpeed
from absjax.speed.run import estimate_speed
from tuning.cli import app
from tuning.core.config import ConfigError
from tuning.core.fit import fit
from tuning.speed import study, tasks
from tuning.speed.bench import Bench, errors_of
from tuning.speed.config import SpeedConfig
from tuning.speed.estimators import NAMES, estimator_of
from tuning.speed.tune import SpeedProblem

SHORT = {
    "roads": ["wet_asphalt"],
    "held_out": ["wet_cobblestones"],
    "speeds_kmh": [50.0, 60.0],
    "held_out_speeds_kmh": [45.0, 55.0],
    "controllers": ["two_phase"],
    "estimators": ["kalman_front", "reference", "largest_rim"],
    "tune": ["reference.margin", "reference.steadiness"],
    "gains": [0.04],
    "delay": 0.3,
    "horizon": 2.8,
    "starts": 1,
    "screened": 1,
    "iterations": 3,
    "refinements": 0,
}
CONFIG = SpeedConfig.from_json(SHORT)


@pytest.fixture(scope="module")
def told():
    return tasks.stops_of(CONFIG, "roads")


@pytest.fixture(scope="module")
def bench(told):
    return Bench.of(told)


def test_a_stop_is_of_one_car(told):
    stops = told.stops
    assert stops.speed.shape == (4, 281) and told.names[1] == "wet_asphalt, 50 km/h, two_phase, bias -0.5, gain +0.04"
    travelled = np.cumsum((stops.acceleration[:, 1:] + stops.acceleration[:, :-1]) / 2 * stops.period, axis=1)
    moves = np.cumsum(~stops.active[:, 60:], axis=1) == 0
    found = (stops.speed[:, :1] + travelled)[:, 59:]
    np.testing.assert_allclose(found[moves], stops.speed[:, 60:][moves], atol=0.05)
    slips = stops.rims / stops.speed[..., None] - 1
    assert np.all(np.abs(slips[:, :30]) < 1e-9) and not stops.active[:, :30].any()
    assert np.all(slips[stops.active].mean(axis=0) < -0.05)
    friction = -stops.acceleration[stops.active].mean() / 9.81
    assert 0.7 < friction < 0.81  # wet asphalt has 0.80 at its peak


def test_what_is_told_of_a_stop(told):
    stops, samples = told.stops, told.samples
    off = samples.acceleration - 1.04 * stops.acceleration
    np.testing.assert_allclose(off.mean(axis=1), [0.5, -0.5, 0.5, -0.5], atol=0.05)
    assert off.std(axis=1) == pytest.approx(0.1, rel=0.25)
    noise = samples.rims - stops.rims
    assert noise.std() == pytest.approx(0.05, rel=0.1)
    drawn = np.concatenate([off.T, noise[..., 0].T, noise[..., 1].T], axis=1)
    assert np.abs(np.corrcoef(drawn.T) - np.eye(12)).max() < 0.4


def test_wheels_that_roll_for_longer_before_a_stop(told):
    longer = told.after_rolling(0.5)
    assert not longer.stops.active[:, :80].any() and longer.stops.active.sum() == told.stops.active.sum()
    np.testing.assert_array_equal(longer.stops.speed[:, 50:], told.stops.speed[:, :-50])
    np.testing.assert_array_equal(longer.stops.acceleration[:, :50], 0.0)
    with pytest.raises(ValueError, match="seconds = 2"):
        told.after_rolling(2.0)
    assert told.roads[1] == "wet_asphalt, bias -0.5"


def test_errors_against_plain_sums(bench, told):
    found = errors_of(bench, ReferenceSpeed())
    for i in range(4):
        counts, truth = told.stops.active[i], told.stops.speed[i]
        samples = type(told.samples)(*(np.asarray(x[i]) for x in told.samples))
        error = (np.asarray(estimate_speed(ReferenceSpeed(), samples, told.stops.period).speed) - truth)[counts]
        np.testing.assert_allclose(found.relative[i], np.abs(error / truth[counts]).mean(), rtol=1e-10)
        np.testing.assert_allclose(found.rms[i], np.sqrt((error**2).mean()), rtol=1e-6)
        np.testing.assert_allclose(found.largest[i], np.abs(error).max(), rtol=1e-10)


def test_gradient_of_the_cost_and_a_fit_that_lowers_it(bench):
    problem = SpeedProblem.of(CONFIG, "reference", bench)
    exact = np.asarray(problem.costs_and_gradients(problem.given, None)[1])[0]
    for i, h in enumerate(1e-5 * np.eye(len(exact))):
        ends = [float(problem.judge(problem.given + e)[0]) for e in (h, -h)]
        np.testing.assert_allclose(exact[i], (ends[0] - ends[1]) / 2e-5, rtol=1e-4, atol=1e-8)
    assert np.count_nonzero(exact) == 1  # no wheel refreshes it, steady or not
    found = fit(problem, CONFIG)
    assert found.cost < 0.999 * problem.judge(problem.given)[0]


def test_gates_are_opened_until_the_error_is_the_one_asked_for(bench):
    filter_ = KalmanSpeed(wheels=1)
    least = float(errors_of(bench, filter_).relative.mean())
    most = float(errors_of(bench, study.opened(filter_, study.WIDEST)).relative.mean())
    assert least < 0.05 < 0.1 < most
    factor = study.gates_for(bench, filter_, 0.08)
    assert factor is not None
    assert float(errors_of(bench, study.opened(filter_, factor)).relative.mean()) == pytest.approx(0.08, abs=1e-4)
    assert study.gates_for(bench, filter_, 0.9) is None


@pytest.mark.parametrize(
    "entries, said",
    [
        ({"estimators": ["best"]}, "estimators: 'best' is unknown"),
        ({"estimators": ["kalman", "kalman"]}, "distinct"),
        ({"start": {"reference.noise": 1.0}}, "start: 'noise' is unknown"),
        ({"start": {"kalman.noise": 1.0}}, "start: 'kalman' is unknown; there are kalman_front"),
        ({"start": {"reference.margin": 90.0}, "limits": {"reference.margin": [0.1, 5.0]}}, r"start\.margin = 90"),
        ({"controllers": ["abs"]}, "controllers: 'abs' is unknown"),
        ({"roads": ["glass"]}, "surface 'glass' is unknown"),
        ({"stop_speed": 20.0}, "below the slowest start"),
        ({"period": 1e-4}, "period"),
    ],
)
def test_wrong_entries_are_refused_by_name(entries, said):
    with pytest.raises(ConfigError, match=said):
        SpeedConfig.from_json({**SHORT, **entries})


def test_names_lead_to_estimators():
    assert [type(estimator_of(name)).__name__ for name in NAMES[:2]] == ["KalmanSpeed"] * 2
    assert estimator_of("absjax.speed.reference:ReferenceSpeed") == ReferenceSpeed()
    assert SpeedConfig.from_json({**SHORT, "tune": ["reference.margin"], "start": {}}).box("kalman_front") is None


def test_the_study(tmp_path, monkeypatch, told):
    """On a short stop in the place of the published scenario."""
    monkeypatch.setattr(tasks, "published_scenario", lambda period, controller: told.stops.select(slice(1)))
    monkeypatch.setattr(tasks, "ROLLING", (0.0, 0.5))
    (tmp_path / "short.json").write_text(json.dumps(SHORT))
    out = tmp_path / "out"
    found = CliRunner().invoke(app, ["speed-study", "--config", str(tmp_path / "short.json"), "--out", str(out)])
    assert found.exit_code == 0, found.output
    result = json.loads((out / "result.json").read_text())
    assert {name.partition(".")[0] for name in result["parameters"]} == {"reference"}
    assert (out / "speed.png").exists()
    table = pd.read_csv(out / "tables" / "held_out_stops.csv").set_index("estimator")
    assert len(table) == 3 and np.isfinite(table.to_numpy()).all()
    rolling = pd.read_csv(out / "tables" / "rolling_before_braking.csv")
    assert rolling["Kalman filter, front axle"].iloc[-1] < rolling["Kalman filter, front axle"].iloc[0]
    largest = table.loc["largest rim"]
    assert largest["rms, before [m/s]"] == largest["rms, after [m/s]"]
    again = SpeedConfig.from_json({**result["config"], "start": result["parameters"]})
    assert float(again.initial("reference").margin) == result["parameters"]["reference.margin"]
