"""Logs of a car read and doubted, the commands on side-slip, and tuning over logs."""

import json

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from absjax.sideslip.car import Car
from tests.oracles.car_simulator import CAR, COLUMNS, drive, slalom
from tuning.cli import app
from tuning.core.config import ConfigError
from tuning.logs.car import CarError
from tuning.logs.recording import LogError
from tuning.logs.vehicle_log import parse_vehicle_columns, read_vehicle_log
from tuning.logs.whole_car import ENTRIES, read_whole_car, whole_car_from
from tuning.sideslip.bench import LogSet, errors_of
from tuning.sideslip.config import SideSlipConfig
from tuning.sideslip.estimators import ESTIMATORS, estimator_of, parameters_of, with_values
from tuning.sideslip.tasks import doubts, worsened
from tuning.sideslip.tune import AFTER, BEFORE, SideSlipProblem, SideSlipResult, tune_side_slip

DESCRIPTION = {**{entry: CAR[field] for entry, field in ENTRIES.items()}, "driven": "front"}
KNOWN = Car(**CAR)
WHEELS = COLUMNS[4:]
BETTER = estimator_of("estimator", "better")


@pytest.fixture(scope="module")
def log():
    """A slalom with a push on the pedal in its first seconds."""
    return slalom(8.0, amplitude=0.04, push=lambda t: 1.0 if t < 3.0 else 0.0)


@pytest.fixture
def write(tmp_path):
    def to(columns, name="log", car=DESCRIPTION):
        path = tmp_path / f"{name}.csv"
        pd.DataFrame(columns).to_csv(path, index=False)
        path.with_suffix(".json").write_text(json.dumps(car))
        return path

    return to


def during(columns, name, value):
    """A column with other values from 4 s to 5 s."""
    changed = columns[name].copy()
    changed[400:500] = value
    return {**columns, name: changed}


def scaled(columns, factor, *names):
    return {**columns, **{name: factor * columns[name] for name in names}}


def ordered(columns, order):
    return {**columns, **{WHEELS[i]: columns[WHEELS[k]] for i, k in enumerate(order)}}


LATERAL = (COLUMNS[1], COLUMNS[2], COLUMNS[3])
WRONG = {
    "gap": (lambda x: during(x, WHEELS[1], np.nan), r"'wheel_speed_fr_rad_s', row 402: no measurement for 1 s"),
    "stuck wheel": (lambda x: during(x, WHEELS[2], 47.1), r"'wheel_speed_rl_rad_s': stuck at 47\.1 for 1 s from 4 s"),
    "stuck yaw rate": (lambda x: during(x, COLUMNS[2], 0.02), r"'yaw_rate_rad_s': stuck at 0\.02 for 1 s"),
    "no wheel": (lambda x: during(x, WHEELS[0], 0.0), r"'wheel_speed_fl_rad_s'.* 0 .*4 s"),
    "degrees": (lambda x: scaled(x, 57.3, COLUMNS[3]), r"'steering_angle_rad'.*is it in degrees"),
    "small degrees": (
        lambda x: scaled(x, 20.0, COLUMNS[3]),
        r"'steering_angle_rad': .* times what the yaw rate says; is it in degrees",
    ),
    "in g": (lambda x: scaled(x, 1 / 9.81, COLUMNS[1]), r"'lateral_acceleration_m_s2' and 'yaw_rate_rad_s': ay over"),
    "wheels in km/h": (lambda x: scaled(x, 1.4, *WHEELS), r"'wheel_speed_rl_rad_s', .*is a unit wrong"),
    "left and right": (lambda x: ordered(x, (1, 0, 3, 2)), "left and right contradict the yaw rate"),
    "front and rear": (lambda x: ordered(x, (2, 3, 0, 1)), "the rear wheels turn faster while the car speeds up"),
    "one by one": (lambda x: ordered(x, (0, 2, 1, 3)), "'wheel_speed_fr_rad_s', 'wheel_speed_rl_rad_s': by the yaw"),
    "positive right": (lambda x: scaled(x, -1, *LATERAL), "or yaw rate, lateral acceleration and steering angle are"),
    "yaw rate": (lambda x: scaled(x, -1, COLUMNS[2]), "'yaw_rate_rad_s': its sign contradicts lateral_acceleration"),
    "lateral": (lambda x: scaled(x, -1, COLUMNS[1]), "'lateral_acceleration_m_s2': its sign contradicts the yaw rate"),
    "steering": (lambda x: scaled(x, -1, COLUMNS[3]), "'steering_angle_rad': its sign contradicts the yaw rate"),
    "time": (lambda x: {**x, "time_s": x["time_s"][::-1]}, r"'time_s', row 3: the time does not increase"),
    "milliseconds": (lambda x: scaled(x, 1000.0, "time_s"), "Is time in s"),
    "a column": (lambda x: {k: v for k, v in x.items() if k != COLUMNS[2]}, "no column 'yaw_rate_rad_s' for yaw_rate"),
}


