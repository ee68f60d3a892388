"""What a control unit measures instead of the truth."""

from absjax.sensors.base import Sensor
from absjax.sensors.delayed import DelayedSensor
from absjax.sensors.encoder import EncoderSensor
from absjax.sensors.noisy import NoisySensor

SENSORS: dict[str, type[Sensor]] = {
    "noisy": NoisySensor,
    "encoder": EncoderSensor,
    "delayed": DelayedSensor,
}
"""By name."""
