"""Encoders and their edges against root finding; time-stamping against polyfit; compensation and notch against plain
loops; over logs, sample by sample, in lanes; gradients; long and hard runs."""

import dataclasses
from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import optimize, signal

from absjax.encoder.edges import Edges, edges_of, in_ticks, pack
from absjax.encoder.encoder import Encoder
from absjax.encoder.harmonics import HarmonicCompensation
from absjax.encoder.notch import NotchFilter
from absjax.encoder.polynomial import unit_interval
from absjax.encoder.rotation import Rotation
from absjax.encoder.time_stamping import TimeStamping
from absjax.encoder.wheel_speed import WheelSpeedChain, estimate

T = 1e-3
TEETH = 60
PITCH = 2 * np.pi / TEETH
SPEED = 1020 * 2 * np.pi / 60


def wavy(time):
    """A wheel whose speed varies: angle, speed, acceleration."""
    return (
        80 * time + 6 * np.sin(4 * time) + 0.3,
        80 + 24 * np.cos(4 * time),
        -96 * np.sin(4 * time),
    )


def rotation(samples, motion=wavy):
    return Rotation(*motion(T * np.arange(samples)))


def steady(samples, speed=SPEED):
    time = T * np.arange(samples)
    return Rotation(speed * time, np.full(samples, speed), np.zeros(samples))


def times(edges: Edges):
    """Instants of all edges of a log, s."""
    ages, count = np.asarray(edges.ages), np.asarray(edges.count)
    return np.concatenate([k * T - ages[k, : count[k]] for k in range(count.size)])


def chain(events=15, harmonics=6, **fields):
    parts = (HarmonicCompensation(s, harmonics, **fields) for s in ("speed", "acceleration"))
    return WheelSpeedChain(TimeStamping(TEETH, events), *parts)


ENCODER = Encoder.random(5, TEETH, tolerance=0.03, eccentricity=5e-4)
SAMPLES = 900


@cache
def logged(clock=None):
    """Edges of the wavy wheel, (SAMPLES, 3): one shape for most tests, so that they share programs."""
    encoder = ENCODER if clock is None else dataclasses.replace(ENCODER, clock=clock)
    return edges_of(encoder, rotation(SAMPLES), T, capacity=3)


def test_edges_against_root_finding():
    found = times(logged())
    share, phase = float(ENCODER.eccentricity / ENCODER.track_radius), float(ENCODER.phase)

    def position(time):
        angle = wavy(time)[0]
        return angle + share * np.sin(angle + phase)

    # The first tooth that passes after time 0, and so on, each by root finding on the motion itself.
    places = PITCH * (np.arange(TEETH) + np.asarray(ENCODER.deviation))
    every = np.concatenate([places + 2 * np.pi * turn for turn in range(14)])
    inside = np.sort(every[(every > position(0.0)) & (every <= position((SAMPLES - 1) * T))])
    true = [optimize.brentq(lambda t, p=p: position(t) - p, -0.01, 1.0, xtol=1e-15, rtol=1e-15) for p in inside]
    assert found.size == len(true)
    np.testing.assert_allclose(found, true, atol=2e-13)
    angles = np.asarray([ENCODER.edge_angle(k) for k in range(3)])
    np.testing.assert_allclose(angles + share * np.sin(angles + phase), places[:3], atol=1e-13)


def test_gradient_of_edge_times():
    def age(eccentricity, speed):
        encoder = dataclasses.replace(ENCODER, eccentricity=eccentricity)
        time = T * jnp.arange(60)
        motion = Rotation(speed * time, jnp.full(60, speed), jnp.zeros(60))
        edges = edges_of(encoder, motion, T, capacity=3)
        return jnp.sum(jnp.where(jnp.arange(3) < edges.count[:, None], edges.ages, 0.0)[40:50])

    for i, (x, h) in enumerate(((5e-4, 1e-7), (90.0, 1e-4))):
        at = [5e-4, 90.0]
        sides = [float(age(*(at[:i] + [x + s * h] + at[i + 1 :]))) for s in (1, -1)]
        assert float(jax.grad(age, i)(*at)) == pytest.approx((sides[0] - sides[1]) / (2 * h), rel=1e-6)


