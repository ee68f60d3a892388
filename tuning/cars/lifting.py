"""Whether a car's rear wheels lift under braking.

    F_r = m (g lf - h |v'|) / L = 0    at |v'| / g = lf / h

The models hold what lies beyond to be no less than zero and go on; a car turns over.
"""

from collections.abc import Sequence
from typing import Any

from tuning.cars.entry import VehicleEntry
from tuning.core.roads import tyres_by_name


def lifting(vehicle: VehicleEntry | None, roads: Sequence[Any]) -> list[str]:
    """A sentence for every car and load whose rear wheels lift before a road's friction is used up."""
    peaks = {name: max(float(tyre.peak().friction) for tyre in tyres) for name, tyres in tyres_by_name(roads).items()}
    found = []
    for one in () if vehicle is None else vehicle.each:
        (car,) = one.cars
        load = car.laden if one.laden else car.unladen
        least = load.to_front / load.height
        lifts = [name for name, peak in peaks.items() if peak > least]
        if lifts:
            found.append(
                f"{one.name}: its rear wheels lift from {least:.2f} g on, and there is more friction on "
                f"{', '.join(lifts)}; the model does not turn over, and what it finds there holds for no car"
            )
    return found
