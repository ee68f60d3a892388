"""Simulated scenarios, metrics, gain tuning, logs with force, and what the shipped gains are worth."""

import dataclasses
import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from absjax.observers import OBSERVERS
from absjax.observers.adaptive import AdaptiveObserver
from absjax.observers.certificate import certify
from absjax.observers.run import observe
from absjax.observers.switched import constant_stiffness
from absjax.parameters import defaults_of, span_of
from absjax.plant.wheel import Wheel
from absjax.results import RolloutError
from absjax.tyres.surfaces import surface
from tuning.core.config import ConfigError
from tuning.core.journal import Journal
from tuning.core.objective import Objective
from tuning.logs.brake_log import BrakeLog
from tuning.logs.tables import LogError
from tuning.observers import curves, singular
from tuning.observers.bench import bench_of, training_runs
from tuning.observers.config import ObserverConfig
from tuning.observers.metrics import crossings, rms, settling, within
from tuning.observers.scenarios import BLEND, concatenate, simulate
from tuning.observers.signals import observer_signals
from tuning.observers.study import (
    HeldOut,
    estimates,
    gain_sets,
    held_out_runs,
    rig_adaptive_rows,
    rig_sets,
    rig_states,
    rig_study,
    speed_rows,
    table_runs,
)
from tuning.observers.tasks import rig_log, tune
from tuning.observers.tracking import drive, loops, summary
from tuning.observers.tune import ObserverProblem, ObserverResult, trade_off, tune_observer

TINY = ObserverConfig(
    observer="unknown_road",
    runs=3,
    duration=1.2,
    speeds=(10.0, 14.0),
    starts=2,
    screened=2,
    iterations=4,
    refinements=1,
)


@pytest.fixture(scope="module")
def runs():
    return training_runs(TINY)


def test_metrics_on_signals_made_by_hand():
    time = np.arange(100) * 0.01
    error = np.zeros((2, 100))
    error[0, 7], error[0, 30], error[1, 60:] = 1.5, -2.0, np.nan
    begins, ends = np.array([[0.0, 0.52]] * 2), np.array([[0.5, 1.0]] * 2)
    np.testing.assert_allclose(settling(time, error, begins, ends), [[0.3, 0.0], [0.0, 0.47]], atol=1e-12)
    inside = within(time, begins, ends)
    assert inside[:, :50].all() and not inside[:, 50:52].any() and inside[:, 52:].all()
    np.testing.assert_allclose(rms(np.array([[3.0, 4.0, 9.0]]), np.array([[True, True, False]])), [np.sqrt(12.5)])
    np.testing.assert_allclose(
        crossings(time, np.sin(2 * np.pi * 2 * (time - 0.123))), [0.123, 0.373, 0.623, 0.873], atol=1e-4
    )


@pytest.mark.parametrize("excitation", ["five_phase", "two_phase"])
def test_simulated_runs_are_what_they_say(excitation):
    pair = [surface("dry_asphalt"), surface("wet_asphalt")]
    cases = [pair, pair[::-1], pair], [0.6, 0.65, 0.6], [14.0, 18.0, 14.0]
    # As many as are simulated for the tuning, for each excitation: no program for this alone.
    count = {"five_phase": 3, "two_phase": 2}[excitation]
    surfaces, changes, speed = (of_each[:count] for of_each in cases)
    runs = simulate(surfaces, changes, speed=speed, duration=1.2, excitation=excitation).select([0, 1])
    time = runs.time
    np.testing.assert_allclose(runs.samples.speed, np.array([[14.0], [18.0]]) - 1.96 * time, rtol=1e-12)
    np.testing.assert_allclose(runs.begins, [[0.0, 0.6 + BLEND], [0.0, 0.65 + BLEND]])
    for i, tyres in enumerate((pair, pair[::-1])):
        for k, tyre in enumerate(tyres):
            on = (time >= runs.begins[i, k]) & (time < runs.ends[i, k])
            np.testing.assert_allclose(runs.stiffness[i, on], tyre.stiffness(runs.slip[i, on]), rtol=1e-12, atol=1e-14)
        # R w' - v' is the rate of slip times speed.
        rate = np.gradient(runs.slip[i] * runs.samples.speed[i], 1e-3)
        assert np.quantile(np.abs(rate - runs.samples.y[i])[5:-5], 0.9) < 0.2
    assert runs.cycling.all()
    both = concatenate([runs, runs])
    assert both.runs == 4 and both.select([1, 2]).runs == 2
    np.testing.assert_array_equal(both.select([3]).stiffness[0], runs.stiffness[1])


