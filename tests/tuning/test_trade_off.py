"""The front of distance and yaw rate on split friction: of a model written down here, and of stops."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.controllers.five_phase import FivePhase
from absjax.lanes import stacked
from absjax.loop.channel import Channel
from absjax.loop.driver import Driver
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.plant.steering import YawDriver
from absjax.tyres.surfaces import surface
from tuning.core.box import Box
from tuning.vehicle import trade_off
from tuning.vehicle.archive import Archive, Turned
from tuning.vehicle.lateral_figures import trade_off_figure
from tuning.vehicle.split_mu import BRAKE, SPUN, WIRINGS, longest_stop, split_car, split_stop
from tuning.vehicle.trade_off import Effort, Search, charged, front_of


def turned(**values) -> Turned:
    usual = {"distance": 60.0, "yaw_rate": 0.1, "side_slip": 0.05, "lock": 0.0, "slide": 0.0, "ended": True}
    return Turned(*(np.asarray(values.get(name, value)) for name, value in usual.items()))


def dominated(yaw_rate, distance) -> np.ndarray:
    """Whether another set is no worse in both and better in one, pair by pair."""
    return np.array(
        [
            any(r <= own_r and s <= own_s and (r < own_r or s < own_s) for r, s in zip(yaw_rate, distance))
            for own_r, own_s in zip(yaw_rate, distance)
        ]
    )


def test_what_a_stop_is_charged_for_and_its_gradient():
    """Above its limits each has its slope; a car that spins is charged like one that does not stop."""
    stops = turned(
        distance=np.array([60.0, 60.0, 60.0, 54.0, 54.0]),
        yaw_rate=np.array([0.099, 0.102, 0.1, 0.09, 0.09]),
        side_slip=np.array([0.05, 0.05, 0.05, 1.01 * SPUN, 0.05]),
        lock=np.array([0.0, 0.0, 0.25, 0.0, 0.0]),
        slide=np.array([0.4, 0.0, 0.8, 0.0, 0.0]),
        ended=np.array([True, True, True, True, False]),
    )
    np.testing.assert_allclose(charged(stops, 60.0, 0.1), [1.0, 1.2, 1.7, 10.9, 10.9])
    for name in ("distance", "yaw_rate", "lock", "slide"):
        values, h = getattr(stops, name)[1:3] + 1e-3, 1e-6

        def cost(x, name=name):
            return charged(stops.taken(slice(1, 3))._replace(**{name: x}), 60.0, 0.1)

        slope = jnp.diagonal(jax.jacobian(cost)(jnp.asarray(values)))
        np.testing.assert_allclose(slope, (cost(values + h) - cost(values - h)) / (2 * h), rtol=1e-6)


def test_the_front_has_the_sound_sets_that_none_beats_and_each_limit_its_shortest():
    rng = np.random.default_rng(0)
    located, sampled = (
        turned(
            distance=rng.uniform(60, 90, 200),
            yaw_rate=rng.uniform(0.05, 0.3, 200),
            side_slip=rng.uniform(0, 1.2 * SPUN, 200),
            lock=rng.uniform(0, 0.22, 200),
            slide=rng.uniform(0, 0.55, 200),
            ended=rng.uniform(size=200) < 0.9,
        )
        for _ in range(2)
    )
    archive = Archive(np.zeros((200, 1)), located, sampled)
    distance, yaw_rate = (np.maximum(getattr(located, x), getattr(sampled, x)) for x in ("distance", "yaw_rate"))
    sound = np.ones(200, bool)
    for found in (located, sampled):
        sound &= found.ended & (found.side_slip <= SPUN) & (found.lock <= 0.2) & (found.slide <= 0.5)
    (sound,) = np.nonzero(sound)
    best = sound[~dominated(yaw_rate[sound], distance[sound])]
    front = archive.front()
    assert len(front) > 3 and set(front) == set(best)
    assert np.all(np.diff(yaw_rate[front]) < 0) and np.all(np.diff(distance[front]) > 0)
    limits = archive.limits(4)
    assert limits[0] == yaw_rate[sound[np.argmin(distance[sound])]] and limits[-1] == yaw_rate[sound].min()
    for limit in limits:
        keeping = sound[yaw_rate[sound] <= limit]
        assert archive.shortest(limit) == keeping[np.argmin(distance[keeping])]
    with pytest.raises(ValueError, match=r"no sound set keeps 0\.01 rad/s"):
        archive.shortest(0.01)


def test_a_search_improves_on_its_screening_and_gives_no_stop_of_a_car_that_spins(monkeypatch):
    """In place of stops: less of the first parameter for more of the yaw rate, and cars that spin and stop shortest."""

    def model(loop, points, speed, box, horizon, ticks):
        low, high = box.limits
        share = (jnp.asarray(points) - low) / (high - low)
        off = jnp.sum((share[:, 2:] - 0.4) ** 2, axis=1)
        spins, still = share[:, 1] > 0.8, 0.0 * off
        distance = 80.0 - 20.0 * share[:, 0] + 10.0 * off - 30.0 * spins
        yaw_rate = (0.05 + 0.1 * share[:, 0] + 0.02 * off) * (1.01 if ticks else 1.0)
        return Turned(distance, yaw_rate, jnp.where(spins, 1.1 * SPUN, 0.1), still, still, off < jnp.inf)

    monkeypatch.setattr(trade_off, "_turned", model)
    effort = Effort(screened=64, iterations=6, generations=2)
    screened = Search("snow", 100.0, "independent", None, 64).archive
    with jax.disable_jit():
        found = trade_off.trade_off("snow", 100.0, "independent", effort=effort)
    assert screened.worse.spun.any() and not found.archive.worse.taken(found.chosen).spun.any()
    assert len(found.archive.points) == 65 + 6 * 10 + 2 * 5 * 64
    for limit in screened.limits(5):
        ends = [archive.worse.distance[archive.shortest(limit)] for archive in (screened, found.archive)]
        assert ends[1] < ends[0]
    visited = found.archive.points[65 : 65 + 60].reshape(6, 10, -1)
    assert np.all(np.any(visited[0] != visited[-1], axis=1))
    monkeypatch.setattr(trade_off, "_turned", lambda *x: model(*x)._replace(ended=np.zeros(len(x[1]), bool)))
    assert not trade_off.trade_off("snow", 100.0, "independent").traded


def test_the_figure_has_every_set_and_tells_stops_from_others():
    """Left: sound sets filled, those that spin hollow, all others with a mark of their own. Right: filled are stops."""
    yaw_rate = np.radians([4.0, 5.0, 6.0, 7.0, 8.0])
    side_slip, lock = np.array([0.1, 1.1 * SPUN, 0.1, 0.1, 0.1]), np.array([0.0, 0.0, 0.3, 0.0, 0.0])
    slide, ended = np.array([0.0, 0.0, 0.0, 0.6, 0.0]), np.array([True, True, True, True, False])
    distance = np.linspace(60.0, 64.0, 5)
    judged = turned(distance=distance, yaw_rate=yaw_rate, side_slip=side_slip, lock=lock, slide=slide, ended=ended)
    archive = Archive(np.zeros((5, 1)), judged, judged)
    box = Box(("eps0",), (1.0,), (2.0,))
    front = trade_off.Front("independent", box, archive, archive.front(), {"as tuned": judged}, [])
    left, right = trade_off_figure([front], [], "split mu").axes

    def drawn(axes, looks):
        lines = [line for line in axes.lines if looks(line)]
        return sorted(round(float(x)) for line in lines for x in np.asarray(line.get_xdata()))

    assert drawn(left, lambda line: line.get_marker() == "x") == [6, 7, 8]
    assert drawn(left, lambda line: line.get_markerfacecolor() == "none" and line.get_marker() == "o") == [5]
    assert set(drawn(left, lambda line: line.get_marker() == "o" and line.get_markerfacecolor() != "none")) == {4}
    legend = left.get_legend()
    assert legend is not None and any("locks or slides" in text.get_text() for text in legend.get_texts())
    assert drawn(right, lambda line: line.get_markerfacecolor() == "none") == [5, 8]
    assert drawn(right, lambda line: line.get_markerfacecolor() != "none") == [4, 6, 7]


def test_the_sets_of_the_limits_keep_them_when_they_are_rolled_out_again(monkeypatch):
    """Their channels put together by hand, of the parameters that are given."""
    monkeypatch.setattr(trade_off, "TOGETHER", 8)
    wiring, speed, right = "select-low behind", 40.0 / 3.6, surface("wet_cobblestones")
    traded = front_of(Search("wet_cobblestones", 40.0, wiring, None, 31)).traded
    car = split_car(surface("dry_asphalt"), right, YawDriver())

    def braked(parameters):
        def channel(axle):
            own: dict[str, Any] = {k.removeprefix(axle): v for k, v in parameters.items() if k.startswith(axle)}
            return Channel(BRAKE, FivePhase(**own))

        channels = channel("front."), channel("front."), channel("rear.")
        return VehicleLoop(car, channels, 4.0, Driver(), wiring=WIRINGS[wiring])

    loops = stacked([braked(one.parameters) for one in traded])
    again = split_stop(loops, np.full(len(traded), speed), horizon=longest_stop(right, speed))
    limits = np.array([one.limit for one in traded])
    # The last limit is what its set has, but for rounding.
    assert np.all(again.yaw_rate <= limits * (1 + 1e-9)) and np.all(again.side_slip < SPUN)
    assert limits[0] > limits[-1] and again.distance[0] < again.distance[-1]
    rows = [[one.row["as tuned [m]"], one.row["as tuned [deg/s]"]] for one in traded]
    np.testing.assert_allclose(np.stack([again.distance, np.degrees(again.yaw_rate)], axis=1), rows, atol=0.006)