def test_clock_jitter_and_missing_edges():
    exact = times(logged())
    ticked = times(logged(clock=1e-5))
    late = exact - ticked
    assert (late > -1e-12).all() and (late < 1e-5).all() and late.std() > 2e-6
    np.testing.assert_allclose(ticked / 1e-5, np.round(ticked / 1e-5), atol=1e-6)
    jittery = Encoder.ideal(TEETH, jitter=0.01, seed=4)
    drawn = times(edges_of(jittery, steady(4000), T, capacity=4)) * SPEED / PITCH
    off = drawn - np.round(drawn)
    assert off.std() == pytest.approx(0.01, rel=0.05)
    assert abs(np.corrcoef(off[:-TEETH], off[TEETH:])[0, 1]) < 0.05
    again = times(edges_of(jittery, steady(4000), T, capacity=4)) * SPEED / PITCH
    np.testing.assert_array_equal(drawn, again)
    sparse = edges_of(Encoder.ideal(TEETH, missing=0.1, seed=1), steady(4000), T)
    whole = edges_of(Encoder.ideal(TEETH), steady(4000), T)
    assert 1 - sparse.count.sum() / whole.count.sum() == pytest.approx(0.1, abs=0.015)
    assert np.isin(times(sparse).round(9), times(whole).round(9)).all()


def test_packing_a_log():
    edges = in_ticks(logged(), 1e-6)
    ticks = np.round(times(edges._replace(ages=edges.ages * 1e-6)) * 1e6).astype(np.int64)
    for start in (0, 3_600_000_000, 2**40):
        packed, instants = pack(ticks + start, 1000)
        assert packed.ages.dtype == np.int32 and instants[0] == ticks[0] + start
        first = int(packed.ages[0, 0])
        assert first == 0 and packed.count.sum() == ticks.size
        back = np.concatenate([instants[k] - packed.ages[k, : packed.count[k]] for k in range(len(instants))])
        np.testing.assert_array_equal(back, ticks + start)
    for bad, message in (
        (ticks.astype(float), "integers"),
        (ticks[::-1], "stamp 1 .* does not come after"),
        (ticks[:0], "integers"),
    ):
        with pytest.raises(ValueError, match=message):
            pack(bad, 1000)
    with pytest.raises(ValueError, match="capacity = 1 edges"):
        pack(ticks, 1000, capacity=1)


def test_conditioning_of_the_fit():
    stamps = np.array([22, 23, 24, 25, 26]) * 1e-5
    scaled, span, _ = unit_interval(np.diff(stamps)[::-1], np.ones(4), np.ones(5, bool), jnp.float64)
    assert float(span) == pytest.approx(4e-5)
    np.testing.assert_allclose(np.asarray(scaled)[::-1], [0, 0.25, 0.5, 0.75, 1], atol=1e-12)
    assert np.linalg.cond(np.vander(scaled, 3)) == pytest.approx(16.668, abs=5e-4)
    assert np.linalg.cond(np.vander(stamps, 3)) == pytest.approx(5.976e9, rel=1e-4)


@pytest.mark.parametrize(
    ("order", "events", "window", "memory"),
    [(2, 15, None, None), (2, 15, 6.0, None), (2, 15, None, 0.011), (3, 9, None, None)],
)
def test_time_stamping_against_polyfit(order, events, window, memory):
    edges = logged()
    stamping = TimeStamping(TEETH, events, order, window=window, memory=memory)
    found = estimate(WheelSpeedChain(stamping), edges, T)[0].measured
    n, instants, sizes = int(window or events), times(edges), set()
    usual = np.asarray(found.valid & found.regular)
    for k in np.flatnonzero(usual)[::19]:
        last = np.flatnonzero(instants <= k * T + 1e-12)[-1]
        if memory is not None:
            n = min(events, int((instants[: last + 1] >= k * T - memory).sum()))
            sizes.add(n)
        t = instants[last - n + 1 : last + 1]
        span = t[-1] - t[0]
        fit = np.polynomial.Polynomial.fit(t, np.arange(1 - n, 1), order, domain=[t[0], t[-1]], window=[0, 1])
        now = k * T
        np.testing.assert_allclose(found.rotation.speed[k], PITCH * fit.deriv()(now), rtol=1e-10)
        np.testing.assert_allclose(
            found.rotation.acceleration[k], PITCH * fit.deriv(2)(now), rtol=1e-10, atol=1e-10 * PITCH / span**2
        )
        angle = PITCH * (last + fit(now)) % (2 * np.pi)
        np.testing.assert_allclose(found.rotation.angle[k], angle, atol=1e-10)
    assert usual.sum() > 800 and len(sizes) >= (3 if memory else 0)