@pytest.mark.parametrize("change, said", WRONG.values(), ids=WRONG.keys())
def test_what_contradicts_what_is_said(log, write, change, said):
    path = write(change(log))
    with pytest.raises(LogError, match=said) as error:
        read_vehicle_log(path, KNOWN)
    assert str(path) in str(error.value)


def test_a_good_log_is_taken_and_short_gaps_are_bridged(log, write):
    holed = log[WHEELS[0]].copy()
    holed[200:205] = np.nan
    read = read_vehicle_log(write({**log, WHEELS[0]: holed}), KNOWN)
    assert read.period == pytest.approx(0.01) and set(read.truth) >= {"lateral_speed", "friction"}
    assert read.notes == ("wheel_speed_fl_rad_s: 5 missing samples bridged",)
    np.testing.assert_allclose(read.samples.wheel_speed[:, 1], log[WHEELS[1]])
    line = np.interp(202, (199, 205), (log[WHEELS[0]][199], log[WHEELS[0]][205]))
    np.testing.assert_allclose(read.samples.wheel_speed[202, 0], line)


def test_declared_columns_and_units(log, write):
    columns = {"delta" if name == COLUMNS[3] else name: column for name, column in log.items()}
    path = write(scaled(columns, 180 / np.pi, "delta"))
    read = read_vehicle_log(path, KNOWN, parse_vehicle_columns("steering_angle=delta:deg"))
    np.testing.assert_allclose(read.samples.steering_angle, log[COLUMNS[3]])
    with pytest.raises(LogError, match="unit 'grad' is unknown; there are rad, deg"):
        read_vehicle_log(path, KNOWN, {"steering_angle": "delta:grad"})
    with pytest.raises(LogError, match="signal 'pitch' is unknown"):
        parse_vehicle_columns("pitch=p")


def test_what_a_straight_log_cannot_tell_is_noted(write):
    straight = drive(lambda t: 0.0, lambda t: 1.0, 20.0, 2.0)
    assert "hardly turns" in read_vehicle_log(write(straight), KNOWN).notes[0]


@pytest.mark.parametrize(
    "change, said",
    [
        ({"mass_kg": -1.0}, "Car.mass = -1"),
        ({"driven": "left"}, "driven: 'left' is unknown; there are front, rear, all"),
        ({"weight": 1.0}, "car: 'weight' is unknown"),
        ({"car": 3}, "car is a dictionary, not int"),
    ],
)
def test_a_wrong_car_is_refused_by_entry(change, said):
    with pytest.raises(CarError, match=said):
        whole_car_from({**DESCRIPTION, **change})
    with pytest.raises(CarError, match="no mass_kg"):
        whole_car_from({key: value for key, value in DESCRIPTION.items() if key != "mass_kg"})


def test_the_car_under_its_own_key():
    inner = {key: value for key, value in DESCRIPTION.items() if key != "driven"}
    assert whole_car_from({"car": inner, "driven": "front", "reference": {}}) == KNOWN


@pytest.fixture(scope="module")
def logs(tmp_path_factory, log):
    folder = tmp_path_factory.mktemp("logs")
    made = {"slalom": log, "slippery": slalom(6.0, friction=0.25, amplitude=0.03, seed=1)}
    paths = []
    for name, columns in made.items():
        paths.append(folder / f"{name}.csv")
        pd.DataFrame(columns).to_csv(paths[-1], index=False)
        paths[-1].with_suffix(".json").write_text(json.dumps(DESCRIPTION))
    return paths


@pytest.fixture(scope="module")
def read(logs):
    return [(read_vehicle_log(path, KNOWN), read_whole_car(path.with_suffix(".json"))) for path in logs]


def test_errors_against_plain_sums(read):
    from absjax.sideslip.run import estimate

    found = errors_of(LogSet.of([log for log, _ in read], [car for _, car in read]), BETTER)
    for i, (log, car) in enumerate(read):
        told = estimate(BETTER, car, log.samples, log.period).estimate
        counts = np.arange(len(log.time)) >= 100
        slip = (np.asarray(told.side_slip) - log.true_side_slip)[counts]
        np.testing.assert_allclose(found.side_slip[i], np.sqrt(np.mean(slip**2)), rtol=1e-4)
        np.testing.assert_allclose(found.largest_side_slip[i], np.abs(slip).max())
        off = (np.asarray(told.lateral_speed) - log.truth["lateral_speed"])[counts]
        np.testing.assert_allclose(found.lateral_speed[i], np.sqrt(np.mean(off**2)), rtol=1e-4)


def test_values_by_path():
    changed = with_values(BETTER, {"friction_model.stiffness_at_rest": 30.0, "lateral_gain": 2.0})
    assert changed.friction_model.stiffness_at_rest == 30 and changed.lateral_gain == 2
    assert parameters_of(changed)["rule.factor"][0] == 5.0
    for name, recipe in ESTIMATORS.items():
        assert set(recipe.tuned) <= set(parameters_of(recipe.make())), name


