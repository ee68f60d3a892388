"""Components written to the contracts alone: through loop, tuner, certificate, identification, command line."""

import dataclasses
import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from typer.testing import CliRunner

import tuning
from absjax import Brake, Clamped, ClosedLoop, SampledLoop, UniformRoad, Wheel, certify, ideal_distance, stop
from absjax.contracts import require_contract
from absjax.controllers.base import Controller
from absjax.encoder.wheel_speed import WheelSpeedChain
from absjax.observers.base import Design, Observer
from absjax.parameters import model
from absjax.plant.base import Plant
from absjax.sensors.base import Sensor
from absjax.tyres.base import Tyre
from tests.foreign import Filtered, FilteredDesign, Rational, Rounding, Sled, SlipThresholds
from tuning.cli import app
from tuning.logs.brake_log import read_log
from tuning.road.identify import Identification, identify

DATA = Path(tuning.__file__).parent / "data"
HERE = "tests.foreign:"


def loop_of(deep=0.25, **parts) -> ClosedLoop:
    car = Sled(Wheel(), UniformRoad(Rational(0.9, 0.12)))
    return ClosedLoop(car, Brake(lag=5e-3), SlipThresholds(deep=deep), 3.0, **parts)


def distance(deep, step=2e-3):
    return stop(loop_of(deep), 15.0, horizon=4.0, step=step).raise_if_failed().distance


def test_they_stop_located_and_sampled_as_lanes_and_one_by_one():
    depths = np.array([0.2, 0.25, 0.3])
    lanes = np.asarray(distance(depths))
    np.testing.assert_allclose(lanes, [float(distance(d)) for d in depths], rtol=1e-12)
    ideal = float(ideal_distance(loop_of(), 15.0, horizon=4.0))
    assert np.all((ideal < lanes) & (lanes < 3 * ideal))
    observed = loop_of(observer=Clamped(Filtered()))
    sampled = SampledLoop(observed, Rounding(), substeps=2)
    assert float(stop(sampled, 15.0, horizon=4.0, step=1e-3).raise_if_failed().distance) == pytest.approx(
        lanes[1], rel=0.05
    )


def test_their_gradient_against_differences():
    both = jax.jit(jax.value_and_grad(lambda d: stop(loop_of(d), 15.0, horizon=4.0, step=1e-3).distance))
    h = 1e-5
    ahead, behind = (float(both(0.25 + side)[0]) for side in (h, -h))
    assert float(both(0.25)[1]) == pytest.approx((ahead - behind) / (2 * h), rel=1e-4)


def test_an_observer_without_a_proof_is_refused_a_certificate_by_name():
    with pytest.raises(ValueError, match=r"Filtered offers no certificate"):
        certify(Filtered())
    with pytest.raises(ValueError, match=r"Filtered offers no certificate"):
        certify(Clamped(Filtered()))


def run(tmp_path, command, config, *arguments):
    path = tmp_path / "config.json"
    path.write_text(json.dumps(config))
    done = CliRunner().invoke(app, [command, "--config", str(path), "--out", str(tmp_path / "out"), *arguments])
    assert done.exit_code == 0, done.output
    return done.output, json.loads((tmp_path / "out" / "result.json").read_text())


def test_they_are_tuned_from_the_command_line(tmp_path):
    config = {
        "controller": HERE + "SlipThresholds",
        "plant": HERE + "Sled",
        "plant_parameters": {"drag": 0.1},
        "sensor": HERE + "Rounding",
        "roads": [{"tyre": HERE + "Rational", "parameters": {"top": 0.9, "where": 0.12}}],
        "speeds_kmh": [50.0],
        "stop_speed_kmh": 10.0,
        "cycle_speeds_kmh": [40.0],
        **{"starts": 1, "screened": 1, "iterations": 3, "refinements": 0, "objective": "mean"},
    }
    said, result = run(tmp_path, "tune-abs", config)
    assert "Rational (0.9, 0.12)" in said and set(result["parameters"]) == {"deep", "flat", "pace"}
    (row,) = result["rows"]
    assert row["ideal"] < row["tuned"]["distance"] <= row["untuned"]["distance"]
    assert {path.name for path in (tmp_path / "out").glob("*.png")} >= {"distances.png", "stop.png", "history.png"}


def test_an_observer_is_tuned_from_the_command_line(tmp_path, monkeypatch):
    monkeypatch.setattr("tuning.observers.tasks.held_out_rows", lambda *_: [{"cycle": "five_phase", "observer": "x"}])
    monkeypatch.setattr("tuning.observers.tasks.held_out_runs", lambda _: None)
    monkeypatch.setattr("tuning.observers.tasks.HELD_OUT_ROADS", ())
    search = {"starts": 1, "screened": 1, "iterations": 2, "refinements": 0}
    few = {"runs": 3, "duration": 1.2, "speeds": [10.0, 14.0]}
    said, result = run(tmp_path, "tune-observer", {"observer": HERE + "FilteredDesign", **few, **search})
    assert "offers no certificate" in said and result["certificate"] is None and set(result["parameters"]) == {"pull"}


def test_a_tyre_is_identified(tmp_path):
    """The log is of Burckhardt's curve: the peak comes out near, the curve is another."""
    log = read_log(DATA / "rig_65kmh.csv")
    result = identify(log, Wheel(load=2850.0), HERE + "Rational")
    (segment,) = result.segments
    assert segment.peak_friction == segment.parameters["top"] == pytest.approx(1.03, rel=0.05)
    assert set(segment.ci95) == {"top", "where", "peak_friction", "peak_slip"}
    assert Identification.from_json(json.loads(json.dumps(result.to_json()))) == result
    arguments = ["identify", str(DATA / "rig_65kmh.csv"), "--tyre", HERE + "Rational", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0 and "top" in done.output, done.output


@pytest.mark.parametrize("kind, contract", [(Rational, Tyre), (Sled, Plant), (Filtered, Observer), (Rounding, Sensor)])
def test_one_that_lacks_a_member_is_refused_by_name(kind, contract):
    require_contract(kind, contract)
    for name in [n for n in vars(contract) if not n.startswith("_") and callable(getattr(contract, n))]:
        members = {k: v for k, v in vars(kind).items() if k != name and not k.startswith(("__doc", "__dict", "__weak"))}
        with pytest.raises(ValueError, match=f"Maimed lacks {name} of the contract {contract.__module__}"):
            require_contract(type("Maimed", (), members), contract)


def test_where_they_are_put_in_they_are_checked():
    class Mute:
        pass

    for part in ("plant", "brake", "controller", "observer"):
        with pytest.raises(ValueError, match="Mute lacks"):
            dataclasses.replace(loop_of(), **{part: Mute()})
    with pytest.raises(ValueError, match="Mute lacks period, begin, flow, measure of the contract"):
        SampledLoop(loop_of(), Mute())
    with pytest.raises(ValueError, match=r"Mute lacks signal, harmonics, initial_state, clean of .*Compensation"):
        WheelSpeedChain(None, Mute())
    require_contract(FilteredDesign, Design)


def test_a_controller_that_lacks_a_method_cannot_be_made():
    @model
    class Idle(Controller):
        title, grid_step, phases, slots, cycle_phase = "idle", 1e-3, ("the driver's",), 0, None

        def initial_state(self, signals):
            return ()

    with pytest.raises(TypeError, match=r"abstract methods.* guards, rate, switch"):
        Idle()
    assert jnp.isfinite(distance(0.25))
