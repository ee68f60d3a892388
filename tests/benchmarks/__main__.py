"""Print the table of benchmarks. Each pair is timed in turns, the best of several rounds counts."""

import os
import time
from functools import partial

import jax
import numpy as np

ROUNDS = 12
LANES, STEP, STEPS, SPEED = 1024, 2e-3, 1250, 33.333


def best_of_rounds(calls: dict) -> dict:
    """Shortest time of each call [s]; the calls take turns.

    A turn is two calls, the second of which is timed: threads of the one before may still be spinning in
    the first.
    """
    best = dict.fromkeys(calls, np.inf)
    for call in calls.values():
        jax.block_until_ready(call())
    for _ in range(ROUNDS):
        for name, call in calls.items():
            jax.block_until_ready(call())
            begun = time.perf_counter()
            jax.block_until_ready(call())
            best[name] = min(best[name], time.perf_counter() - begun)
    return best


def scattered(lanes: int) -> np.ndarray:
    """Burckhardt coefficients of dry asphalt, scattered by 10 %: (3, lanes)."""
    return (
        np.array([[1.2801], [23.99], [0.52]])
        * (1 + 0.1 * np.random.default_rng(0).standard_normal((3, LANES)))[:, :lanes]
    )


def runner(dtype, *, lanes=LANES, sampled=False, steps=STEPS, stop_speed=2.5, checkpoint=None):
    """`run(parameters) -> Rollout` of scattered lanes."""
    import jax.numpy as jnp

    from absjax import Burckhardt, SampledLoop, rollout
    from tests.systems import five_phase_loop

    tyre = Burckhardt(*(jnp.asarray(c, dtype) for c in scattered(lanes)))
    speed = jnp.full(lanes, SPEED, dtype)

    def run(parameters):
        loop = five_phase_loop(parameters, tyre, stop_speed)
        system = SampledLoop(loop) if sampled else loop
        return rollout(
            system, system.initial_state(speed), step=STEP, steps=steps, max_events=200, checkpoint=checkpoint
        )

    return run


def mean_distance(run, parameters):
    return run(parameters).state.plant.distance.mean()


def located_against_sampled() -> None:
    import jax.numpy as jnp

    from tests.systems import PARAMETERS

    for dtype in (jnp.float64, jnp.float32):
        for stop_speed, steps, label in ((2.5, STEPS, "2.5 s, ends at 2.5 m/s"), (None, 900, "1.8 s, no end")):
            functions = {
                name: jax.jit(runner(dtype, sampled=name == "sampled", steps=steps, stop_speed=stop_speed))
                for name in ("located", "sampled")
            }
            parameters = PARAMETERS.astype(dtype)
            results = {name: function(parameters) for name, function in functions.items()}
            lane_steps = {name: float(np.sum(np.asarray(r.time)) / STEP) for name, r in results.items()}
            best = best_of_rounds({name: partial(function, parameters) for name, function in functions.items()})
            ns = {name: 1e9 * best[name] / lane_steps[name] for name in best}
            print(
                f"lane-step, {LANES} lanes, {jnp.dtype(dtype).name}, {label}: located {ns['located']:.1f} ns, "
                f"sampled {ns['sampled']:.1f} ns, ratio {ns['located'] / ns['sampled']:.2f}",
                flush=True,
            )


def gradient_against_forward() -> None:
    import jax.numpy as jnp

    from tests.systems import PARAMETERS

    for dtype in (jnp.float64, jnp.float32):
        run, parameters = runner(dtype, lanes=256), PARAMETERS.astype(dtype)
        forward = jax.jit(run)
        gradient = jax.jit(jax.grad(partial(mean_distance, run)))
        best = best_of_rounds({"forward": partial(forward, parameters), "gradient": partial(gradient, parameters)})
        print(
            f"gradient of the mean distance of 256 lanes, 9 parameters, {jnp.dtype(dtype).name}: "
            f"{best['gradient'] / best['forward']:.2f} times forward, {256 / best['gradient']:.0f} gradients/s",
            flush=True,
        )


def peak_memory() -> None:
    import jax.numpy as jnp

    from tests.systems import PARAMETERS

    need = {}
    for mode in ("forward", "record kept", "checkpointed"):
        run = runner(jnp.float64, lanes=256, steps=5000, checkpoint=mode == "checkpointed")
        function = run if mode == "forward" else jax.grad(partial(mean_distance, run))
        memory = jax.jit(function).lower(PARAMETERS).compile().memory_analysis()
        need[mode] = (memory.temp_size_in_bytes + memory.output_size_in_bytes) / 2**20
    print(
        "memory of 256 lanes over 5000 steps, 9 parameters, float64, as the compiler allots it: "
        + ", ".join(f"{mode} {size:.1f} MiB" for mode, size in need.items()),
        flush=True,
    )


