"""What the commands on observers say of themselves in their reports."""

from tuning.core.about import About

CERTIFICATE = (
    "An observer estimates, from the wheel's acceleration offset x2, the slope of the friction curve at the point the "
    "tyre is at (XBS), which tells how near the friction peak is without knowing the road."
)
TUNE_OBSERVER = About(
    "Gains of an observer of the friction slope, tuned",
    f"{CERTIFICATE} Its gains are tuned on simulated runs, or on a log with measured force, and judged on what was not "
    "tuned on. The certificate says whether its error is proven to decay, and how fast.",
    {
        "runs tuned on": "Settling after a change of the road, the share of noise, and the error, before and after.",
        "settling on changes": "Worst settling time on changes of the road that were not tuned on, by the road changed "
        "to.",
        "against force": "Root mean square of the error on the part of the log tuned on and on the rest.",
        "history.png": "The search: cost of each start by iteration.",
        "held_out.png": "Worst settling by the road changed to, before and after, on changes not tuned on.",
        "log.png": "XBS on the log, from force and observed, before and after; the part tuned on lies left of the "
        "line.",
    },
)
OBSERVER_STUDY = About(
    "Observers of the friction slope, default gains against tuned",
    f"{CERTIFICATE} Default gains and tuned ones are compared on simulated runs over changing roads, with noise, with "
    "a wrong vehicle speed, on a recorded rig log, and in the loop with a controller that tracks.",
    {
        "exponential basis": "The curve the 4-state observer believes in, and how far it is off the published ones.",
        "what a run offers": "Whether runs move enough for an observer to tell the slope.",
        "triple pole": "A loop of controller and observer with gains as published, and what it does.",
        "worst settling": "Time until the estimate is near the truth after a change of the road, worst case [s].",
        "settling on changes": "The same on changes that were not tuned on.",
        "of noise on x2": "Error that measurement noise alone makes, once settled.",
        "vehicle speed wrong": "Error when the observer is told a wrong vehicle speed.",
        "clamped": "What it costs to keep the estimate between bounds.",
        "settling against noise": "Gains tuned with more or less weight on noise.",
        "against the slope of the curve": "Error on the rig log against the slope of the curve fitted to force.",
        "second half": "The adaptive observer once it has learned.",
        "tracking": "Stops over dry, wet and snow, without feedback and tracking on the estimate.",
        "basis.png": "Friction and XBS against slip: published curve and the observer's.",
        "singularity.png": "What can be observed where the signal is zero, and what changes of its sign cost.",
        "singular_loop.png": "What the published loop does, and the errors of its observer.",
        "singular_error.png": "The same errors in a plane, from the first switching on.",
        "held_out.png": "Worst settling by the road changed to, on changes not tuned on.",
        "rig_slip.png": "Wheel slip on the rig log, and the friction peak.",
        "rig_adaptive.png": "States and parameters of the adaptive observer on the rig log.",
        "rig_xbs.png": "XBS on the rig log, from force and estimated; the whole log and a stretch of it.",
        "rig_3_state.png": "Acceleration offset and XBS on the rig log, measured and estimated.",
        "_states.png": "Errors of the adaptive observer's states and parameters.",
        "_xbs.png": "XBS true and estimated, and the errors.",
        "road_change_4_state.png": "The 4-state observer over a change of the road.",
        "perturbed_offset.png": "The acceleration offset, and as it is measured.",
        "excitation.png": "How much a run tells: eigenvalues of its information in windows, and times between changes "
        "of sign.",
        "speed.png": "XBS when the vehicle speed is wrong by 20 %.",
        "trade_off.png": "Settling against noise: tuned with several weights of the noise; points are gain sets.",
        "tracking.png": "Speeds, acceleration offset, XBS and pressure of every stop, a column each.",
    },
)
