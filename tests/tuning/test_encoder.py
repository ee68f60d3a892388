"""Edge logs, the published table, tuning of the chain, and the stop told the truth."""

import json
from importlib import resources

import jax
import numpy as np
import pytest

from absjax.encoder.encoder import Encoder
from absjax.loop.ideal import ideal_distance
from tuning.core.config import ConfigError
from tuning.core.journal import Journal
from tuning.encoder import imperfections
from tuning.encoder.analysis import order_spectrum, study_log
from tuning.encoder.bench import PERIOD, bench_of, joined, mean_errors
from tuning.encoder.bench import reference as reference_of
from tuning.encoder.chains import filtered_chain, measured_chain, published_chain
from tuning.encoder.config import EncoderConfig
from tuning.encoder.loop import HORIZON, SPEED, braking_loop, course, loop_row
from tuning.encoder.study import tuned_chain
from tuning.encoder.tasks import chain_for, tune
from tuning.encoder.tune import EncoderProblem, EncoderResult, Form, training_benches
from tuning.logs.edges import EdgeLog, read_edges
from tuning.logs.tables import LogError
from tuning.logs.teeth import passings_of
from tuning.logs.tooth_errors import tooth_errors

LOG = resources.files("tuning") / "data" / "encoder_edges.csv"
SMALL = EncoderConfig(
    events=(8, 12),
    harmonics=(2, 3),
    encoders=2,
    held_out=2,
    references=("constant",),
    duration=0.6,
    settle=0.2,
    starts=2,
    screened=16,
    iterations=2,
)


def test_a_log_of_edges_tells_the_encoder_that_made_it():
    """It has e / r = 0.004, teeth within 0.006 cycles, and two edges less than it should."""
    with resources.as_file(LOG) as path:
        log = read_edges(path, teeth=60)
    assert log.stamps[0] > 2**31 - 2**20 and log.stamps[-1] > 2**31
    errors = tooth_errors(passings_of(log))
    assert errors.missing == 2
    assert errors.eccentricity == pytest.approx(0.004, rel=0.03)
    assert errors.tolerance == pytest.approx(0.006, rel=0.1) and 0.0005 < errors.jitter < 0.0012
    study = study_log(log, filtered_chain())
    assert study.coefficients["speed"].shape == (12,)
    assert study.valid[100:].all() and np.isfinite(study.acceleration).all()
    measured, compensated = (order_spectrum(study, "acceleration", c, 6) for c in (False, True))
    assert (measured > 5 * compensated).all()
    with pytest.raises(LogError, match=r"edges within 0\.1 s; 32 at most"):
        study_log(log, filtered_chain(), period=0.1)
    with pytest.raises(LogError, match="not a whole number of ticks"):
        study_log(log, filtered_chain(), period=1.0005e-3)


def test_edges_of_a_fine_encoder_tell_what_it_was_made_with():
    """Aguado-Rojas 2019, Fig. 5.3 (b): 1024 pulses, 100 revolutions."""
    made = imperfections.ENCODERS["1024 pulses"]
    errors = tooth_errors(passings_of(imperfections.steady_log(Encoder.random(3, **made))))
    (row,) = imperfections.transition_rows({"1024 pulses": errors})
    assert errors.mean.size == 1024 and errors.missing == 0
    for name, found in (("e / r", "e / r"), ("teeth", "teeth within [cycles]"), ("jitter", "jitter [cycles]")):
        assert row[found] == pytest.approx(row[f"{name}, made with"], rel=0.04)


def test_each_model_of_the_errors_fits_its_own_signal():
    """Aguado-Rojas 2019, remark 3: the coefficients of position, speed and acceleration are not the same."""
    found = imperfections.learned()
    for name, values in found.recursive.items():
        np.testing.assert_allclose(values, found.batch[name], atol=2e-5)
    assert abs(found.recursive["position"][0] - found.recursive["acceleration"][0]) > 1e-3
    for row in found.rows:
        signal, others = row.pop("rms of").split(" ")[0], dict(row)
        own = others.pop(f"with those of the {signal}")
        assert own < 0.2 * others["not compensated"] and own < min(others.values())


