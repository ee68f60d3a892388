"""The studies of controllers where they run: slopes and descents under a clock; sets by setting; scattered stops."""

from collections.abc import Iterator
from pathlib import Path

from tuning.controllers.published import ROADS
from tuning.controllers.study import by_setting, descents, slopes, stand_in, through_chain
from tuning.core.figures import save
from tuning.core.files import write_csv
from tuning.core.report import Report


def run_gradients(out: Path, pairs: int, roads: tuple[str, ...] | None = None) -> Iterator[Report]:
    """The stand-in of an encoder's chain, and slopes of the mean stop under a control unit's clock."""
    responses = stand_in.responses()
    files = [save(stand_in.figure(responses), out / "stand_in.png")]
    yield Report({"stand-in of time-stamping over 12 edges": responses}, [], files)
    for period in slopes.PERIODS:
        title = f"slope of the mean stop, a tick every {1e3 * period:g} ms: {2 * pairs} lanes"
        yield Report({title: slopes.table(period, pairs, roads or ROADS)}, [], [])
    found = [row for period in slopes.PERIODS for row in descents.table(period)]
    yield Report({"descents under a clock": found}, [], [])
    yield Report({"slope through the chain": through_chain.table()}, [], [])


def run_settings(out: Path, controllers: tuple[str, ...], draws: int, stops: int) -> Iterator[Report]:
    """Every set in every setting; then scattered stops through the chain, of controllers with a set for it."""
    found = []
    for controller in controllers:
        found += by_setting.judged(controller, by_setting.contestants(controller), draws)
    files = [save(by_setting.figure(found), out / "settings.png")]
    title = f"every set in every setting, 15 rows, {draws} draws each, to 15 km/h"
    yield Report({title: by_setting.table(found)}, [], files)
    rows = []
    for controller in controllers:
        sets = by_setting.contestants(controller)
        if "chain" not in sets:
            continue
        chosen = {label: sets[label] for label in ("untuned", "truth", "chain")}
        rows += by_setting.scattered_rows(controller, by_setting.scattered_stops(controller, chosen, stops))
    if not rows:
        return
    title = f"scattered stops through the chain, {stops} in test"
    yield Report({title: rows}, [], [write_csv(rows, out / "tables" / "scattered_stops.csv")])