@pytest.mark.parametrize("memory", [None, 0.008])
def test_regressors_made_of_the_edges_are_exact(memory):
    """Errors of two harmonics are found, and taken off, to rounding; however many edges are in the fit."""
    k = 2 * np.pi * np.arange(TEETH) / TEETH
    sine, cosine = 0.02, -0.01
    encoder = Encoder(sine * np.sin(3 * k) + cosine * np.cos(2 * k))
    edges = edges_of(encoder, steady(2000, 90.0), T)
    parts = (HarmonicCompensation(s, 3, through_edges=True, gain=1e9) for s in ("speed", "acceleration"))
    chain_ = WheelSpeedChain(TimeStamping(TEETH, 15, memory=memory), *parts)
    found, state = estimate(chain_, edges, T)
    np.testing.assert_allclose(found.speed[-200:], 90.0, atol=1e-6)
    np.testing.assert_allclose(found.acceleration[-200:], 0.0, atol=1e-4)
    # Tooth 0 of the chain is the first that passed: tooth 1, the encoder's 0 lies before the start.
    shift = 2 * np.pi / TEETH * int(np.asarray(encoder.edge_angle(np.arange(TEETH)) <= 0.0).sum())
    a3, b3 = sine * np.cos(3 * shift), sine * np.sin(3 * shift)
    a2, b2 = -cosine * np.sin(2 * shift), cosine * np.cos(2 * shift)
    expected = -PITCH * np.array([0.0, 0.0, a2, b2, a3, b3])
    for name in ("speed", "acceleration"):
        learned = getattr(chain_, name).coefficients(getattr(state, name))
        np.testing.assert_allclose(learned, expected, atol=1e-7)


def test_an_ideal_encoder_at_constant_speed_has_no_error():
    found, _ = estimate(chain(), edges_of(Encoder.ideal(TEETH), steady(600), T), T)
    valid = np.asarray(found.measured.valid)
    assert valid[20:].all()
    np.testing.assert_allclose(np.asarray(found.speed)[valid], SPEED, atol=1e-9)
    np.testing.assert_allclose(np.asarray(found.acceleration)[valid], 0.0, atol=1e-8)


def plain_compensation(c: HarmonicCompensation, measured, power, values):
    """The source's law on its own scale, one sample after the other."""
    m = c.harmonics
    k = np.repeat(np.arange(1, m + 1), 2)
    d = np.diag(k).astype(float)
    theta, g = np.zeros(2 * m), float(c.gain) * 2 * float(c.forgetting) * (k[::2] ** (2 * power)).sum()
    gamma = g * np.diag(1.0 / k ** (2.0 * power))
    most = np.trace(np.diag(k**power) @ gamma @ np.diag(k**power))
    warped = np.tan(np.pi * float(c.cutoff) * T)
    before, out = None, []
    for i in range(len(values)):
        angle, w, a = (float(x[i]) for x in measured.rotation)
        phi = np.stack([np.cos(k[::2] * angle), -np.sin(k[::2] * angle)], -1).ravel()
        psi = np.stack([np.sin(k[::2] * angle), np.cos(k[::2] * angle)], -1).ravel()
        regressor = d @ phi * w if power == 1 else d @ phi * a - d @ d @ psi * w**2
        if not measured.regular[i]:
            before = None
            out.append(values[i] - regressor @ theta)
            continue
        now = np.concatenate([[values[i]], regressor, [measured.rotation.acceleration[i]]])
        if before is None:
            passed, learns = np.zeros_like(now), False
        else:
            passed, learns = (now - before + (1 - warped) * passed) / (1 + warped), True
        before = now
        zeta, x = passed[0], passed[1:-1] if c.filter_regressor else regressor
        held = T * float(learns and w > float(c.slowest))
        if c.gate is not None:
            held /= 1 + ((now[-1] - passed[-1]) / float(c.gate)) ** 4
        scale = 1 + float(c.kappa) * x @ x + held * x @ gamma @ x
        theta = theta + held * gamma @ x * (zeta - x @ theta) / scale
        gamma = np.exp(float(c.forgetting) * held) * (gamma - held * np.outer(gamma @ x, gamma @ x) / scale)
        trace = np.trace(np.diag(k**power) @ gamma @ np.diag(k**power))
        gamma = gamma * min(1.0, most / trace)
        out.append(values[i] - regressor @ theta)
    return np.array(out), theta


