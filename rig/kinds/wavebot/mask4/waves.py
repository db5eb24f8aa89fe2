"""Write the common sine and trigger and the basin waves of a MASK4 file as CSV."""

from pathlib import Path
from typing import Any

import numpy as np

from rig.interop.basin.merge import SYNC_FILE
from rig.kinds.wavebot.mask4.signals import Mask4Signals

# The first present channel is used; files with lag 0 lack syncTimeSine.
TIME_CHANNELS = ("syncTimeSine", "syncTimeTTL")
WAVES_FILE = "waves.csv"
_CLOCK_CHANNELS = (
    "time",
    "elapsedtime",
    "utctime",
    "taitime",
    "synctimettl",
    "synctimesine",
    "synctimegps",
)


def write_sync(signals: Mask4Signals, folder: Path) -> Path | None:
    """Write ``sync.csv`` for `rig merge`: the rig's own trigger and sine; None if absent."""
    bus = "setpointSignals."
    names = [name for name in ("trigger", "syncSine") if bus + name in signals.variables]
    time = signals.variables.get(f"{bus}time")
    if not names or time is None:
        return None
    columns = {"time_s": np.asarray(time) - signals.time[0]}
    columns |= {name: np.asarray(signals.variables[bus + name]) for name in names}
    return _write_csv(folder / SYNC_FILE, columns)


def write_waves(signals: Mask4Signals, folder: Path) -> Path | None:
    """Write ``waves.csv``: basin data (m) on the run's time, as in the file; None if absent."""
    bus = "waveData."
    data = {n.removeprefix(bus): v for n, v in signals.variables.items() if n.startswith(bus)}
    time = next((data[name] for name in TIME_CHANNELS if name in data), None)
    waves = {
        name: np.asarray(value)
        for name, value in data.items()
        if name.lower() not in _CLOCK_CHANNELS and time is not None and len(value) == len(time)
    }
    if time is None or not waves:
        return None
    return _write_csv(folder / WAVES_FILE, {"time_s": np.asarray(time) - signals.time[0]} | waves)


def _write_csv(path: Path, columns: dict[str, Any]) -> Path:
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(columns) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)
    return path