def test_scenarios_are_refused_by_name():
    dry = surface("dry_asphalt")
    with pytest.raises(ValueError, match="2 changes need 3 surfaces"):
        simulate([[dry, dry]], [[0.1, 0.2]])
    with pytest.raises(ValueError, match="the speed falls to"):
        simulate([[dry, dry]], [1.0], speed=10.0, duration=9.0)


def test_gradient_of_the_cost_against_differences(runs):
    """Of the very program that descends, a set in each of its two lanes."""
    problem = ObserverProblem.of(dataclasses.replace(TINY, noise_weight=0.2), bench_of(TINY, runs))
    assert problem.objective == Objective("power") and len(problem.box.names) == 7
    at = problem.box.point({name: 1.1 * value for name, value in defaults_of(TINY.design).items()})
    gradient = np.asarray(problem.costs_and_gradients(np.stack([at, at]), None)[1])[0]
    for i in (0, 3, 4, 6):
        h = 1e-5 * np.eye(at.size)[i]
        ahead, behind = np.asarray(problem.costs_and_gradients(np.stack([at + h, at - h]), None)[0])
        assert gradient[i] == pytest.approx((ahead - behind) / 2e-5, rel=1e-4, abs=1e-7)


def test_tuning_improves_certifies_and_can_be_read_back(runs):
    bench = bench_of(TINY, runs)
    result = tune_observer(TINY, bench)
    problem = ObserverProblem.of(TINY, bench)
    points = np.stack([problem.box.point(values) for values in (TINY.initial(), result.parameters)])
    costs = problem.judge(points)
    assert costs[1] < costs[0]
    assert result.certificate["holds"] and certify(result.observer()).holds
    assert ObserverResult.from_json(read_back(result.to_json())) == result
    assert len(result.history) == TINY.iterations and len(result.history[0]) == TINY.starts
    np.testing.assert_allclose(problem.judge(np.repeat(points, 20, axis=0)), np.repeat(costs, 20), rtol=1e-12)
    # As many as there are: a program less. One of them twice.
    some = np.array([0, 2, 2])
    costs, gradients = problem.costs_and_gradients(points, some)
    lone = dataclasses.replace(problem, bench=problem.bench.of(some))
    np.testing.assert_allclose(costs, lone.costs_and_gradients(points, None)[0], rtol=1e-12)
    assert np.isfinite(gradients).all()


def read_back(data):
    return json.loads(json.dumps(data))


def test_noise_levels_are_dealt_out_to_the_runs(runs):
    bench = bench_of(dataclasses.replace(TINY, noise=(0.0, 2.0)), runs)
    np.testing.assert_allclose(np.std(bench.noise, axis=1), [0.0, 2.0, 0.0], atol=0.15)


def test_trade_off_goes_from_quick_to_quiet():
    config = dataclasses.replace(TINY, iterations=6, learning_rate=0.2)
    curve, given = trade_off(config, [config.initial()], [0.01, 10.0])
    assert curve[0]["mean"] <= curve[1]["mean"] and curve[0]["noise"] > curve[1]["noise"]
    assert len(given) == 1 and given[0]["noise_weight"] is None


