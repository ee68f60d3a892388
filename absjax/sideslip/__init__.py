"""Side-slip of a car, estimated with adaptation to the friction of the road."""

from absjax.sideslip.choice import ConstantXi, PublishedXi, SlopeXi, XiRule
from absjax.sideslip.friction import ExponentialFriction, LevelBurckhardt, MonotoneFriction, TanhFriction
from absjax.sideslip.monitor import Monitor, NoMonitor, PublishedMonitor, ScaledMonitor

FRICTION_MODELS: dict[str, type[MonotoneFriction]] = {
    "tanh": TanhFriction,
    "exponential": ExponentialFriction,
    "burckhardt": LevelBurckhardt,
}
XI_RULES: dict[str, type[XiRule]] = {"published": PublishedXi, "slope": SlopeXi, "constant": ConstantXi}
MONITORS: dict[str, type[Monitor]] = {"scaled": ScaledMonitor, "published": PublishedMonitor, "none": NoMonitor}