def stops_against_numba() -> None:
    import jax.numpy as jnp
    import numba

    from tests.benchmarks.numba_reference import stops
    from tests.systems import PARAMETERS

    # OpenMP's threads keep spinning when their work is done, and would slow down whatever runs next.
    numba.config.THREADING_LAYER = "workqueue"
    numba.set_num_threads(len(jax.local_devices()))
    c1, c2, c3 = (np.ascontiguousarray(c) for c in scattered(LANES))
    speed, p = np.full(LANES, SPEED), np.asarray(PARAMETERS)
    forward = jax.jit(runner(jnp.float64))

    def by_hand():
        return stops(c1, c2, c3, speed, p[:6], p[6:], STEP, STEPS, 2.5)

    ours = forward(PARAMETERS)
    gap = np.abs(np.asarray(ours.state.plant.distance) - by_hand()[1]).max()
    best = best_of_rounds({"absjax": lambda: forward(PARAMETERS), "numba": by_hand})
    rate = {name: LANES / seconds for name, seconds in best.items()}
    print(
        f"stops/s, {LANES} lanes, float64, 2 ms, {len(jax.local_devices())} cores: absjax {rate['absjax']:.0f}, "
        f"numba by hand {rate['numba']:.0f}, ratio {rate['absjax'] / rate['numba']:.2f} "
        f"(distances agree to {gap:.0e} m)",
        flush=True,
    )


def encoder_chain_against_numpy(encoders: int = 256, samples: int = 1000) -> None:
    import jax.numpy as jnp

    from absjax import Encoder, HarmonicCompensation, TimeStamping, WheelSpeedChain
    from absjax.encoder.edges import edges_of
    from absjax.encoder.rotation import Rotation
    from absjax.encoder.wheel_speed import estimate
    from tests.benchmarks.numpy_reference import PERIOD, compensated

    speed = np.full(samples, 107.0)
    edges = edges_of(Encoder.random(range(encoders)), Rotation.of_speed(speed, 0 * speed, PERIOD), PERIOD)
    chain = WheelSpeedChain(TimeStamping(), *(HarmonicCompensation(s, 6) for s in ("speed", "acceleration")))
    lone = jax.tree.map(lambda x: x[0], edges)
    together = jax.jit(lambda edges: estimate(chain, edges, PERIOD)[0])
    ours = together(edges)
    apart = [together(jax.tree.map(lambda x, i=i: x[i], edges)) for i in range(encoders)]
    gap = max(
        float(jnp.abs(getattr(ours, name) / jnp.stack([getattr(one, name) for one in apart]) - 1)[:, 100:].max())
        for name in ("speed", "acceleration")
    )
    ages, count = np.asarray(lone.ages), np.asarray(lone.count)
    by_hand = compensated(ages, count, 15, 6)
    off = np.abs(by_hand[:, 0] - np.asarray(ours.speed[0]))[100:].max()
    best = best_of_rounds(
        {
            "together": lambda: together(edges),
            "one": lambda: together(lone),
            "numpy": lambda: compensated(ages, count, 15, 6),
        }
    )
    rate = {name: samples / seconds * (encoders if name == "together" else 1) for name, seconds in best.items()}
    print(
        f"encoder chain, n = 15, M = 6, float64: {encoders} encoders at once {rate['together']:.3g} samples/s, one "
        f"{rate['one']:.3g}, NumPy by hand {rate['numpy']:.3g}; {rate['together'] / rate['numpy']:.0f} times NumPy "
        f"(at once against one by one: {gap:.0e}; against NumPy: {off:.0e} rad/s)",
        flush=True,
    )


def cost_of_channels(lanes: int = 256) -> None:
    """Stops from 80 to 30 km/h of one wheel, of two axles and of four wheels, five phases at each."""
    import dataclasses

    import jax.numpy as jnp

    from absjax import Brake, Driver, FivePhase, QuarterCar, Wheel, stop
    from absjax.loop.channel import Channel
    from absjax.loop.vehicle_loop import VehicleLoop
    from absjax.plant.four_wheel import FourWheel
    from absjax.plant.one_wheel import OneWheel
    from absjax.plant.road import as_road
    from absjax.plant.two_axle import TwoAxle

    road = as_road("dry_asphalt")
    cars = OneWheel(QuarterCar(Wheel(), road)), TwoAxle((road,) * 2), FourWheel((road,) * 4)
    eps1 = jnp.linspace(20.0, 40.0, lanes)
    calls, lane_steps, switchings = {}, {}, {}
    for car in cars:
        channels = len(car.places)

        def stops(eps1, car=car, channels=channels):
            controller = dataclasses.replace(FivePhase(), eps1=eps1)
            channel = Channel(Brake(rate_limit=750.0, lag=5e-3), controller)
            loop = VehicleLoop(car, (channel,) * channels, 30 / 3.6, Driver())
            return stop(loop, 80 / 3.6 + 0 * eps1, horizon=3.0, step=STEP, max_events=800)

        forward = jax.jit(stops)
        calls[channels, "forward"] = partial(forward, eps1)
        calls[channels, "gradient"] = partial(jax.jit(jax.grad(lambda e, stops=stops: stops(e).distance.sum())), eps1)
        found = forward(eps1).rollout
        lane_steps[channels], switchings[channels] = float(found.time.sum() / STEP), float(found.events.mean())
    best = best_of_rounds(calls)
    ns = {n: 1e9 * best[n, "forward"] / lane_steps[n] for n in lane_steps}
    for n in ns:
        reverse = best[n, "gradient"] / best[n, "forward"]
        print(
            f"{n} channels, {lanes} lanes, float64: lane-step {ns[n]:.0f} ns, {ns[n] / ns[1]:.1f} times one channel; "
            f"{switchings[n]:.0f} switchings a stop, gradient {reverse:.1f} forward runs",
            flush=True,
        )


def main() -> None:
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_num_cpu_devices", len(os.sched_getaffinity(0)))
    stops_against_numba()
    located_against_sampled()
    gradient_against_forward()
    peak_memory()
    encoder_chain_against_numpy()
    cost_of_channels()


if __name__ == "__main__":
    main()
