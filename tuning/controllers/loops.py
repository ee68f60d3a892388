"""What tuners do with a loop, of one wheel or of a vehicle: parameters put in, rows carried, a clock, the ideal."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, TypeVar

from absjax.lanes import repeated
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.delayed_loop import in_unit
from absjax.loop.ideal import ideal_distance
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.sampled_vehicle import SampledVehicle
from absjax.loop.vehicle_ideal import vehicle_ideal_distance
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.sensors.base import Sensor
from tuning.cars.entry import of_axle
from tuning.cars.speedometer import Speedometer
from tuning.controllers.chain import of_controller

Sensors = Sensor | tuple[Sensor, ...] | None
Loop = TypeVar("Loop", bound=ClosedLoop | VehicleLoop)
CARRIERS = "plant", "vehicle", "brake", "driver"
"""Parts of a loop that carry the rows, those it has; of a vehicle's loop its channels do as well."""


def carried(loop: Loop, change: Callable[[Any], Any]) -> Loop:
    """A loop whose parts that carry the rows are changed."""
    parts = {name: change(getattr(loop, name)) for name in CARRIERS if hasattr(loop, name)}
    if isinstance(loop, VehicleLoop):
        parts["channels"] = tuple(map(change, loop.channels))
    return dataclasses.replace(loop, **parts)


def with_parameters(loop: Loop, own: Mapping[str, Any]) -> Loop:
    """A loop with parameters of its controller, or of those of its axles; a chain's are none of the loop."""
    own = of_controller(own)

    def given(controller, values):
        return dataclasses.replace(controller, **values)

    if isinstance(loop, ClosedLoop):
        return dataclasses.replace(loop, controller=given(loop.controller, own))
    places = len(loop.vehicle.places)
    channels = tuple(
        dataclasses.replace(channel, controller=given(channel.controller, of_axle(own, wheels[0] * 2 // places)))
        for channel, wheels in zip(loop.channels, loop.wheels_of)
    )
    return dataclasses.replace(loop, channels=channels)


def loop_of_lanes(loop: Loop, own: Mapping[str, Any], rows: int) -> Loop:
    """A loop whose plant and driver carry the rows, with the controller's parameters of each lane, (lanes,)."""
    sets = len(next(iter(own.values()))) // rows
    return with_parameters(carried(loop, partial(repeated, times=sets)), own)


def in_control_unit(
    loop: ClosedLoop | VehicleLoop,
    ticks: int,
    substeps: int,
    period: float,
    sensor: Sensors = None,
    speedometer: Speedometer | None = None,
    delay: float | None = None,
    kind: type[SampledLoop] = SampledLoop,
) -> SampledLoop | SampledVehicle:
    """A loop in a control unit that tests its guards every so many grid steps; a vehicle has the sensor at each wheel.

    Args:
        sensor: what is measured with; of a vehicle one for all wheels, or one for each.
        substeps: Runge-Kutta steps of an observer per sample.
        period: between two tests [s].
        speedometer: what the unit estimates the speed of a vehicle by; None tells it the true one.
        delay: between a controller that predicts and the brake [s].
        kind: of the loop of one wheel without such a delay.
    """
    if isinstance(loop, ClosedLoop):
        assert not isinstance(sensor, tuple)
        if kind is not SampledLoop:
            return kind(loop, sensor, tick_every=ticks, substeps=substeps)
        return in_unit(loop, sensor, delay, period, tick_every=ticks, substeps=substeps)
    sensors = () if sensor is None else sensor
    if not isinstance(sensors, tuple):
        sensors = (sensors,) * len(loop.vehicle.places)
    how = {"tick_every": ticks, "substeps": substeps, "period": period}
    if speedometer is None:
        return SampledVehicle(loop, sensors, **how)
    rolling = round(speedometer.rolling / period)
    return SampledVehicle(loop, sensors, speedometer.estimator, speedometer.accelerometer, rolling=rolling, **how)


def shortest(loop: ClosedLoop | VehicleLoop, speed: Any, horizon: float) -> Any:
    """The shortest distances (rows,) that the pedal allows [m]; infinite where a stop takes much longer than the
    horizon [s]."""
    # A power of two: stops on many roads, which end long before, are of one program.
    horizon = 2.0 ** math.ceil(math.log2(horizon))
    if isinstance(loop, ClosedLoop):
        return ideal_distance(dataclasses.replace(loop, observer=None), speed, horizon=horizon)
    return vehicle_ideal_distance(loop, speed, horizon=horizon)
