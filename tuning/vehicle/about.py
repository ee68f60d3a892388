"""What the commands on whole vehicles say of themselves in their reports."""

from tuning.core.about import About

VEHICLE_STUDY = About(
    "Anti-lock braking of whole vehicles",
    "Cars on two axles and on four wheels brake under one controller for each wheel or axle. Load moves to the front, "
    "tyres take a length to build up their force, and the control unit may have to estimate the car's speed.",
    {
        "published scenario": "Errors while the controllers act: of the speed, of the load as reckoned from the "
        "acceleration, of XBS; how many of its zero crossings the estimate finds, and how long it takes after a change "
        "of the road.",
        "observers told": "The same of observers that are told another relaxation length of the tyres, or none.",
        "distances": "Distance over the ideal one of the car under the same pedal, mean and worst of all roads and "
        "speeds: default sets, sets tuned on a quarter car, and sets tuned on the car.",
        "roads that change": "The same of five phases and of wheel slip where the road changes along the way: to less "
        "friction, to more, and a patch; no set was tuned on these. Wheels slide at a slip below -0.8 above 15 km/h: "
        "one that is let go of whenever it stands, and locks again, has no long lock, and slides all the same.",
        "further roads": "On others, on which nothing was tuned either.",
        "speed.png": "Speed of the car, estimated speed and rims; dashed lines: changes of the road.",
        "pressure.png": "Pressure in front and behind.",
        "load.png": "Loads of the axles, true and as reckoned from the measured acceleration.",
        "stiffness_compared.png": "XBS, and its estimates from the true signals and from what the unit is told.",
        "stiffness.png": "XBS and its estimate in front and behind.",
    },
)
DRIVE_LOG = About(
    "A car driven by a log",
    "The four-wheel car is driven by the wheel speeds and the steering of a log. One number is fitted to what was "
    "measured, yaw rate and lateral acceleration: the friction over that of the tyre's curve. The truth of the log is "
    "for judging only.",
    {
        "cars driven": "Each car with the friction that fits, its misfit to the measurements, and its errors from 1 s "
        "on against the truth.",
        "driven.png": "Motion of the car that fits the measurements best, against the truth or what was measured.",
    },
)
SPLIT_MU = About(
    "Braking on split friction",
    "A four-wheel car brakes hard with the left wheels on dry asphalt and the right ones on less. Each wheel has its "
    "own channel, or both wheels of an axle go by the one that turns slower; the steering wheel is held, or a driver "
    "steers against the yaw.",
    {
        "split mu": "From the pedal to the stop speed; yaw rate and side-slip are the largest on the way.",
        "split_mu.png": "Yaw rate and side-slip over time, and what distance is paid for less of them.",
        "shortest stops": "Under each limit of the yaw rate, a driver steering, distance and largest yaw rate of the "
        "shortest stop among all sets that were judged: in which the car does not spin, and no wheel locks or slides "
        "for long, located as in a control unit that ticks every millisecond. Then from a speed and on a road that it "
        "was not tuned for; side-slip, longest lock and slide above 15 km/h are the worse of located and sampled.",
        "trade_off.png": "Distance over the largest yaw rate: of all sets that were judged, with the front among them; "
        "and of the sets of the limits wherever they were judged.",
    },
)
REGULATION = About(
    "Controllers of a car, screened after UN Regulation 13-H, Annex 6",
    "Simulated tests after the regulation: how much of the adhesion is used, measured as it says, by stops of single "
    "axles without anti-lock control; locks; changes of the road; split friction. It is no certificate.",
    {
        "screening": "What each row demands, what was reached, and the margin.",
        ".png": "The stops of the screening: speed of the car and rims.",
    },
)
REGULATION_STUDY = About(
    "All controllers of a car, screened after UN Regulation 13-H, Annex 6",
    "The simulated tests of regulation with every controller on every car: its default parameters, the shipped set "
    "that was tuned on one wheel, and that tuned on a car. It is no certificate.",
    {
        "screening": "Of both loads the worst. Epsilon at least 0.75; locks at most 0.2 s; wheels at a slip below "
        "-0.8 at most 0.5 s in all; z of the split road over what is demanded; steerability at least 0.3, and "
        "told only, that of the half second which has least of it; the steering wheel in two seconds at most 120 deg. "
        "Narrow rows are passed by less than 5 %. Undefined: of a stop that diverged, or has no end.",
    },
)
