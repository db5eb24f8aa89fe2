"""What a MASK4 file holds beside the rig's own signals: common sine and trigger, basin waves."""

from pathlib import Path
from typing import Any

import numpy as np

from rig.interop.basin.merge import SYNC
from rig.interop.exchange.mask4_signals import Signals

SYNCED = ("syncTimeSine", "syncTimeTTL")  # the first that is there: the sine's is left out at lag 0
WAVES = "waves.csv"
_CLOCKS = (
    "time",
    "elapsedtime",
    "utctime",
    "taitime",
    "synctimettl",
    "synctimesine",
    "synctimegps",
)


def write_sync(signals: Signals, folder: Path) -> Path | None:
    """``sync.csv``: trigger and sine as the rig's own side recorded them, for `rig merge`."""
    bus = "setpointSignals."
    names = [name for name in ("trigger", "syncSine") if bus + name in signals.found]
    time = signals.found.get(f"{bus}time")
    if not names or time is None:
        return None
    columns = {"time_s": np.asarray(time) - signals.time[0]}
    columns |= {name: np.asarray(signals.found[bus + name]) for name in names}
    return _csv(folder / SYNC, columns)


def write_waves(signals: Signals, folder: Path) -> Path | None:
    """``waves.csv``: the merged basin data (m) on the run's time, as the file has it aligned."""
    bus = "waveData."
    data = {n.removeprefix(bus): v for n, v in signals.found.items() if n.startswith(bus)}
    time = next((data[name] for name in SYNCED if name in data), None)
    kept = {
        name: np.asarray(value)
        for name, value in data.items()
        if name.lower() not in _CLOCKS and time is not None and len(value) == len(time)
    }
    if time is None or not kept:
        return None
    return _csv(folder / WAVES, {"time_s": np.asarray(time) - signals.time[0]} | kept)


def _csv(path: Path, columns: dict[str, Any]) -> Path:
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(columns) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)
    return path
