"""Mutated logs through the identification: one of each kind here, all of them by `python -m tests.fuzz.identify`."""

import pytest

from tests.fuzz.identify import outcome
from tests.fuzz.mutate import MUTATIONS


@pytest.mark.parametrize("name", MUTATIONS)
def test_no_mutated_log_is_silently_wrong(name, tmp_path):
    assert outcome(name, 1000, tmp_path) in ("right", "refused", "doubtful", "refuted")
