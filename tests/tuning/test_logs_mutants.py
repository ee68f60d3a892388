"""Mutated logs at the reader: read as the original, or refused in words that name what is wrong."""

import numpy as np
import pandas as pd
import pytest

from tests.fuzz.mutate import ACCELERATION, MUTATIONS, PRESSURE, TIME, VEHICLE, WHEEL, mutant, original
from tuning.logs.brake_log import parse_columns, read_log
from tuning.logs.tables import LogError

SIGNALS = {"wheel_speed": WHEEL, "vehicle_speed": VEHICLE, "brake_pressure": PRESSURE, "acceleration": ACCELERATION}


def test_there_are_as_many_as_there_should_be():
    assert len(MUTATIONS) >= 25


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", MUTATIONS)
def test_a_mutant_is_read_as_the_original_or_refused_in_words(name, seed, tmp_path):
    made = mutant(name, seed)
    path = made.written(tmp_path)
    must_read = all(answer[0] != "refused" for answer in made.answers)
    must_refuse = all(answer[0] == "refused" for answer in made.answers)
    try:
        log = read_log(path, parse_columns(made.columns))
    except LogError as error:
        assert not must_read and str(path) in str(error)
        assert all(word in str(error) for word in made.refused), error
        return
    assert not must_refuse
    if made.answers == (("same",),):
        plain = original()
        assert log.doubts == ()
        for signal in log.signals:
            if signal in SIGNALS:
                there = np.interp(log.time - log.time[0], plain[TIME], plain[SIGNALS[signal]])
                measured = log.measured[signal]
                np.testing.assert_allclose(getattr(log, signal)[measured], there[measured], rtol=1e-3, atol=6e-3)
                assert measured.mean() > 0.95


def test_a_mutant_is_made_again_from_its_seed():
    assert mutant("spikes", 5) == mutant("spikes", 5) != mutant("spikes", 6)
    assert isinstance(original(), pd.DataFrame)
