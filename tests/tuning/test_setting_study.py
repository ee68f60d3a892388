"""Sets by setting: which there are, what is told of each, and that a set is judged with the chain it was tuned with."""

import dataclasses
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np

from tuning.controllers import figures, report
from tuning.controllers import tune as tuning_of
from tuning.controllers.command import run_of
from tuning.controllers.recipes import recipes, running_sets, tuned_sets
from tuning.controllers.setup import Setup
from tuning.controllers.splits import SplitFigures
from tuning.controllers.study import by_setting
from tuning.controllers.study.by_setting import SETTINGS, Judged
from tuning.controllers.study.descents import passed
from tuning.controllers.study.running import run_settings
from tuning.core.box import Box
from tuning.core.problem import Problem
from tuning.core.report import table_name

FINE = SplitFigures("test", "chain", 20, 1.0345, 1.071, 0, 0, 0)


def test_shipped_sets_are_those_of_their_recipes():
    names = {name for name, config in recipes().items() if config.setting != "located" and config.vehicle is None}
    assert len(running_sets()) == len(names) and {c.controller for c in running_sets()} == set(by_setting.controllers())
    for config in running_sets():
        setup = Setup.of(config)
        setup.box()
        assert all(float(getattr(setup.controller(), field)) >= 10.0 for field in setup.kind.thresholds)
        assert config.controller in tuned_sets() and config.vehicle is None


def test_a_set_is_judged_with_its_own_chain():
    sets = by_setting.contestants("five_phase")
    assert list(sets)[:2] == ["untuned", "truth"] and set(sets) == {"untuned", "truth", "1 ms", "5 ms", "chain"}
    assert "chain.memory" in sets["chain"] and "chain.memory" not in sets["truth"]
    base = dataclasses.replace(tuned_sets()["five_phase"], start={}, conditions=by_setting.ONLY_ENCODERS)
    for where in SETTINGS:
        setup = where.of(base)
        complete = by_setting.completed(setup, sets)
        assert {tuple(values) for values in complete.values()} == {tuple(setup.initial)}
        assert complete["truth"]["eps0"] == sets["truth"]["eps0"] != complete["untuned"]["eps0"]
        if where.label == "chain":
            assert complete["chain"]["chain.memory"] == sets["chain"]["chain.memory"]
            assert complete["truth"]["chain.memory"] == 0.012


def test_what_fails_stands_beside_the_mean():
    failing = dataclasses.replace(FINE, unfinished=2, stuck=1)
    assert by_setting.cell(FINE) == "3.45, 7.10"
    assert by_setting.cell(failing) == "3.45, 7.10 (2 do not end, 1 stick)"
    assert by_setting.cell(dataclasses.replace(FINE, mean=None, worst=None, unfinished=20)) == "none ends"
    found = [Judged("five_phase", "chain", where.label, FINE) for where in SETTINGS]
    (row,) = by_setting.table(found)
    assert row == {"controller": "five-phase", "tuned for": "chain", **{w.label: "3.45, 7.10" for w in SETTINGS}}
    (line,) = by_setting.scattered_rows("five_phase", iter([failing]))
    assert (line["mean above ideal [%]"], line["do not end"], line["stuck"]) == ("3.45", 2, 1)
    drawn = by_setting.figure(found)
    assert [axes.get_title() for axes in drawn.axes] == [f"judged: {where.label}" for where in SETTINGS]
    plt.close(drawn)


def test_without_a_set_for_the_chain_none_is_judged_in_scattered_stops(monkeypatch, tmp_path):
    sets = by_setting.contestants("five_phase")
    monkeypatch.setattr(by_setting, "contestants", lambda _: {label: sets[label] for label in ("untuned", "1 ms")})
    monkeypatch.setattr(
        by_setting, "judged", lambda *_: [Judged("five_phase", "1 ms", w.label, FINE) for w in SETTINGS]
    )
    (report,) = run_settings(tmp_path, ("five_phase",), 8, 100)
    assert next(iter(report.tables.values())) == by_setting.table(by_setting.judged())


def test_the_tables_of_a_tuning_for_a_setting_have_files_of_their_own(monkeypatch, tmp_path):
    found = SimpleNamespace(on_limit=[], warnings=[], breached=None, splits=[FINE], interrupted=False, to_json=dict)
    monkeypatch.setattr(tuning_of, "tune_abs", lambda *_, **__: found)
    monkeypatch.setattr(figures, "tuning_figures", lambda *_: [])
    for name in ("parameter_line", "cycles_line", "tuning_rows", "split_rows"):
        monkeypatch.setattr(report, name, lambda _: [{"a": 1.0}])
    told = run_of(recipes()["five_phase_at_1_ms"], tmp_path, "five phases")(None, None)
    assert len({table_name(title) for title in told.tables}) == len(told.tables) == 2


class Slope(Problem):
    """Down along the first of two parameters."""

    box = Box(("a", "b"), (0.1, 0.1), (10.0, 10.0))

    def costs_and_gradients(self, points, members):
        return points[:, 0], np.tile([1.0, 0.0], (len(points), 1))

    def judge(self, points):
        raise AssertionError("the points passed are judged by whoever asks for them")


def test_points_passed_begin_at_the_starts_and_go_down():
    starts = np.array([[0.0, 0.5], [1.0, -0.5]])
    points = passed(Slope(), starts, 5)
    assert points.shape == (5, 2, 2)
    np.testing.assert_array_equal(points[0], starts)
    assert np.all(np.diff(points[:, :, 0], axis=0) < 0) and np.all(points[:, :, 1] == starts[:, 1])