@pytest.mark.parametrize("kind", OBSERVERS)
def test_every_kind_builds_certified_observers_anywhere_in_its_box(kind):
    rng, wheel = np.random.default_rng(0), Wheel()
    design = OBSERVERS[kind]
    spans = {name: span_of(design, name) for name in defaults_of(design)}
    for _ in range(5):
        drawn = {n: np.exp(rng.uniform(*np.log(span))) for n, span in spans.items()}
        assert certify(design(**drawn).observer(wheel)).holds
    assert certify(design().observer(wheel)).holds


@pytest.mark.parametrize(
    "entries, message",
    [
        ({"observer": "kalman"}, "observer: 'kalman' is unknown; there are constant"),
        ({"start": {"frequenzy": 1.0}}, "start: 'frequenzy' is unknown"),
        (
            {"start": {"frequency": 9.0}, "limits": {"frequency": [10, 20]}},
            r"start.frequency = 9.0 must be in \[10, 20\]",
        ),
        ({"tune": ["pole"]}, "tune: 'pole' is unknown"),
        ({"limits": {"ratio": [2.0, 1.0]}}, "limits.ratio"),
        ({"roads": ["mud", "ice"]}, "surface 'mud' is unknown"),
        ({"roads": ["snow"]}, "roads = .* must be empty, or two"),
        ({"runs": 0}, "runs = 0"),
        ({"substeps": 0}, "substeps = 0"),
        ({"substeps": 1.5}, "substeps = 1.5: must be a valid integer"),
        ({"noise": [0.5, -1.0]}, r"noise\[1\] = -1.0: must be greater than or equal to 0"),
        ({"noise": 0.5}, "noise = 0.5: must be a list$"),
        ({"speeds": [3.0, 30.0]}, "speeds = .* must be above"),
        ({"speeds": [30.0]}, r"^speeds\[1\] is missing$"),
        ({"wheel": {"radius": -1.0}}, r"wheel: Wheel\.radius = -1"),
        ({"screened": 1}, "screened = 1"),
        ({"gains": 1}, "configuration: 'gains' is unknown"),
    ],
)
def test_configurations_are_refused_by_name(entries, message):
    with pytest.raises(ConfigError, match=message):
        ObserverConfig.from_json(entries)


def test_configuration_round_trip():
    config = ObserverConfig(observer="adaptive", substeps=2, noise_weight=None, limits={"ratio": (0.5, 2.0)})
    assert ObserverConfig.from_json(read_back(config.to_json())) == config


def log_of(time, speed, wheel_speed, pressure):
    return BrakeLog("made.csv", time, wheel_speed, speed, pressure)


def test_signals_of_a_log_keep_cubics_and_refuse_uneven_sampling():
    time = np.arange(400) * 1e-3
    wheel_speed = 60 - 8 * time + 30 * time**2 - 40 * time**3
    log = log_of(time, 18.0 - 2 * time, wheel_speed, 10 + 5 * time)
    signals = observer_signals(log, Wheel())
    np.testing.assert_allclose(signals.samples.y, 0.3 * (-8 + 60 * time - 120 * time**2) + 2, atol=1e-8)
    np.testing.assert_allclose(signals.slip, 0.3 * wheel_speed / (18 - 2 * time) - 1, atol=1e-10)
    uneven = log_of(np.sort(np.append(time[:-1], 0.0125e-1)), log.vehicle_speed, wheel_speed, log.brake_pressure)
    with pytest.raises(LogError, match="an observer needs one period"):
        observer_signals(uneven, Wheel())
    with pytest.raises(LogError, match="holds 3 samples"):
        observer_signals(log, Wheel(), window=2e-3)


