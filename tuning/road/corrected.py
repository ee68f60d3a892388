"""A log as it would be if the car's own quantities were as known: zeros, delay and lag taken out."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from tuning.logs.brake_log import BrakeLog
from tuning.road.output_error import lagged


def corrected(log: BrakeLog, values: Mapping[str, float]) -> BrakeLog:
    """A log with zeros, delay and lag taken out.

    Args:
        log: as it was read.
        values: of quantities of `tuning.logs.quantities.KINDS`; those that are not given count as 0.
    """
    changed = {}
    if log.brake_pressure is not None:
        pressure = lagged(log.brake_pressure, log.period, max(values.get("pressure_lag", 0.0), 0.0))
        changed["brake_pressure"] = pressure - values.get("pressure_zero", 0.0)
    if log.acceleration is not None:
        changed["acceleration"] = log.acceleration - values.get("acceleration_bias", 0.0)
    if log.force is not None:
        changed["force"] = log.force - values.get("force_zero", 0.0)
    if values.get("speed_delay", 0.0):
        changed["vehicle_speed"] = np.interp(log.time + values["speed_delay"], log.time, log.vehicle_speed)
    return dataclasses.replace(log, **changed)