@pytest.mark.parametrize("filtered", [True, False])
def test_compensation_against_a_plain_loop(filtered):
    edges = logged()
    parts = chain(harmonics=4, filter_regressor=filtered, gate=60.0, forgetting=0.7)
    found, state = estimate(parts, edges, T)
    measured = jax.tree.map(np.asarray, found.measured)
    for name, power in (("speed", 1), ("acceleration", 2)):
        part, values = getattr(parts, name), getattr(measured.rotation, name)
        plain, theta = plain_compensation(part, measured, power, values)
        np.testing.assert_allclose(getattr(found, name), plain, rtol=1e-9, atol=1e-9 * np.abs(values).max())
        np.testing.assert_allclose(part.coefficients(getattr(state, name)), theta, rtol=1e-7, atol=1e-12)


def test_without_forgetting_the_coefficients_are_those_of_batch_least_squares():
    part = HarmonicCompensation("speed", 3, forgetting=1e-9, gain=1e17, cutoff=2.0)
    parts = WheelSpeedChain(TimeStamping(TEETH, 15), part)
    found, state = estimate(parts, logged(), T)
    measured, valid = found.measured, np.asarray(found.measured.valid)
    first = int(valid.argmax())
    b, a = signal.butter(1, 2.0, "high", fs=1 / T)
    regressors = np.asarray(jax.vmap(part.regressor)(measured)) * np.repeat([1, 2, 3], 2)
    rows = np.column_stack([np.asarray(measured.rotation.speed), regressors])[first:]
    zero = np.asarray(signal.lfilter_zi(b, a))
    passed = np.stack([signal.lfilter(b, a, x, zi=zero * x[0])[0] for x in rows.T])[:, 1:]
    assert np.asarray(measured.regular)[first:].all()
    zeta, x = passed[0], passed[1:]
    weight = 1 / np.sqrt(1 + (x**2).sum(axis=0))
    batch = np.linalg.lstsq((x * weight).T, zeta * weight, rcond=None)[0]
    np.testing.assert_allclose(part.coefficients(state.speed), batch, rtol=1e-5, atol=1e-8)


def test_notch_against_scipy():
    parts = WheelSpeedChain(TimeStamping(TEETH, 15), None, NotchFilter("acceleration", depth=0.05, width=0.4))
    found, _ = estimate(parts, edges_of(ENCODER, steady(SAMPLES), T, 3), T)
    # On an encoder with errors the measured speed is not quite constant; hold it to have a filter that is.
    measured = found.measured
    held = measured._replace(rotation=measured.rotation._replace(speed=jnp.full(SAMPLES, SPEED)))
    notch, state, out = parts.acceleration, parts.acceleration.initial_state(jnp.float64), []
    step = jax.jit(notch.clean)
    for i in range(SAMPLES):
        state, value = step(state, jax.tree.map(lambda x, i=i: x[i], held), T)
        out.append(float(value))
    warped = 2 / T * np.tan(SPEED * T / 2)
    b, a = ([1 / warped**2, 2 * z / warped, 1] for z in (0.05, 0.4))
    b, a = signal.bilinear(b, a, 1 / T)
    x = np.asarray(measured.rotation.acceleration)
    first = int(np.asarray(measured.valid).argmax())
    expected = signal.lfilter(b, a, x[first:], zi=signal.lfilter_zi(b, a) * x[first])[0]
    np.testing.assert_allclose(out[first:], expected, atol=1e-9 * np.abs(x).max())
    gain = signal.freqz(b, a, [SPEED * T])[1]
    assert abs(gain[0]) == pytest.approx(0.05 / 0.4, rel=1e-9)


