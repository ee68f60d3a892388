"""What the command on vehicle speed says of itself in its report."""

from tuning.core.about import About

SPEED_STUDY = About(
    "Estimators of the vehicle's speed, tuned and compared",
    "No car measures its speed; a control unit makes it of wheels, which slip while it brakes, and of an accelerometer "
    "with a bias. Estimators were tuned on simulated anti-lock stops and judged on others.",
    {
        "held-out": "Errors on stops that were not tuned on, while a controller acts, before and after tuning.",
        "tuned stops": "Errors on the stops that were tuned on.",
        "published scenario": "Errors in the scenario of the source, which reports 18 % on average.",
        "each road": "Mean error of the tuned estimators by road.",
        "rolling": "The same where the wheels roll longer before the pedal is touched, which tells the bias.",
        "parameters": "Before and after; * is on its limit.",
        "gates": "Error as the gates get wider, by which a filter tells that a wheel slips.",
        "speed.png": "True and estimated speed and the rims, and below the errors.",
    },
)
