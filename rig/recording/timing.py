"""The timing certificate of a run: lateness of the loop's wake-ups and duration of its ticks.

The logger computes it from every row, as histograms of one microsecond, so that an eight-hour run
costs no memory and every percentile is exact to the bin.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from rig.recording.row_layout import Leaf

_BINS = 100_000  # 1 us each; values above 0.1 s count in the last bin
_PERCENTILES = {"p50": 0.50, "p99": 0.99, "p999": 0.999}


class TimingCertificate:
    """Accumulates the timing fields of packed rows."""

    def __init__(self, leaves: tuple[Leaf, ...]) -> None:
        names = [leaf.name for leaf in leaves]
        self._width = len(names)
        self._lateness = names.index("timing.lateness")
        self._work = names.index("timing.work")
        self._skipped = names.index("timing.skipped")
        self._reason = names.index("safety.reason")
        self._late = np.zeros(_BINS, dtype=np.int64)
        self._busy = np.zeros(_BINS, dtype=np.int64)
        self._latest = 0.0
        self._last_tick = -1
        self.ticks = 0
        self.skipped = 0
        self.reason = 0  # `rig.realtime.reasons` of the last row

    def add(self, block: bytes) -> None:
        """Count the rows of a block; ignore rows up to the last tick counted, which are repeats.

        A logger that is killed between writing rows and moving the tail of the ring leaves rows
        in its part of the file that the next logger takes from the ring again.
        """
        rows = np.frombuffer(block, dtype="<i8").reshape(-1, self._width)
        rows = rows[rows[:, 0] > self._last_tick]  # the first field of a row is its tick
        if not len(rows):
            return
        floats = rows.view("<f8")
        self._last_tick = int(rows[-1, 0])
        self.ticks += len(rows)
        self.skipped = int(rows[-1, self._skipped])
        self.reason = int(rows[-1, self._reason])
        late = floats[:, self._lateness]
        self._latest = max(self._latest, float(late.max()))
        _count(self._late, late)
        _count(self._busy, floats[:, self._work])

    def result(self, clock: str, rate_hz: float, dropped: int, privileges: Any) -> dict[str, Any]:
        """Return the certificate as a mapping; times in microseconds."""
        certificate: dict[str, Any] = {
            "clock": clock,
            "rate_hz": rate_hz,
            "ticks": self.ticks,
            "skipped": self.skipped,
            "dropped_rows": dropped,
            "privileges": privileges,
        }
        if clock == "virtual":
            certificate["summary"] = (
                f"{self.ticks} ticks on the virtual clock, every one of exactly "
                f"{1e3 / rate_hz:g} ms; nothing can be late."
            )
            return certificate
        lateness = _summary(self._late) | {"max": self._latest * 1e6}
        certificate["lateness_us"] = lateness
        certificate["work_us"] = _summary(self._busy)
        refused = [name for name, why in (privileges or {}).items() if why]
        certificate["summary"] = (
            f"{self.ticks} ticks on the real clock at {rate_hz:g} Hz, {self.skipped} skipped, "
            f"{dropped} rows dropped; woke {lateness['p50']:.0f} us late at the median, "
            f"{lateness['p99']:.0f} us at the 99th percentile, "
            f"{lateness['max']:.0f} us at worst"
            + (f"; not granted: {', '.join(refused)}." if refused else ".")
        )
        return certificate


def _count(into: npt.NDArray[np.int64], seconds: npt.NDArray[np.float64]) -> None:
    bins = np.clip((seconds * 1e6).astype(np.int64), 0, _BINS - 1)
    counts = np.bincount(bins)  # only as long as the largest bin needs: most blocks use few bins
    into[: len(counts)] += counts


def _summary(counts: npt.NDArray[np.int64]) -> dict[str, float]:
    total = np.cumsum(counts)
    return {
        name: float(np.searchsorted(total, share * total[-1])) if total[-1] else 0.0
        for name, share in _PERCENTILES.items()
    }
