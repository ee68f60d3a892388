"""The study of the controllers: shipped sets against the published table, certificates, robustness, failure."""

import dataclasses

import numpy as np
import pytest

from absjax.manoeuvre import Outcome
from tuning import phase_study, robustness
from tuning.controllers import CONTROLLERS
from tuning.cycles import CONTRACTION_CHARGE, CycleRow, certify_cycles, exact_charges
from tuning.distance_study import (
    DEFAULTS,
    Distances,
    Study,
    best_rows,
    default_sets,
    distance_rows,
    distances,
    reached,
    tuned_sets,
)


def test_every_controller_has_a_tuned_set():
    assert set(tuned_sets()) == set(CONTROLLERS)
    for name, config in tuned_sets().items():
        assert config.controller == name
        assert (config.rate_limit, config.lag, config.threshold_floor) == (750.0, 0.005, 10.0)
        controller = config.base_controller()
        assert all(float(getattr(controller, field)) >= 10.0 for field in controller.thresholds)
    assert tuned_sets()["two_phase"].observer == "adaptive"


@pytest.mark.parametrize("name", DEFAULTS)
def test_the_hard_rows_are_reached(name):
    """Dry cobblestones and wet asphalt leave the least room; the whole table takes minutes (`abs-study`)."""
    where = (("dry_cobblestones", "wet_asphalt"), (60.0,))
    before = distances(default_sets()[name], False, *where)
    located, sampled = (distances(tuned_sets()[name], sampled, *where) for sampled in (False, True))
    rows = [("dry_cobblestones", 60.0, 14.16), ("wet_asphalt", 60.0, 17.67)]
    done = Study(rows, {name: before}, {name: located}, {name: sampled})
    assert reached(done, name) == [True, True]
    assert [row["<= published"] for row in distance_rows(done, name)] == ["yes", "yes"]
    assert best_rows(done)[0]["best but for the true XBS"] == name.replace("_", "-")
    published = {"five_phase": 18.09, "two_phase": 17.84}[name]
    assert before.distance[1] == pytest.approx(published, rel=5e-3)


def test_cells_say_how_a_stop_ended():
    d = Distances(np.array([12.0, 13.0, 9e9]), np.array([Outcome.STOPPED, Outcome.LOCKED, Outcome.STILL_MOVING]), None)
    assert [d.cell(i) for i in range(3)] == ["12.00", "13.00 L", "- M"]
    rows = [("snow", 60.0, 11.0)] * 3
    assert Study(rows, {}, {}, {"slip": d}).best(0) == "slip"
    assert Study(rows, {}, {}, {"slip": d}).best(1) == ""
    assert Study(rows, {}, {}, {"stiffness": d}).best(0) == ""


def test_limit_cycles_of_the_shipped_five_phase_set_contract():
    config = dataclasses.replace(
        tuned_sets()["five_phase"], roads=("dry_cobblestones", "wet_cobblestones"), cycle_speeds_kmh=(30.0, 180.0)
    )
    rows = certify_cycles(config, config.start)
    assert len(rows) == 4 and all(row.certified for row in rows)
    assert [(row.road, row.speed_kmh) for row in rows[:2]] == [("dry_cobblestones", 30.0), ("dry_cobblestones", 180.0)]
    assert 0.3 < rows[0].contraction < 0.7
    limited = dataclasses.replace(config, largest_contraction=0.4)
    names, sets = ("eps1", "eps5"), np.array([[config.start["eps1"], config.start["eps5"]], [90.0, 60.0]])
    charged = exact_charges(limited, names, sets)
    expected = sum(CONTRACTION_CHARGE * max(row.contraction - 0.4, 0.0) for row in rows)
    assert charged[0] == pytest.approx(expected, rel=1e-6) and charged[1] >= 0.05


def test_a_certificate_needs_the_observer_too():
    sound = CycleRow("snow", 60.0, "FOUND", 0.1, 0.5)
    assert sound.certified and not dataclasses.replace(sound, contraction=1.5).certified
    observed = dataclasses.replace(sound, observer_status="FOUND", with_observer=0.999)
    assert observed.certified and not dataclasses.replace(observed, with_observer=1.1).certified
    assert not dataclasses.replace(observed, observer_status="NOT_CONVERGED", with_observer=None).certified


def test_scattered_stops_are_reproducible_and_summarised():
    draws = robustness.draw(24, 5)
    again = robustness.draw(24, 5)
    np.testing.assert_array_equal(draws.speed, again.speed)
    assert draws.wheel.load.std() / draws.wheel.load.mean() == pytest.approx(0.1, rel=0.5)
    config = tuned_sets()["five_phase"]
    stopped = robustness.stops(config, config.base_controller(), draws)
    found, excess = robustness.summarise(stopped), robustness.excess(stopped)
    assert found.locked == 0.0 and 1.0 < found.mean < 1.1
    assert found.mean == pytest.approx(excess.mean()) and found.worst == pytest.approx(excess.max())
    other = robustness.stops(config, config.base_controller(), draws._replace(seed=draws.seed + 1))
    assert np.any(np.asarray(other.distance) != np.asarray(stopped.distance))


def test_continuous_control_fails_on_the_estimate_and_two_phases_do_not():
    continuous, cycling = phase_study.runs(phase_study.CONTINUOUS), phase_study.runs(phase_study.TWO_PHASE)
    for start in ("a", "b"):
        assert continuous[start][False].distance < 1e-3 and not continuous[start][False].undefined
        assert cycling[start][True].error < 0.05 and not cycling[start][True].undefined
        assert abs(cycling[start][True].offset[-8000:]).max() > 15
    unexcited = continuous["a"][True]
    assert unexcited.distance > 0.05 and abs(unexcited.offset[-1]) < 0.05 and not unexcited.undefined
    assert continuous["b"][True].undefined and continuous["b"][True].time[-1] < 0.1
    rows = phase_study.rows("continuous", continuous)
    assert [row["ends"].split(" at")[0] for row in rows] == ["still running"] * 3 + ["control undefined"]
