"""What the command on delays says of itself in its report."""

from tuning.core.about import About

DELAY_STUDY = About(
    "A delay of the brake: prediction, and how much delay loops bear",
    "A command takes time to reach the brake. A controller that predicts across that time acts as if there were none, "
    "as long as it knows the delay. Margins say how much delay a loop bears before it is unstable.",
    {
        "pendulum.png": "Error of the pendulum under a square wave, without delay, with it, and with prediction.",
        "roots.png": "Rightmost roots of the closed loops over the delay; above zero is unstable.",
        "margins.png": "Delay margin over speed, with and without a notch filter.",
        "nyquist.png": "Open loops in the complex plane; what is left around -1.",
        "tracking.png": "Acceleration offset and its reference under 10 ms of delay.",
        "cycle.png": "The cycle in the plane of slip and acceleration offset.",
        "pressure.png": "Pressure in the brake.",
        "observer.png": "XBS and its estimate.",
        "sweep.png": "Cycles and distance over the delay: where each version stops cycling.",
    },
)