def test_sample_by_sample_in_parts_and_in_lanes():
    encoders = Encoder.random(range(3), TEETH)
    edges = edges_of(encoders, rotation(300), T)
    parts = chain(harmonics=3)
    many, after = estimate(parts, edges, T)
    lone = jax.tree.map(lambda x: x[1], edges)
    one, _ = estimate(parts, lone, T)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a[1], b, rtol=1e-9, atol=1e-9), many, one)
    step, state, path = jax.jit(parts.absorb), parts.initial_state(jnp.float64, jnp.float64), []
    for k in range(300):
        state, now = step(state, Edges(lone.ages[k], lone.count[k]), T)
        path.append(now._replace(measured=now.measured._replace(weights=None)))
    jax.tree.map(lambda a, *b: np.testing.assert_allclose(a, np.stack(b), rtol=1e-9, atol=1e-9), one, *path)
    start = jax.tree.map(lambda x: jnp.broadcast_to(x, (3, *x.shape)), parts.initial_state(jnp.float64, jnp.float64))
    head, tail = (jax.tree.map(lambda x, part=part: x[:, part], edges) for part in (slice(150), slice(150, None)))
    _, middle = estimate(parts, head, T, start=start)
    again, end = estimate(parts, tail, T, start=middle)
    np.testing.assert_allclose(again.acceleration, many.acceleration[:, 150:], rtol=1e-9, atol=1e-9)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9), end, after)
    gains = dataclasses.replace(parts.speed, gain=jnp.array([10.0, 1000.0, 1e5]))
    shared, _ = estimate(dataclasses.replace(parts, speed=gains), lone, T)
    np.testing.assert_allclose(shared.speed[1], one.speed, rtol=1e-9)
    assert np.ptp(np.asarray(shared.speed)[:, -1]) > 0


def test_dynamic_numbers_of_events_and_harmonics():
    edges = logged()
    few, _ = estimate(chain(9, 3), edges, T)
    wide = chain(15, 6, active=3.0)
    used, _ = estimate(dataclasses.replace(wide, stamping=TimeStamping(TEETH, 15, window=9.0)), edges, T)
    np.testing.assert_allclose(used.speed, few.speed, rtol=1e-9)
    np.testing.assert_allclose(used.acceleration, few.acceleration, rtol=1e-9, atol=1e-7)


def test_gradients_against_differences():
    edges, truth = jax.tree.map(lambda x: x[:500], logged()), rotation(500)

    @jax.jit
    def cost(x):
        found, _ = estimate(chain(harmonics=3, **x), edges, T)
        off = found.speed - truth.speed, found.acceleration - truth.acceleration
        return sum(jnp.mean(x[60:] ** 2) for x in off)

    at = {"forgetting": 0.5, "cutoff": 3.0, "gain": 100.0, "gate": 80.0}
    with_slopes = jax.jit(jax.value_and_grad(cost))
    forward, reverse = jax.jacfwd(cost)(at), with_slopes(at)[1]
    for name, x in at.items():
        h = 1e-4 * x
        values = [float(with_slopes({**at, name: x + s * h})[0]) for s in (2, 1, -1, -2)]
        difference = (-values[0] + 8 * values[1] - 8 * values[2] + values[3]) / (12 * h)
        assert float(forward[name]) == pytest.approx(difference, rel=1e-6)
        assert float(reverse[name]) == pytest.approx(float(forward[name]), rel=1e-9)


def test_single_precision_with_ticks_equals_double():
    edges = in_ticks(logged(), 1e-6)
    parts = chain(harmonics=5)
    single, _ = estimate(parts, edges, 1000, jnp.float32(1e-6))
    double, _ = estimate(parts, edges, 1000, jnp.float64(1e-6))
    exact, _ = estimate(parts, logged(), T)
    assert single.speed.dtype == jnp.float32 and double.speed.dtype == jnp.float64
    for name, least in (("speed", 1e-5), ("acceleration", 1e-3)):
        a, b, c = (np.asarray(getattr(x, name), float)[50:] for x in (single, double, exact))
        clock = np.sqrt(np.mean((b - c) ** 2))
        assert clock > least and np.sqrt(np.mean((a - b) ** 2)) < clock


