"""What the commands on encoders say of themselves in their reports."""

from tuning.core.about import About

ENCODER = About(
    "Wheel speed and acceleration from encoder edges",
    "A toothed wheel gives an edge whenever a tooth passes. From the recorded times of these edges, wheel speed and "
    "acceleration are found, edges that are doubled or missing are recognised, and the periodic error that uneven "
    "teeth and an eccentric wheel make is learned and taken off. The verdict says whether the edges can be trusted.",
    {
        "rms at multiples": "The part of each signal that repeats with every turn of the wheel, which is error, before "
        "and after it is taken off.",
        "the encoder": "The wheel as the edges tell it. Trusted: share of the log in which the result counts. e / r: "
        "eccentricity over radius. Teeth within: how far teeth are off their place, in parts of a tooth.",
        "signals.png": "Speed and acceleration, measured and compensated; to the right the end of the log. Gaps where "
        "nothing is trusted.",
        "spectrum.png": "Amplitude at multiples of the wheel's frequency, before and after.",
        "teeth.png": "How far each tooth is off its place.",
        "coefficients.png": "Coefficients of the periodic error, learned from speed and from acceleration.",
    },
)
TUNE_ENCODER = About(
    "The compensation of encoder errors, tuned",
    "Encoders with errors drawn at random are simulated. The number of edges in a fit (n), the number of harmonics "
    "taken off (M) and the parameters of the learning are chosen so that wheel speed and acceleration come out best; "
    "then judged on encoders that were not tuned on.",
    {
        "held-out encoders": "Errors on encoders not tuned on, as measured, before and after tuning.",
        "events_and_harmonics.png": "How many times smaller the errors become with n edges and M harmonics.",
        "history.png": "The search: cost of each start by iteration.",
    },
)
ENCODER_STUDY = About(
    "The chain from encoder edges to wheel speed, studied",
    "Simulated encoders with errors: what the errors do to speed and acceleration, how well several ways of taking "
    "them off do, on other encoders and over a long run; and what an anti-lock controller makes of the signals when it "
    "brakes on them. x2 is the wheel's acceleration offset, XBS the slope of the friction curve.",
    {
        "errors of the edges": "What an encoder's imperfections do to its edges, as they are made and as the log of a "
        "steady run tells them.",
        "time-stamping over n events": "Error of speed and acceleration by how many edges one value is made of.",
        "errors learned": "Three models of the periodic error, learned online, against least squares.",
        "rms errors, 16 encoders": "Errors of speed and acceleration by way of compensation, and their ratio to the "
        "uncompensated ones.",
        "other encoders and clocks": "The same on encoders with more or other errors.",
        "endurance": "Whether errors stay small in a long run.",
        "pressure free": "Stops by what the controller is told of the wheel; the pressure without a driver's limit, as "
        "in the source.",
        "pedal 400": "The same stops under a driver's pedal, against the ideal distance.",
        "XBS in the loop": "Error of the observed slope of the friction curve in these stops.",
        "wheel-slip control": "A notch filter against an oscillation of the signal, in control of wheel slip.",
        "five phases at 130": "A notch filter against an oscillation of the signal, under the five-phase controller.",
        "five phases at constant speed": "Frequency of the limit cycle by speed, against that of the wheel.",
        "five phases behind": "Stops behind notch filters, and where they stick.",
        "transitions.png": "Error of every edge and mean of each tooth, against the angle.",
        "time_stamping.png": "Speed and acceleration made of n edges, each shifted.",
        "models.png": "Coefficients of the three models, learned and by least squares.",
        "convergence.png": "Error of both signals against time, mean over encoders.",
        "notch_cycles.png": "Cycles of five phases in the plane of slip and x2, with and without filter.",
        "notch_sticks.png": "Where the cycle's frequency meets the wheel's, and where stops begin their last cycle.",
        "notch_slip.png": "x2 and pressure, with and without a filter.",
        "notch.png": "Amplitude and phase of the notch filter by its width.",
        "cycles.png": "Stops in the plane of slip and x2 by what the controller is told.",
        "stops.png": "Speeds of vehicle and rim against time by what the controller is told.",
    },
)
