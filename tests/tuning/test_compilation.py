"""Programs of a process that has too many are dropped."""

import jax
import pytest

from tuning.core import compilation


@pytest.mark.parametrize("most, exist, dropped", [(10**9, True, False), (0, True, True), (0, False, False)])
def test_programs_are_dropped_where_they_are_many(most, exist, dropped, monkeypatch, tmp_path):
    traced, dropped = [], dropped and compilation.MAPPINGS.exists()

    @jax.jit
    def double(x):
        traced.append(x)
        return 2 * x

    monkeypatch.setattr(compilation, "MOST_MAPPINGS", most)
    if not exist:
        monkeypatch.setattr(compilation, "MAPPINGS", tmp_path / "maps")
    assert double(1.0) == double(3.0) / 3 == 2.0
    assert len(traced) == 1
    compilation.drop_if_many()
    assert double(1.0) == 2.0
    assert len(traced) == 1 + dropped
