"""Vehicle speed estimated from wheel speeds and an accelerometer."""

from absjax.speed.base import SpeedEstimator
from absjax.speed.fixed_gradient import FixedGradient
from absjax.speed.kalman import KalmanSpeed
from absjax.speed.largest_rim import LargestRim
from absjax.speed.reference import ReferenceSpeed

SPEED_ESTIMATORS: dict[str, type[SpeedEstimator]] = {
    "kalman": KalmanSpeed,
    "reference": ReferenceSpeed,
    "largest_rim": LargestRim,
    "fixed_gradient": FixedGradient,
}
"""By name."""