def locked(samples=4000, at=2000, speed=100.0):
    time = T * np.arange(samples)
    turns = np.where(np.arange(samples) < at, speed, 0.0)
    return Rotation(speed * np.minimum(time, (at - 1) * T), turns, np.zeros(samples))


@pytest.mark.parametrize(("dtype", "limit", "through"), [(jnp.float32, None, False), (jnp.float64, 3000.0, True)])
def test_a_sudden_lock_and_a_long_standstill(dtype, limit, through):
    edges = in_ticks(edges_of(ENCODER, locked(), T, capacity=3), 1e-6)
    last = int(np.flatnonzero(edges.count)[-1])
    parts = dataclasses.replace(
        chain(harmonics=3, through_edges=through, cutoff=0.4),
        stamping=TimeStamping(TEETH, 15, greatest_deceleration=limit),
    )
    found, state = estimate(parts, edges, 1000, dtype(1e-6))
    jax.tree.map(lambda x: np.testing.assert_array_equal(np.isfinite(x), True), (found, state))
    since = (np.arange(last + 2, 4000) - last) * T
    measured = np.asarray(found.measured.rotation.speed)[last + 2 :]
    slowest = -np.inf if limit is None else 103.0 - limit * since
    assert (measured <= np.maximum(PITCH / since, slowest) * (1 + 1e-5)).all() and (measured >= 0).all()
    assert (np.diff(measured) <= 0).all() and measured[-1] < 0.06
    assert abs(float(found.acceleration[-1])) < 0.1 and abs(float(found.speed[-1])) < 0.1
    # Nothing is learned, nothing forgotten, and no time overflows.
    turning = in_ticks(edges_of(ENCODER, steady(4000, 60.0), T, capacity=3), 1e-6)
    nothing = turning._replace(count=0 * turning.count)
    still, rest = estimate(parts, nothing, 10**6, dtype(1e-6), start=state)
    jax.tree.map(lambda x: np.testing.assert_array_equal(np.isfinite(x), True), (still, rest))
    assert float(still.speed[-1]) == pytest.approx(0.0, abs=1e-4)
    np.testing.assert_array_equal(rest.speed.covariance, state.speed.covariance)
    after, _ = estimate(parts, turning, 1000, dtype(1e-6), start=rest)
    assert np.asarray(after.measured.valid)[300:].all()
    np.testing.assert_allclose(np.asarray(after.measured.rotation.speed)[300:], 60.0, atol=2.0)


@pytest.mark.parametrize(("speed", "gone"), [(100.0, 400), (25.0, 100)])
def test_a_missing_edge_does_not_shift_the_angle(speed, gone):
    """At 100 rad/s it is known by its lateness, at 25 rad/s by the next edge."""
    edges = edges_of(ENCODER, steady(800, speed), T)
    stamps = np.round(times(edges) * 1e8).astype(np.int64)
    dropped = np.delete(stamps, gone)
    whole, _ = pack(stamps, 10**5, capacity=3)
    fewer, _ = pack(dropped, 10**5, capacity=3)
    for limit, shifted in ((3000.0, False), (None, True)):
        parts = WheelSpeedChain(TimeStamping(TEETH, 15, greatest_deceleration=limit))
        full, gap = (estimate(parts, e, 10**5, jnp.float64(1e-8))[0].measured for e in (whole, fewer))
        off = np.angle(np.exp(1j * np.asarray(gap.rotation.angle - full.rotation.angle)))[-200:]
        assert not np.asarray(gap.regular).all()
        np.testing.assert_allclose(off, -PITCH if shifted else 0.0, atol=1e-3)
        turns = np.asarray(gap.rotation.speed)
        least = max(0.45 * speed, speed - 20.0 if limit else 0.0)
        assert np.isfinite(turns).all() and (turns[200:] > least).all()
        np.testing.assert_allclose(turns[-200:], np.asarray(full.rotation.speed)[-200:], atol=1e-3)


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_long_forgetting_keeps_the_covariance_definite(dtype):
    """100 times the time constant of the forgetting: what is not symmetric would have grown by e^100."""
    edges = in_ticks(edges_of(Encoder.random(1, TEETH), rotation(20_000), T), 1e-6)
    found, state = estimate(chain(harmonics=3, forgetting=5.0), edges, 1000, dtype(1e-6))
    for learned in (state.speed, state.acceleration):
        np.testing.assert_array_equal(learned.covariance, learned.covariance.T)
        assert np.linalg.eigvalsh(np.asarray(learned.covariance, float)).min() > 0
    off = np.abs(np.asarray(found.speed) - rotation(20_000).speed)[-5000:]
    assert off.max() < 0.5


