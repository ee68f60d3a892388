"""The chain's parameters beside the controller's: where they go, what they change, what is refused."""

import dataclasses

import numpy as np
import pytest

from absjax.encoder.known_errors import KnownErrors
from absjax.sensors.delayed import DelayedSensor
from absjax.sensors.encoder import EncoderSensor
from tuning.controllers.batch import batch_of, scored
from tuning.controllers.chain import LEARNING, Chain, of_chain, of_controller, told_through
from tuning.controllers.config import TuningConfig
from tuning.controllers.loops import with_parameters
from tuning.controllers.phase_times import short_phases
from tuning.controllers.scatter import scattered
from tuning.controllers.setup import Setup
from tuning.core.config import ConfigError

CONFIG = TuningConfig(
    setting="chain",
    chain="settled",
    roads=("dry_asphalt",),
    speeds_kmh=(36.0,),
    stop_speed_kmh=20.0,
    draws=2,
    checked=1,
    start={"eps0": 45.0, "eps1": 22.0, "eps2": 27.0, "chain.memory": 0.01},
    tune=("eps1", "chain.window", "chain.memory", "chain.harmonics"),
)


@pytest.fixture(scope="module")
def setup():
    return Setup.of(CONFIG)


@pytest.fixture(scope="module")
def batch(setup):
    return scattered(setup, "training")


def test_a_set_is_the_controllers_and_the_chains(setup):
    assert of_chain(setup.initial) == {**LEARNING["settled"], "window": 12.0, "memory": 0.01, "cutoff": 5.0}
    assert set(of_controller(setup.initial)) == {name for name in setup.initial if not name.startswith("chain.")}
    assert setup.controller({"chain.window": 5.0, "eps1": 21.0}).eps1 == 21.0
    assert setup.chain({"chain.window": 5.0}).window == 5.0
    box = setup.box()
    assert box.names == ("eps1", "chain.window", "chain.memory", "chain.harmonics")
    assert (box.low[3], box.high[3]) == (1.0, 29.0)
    edges = Setup.of(dataclasses.replace(CONFIG, chain="edges"))
    assert edges.box().high[3] == edges.initial["chain.harmonics"] == 12.0


def test_parameters_go_into_the_chain_and_its_stand_in(setup, batch):
    values = {"window": np.array([6.0, 8.0]), "memory": 0.02, "harmonics": np.array([1.0, 2.0])}
    smooth = told_through(scattered(setup, "training", stand_in=True).sensor, values)
    assert isinstance(smooth, DelayedSensor)
    np.testing.assert_allclose(smooth.events, [6.0, 8.0])
    np.testing.assert_allclose(smooth.taken_off, [2 / 60, 4 / 60])
    ratio = smooth.error(100.0) / dataclasses.replace(smooth, taken_off=0.0).error(100.0)
    np.testing.assert_allclose(ratio, np.sqrt([1 - 2 / 60, 1 - 4 / 60]), rtol=1e-6)
    sensor = batch.sensor
    assert isinstance(sensor, EncoderSensor) and isinstance(sensor.chain.speed, KnownErrors)
    told = told_through(sensor, values)
    assert told.begun is not None and told.chain.stamping.memory == 0.02
    spectrum = np.abs(np.fft.rfft(told.chain.speed.errors, axis=1))
    assert np.all(spectrum[0, 2:] < 1e-6 * spectrum[0, 1]) and spectrum[1, 2] > 1e-3 * spectrum[1, 1]
    learning = dataclasses.replace(sensor, chain=Chain().chain("edges"))
    assert told_through(learning, values).begun is None
    assert told_through(sensor, {}) is sensor and told_through(None, values) is None


def test_a_stop_is_told_by_its_own_chain(setup, batch):
    """A window of all edges for a second lags behind any wheel."""
    memory, window = np.array([0.01, 1.0, 1.0, 0.01]), np.array([12.0, 12.0, 8.0, 12.0])
    found = scored(batch, {"chain.memory": memory, "chain.window": window}, *setup.sampled_grid()).ratios[0]
    assert found[0] == found[3] < found[2] < found[1]


def test_a_chain_that_does_not_tell_is_not_tuned():
    for other in ({"setting": "sampled"}, {"chain": "window"}):
        with pytest.raises(ConfigError, match=r"chain\.window"):
            dataclasses.replace(CONFIG, start={}, **other)
    with pytest.raises(ConfigError, match=r"start: Chain\.window = 40"):
        Setup.of(dataclasses.replace(CONFIG, start={"chain.window": 40.0}))
    with pytest.raises(ConfigError, match="no_such"):
        dataclasses.replace(CONFIG, start={"chain.no_such": 1.0})


def test_a_loop_takes_the_controllers_of_them(setup, batch):
    loop = with_parameters(batch.loop, {"eps1": 21.0, "chain.memory": 0.02})
    assert loop.controller.eps1 == 21.0 and loop.controller.eps2 == setup.initial["eps2"]
    assert short_phases(setup, batch_of(setup), setup.initial) == []
