"""What the accelerometers on the body tell of the accelerations along the road.

They sit on a body that rolls and pitches: by 0.015 rad for each m/s^2 to the side, and by 0.005 rad for each along,
so that they see a part of the weight. Without it the error on low friction doubles. Ours; the source corrects drift
and bias alone, by a high-pass in the adaptation (8.1.3).
"""

from typing import Any

from absjax.parameters import model, parameter
from absjax.plant.wheel import GRAVITY
from absjax.sideslip.car import CarSample


@model
class BodyAccelerometer:
    """ay / (1 + k_roll g), ax / (1 + k_pitch g)."""

    roll: Any = parameter("roll angle over ay, rad s^2/m", default=0.015, low=0.0, high=0.1)
    pitch: Any = parameter("pitch angle over ax, rad s^2/m", default=0.005, low=0.0, high=0.1)

    def level(self, sample: CarSample) -> CarSample:
        """The sample with accelerations along the road."""
        return sample._replace(
            longitudinal_acceleration=sample.longitudinal_acceleration / (1 + self.pitch * GRAVITY),
            lateral_acceleration=sample.lateral_acceleration / (1 + self.roll * GRAVITY),
        )
