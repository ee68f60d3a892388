"""What `identify` says of itself in its report."""

from tuning.core.about import About

IDENTIFY = About(
    "The road's friction curve from a brake log",
    "From the recording of one braked wheel the friction between tyre and road is found as a curve against wheel slip, "
    "with its uncertainty; one curve for each surface the car braked on. The verdict says whether the log goes with "
    "what the fit takes for true: sound, doubtful, or refuted. A refuted curve should not be used.",
    {
        "friction curve": "A row a surface, with the time it lasted: coefficients of the curve, then its peak: the "
        "largest friction, and the slip at which it lies. ± is the half-width of the 95 % interval; ? marks what this "
        "log does not tell.",
        "the car's own quantities": "Zeros, delays and scales of the car's channels that the log tells better than the "
        "car's file.",
        "friction_curve.png": "Friction against slip. Points: measured. Lines: the fitted curve of each surface with "
        "its 95 % band. The marked point is the peak, with its intervals.",
        "log.png": "The log against time: speeds of vehicle and wheel rim, brake pressure, and friction, measured and "
        "fitted. Shades tell the surfaces apart.",
    },
)
