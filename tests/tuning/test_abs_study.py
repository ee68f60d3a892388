"""The study of the controllers: shipped sets, settings, certificates, changing roads, robustness, failure."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from absjax.controllers import CONTROLLERS
from absjax.loop.stop import Outcome
from absjax.parameters import trainable_names
from tuning.controllers.batch import batch_of
from tuning.controllers.chain import of_controller
from tuning.controllers.config import TuningConfig
from tuning.controllers.cycles import CONTRACTION_CHARGE, NO_CYCLE_CHARGE, CycleRow, certify_cycles, exact_charges
from tuning.controllers.recipes import published_sets, recipes, tuned_sets
from tuning.controllers.rows import Row
from tuning.controllers.settings import CHAIN, COARSE, LOCATED, SAMPLED
from tuning.controllers.setup import Setup
from tuning.controllers.stop_figures import StopFigures
from tuning.controllers.study import changing as changing_study
from tuning.controllers.study import curves as curve_study
from tuning.controllers.study import logics as logic_study
from tuning.controllers.study import phase_plane as phase_study
from tuning.controllers.study import published_table as published_study
from tuning.controllers.study import robustness
from tuning.controllers.study.distances import Entry, cell, details, stops_of, summary, table, untuned_and_tuned
from tuning.core.files import write_csv

KEY = ["controller", "set", "setting", "period_ms", "road", "speed_kmh"]
COLUMNS = [
    *KEY,
    *("pedal_bar_s", "pedal_distance_m", "pedal_ideal_m", "published_quantity_m", "onset_s", "onset_kmh", "cycles"),
    *("lock_s_above_15", "lock_s_above_2_5", "outcome"),
]


def test_every_controller_has_a_tuned_set_that_is_valid():
    assert set(tuned_sets()) == set(CONTROLLERS) - {"no_control"}
    for name, config in tuned_sets().items():
        recipe = recipes()[name]
        assert config.controller == name and dataclasses.replace(config, start=recipe.start) == recipe
        assert (config.rate_limit, config.lag, config.threshold_floor) == (750.0, 0.005, 10.0)
        assert (config.pedal_rate, config.foot_delay, config.driver_pressure) == (400.0, 0.0, 150.0)
        setup = Setup.of(config)
        controller = setup.controller()
        assert all(float(getattr(controller, field)) >= 10.0 for field in controller.thresholds)
        assert config.start != recipe.start and "ramp" not in config.start
        setup.box()
    assert tuned_sets()["two_phase"].observer == "adaptive"


def test_recipes_begin_untuned():
    """A recipe starts from the defaults, or from round values set by hand, and knows no set."""
    for name, recipe in recipes().items():
        assert recipe.known == () and all(value == float(f"{value:.2g}") for value in recipe.start.values()), name


@pytest.fixture(scope="module")
def five_phase():
    """Untuned and tuned five phases on the two hardest rows, and on a road that changes."""
    config = dataclasses.replace(
        tuned_sets()["five_phase"], roads=("dry_cobblestones", "wet_cobblestones"), speeds_kmh=(60.0,)
    )
    sets = untuned_and_tuned(config)
    return {setting: stops_of(config, sets, setting, record=setting == SAMPLED) for setting in (LOCATED, SAMPLED)}


def test_the_shipped_five_phase_set_is_near_ideal_from_the_pedal(five_phase):
    for entries in five_phase.values():
        tuned = [e for e in entries if e.set == "tuned"]
        assert len(tuned) == 2 and all(0.0 < e.excess < 0.06 for e in tuned)
        assert all(e.stop.longest_lock_above_15 <= 0.05 for e in tuned)
        untuned = [e for e in entries if e.set == "untuned"]
        assert all(e.excess is None or e.excess > f.excess for e, f in zip(untuned, tuned))


def test_the_table_of_distances_has_its_columns(five_phase, tmp_path):
    entries = [e for found in five_phase.values() for e in found]
    written = pd.read_csv(write_csv(table(entries), tmp_path / "distances.csv"))
    assert list(written.columns) == COLUMNS and len(written) == 8
    assert set(written["set"]) == {"untuned", "tuned"} and set(written["setting"]) == {"located", "sampled"}
    recorded = [row for row in details(entries) if row["rms_jerk_m_s3"] is not None]
    assert len(recorded) == 4 and all(0 < row["largest_slip_above_15"] <= 1.0 for row in recorded)
    rows = summary(entries)
    assert [row["set"] for row in rows] == ["untuned", "tuned"] * 2 and rows[1]["do not end"] == 0


def test_a_stop_that_does_not_end_is_counted_apart():
    row = Row("snow", 60.0, 400.0)
    ended = StopFigures(75.0, 74.0, 3, 0.2, "STOPPED", 0.1, 59.0, 0.0, 0.0, 0.0)
    moving = dataclasses.replace(ended, distance=None, outcome="STILL_MOVING")
    entries = [Entry("slip", "tuned", LOCATED, row, 70.0, stop, "") for stop in (ended, moving)]
    assert [cell(e) for e in entries] == ["75.00", "still moving"]
    (line,) = summary(entries)
    assert (line["stops"], line["do not end"], line["mean above ideal [%]"]) == (2, 1, "7.14")
    assert cell(entries[0]._replace(mark="S")) == "75.00 S"


def test_told_by_the_chain_a_stop_is_another():
    config = dataclasses.replace(
        tuned_sets()["five_phase"], roads=("dry_asphalt",), speeds_kmh=(60.0,), stop_speed_kmh=30.0
    )
    sets = {"tuned": Setup.of(config).initial}
    truth, chain = (stops_of(config, sets, setting)[0] for setting in (COARSE, CHAIN))
    assert truth.ideal == chain.ideal and truth.stop.onset_s > 0
    assert chain.stop.onset_s > truth.stop.onset_s - 5e-3 and chain.stop.distance != truth.stop.distance


def test_a_patch_of_snow_is_left_behind():
    """Locked on it or not, the wheel comes free: the stop is nothing like one on endless snow."""
    config = changing_study.configured(tuned_sets()["five_phase"], changing_study.PATCH, (120.0,))
    setup = Setup.of(config)
    _, stopped = changing_study.recorded(config, setup.initial)
    (ideal,) = batch_of(setup).ideal
    assert 75.0 < ideal < 76.5 and ideal < float(stopped.distance[0]) < 1.1 * ideal
    (again,) = changing_study.brakes_again(config, setup.initial)
    assert 0.0 < again < 1.0


def test_the_published_entries_without_limits_are_reached():
    """The row that leaves least room, of both algorithms; the whole table is printed by `abs-study`."""
    free = [config for config in published_sets() if config.rate_limit is None and config.lag is None]
    assert {config.controller for config in free} == {"five_phase", "two_phase"}
    for config in free:
        assert config.threshold_floor == 10.0 and (config.pedal_rate, config.pedal_strength) == (400.0, 6000.0)
        config = dataclasses.replace(config, roads=("dry_cobblestones",), speeds_kmh=(60.0,))
        entries = stops_of(config, {"tuned": Setup.of(config).initial}, LOCATED)
        assert len(entries) == 2 and all(published_study.gap(e) <= 0 for e in entries)


def test_limit_cycles_of_the_shipped_five_phase_set():
    config = dataclasses.replace(
        tuned_sets()["five_phase"], roads=("dry_asphalt", "wet_asphalt"), cycle_speeds_kmh=(60.0, 180.0)
    )
    rows = certify_cycles(Setup.of(config), config.start)
    assert [(row.road, row.speed_kmh) for row in rows[:2]] == [("dry_asphalt", 60.0), ("dry_asphalt", 180.0)]
    assert rows[1].certified and rows[3].certified and not any(row.certified and row.contraction >= 1 for row in rows)
    largest = 0.5 * rows[1].contraction
    names, sets = ("eps1", "eps5"), np.array([[config.start["eps1"], config.start["eps5"]], [90.0, 60.0]])
    charged = exact_charges(Setup.of(config), names, sets, largest)
    excess = [row.contraction and max(row.contraction - largest, 0.0) for row in rows]
    expected = sum(NO_CYCLE_CHARGE if each is None else CONTRACTION_CHARGE * each for each in excess)
    assert charged[0] == pytest.approx(expected, rel=1e-6) and expected > 0 and charged[1] != charged[0]


def test_a_certificate_needs_the_observer_too():
    sound = CycleRow("snow", 60.0, "FOUND", 0.1, 0.5)
    assert sound.certified and not dataclasses.replace(sound, contraction=1.5).certified
    observed = dataclasses.replace(sound, observer_status="FOUND", with_observer=0.999)
    assert observed.certified and not dataclasses.replace(observed, with_observer=1.1).certified
    assert not dataclasses.replace(observed, observer_status="NOT_CONVERGED", with_observer=None).certified


def test_scattered_stops_are_reproducible_and_summarised():
    draws = robustness.draw(24, 5, robustness.SCATTERED_PEDAL)
    again = robustness.draw(24, 5, robustness.SCATTERED_PEDAL)
    np.testing.assert_array_equal(draws.speed, again.speed)
    assert draws.wheel.load.std() / draws.wheel.load.mean() == pytest.approx(0.1, rel=0.5)
    assert 200 <= draws.pedal_rate.min() < 400 < draws.pedal_rate.max() <= 1000
    config = tuned_sets()["five_phase"]
    controller = Setup.of(config).controller()
    stopped, ideal = robustness.stops(config, controller, draws)
    found, excess = robustness.summarise(stopped, ideal), robustness.excess(stopped, ideal)
    assert found.unfinished == np.mean(~np.isfinite(excess)) and 1.0 < found.mean < 1.2
    ended = excess[np.isfinite(excess)]
    assert found.mean == pytest.approx(ended.mean()) and found.worst == pytest.approx(ended.max())
    assert found.spread == pytest.approx(ended.std()) and np.all(ended > 1.0)
    other, _ = robustness.stops(config, controller, draws._replace(seed=draws.seed + 1))
    assert np.any(np.asarray(other.distance) != np.asarray(stopped.distance))
    assert np.all(np.asarray(other.outcome)[np.isfinite(excess)] == Outcome.STOPPED)


def test_peaks_of_the_published_surfaces():
    """lambda* = ln(c1 c2 / c3) / c2; the source says a locked wheel loses 20 to 30 %, its own table says more."""
    rows = {row["road"]: row for row in curve_study.rows()}
    dry = rows["dry_asphalt"]
    assert dry["peak slip"] == pytest.approx(np.log(1.2801 * 23.99 / 0.52) / 23.99, abs=1e-4)
    assert dry["XBS, rolling"] == pytest.approx(1.2801 * 23.99 - 0.52, abs=5e-3)
    lost = [row["lost by a locked wheel [%]"] for name, row in rows.items() if name != "ice"]
    assert 26 < min(lost) < 27 and 39 < max(lost) < 40 and rows["ice"]["peak slip"] == "none"


def test_the_logics_of_cars_go_through_their_phases_as_told():
    """Aguado-Rojas 2019, section 2.2.3, phases 1 to 8; Hoang 2014, section 1.3: no first hold in later cycles."""
    eight, four = (logic_study.run(name) for name in logic_study.SETTINGS)
    assert eight.sequence()[:12] == [0, 1, 2, 3, 5, 4, 5, 6, 7, 6, 7, 6]
    for found, before in ((eight, (6, 7)), (four, (6,))):
        sequence = found.sequence()
        cycles = [i for i, phase in enumerate(sequence) if phase == 2]
        assert sequence[cycles[0] - 1] == 1 and len(cycles) > 4
        assert all(sequence[i - 1] in before for i in cycles[1:4]) and 1 not in sequence[cycles[0] : cycles[4]]
    for extreme, threshold in ((-four.acceleration.min(), "a2"), (four.acceleration.max(), "a4")):
        assert extreme == pytest.approx(logic_study.SETTINGS["production"][threshold], abs=0.5)
    assert all(row["friction used [%]"] > 95 for row in logic_study.rows([eight, four]))


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


def test_the_tuned_parameters_are_the_trainable_ones_and_the_ways_out():
    for name, recipe in recipes().items():
        tuned = set(of_controller(dict.fromkeys(Setup.of(recipe).box().names)))
        extra = {name.split(".")[-1] for name in tuned} - set(trainable_names(recipe.kind))
        assert extra <= {"fallback", "longest_release", "slip_limit", "pressure_rate", "beyond"}, name
    assert Setup.of(TuningConfig()).box().names == trainable_names(CONTROLLERS["five_phase"])
