"""Names of channels in common exports: the project's own, MoTeC's, AiM's, those of CAN databases and of tyre rigs.

A name is compared without its unit, its wheel, capitals and punctuation. The names are those seen in public logs.
"""

import re

from tuning.logs.units import Unit, unit_of

NAMES = {
    "time": "time t ts et timestamp timestamps elapsedtime logtime zeit datetime",
    "wheel_speed": "wheelspeed wheelspd whlspeed whlspd wheelrotspeed wheelrotationalspeed wheelangularspeed nwheel "
    "wwheel vwheel wspd omega omegawheel wheelrpm rimspeed raddrehzahl radgeschwindigkeit",
    "vehicle_speed": "vehiclespeed vehiclespd vehspeed vehspd vcar vveh speed carspeed gpsspeed groundspeed corrspeed "
    "bodyspeed speedgps speedobd vgps vx fahrzeuggeschwindigkeit",
    "brake_pressure": "brakepressure brakepress brakepres brkpressure brkpress brkpres brkp pbrake pbrk brakep "
    "brakelinepressure brakecylinderpressure wheelbrakepressure caliperpressure bremsdruck",
    "acceleration": "longitudinalacceleration longacceleration longacc longaccel longg lonacc acclong alongitudinal "
    "along ax axcar accx accelx accelerationx inlineacc inlineacceleration gforcelong gforcelon glong glon gpslonacc "
    "laengsbeschleunigung",
    "force": "longitudinalforce fx fxtyre fxtire tyreforcex tireforcex wheelforcex",
    "load": "verticalload fz fztyre fztire wheelload wheelforcez verticalforce normalforce normalload radlast",
}
"""By signal, in small letters and without punctuation."""
WHEELS = re.compile(r"([fr][lr]|[lr][fr]|[vh][lr]|(front|rear)(left|right)?|(left|right)(front|rear))$")
RIG = {
    "ET": ("time", "s"),
    "V": ("vehicle_speed", "km/h"),
    "N": ("wheel_speed", "rpm"),
    "FX": ("force", "N"),
    "FZ": ("load", "N"),
    "SL": ("wheel_speed", "slip"),
    "SR": ("wheel_speed", "slip"),
}
"""Channels of flat-belt tyre rigs, and their units where the file states none; the later ones if the earlier lack."""
RIG_MARKS = {"ET", "V", "FX", "FZ"}
"""Names that make a file one of a tyre rig."""
BRACKETS = re.compile(r"^(.*?)\s*[\[({<]([^\[\](){}<>]*(?:\([^()]*\))?)[\])}>]\s*$")


def stated(signal: str, name: str) -> tuple[str, Unit | None]:
    """A name without the unit it states for a signal, and the unit."""
    found = BRACKETS.match(name)
    if found and found.group(2):
        unit = unit_of(signal, found.group(2))
        if unit:
            return found.group(1), unit
    parts = name.split("_")
    for count in (3, 2, 1):
        if len(parts) > count:
            unit = unit_of(signal, "_".join(parts[-count:]))
            if unit:
                return "_".join(parts[:-count]), unit
    return name, None


def may_be(signal: str, name: str) -> bool:
    """Whether a name is one of those known for a signal."""
    bare = re.sub(r"[\W_]", "", stated(signal, name)[0].lower())
    known = NAMES[signal].split()
    return bare in known or WHEELS.sub("", bare) in known