def configured(logs, **entries):
    few = {"iterations": 3, "starts": 1, "screened": 1, "tune": ["friction_gain", "lateral_gain"]}
    return SideSlipConfig.from_json({"logs": [str(path) for path in logs], **few, **entries})


def test_gradient_of_the_cost_against_differences(logs, read):
    """Of a filter: the monitor of the observer is the one switch."""
    config = configured(logs, estimator="linear_filter", tune=["lateral_drift", "friction_model.stiffness_at_rest"])
    problem = SideSlipProblem.of(config, LogSet.of([log for log, _ in read], [car for _, car in read]))
    point = problem.given + 0.1
    exact = np.asarray(problem.costs_and_gradients(point, None)[1])[0]
    for i in range(2):
        h = 1e-5 * np.eye(2)[i]
        ends = [float(np.asarray(problem.costs_and_gradients(point + e, None)[0])[0]) for e in (h, -h)]
        np.testing.assert_allclose(exact[i], (ends[0] - ends[1]) / 2e-5, rtol=1e-5)


def test_tuning_lowers_the_cost_holds_out_and_comes_back_from_json(logs, read):
    config = configured(logs[:1], held_out=[str(logs[1])])
    result = tune_side_slip(config, read[:1], read[1:])
    assert min(min(costs) for costs in result.history) < result.history[0][0]
    assert [row["tuned on"] for row in result.logs] == ["yes", "no"]
    again = SideSlipResult.from_json(json.loads(json.dumps(result.to_json())))
    assert again.estimator() == result.estimator() != config.initial()


def test_one_manoeuvre_is_warned_of(read):
    assert "one manoeuvre only" in doubts(read[:1])[0]


@pytest.mark.parametrize(
    "entries, said",
    [
        ({"logs": []}, "logs"),
        ({"estimator": "best"}, "estimator: 'best' is unknown"),
        ({"estimator": "kinematic", "tune": []}, "kinematic tunes none by default"),
        ({"parts": {"monitor": "best"}}, "parts.monitor: 'best' is unknown; there are scaled, published, none"),
        (
            {"estimator": "linear_filter", "parts": {"rule": "slope"}},
            "parts: 'rule' is unknown; there are friction_model",
        ),
        ({"tune": ["mass"]}, "tune: 'mass' is unknown"),
        ({"start": {"lateral_gain": 100.0}}, "start.lateral_gain = 100"),
        ({"each": True}, "of two logs at least"),
        ({"held_out": ["a.csv"]}, "stands twice"),
    ],
)
def test_wrong_entries_are_refused_by_name(entries, said):
    with pytest.raises(ConfigError, match=said):
        SideSlipConfig.from_json({"logs": ["a.csv"], **entries})


def test_parts_by_name():
    config = SideSlipConfig.from_json({"logs": ["a.csv"], "parts": {"friction_model": "burckhardt", "rule": "slope"}})
    found = config.initial()
    assert found.friction_model.title.startswith("Burckhardt") and found.rule.title == "slope"
    assert config.tuned == ("lateral_gain", "friction_gain")


def test_logs_held_out_that_got_worse_are_said():
    worse = {"log": "b.csv", "tuned on": "no", BEFORE: 0.025, AFTER: 0.1806}
    rows = [{**worse, "tuned on": "yes"}, worse, {**worse, AFTER: 0.02}]
    assert worsened(rows) == ["warning: b.csv, held out: the side-slip error grew from 0.025 to 0.181 deg"]


def test_commands(logs, tmp_path):
    run = CliRunner()

    def done(*words):
        result = run.invoke(app, [str(word) for word in words])
        return result.exit_code, result.output

    code, said = done("side-slip", logs[0], "--out", tmp_path / "one")
    assert code == 0 and "theta can be told" in said
    table = pd.read_csv(tmp_path / "one" / "estimates.csv")
    assert len(table) == 800 and {"vy_m_s", "side_slip_rad", "friction", "identifiable"} <= set(table)
    result = json.loads((tmp_path / "one" / "result.json").read_text())
    assert result["intervals"]["friction"][-1]["identifiable"] and result["errors"]["side-slip rms [deg]"] < 1
    figures = {"estimates.png", "excitation.png", "friction_curves.png", "friction_parameter.png"}
    assert figures <= {path.name for path in (tmp_path / "one").iterdir()}
    page = (tmp_path / "one" / "report.html").read_text()
    assert "theta can be told" in page and page.count("data:image/png") == len(figures)

    bad = pd.read_csv(logs[0]).assign(yaw_rate_rad_s=lambda x: -x.yaw_rate_rad_s)
    bad.to_csv(tmp_path / "bad.csv", index=False)
    code, said = done(
        "side-slip", tmp_path / "bad.csv", "--car", logs[0].with_suffix(".json"), "--out", tmp_path / "no"
    )
    assert code == 2 and "its sign contradicts" in said and not (tmp_path / "no").exists()
    code, said = done("side-slip", tmp_path / "bad.csv", "--out", tmp_path / "no")
    assert code == 2 and "no car" in said