@pytest.mark.parametrize(("name", "least"), [("constant", (7.5, 5.5)), ("varying", (3.5, 3.0))])
def test_published_ratios(name, least):
    """At least what was measured elsewhere: 6 and 4.4 with the source's law, 7.5 and 5.5 with filtered regressors."""
    bench = bench_of(Encoder.random(range(16)), name, 7.0, 3.0)
    measured = np.array(mean_errors(bench, measured_chain()))
    filtered = measured / mean_errors(bench, filtered_chain())
    assert (filtered > least).all()
    if name == "constant":
        assert measured == pytest.approx([0.298, 26.0], rel=0.02)
        assert (measured / mean_errors(bench, published_chain()) > (6.0, 4.4)).all()
        assert (measured / mean_errors(bench, tuned_chain()) > filtered).all()


def test_tuning_its_costs_and_gradients_and_what_it_writes(tmp_path):
    report = tune(SMALL, tmp_path, lambda i, n, cost: None, Journal())
    data = json.loads(json.dumps(report.results[tmp_path / "result.json"]))
    result = EncoderResult.from_json(data)
    assert json.loads(json.dumps(result.to_json())) == data
    assert {path.name for path in report.files} == {path.name for path in tmp_path.iterdir()}
    assert np.shape(result.history) == (2, 2) and np.min(result.history) <= result.history[0][0]
    rows = {row["signals"]: row for row in result.held_out}
    assert rows["measured"]["speed ratio"] == 1 < rows["tuned"]["speed ratio"]
    pairs = [(row["events"], row["harmonics"]) for row in result.grid]
    assert pairs == [(8, 2), (8, 3), (12, 2), (12, 3)]
    assert (result.events, result.harmonics) == pairs[int(np.argmin([row["cost"] for row in result.grid]))]

    benches, initial = training_benches(SMALL), SMALL.initial()
    chain = Form.of(SMALL, 8, 3).chain(initial)
    direct = np.mean([np.log(np.asarray(e)).mean() for bench in benches for e in bench.errors(chain)])
    assert result.grid[1]["cost"] == pytest.approx(direct, rel=1e-9)
    problem = EncoderProblem.of(SMALL)
    point = problem.given[0] + 0.1 * np.arange(8)
    steps = 1e-4 * np.concatenate([np.eye(8), -np.eye(8)])
    values = problem.judge(point + steps)
    cost, gradient = problem.costs_and_gradients(np.stack([point, point]), None)
    assert float(cost[0]) == pytest.approx(values.mean(), rel=1e-6)
    np.testing.assert_allclose(gradient[0], (values[:8] - values[8:]) / 2e-4, rtol=1e-5, atol=1e-8)


def test_a_tuned_chain_is_taken_for_a_log_of_as_many_teeth():
    with resources.as_file(LOG) as path, resources.as_file(LOG.parent / "encoder_chain.json") as tuned:
        log = read_edges(path, teeth=60)
        chain = chain_for(log, 15, None, tuned)
        assert jax.tree.structure(chain) == jax.tree.structure(tuned_chain()) and not chain.speed.through_edges
        every = chain_for(log, 15, None, None)
        assert every.speed.harmonics == 29 and every.speed.through_edges
        with pytest.raises(LogError, match="tuned for 60 teeth, the log is of 48"):
            chain_for(EdgeLog("x", log.stamps, log.clock, 48), 15, None, tuned)
        with pytest.raises(LogError, match="not a result of tune-encoder"):
            chain_for(log, 15, None, tuned.parent / "controllers.json")
        with pytest.raises(LogError, match="harmonics = 30 must lie between 1 and 29"):
            chain_for(log, 15, 30, None)