def test_adaptive_beats_four_states_on_the_rig_log():
    """Aguado-Rojas 2019, Fig. 3.14: the more roads the 4-state observer has to cover, the worse it gets."""
    log, wheel = rig_log()
    tyre = dataclasses.replace(surface("dry_asphalt"), c1=1.181, c2=26.9, c3=0.862)
    default = [gains for gains in gain_sets() if "default" in gains.label]
    study = rig_study(log, wheel, tyre, rig_sets(tyre, default))
    error = {row["observer"]: row["XBS rms"] for row in study.rows}
    four = [error[f"4-state, bounds of {name}"] for name in ("the rig's road", "dry and wet", "all roads")]
    assert error["adaptive, default"] < 0.6 * four[0] and four[0] < four[1] < four[2]
    assert error["adaptive, default"] < 0.35
    states = rig_states(study, wheel, tyre)
    np.testing.assert_allclose(states["w2"] - 26.9 / 213.75 * states["w1"], study.truth, atol=1e-12)
    observed = observe(default[0].observer(wheel), study.signals.samples, log.period, substeps=default[0].substeps)
    (row,) = rig_adaptive_rows(study, states, {"default": observed})
    assert row["w1, rms"] < 0.1 * np.std(states["w1"]) and row["d, rms"] < 0.3 * row["d, true"] == 0.3 * 23.2
    assert row["c, rms"] > 0.5 * row["c, true"]


def test_shipped_gains_are_certified_and_settle_on_roads_not_tuned_on():
    """Worst and mean settling after changes between roads none was tuned on, snow and cobblestones among them."""
    sets = {gains.label: gains for gains in gain_sets()}
    for gains in sets.values():
        assert certify(gains.observer(Wheel())).holds
    times = {label: [] for label in sets}
    for excitation in ("five_phase", "two_phase"):
        held_out = held_out_runs(excitation, instants=1).runs
        assert held_out.runs > 80
        for label, gains in sets.items():
            error = estimates(gains, held_out).stiffness - held_out.stiffness
            times[label].append(settling(held_out.time, error, held_out.begins, held_out.ends))
    for before, after in (("4-state, poles -60", "4-state, tuned"), ("adaptive, default", "adaptive, tuned")):
        assert np.max(times[after]) < np.max(times[before])
        for k in range(2):
            assert times[after][k].mean() < times[before][k].mean()


def test_the_published_observer_in_the_loop_and_what_it_asks_of_a_run():
    """Hoang 2014, Figs 4.1 and 4.2: the common P decreases throughout; one gain for both signs diverges."""
    ride = singular.ride()
    lyapunov = ride.lyapunov
    assert np.all(np.diff(lyapunov) < 1e-9 * lyapunov[:-1]) and lyapunov[-1] < 1e-4 * lyapunov[0]
    poles = np.linalg.eigvals(np.asarray(ride.observer.A) - np.outer(ride.observer.plus, [1.0, 0.0, 0.0]))
    np.testing.assert_allclose(poles, -0.1 * 187.5, rtol=1e-3)
    table = {row["observer"]: row for row in singular.rows(ride)}
    assert table["3 states, in the loop"]["settles after the first switching [s]"] < 1.0
    one_gain = table["3 states, one gain for both signs"]
    assert one_gain["settles after the first switching [s]"] == "never" and one_gain["XBS rms, second half"] > 100
    cycling, continuous = singular.excited_rows({}, ride)
    assert cycling["assumptions"] == "hold" and cycling["admissible"] == "yes"
    assert cycling["dwell, at least [ms]"] < cycling["dwell time [ms]"]
    assert continuous["assumptions"].startswith("fail: (3.17)") and continuous["admissible"] == "no"


def test_a_vanishing_dwell_time_leaves_no_decay():
    """Hoang 2014, section 2.1.3: Balde's invariant says never uniformly asymptotically stable without a dwell time."""
    observer = singular.placed(constant_stiffness(Wheel()), Wheel())
    plus, minus = np.outer(observer.plus, [1.0, 0.0]), np.outer(observer.minus, [1.0, 0.0])
    a_plus, a_minus = np.asarray(observer.A) - plus, minus - np.asarray(observer.A)
    gamma = 0.5 * (np.trace(a_plus) * np.trace(a_minus) - np.trace(a_plus @ a_minus))
    assert gamma == pytest.approx(-np.sqrt(np.linalg.det(a_plus) * np.linalg.det(a_minus)), rel=1e-9)
    rates = singular.decay_at(observer, np.array([1e-3, 2e-3, 1.0]))
    assert rates[1] / rates[0] == pytest.approx(4.0, rel=0.01)
    assert 0.5 * 0.1 * 187.5 < rates[2] < 0.1 * 187.5


