"""What the commands on side-slip say of themselves in their reports."""

from tuning.core.about import About

THETA = (
    "Side-slip is the angle between where a car points and where it goes; it is not measured in series cars, but "
    "estimated from steering, yaw rate, accelerations and wheel speeds. Theta is the friction the estimator adapts to."
)
SIDE_SLIP = About(
    "Side-slip and friction from a log of a car",
    f"{THETA} The estimator was run over the log; where the log has true velocities, the estimate is judged by them. "
    "The lines say in which stretches the manoeuvre tells theta at all.",
    {
        "errors": "Error of the estimate against the true velocities of the log.",
        "choice functions": "Whether the assumptions of the estimator's proof held along the run, in shares of it.",
        "no truth": "Range of the estimate. The log has no true velocities to judge it by.",
        "estimates.png": "Longitudinal and lateral velocity, side-slip and friction against time; bands where the log "
        "does not tell the friction.",
        "excitation.png": "Whether the run tells the friction: the estimator's choice functions and conditions.",
        "friction_curves.png": "One tyre's friction: the model (solid) against theta times the nominal curve (dashed).",
        "friction_parameter.png": "Theta that the true velocities ask for, beside the adapted one.",
    },
)
TUNE_SIDE_SLIP = About(
    "An estimator of side-slip, tuned",
    f"{THETA} Its gains were tuned on logs with true velocities, and judged on logs that were held out. A ratio below "
    "1 is an error that became smaller.",
    {
        "parameters": "Before and after; * is on its limit.",
        "errors": "Error on each log before and after, and whether it was tuned on.",
        "held out in turn": "Tuned on all other logs, judged on this one.",
        "history.png": "The search: cost of each start by iteration.",
    },
)
SIDE_SLIP_STUDY = About(
    "Estimators of side-slip, compared over logs",
    f"{THETA} All estimators, Kalman filters and simpler ones among them, were run over the same logs with true "
    "velocities.",
    {
        "side-slip rms": "Root mean square of the error by estimator and log.",
        "side-slip largest": "Largest error by estimator and log.",
        "lateral velocity": "Root mean square of the error by estimator and log.",
        "longitudinal velocity": "Root mean square of the error by estimator and log.",
        "side_slip_errors.png": "Side-slip error of every estimator on every log.",
    },
)