def test_references():
    varying = jax.tree.map(np.asarray, reference_of("varying", 5.0))
    np.testing.assert_allclose(np.gradient(varying.angle, PERIOD)[1:-1], varying.speed[1:-1], atol=1e-3)
    np.testing.assert_allclose(np.gradient(varying.speed, PERIOD)[1:-1], varying.acceleration[1:-1], atol=0.02)
    assert varying.speed[[0, 999, 2600, 4999]] == pytest.approx([107.0, 107.0, 40.0, 80.0], abs=1e-6)
    assert np.asarray(joined([0.0, 0.1], [5.0, 0.0], 0.3).speed)[100:].max() == 0.0
    with pytest.raises(ValueError, match="'sinusoid' is unknown; there are constant, varying, braking"):
        reference_of("sinusoid", 1.0)


def test_the_stop_told_the_truth_is_near_the_ideal():
    found = course(None)
    ideal = float(ideal_distance(braking_loop(), SPEED, horizon=HORIZON))
    row = loop_row("the truth", found, ideal)
    assert row["do not end"] == row["stuck"] == 0 and 0 < row["mean above ideal [%]"] < 5
    assert row["x2 to"] == pytest.approx(40, abs=1) and row["x2 from"] == pytest.approx(-30, abs=1)
    braking = reference_of("braking", 2.0)
    wheel = found.signals.wheel_speed[0]
    np.testing.assert_allclose(np.asarray(braking.speed)[[0, 999, 1000, 1999]], wheel[[0, 0, 0, 999]])


def good_log(edges=400):
    return [str(5_000_000_000 + 1000 * k) for k in range(edges)]


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        (lambda rows: rows[:5] + ["12.5"] + rows[5:], {}, "column 'edge_tick', row 7: '12.5' is not an integer"),
        (lambda rows: rows[:5] + rows[3:], {}, "row 7: 5000003000 goes back in time, and not as a counter of 16, 24"),
        (lambda rows: rows[:200], {}, "200 edges, 5 revolutions of 60 needed"),
        (lambda rows: rows, {"clock": 1e-9}, "turns at 1.05e[+]05 rad/s; is the clock right"),
        (lambda rows: rows, {"clock": -1.0}, "clock = -1 s must be at least 1e-09 and below 1"),
        (lambda rows: rows, {"teeth": 2}, "teeth = 2"),
        (lambda rows: rows, {"column": "stamp"}, "no column 'stamp'; there are edge_tick"),
    ],
)
def test_errors_name_file_column_and_row(change, options, message, tmp_path):
    path = tmp_path / "edges.csv"
    path.write_text("\n".join(["edge_tick", *change(good_log())]) + "\n")
    with pytest.raises(LogError, match=message) as error:
        read_edges(path, **{"teeth": 60, **options})
    assert options or "edges.csv" in str(error.value)


def test_large_ticks_are_read_exactly(tmp_path):
    path = tmp_path / "edges.csv"
    path.write_text("edge_tick\n" + "\n".join(str(10**17 + 1000 * k + 1) for k in range(400)))
    log = read_edges(path, teeth=60)
    assert isinstance(log, EdgeLog) and log.stamps[0] == 10**17 + 1


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"start": {"beta": 1.0}}, "'beta' is unknown; there are speed_forgetting"),
        ({"references": ["sinusoid"]}, r"references\[0\] = 'sinusoid': must be 'constant', 'varying' or 'braking'"),
        ({"events": [2]}, r"events\[0\] = 2: must be greater than or equal to 3"),
        ({"duration": 9.0}, r"duration = 9.0 must be at most 5 s"),
        ({"through_edges": 2}, "through_edges = 2: must be less than or equal to 1"),
        ({"harmonics": [30]}, "harmonics = .* below half the teeth"),
        ({"settle": 9.0}, "settle = 9.0 must be below"),
        ({"tolerance": -1.0}, "tolerance"),
        ({"limits": {"speed_gain": [3.0, 2.0]}}, "limits.speed_gain"),
        ({"start": {"speed_cutoff": 100.0}}, "start.speed_cutoff = 100.0 must be in"),
    ],
)
def test_configurations_are_refused_by_name(entries, message):
    with pytest.raises(ConfigError, match=message):
        EncoderConfig.from_json(entries)