def test_two_states_without_control_look_alike():
    time, pair = singular.indistinguishable(300.0)

    def slope(t, y, xbs):
        return -187.5 / singular.SPEED * xbs * y - 4.375 * 300.0

    for xbs, values in zip((0.5, 3.0), pair):
        expected = solve_ivp(slope, (0, time[-1]), [0.0], t_eval=time, args=(xbs,), rtol=1e-10, atol=1e-10).y[0]
        np.testing.assert_allclose(values, expected, atol=1e-6)
    assert np.all(singular.indistinguishable(0.0)[1] == 0.0)


def test_the_basis_is_as_printed_between_its_rates_and_not_outside_them():
    """Hoang et al. 2014, Table I."""
    rows = {row["road"]: row for row in curves.rows()}
    for name in curves.PUBLISHED:
        assert float(rows[name]["off the printed"]) < 6e-4 and rows[name]["largest difference of mu"] < 0.025
    assert rows["dry_cobblestones, [A] Table 2.1"]["largest difference of mu"] > 0.1


def test_wrong_vehicle_speed_moves_the_estimate_but_not_its_zero_crossings():
    four = next(gains for gains in gain_sets() if gains.label == "4-state, poles -60")
    rows = speed_rows([four], table_runs("five_phase").select([0, 12]), factors=(0.8, 1.0, 1.2))
    assert rows[1]["XBS rms"] < 0.1 < rows[0]["XBS rms"] < 0.4 and 0.1 < rows[2]["XBS rms"] < 0.4
    assert all(row["off by > 50 ms"] == 0 and row["95 % [ms]"] < 5 for row in rows)


def test_tracking_keeps_cycling_where_open_loop_locks():
    """Hoang et al. 2014, Fig. 4: dry, wet at 3 s, snow at 4 s."""
    all_loops = loops()
    slow, quick = (summary(drive(rates, all_loops[f"open loop, {rates} rates"])) for rates in ("slow", "quick"))
    assert slow["cycles on dry"] == 1 and slow["on snow"] == 0 and quick["locked above 15 km/h [s]"] > 0.5
    for kind in ("4-state", "adaptive"):
        ride = summary(drive(kind, all_loops[f"tracking, {kind} observer"]))
        assert ride["on snow"] >= 3 and ride["longest cycle [s]"] < 0.7 and ride["locked above 15 km/h [s]"] == 0


def test_a_ride_with_a_step_too_large_for_its_observer_is_refused():
    quick = AdaptiveObserver.placed(Wheel(), (4e3, 4e6), (4e4, 1e4))
    loop = dataclasses.replace(loops()["tracking, adaptive observer"], observer=quick)
    with pytest.raises(RolloutError, match=r"STEP_TOO_LARGE: a step of 0\.00025 s is .* times"):
        drive("coarse", loop)


def test_a_task_writes_what_it_says(tmp_path, monkeypatch):
    every = held_out_runs("five_phase", instants=1)
    few = HeldOut(every.runs.select(slice(0, None, 3)), every.changed_to[::3])
    monkeypatch.setattr("tuning.observers.tasks.held_out_runs", lambda excitation: few)
    report = tune(TINY, tmp_path, lambda i, n, cost: None, Journal())
    assert {path.name for path in report.files} == {"tables.json", "history.png", "held_out.png"}
    assert all(path.stat().st_size > 1000 for path in report.files)
    result = ObserverResult.from_json(json.loads(json.dumps(report.results[tmp_path / "result.json"])))
    assert result.parameters.keys() == defaults_of(TINY.design).keys() and result.certificate["holds"]
    assert report.verdict is not None and report.verdict.startswith("certified") and report.reasons
