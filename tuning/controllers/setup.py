"""The loop a configuration describes: plant, brake, driver, observer, controller, and the steps they need."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

from absjax.controllers.base import Controller
from absjax.lanes import chosen
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.delayed_loop import DelayedLoop, nodes_of
from absjax.loop.driver import Driver
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.sampled_vehicle import SampledVehicle
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.observers.base import Observer
from absjax.observers.tyres import on_tyres
from absjax.plant.base import Plant, Road
from absjax.plant.brake import Brake
from absjax.plant.road import as_road
from absjax.plant.test_rig import TestRig
from absjax.plant.wheel import Wheel
from absjax.sensors.base import Sensor
from absjax.tyres.surfaces import SURFACES
from tuning.cars.entry import VehicleEntry, of_axle
from tuning.controllers.chain import LEARNING, PREFIX, Chain, of_chain, of_controller
from tuning.controllers.config import TuningConfig
from tuning.controllers.loops import in_control_unit
from tuning.core import components
from tuning.core.box import Box, box_of, joined
from tuning.core.config import ConfigError
from tuning.core.roads import tyres_by_name


@dataclasses.dataclass(frozen=True)
class Setup:
    """What a configuration describes, built once; `Setup.of` a configuration."""

    config: TuningConfig
    kind: type[Controller]
    wheel: Wheel
    brake: Brake
    driver: Driver
    observer: Observer | None
    """of a vehicle that of the front axle"""
    sensor: Sensor | None
    initial: dict[str, float]
    """parameters of the controller to start from"""
    step: float
    """grid step, s"""

    @classmethod
    def of(cls, config: TuningConfig) -> "Setup":
        """The setup of a configuration.

        Raises:
            ConfigError: if a part is not admissible; names the entry.
        """
        wheel, design = components.built("wheel", Wheel, config.wheel), config.design
        if config.vehicle is not None:
            wheel = _axle_wheel(config.vehicle, 0)
        try:
            brake = Brake(config.rate_limit, config.lag, None if config.predicts else config.delay)
            driver = Driver(config.pedal_rate, config.foot_delay, config.driver_pressure)
        except ValueError as error:
            raise ConfigError(str(error)) from None
        step, observer = config.step or config.kind.grid_step, None
        if design is not None:
            step = config.step or 1e-3 / design.substeps
            observer = components.built("observer_parameters", design, config.observer_parameters).observer(wheel)
        sensor = config.sensor_kind
        if sensor is not None:
            sensor = components.built("sensor_parameters", sensor, config.sensor_parameters)
        known = {"delay": config.delay} if config.predicts and config.delay else {}
        given = of_controller(config.start)
        initial = {
            prefix + name: value
            for prefix in config.prefixes
            for name, value in components.initial(config.kind, {**known, **_without(prefix, given)}).items()
        }
        if config.tells:
            of_kind = {**LEARNING[config.chain], **of_chain(config.start)}
            initial |= {PREFIX + name: value for name, value in components.initial(Chain, of_kind).items()}
        setup = cls(config, config.kind, wheel, brake, driver, observer, sensor, initial, step)
        setup.loop_of(which=() if config.vehicle is None else range(len(config.vehicle.each)))
        setup.chain()
        return setup

    def controller(
        self, values: Mapping[str, Any] | None = None, axle: int = 0, vehicle: VehicleEntry | None = None
    ) -> Controller:
        """The controller of given parameters, of the initial ones without; of a vehicle that of an axle.

        Args:
            vehicle: one of the configuration's; the first of them without.
        """
        values, wheel = of_controller({**self.initial, **(values or {})}), self.wheel
        vehicle = vehicle or self.config.vehicle
        if vehicle is not None:
            values, wheel = of_axle(values, axle), _axle_wheel(vehicle, axle)
        return components.built("start", self.kind, values, wheel)

    def chain(self, values: Mapping[str, Any] | None = None) -> Chain | None:
        """The chain through the edges that a setting tells by, of given parameters; None without one."""
        kind = self.config.chain
        if self.config.setting != "chain" or kind not in LEARNING:
            return None
        return components.built("start", Chain, {**LEARNING[kind], **of_chain({**self.initial, **(values or {})})})

    def loop_of(
        self,
        values: Mapping[str, Any] | None = None,
        road: Any = SURFACES["dry_asphalt"],
        pedal_rate: Any = None,
        which: Sequence[int] = (),
    ) -> ClosedLoop | VehicleLoop:
        """The loop of given parameters, of a vehicle where there is one, else of one wheel; see `loop`.

        Args:
            which: of the vehicles of the configuration in each lane; the first without.
        """
        vehicle = self.config.vehicle
        if vehicle is None:
            return self.loop(self.controller(values), road, pedal_rate)
        loops = [self._vehicle_loop(values, one) for one in vehicle.each]
        try:
            loop = chosen(loops, which) if len(which) else loops[0]
        except ValueError:
            raise ConfigError("vehicle.car: all cars or none must have a relaxation length") from None
        car: Any = loop.vehicle
        roads = (as_road(road),) * vehicle.wheels
        driver = self.driver if pedal_rate is None else dataclasses.replace(self.driver, rate=pedal_rate)
        return dataclasses.replace(loop, vehicle=dataclasses.replace(car, roads=roads), driver=driver)

    def _vehicle_loop(self, values: Mapping[str, Any] | None, vehicle: VehicleEntry) -> VehicleLoop:
        """That of one vehicle, on dry asphalt."""
        model = vehicle.vehicle((as_road("dry_asphalt"),) * vehicle.wheels)
        controllers = [self.controller(values, axle, vehicle) for axle in range(2)]
        observers = [self._observer_of(vehicle, axle) for axle in range(2)]
        stop_speed = self.config.stop_speed_kmh / 3.6
        return vehicle.loop(model, self.brake, controllers, observers, stop_speed, self.driver)

    def _observer_of(self, vehicle: VehicleEntry, axle: int) -> Observer | None:
        """That of an axle; one that knows of relaxed tyres has the length of the car's."""
        if self.config.design is None:
            return None
        observer = self.config.design(**self.config.observer_parameters).observer(_axle_wheel(vehicle, axle))
        return on_tyres(observer, vehicle.cars[0].relaxation)

    def plant(self, road: Road) -> Plant:
        """What is braked, on a road."""
        fields: dict[str, Any] = {"wheel": self.wheel, "road": road}
        try:
            return self.config.plant_kind(**fields, **self.config.plant_parameters)
        except (TypeError, ValueError) as error:
            raise ConfigError(f"plant: {error}") from None

    def loop(self, controller: Controller, road: Any = SURFACES["dry_asphalt"], pedal_rate: Any = None) -> ClosedLoop:
        """The closed loop on a road or tyre curve; the pedal's pressure rate [bar/s] may carry lanes."""
        driver = self.driver if pedal_rate is None else dataclasses.replace(self.driver, rate=pedal_rate)
        stop_speed = self.config.stop_speed_kmh / 3.6
        parts = self.plant(as_road(road)), self.brake, controller, stop_speed, self.observer, driver
        if self.config.predicts:
            delay = self.config.delay or 0.0
            return DelayedLoop(*parts, delay=delay, nodes=nodes_of(delay, self.step))
        return ClosedLoop(*parts)

    def rig_loop(self, controller: Controller, road: Road, speed: Any) -> ClosedLoop:
        """The same on a rig at constant speed [m/s], where limit cycles are looked for."""
        return dataclasses.replace(self.loop(controller, road), plant=TestRig(self.wheel, road, speed), stop_speed=None)

    def sampled_grid(self, period: float | None = None) -> tuple[float, int]:
        """Grid step [s] and steps per test of the guards when sampled; the observer has steps of its own then.

        The step is the period itself, or the largest part of it that does for the controller.
        """
        period = self.config.sampled_period if period is None else period
        longest = self.step if self.observer is None else self.kind.grid_step
        ticks = max(1, math.ceil(period / longest - 1e-9))
        return period / ticks, ticks

    def substeps(self, period: float | None = None) -> int:
        """Runge-Kutta steps of the observer per sample."""
        design, period = self.config.design, self.config.sampled_period if period is None else period
        if design is None:
            return 1
        return self.config.substeps or math.ceil(2 * design.substeps * period / 1e-3)

    def sampled(
        self, loop: ClosedLoop | VehicleLoop, period: float | None = None, sensor: Sensor | None = None
    ) -> tuple[SampledLoop | SampledVehicle, float]:
        """A loop under the clock of a control unit, with the configured sensor unless one is given; its grid step."""
        step, ticks = self.sampled_grid(period)
        vehicle = self.config.vehicle
        speedometer = None if vehicle is None else vehicle.speedometer()
        how = ticks, self.substeps(period), step * ticks, sensor or self.sensor, speedometer
        return in_control_unit(loop, *how, self.config.delay), step

    def box(self) -> Box:
        """The tuned parameters, their limits and their order.

        Raises:
            ConfigError: if limits are not admissible, or the controller cannot work on a road, at the start or at the
                lowest limits.
        """
        config, roads = self.config, tyres_by_name(self.config.roads)
        spans, boxes = self.kind.spans_on(roads), []
        for axle, prefix in enumerate(config.prefixes):
            box = box_of(
                self.kind,
                _without(prefix, of_controller(self.initial)),
                tune=[name.removeprefix(prefix) for name in config.own_tune if name.startswith(prefix)],
                limits=_without(prefix, of_controller(config.limits)),
                spans=spans,
                floor=config.threshold_floor,
            )
            lowest = {prefix + name: value for name, value in zip(box.names, box.low) if name in spans}
            for entry, values in (("start", {}), ("limits", lowest)):
                try:
                    self.controller(values, axle).require_roads(roads)
                except ValueError as error:
                    raise ConfigError(f"{entry}: {error}") from None
            boxes.append(box.called(prefix))
        chained = [name.removeprefix(PREFIX) for name in config.tune if name.startswith(PREFIX)]
        if chained:
            most = LEARNING[config.chain]["harmonics"]
            limits = {"harmonics": (1.0, most)} if "harmonics" in chained else {}
            box = box_of(Chain, of_chain(self.initial), tune=chained, limits=limits | of_chain(config.limits))
            boxes.append(box.called(PREFIX))
        return joined(boxes)


def _without(prefix: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Those whose names begin with a prefix, called without it."""
    return {name.removeprefix(prefix): value for name, value in values.items() if name.startswith(prefix)}


def _axle_wheel(vehicle: VehicleEntry, axle: int) -> Wheel:
    """A wheel of an axle of a vehicle, with its load at rest."""
    model = vehicle.vehicle((as_road("dry_asphalt"),) * vehicle.wheels)
    return model.wheels[axle * vehicle.wheels // 2]
