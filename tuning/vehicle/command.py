"""`vehicle-study`: anti-lock braking of whole vehicles."""

from tuning.core.command import Force, Out, carry_out
from tuning.vehicle.about import VEHICLE_STUDY


def vehicle_study(out: Out, force: Force = False) -> None:
    """Whole vehicles: the published scenario of two axles, distances of cars, split mu; with figures."""

    def work():
        from tuning.vehicle.tasks import study

        return (), lambda: study(out)

    carry_out(out, work, about=VEHICLE_STUDY, force=force)
