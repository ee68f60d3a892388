"""What the commands on controllers say of themselves in their reports."""

from tuning.core.about import About

QUANTITY = (
    "Ideal: the shortest distance the driver's pedal allows on that road. Distances count from the first touch of the "
    "pedal to the stop, with switchings located exactly, and sampled as a control unit does. Above ideal: the worse of "
    "both. Onset: the first switching. Lock: how long the wheel stood still while the car was faster than 15 km/h. The "
    "published quantity begins at the first switching and stands for comparison with published tables only."
)
TUNED = {
    "distances from the pedal": f"A row a road and speed, before and after tuning; what the search began with is "
    f"called untuned where it is the default set, else start. {QUANTITY}",
    "scattered conditions": "Stops in the setting that was tuned for, roads, load, brake and encoder scattered: on "
    "draws the set was tuned on, on draws that may refute it, and on further ones. A stop is stuck where a cycle takes "
    "more than 1 s.",
    "distances.png": "By road and speed, before and after: the distance from the pedal over the ideal one, of each of "
    "several cars; of one wheel, below, the published quantity over its own ideal. Bars end at 20 %, with their value "
    "in them where it is more.",
    "history.png": "The search: cost of each start by iteration, and what was chosen in the end.",
    "stop.png": "One stop before and after tuning: speeds, slip, pressure and phases against time.",
    "cycles.png": "Slip against wheel acceleration on each road, before tuning above, after it below. The dotted "
    "vertical is the slip of the friction peak.",
}
TUNE_ABS = About(
    "An anti-lock controller, tuned",
    "The thresholds and rates of an anti-lock controller are tuned by gradient descent over a batch of simulated roads "
    "and speeds, so that the car stops in the shortest distance under a given driver's pedal; then judged as a control "
    "unit runs it, in samples. The limit cycles it settles into are certified, where it has any.",
    TUNED,
)
ABS_SETS = About(
    "The shipped controller sets, made anew",
    "Each controller that ships with the project is tuned again from untuned values, after its recipe.",
    TUNED,
)
ABS_STUDY = About(
    "All anti-lock controllers, compared",
    "All controllers, untuned and tuned, are simulated on the same roads under the same pedal: how far they stop from "
    "the ideal, whether their limit cycles are attractive, and how they take roads, cars and noise they were not tuned "
    "on. XBS is the slope of the friction curve that some of them control; x2 the wheel's acceleration offset.",
    {
        "published surfaces": "Coefficients and peak of the friction curves used throughout.",
        "logics on": "What two logics set by hand do in one stop: the textbook's eight phases, and that of production "
        "cars with four thresholds.",
        "limit cycle of two phases": "The two-phase limit cycle from its closed form, and how far a simulation is off.",
        "control of XBS": "Control of XBS in the phase plane, on the true and on the estimated value.",
        "distances from the pedal, 5 roads": "Above the ideal distance by controller and setting, over all roads and "
        "speeds.",
        "jerk and slip": "What passengers and tyres get of the same stops.",
        "from the pedal [m]": "Distance by controller, road and speed, and the ideal one.",
        "roads that change": "Stops on a patch of snow, and from ice to dry asphalt.",
        "entries reached": "How many entries of the published table are reached or bettered.",
        "what it leaves out": "What happens before the first switching, at which the published quantity begins.",
        "every entry": "The published quantity by controller, road and speed; + is above the published one.",
        "entries above": "Entries that are not reached.",
        "limit cycles at": "A contraction below 1 means that the cycle is attractive: disturbances die out.",
        "scattered stops": "Stops on roads, wheels, brakes and noise drawn at random.",
        "curves.png": "Friction and its slope XBS against slip: one road in detail, and friction of all.",
        "logics.png": "Speeds, acceleration of the rim with its thresholds, pressure and phases of the two logics.",
        "lambert.png": "The branches of Lambert's W of which the closed form of the two-phase cycle is made.",
        "feedback.png": "Phase plane from several starts; beside the true course what the observer believes.",
        "slip_planes.png": "Two and five phases in the plane of slip and x2, untuned and tuned.",
        "distances.png": "Distance above ideal of every tuned controller by road and speed, a panel for each setting. "
        "Bars end at 20 %, with their value in them where it is more.",
        "patch_of_snow.png": "Speeds and pressure over a patch of snow, untuned and tuned.",
        "ice_to_dry.png": "Speeds and pressure from ice to dry asphalt, untuned and tuned.",
        "contraction.png": "Contraction of the limit cycles by road and speed; below 1 is attractive.",
        "robustness": "Distribution of distance over ideal on the scattered stops; sets of one controller share a "
        "colour.",
    },
)
GRADIENT_STUDY = About(
    "Slopes of the mean stop under a control unit's clock",
    "A control unit tests its thresholds every few milliseconds, and a threshold moves nothing until it moves a "
    "switching to another tick. The slope of the mean over phases of the clock is found three ways and held against "
    "differences.",
    {
        "stand-in": "Delay and gain of the stand-in of an encoder's chain beside those of the chain.",
        "slope of the mean": "Cosine of each slope to that by differences, and its entries.",
        "descents under a clock": "Where descents by the located gradient and by that under the clock lead, all judged "
        "under the clock.",
        "slope through the chain": "Stops told by a chain and by its stand-in, and the cosine of the slope that "
        "descends for the chain to that by differences through the chain itself.",
        "stand_in.png": "Delay and gain over wheel speed, of the chain and of its stand-in.",
    },
)
SETTING_STUDY = About(
    "Sets tuned for where they run",
    "A set tuned on the truth is not one a control unit can use. Sets tuned for a clock of 1 and of 5 ms and for an "
    "encoder's chain are judged in every setting, on draws none was tuned on.",
    {
        "every set in every setting": "Mean and worst twentieth above ideal [%], from the pedal to 15 km/h, and stops "
        "that do not end, lock above 15 km/h or stick.",
        "scattered stops through the chain": "The same with roads, load, brake and encoder scattered: on draws a set "
        "was tuned on, was chosen by, and on neither.",
        "settings.png": "Mean above ideal of every set, a panel for each setting. Hollow: some stops do not end, lock "
        "or stick.",
    },
)
DEMO = About(
    "Demonstration: from a brake log to tuned thresholds",
    "First the road is identified from a recorded stop. Then the thresholds of a five-phase anti-lock controller are "
    "tuned, from the default set but for a first one that grows with speed, under a driver who presses at 400 bar/s "
    "and a brake that can follow 750 bar/s with a lag of 5 ms. Last, the tuning is repeated under one limit at a time, "
    "to see what each costs.",
    {
        "friction curve": "The identified road, a row a surface. ± is the half-width of the 95 % interval; ? marks "
        "what the log does not tell.",
        "by the limits in force": "Mean and worst distance above the ideal with one limit at a time in force, and "
        "with all.",
        "friction_curve.png": "Friction against slip: measured, the fitted curve of each surface with its 95 % band, "
        "and the peak.",
        "log.png": "The log against time: speeds, brake pressure, friction measured and fitted; shades tell the "
        "surfaces apart.",
        **TUNED,
    },
)