def test_500_kmh():
    fast = 500 / 3.6 / 0.3
    found, _ = estimate(chain(), edges_of(Encoder.random(1, TEETH), steady(3000, fast), T), T)
    assert np.asarray(found.measured.valid)[10:].all()
    compensated, measured = (np.asarray(x)[-1000:] - fast for x in (found.speed, found.measured.rotation.speed))
    assert np.std(compensated) < 0.2 * np.std(measured) < 0.004 * fast


def test_no_gradient_is_nan_through_lock_and_start():
    edges = edges_of(ENCODER, locked(600, 300), T)

    def cost(parts):
        found, _ = estimate(parts, edges, T)
        return jnp.sum(found.speed**2) + jnp.sum(found.acceleration**2)

    parts = jax.tree.map(jnp.asarray, chain(harmonics=2, gate=50.0, through_edges=True))
    for leaf in jax.tree.leaves(jax.grad(cost)(parts)):
        assert np.isfinite(leaf).all()


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Encoder(np.zeros(2)), "Encoder.deviation has 2 teeth"),
        (lambda: Encoder(np.full(60, 0.6)), r"Encoder\.deviation = 0\.6"),
        (lambda: Encoder.ideal(60, eccentricity=0.01), r"Encoder\.eccentricity = 0\.01 m is more than 0\.1 of"),
        (lambda: edges_of(ENCODER, steady(1), T), "rotation has 1 samples, two are needed"),
        (lambda: edges_of(ENCODER, steady(9, np.nan), T), "not finite"),
        (lambda: estimate(chain(cutoff=600.0), logged(), T), "cutoff = 600 Hz is not below half the sampling"),
        (lambda: Encoder.ideal(60, clock=-1.0), r"Encoder\.clock = -1"),
        (lambda: TimeStamping(events=2), r"TimeStamping\.events = 2 must be an integer >= 3"),
        (lambda: TimeStamping(order=1), r"TimeStamping\.order = 1"),
        (lambda: HarmonicCompensation("angle"), "HarmonicCompensation.signal = 'angle'"),
        (lambda: HarmonicCompensation("speed", 0), r"HarmonicCompensation\.harmonics = 0"),
        (lambda: HarmonicCompensation("speed", gain=-1.0), r"HarmonicCompensation\.gain = -1"),
        (lambda: NotchFilter("speed", width=0.0), r"NotchFilter\.width = 0"),
        (lambda: WheelSpeedChain(TimeStamping(), NotchFilter("acceleration")), "WheelSpeedChain.speed compensates"),
        (lambda: chain(harmonics=30), "WheelSpeedChain.speed has 30 harmonics; 60 teeth tell 29 apart"),
        (lambda: edges_of(ENCODER, steady(9, -5.0), T), "turns backwards"),
        (lambda: edges_of(ENCODER, steady(9, 400.0), T, capacity=2), "capacity = 2 edges between two samples, 5"),
        (lambda: estimate(chain(), Edges(jnp.zeros(5), jnp.zeros(5, int)), T), "shape"),
        (
            lambda: estimate(chain(), Edges(jnp.zeros((5, 2), jnp.int32), jnp.zeros(5, jnp.int32)), 0.5, 1e-6),
            "whole number of ticks",
        ),
    ],
)
def test_errors_name_the_thing(build, message):
    with pytest.raises(ValueError, match=message):
        build()


def test_values_do_not_compile_twice():
    run = jax.jit(partial(estimate, period=T))
    for seed in range(3):
        run(chain(harmonics=2, forgetting=0.1 * (seed + 1)), edges_of(Encoder.random(seed, TEETH), steady(60), T, 3))
    assert run._cache_size() == 1
