"""What `describe` says of itself in its report."""

from tuning.core.about import About

DESCRIBE = About(
    "What a brake log holds",
    "A brake log is a recording of one braked wheel: its speed, the car's speed, brake pressure, deceleration, force. "
    "Before anything is identified from it, its channels are found, their units and rates told, and what looks wrong "
    "with them is said. The road itself is not looked at.",
    {
        "signals": "A row a signal that was found. Step: the smallest difference the channel resolves. Measured: share "
        "of the samples on the common time grid that the channel itself had; the others are interpolated.",
        "description.png": "Every signal against time: points are measurements, the grey line is what is used; in red "
        "what is clipped or stuck and not to be trusted.",
    },
)
