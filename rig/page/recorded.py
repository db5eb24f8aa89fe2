"""A recorded run as a tap: its rows at a multiple of the speed at which they were recorded."""

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rig.page.tap import Rows
from rig.recording.mcap_writer import CLOCK_RECORD, START_KEY
from rig.recording.row_layout import Leaf, RowSchema
from rig.recording.runs import run_info
from rig.recording.runs.reader import blocks, open_files

MIN_SPEED, MAX_SPEED = 1.0, 50.0
_LONGEST_STEP_S = 1.0  # of the clock: after a longer pause of the process nothing is skipped


class RecordedTap:
    """Replays the rows of a run's MCAP file by their times."""

    def __init__(self, run: Path) -> None:
        """RunError for a run that cannot be read."""
        self._run = run
        self._files = open_files(run)
        self.schema: RowSchema = self._files.contents[0].schema
        self.leaves: Sequence[Leaf] = self._files.leaves
        self._time = [leaf.name for leaf in self.leaves].index("time")
        self.restart()
        self.speed = MIN_SPEED
        self.paused = False

    def restart(self) -> None:
        """Go back to the first row."""
        self._blocks: Iterator[Rows] = map(self._numbers, blocks(self._files))
        self._waiting: Rows = np.empty((0, len(self.leaves)))
        self._polled = time.monotonic()
        self._now: float | None = None  # time of the replay, s of the run
        self._ended = False

    def set_speed(self, speed: float) -> None:
        """Set the multiple of the recorded speed, 1 .. 50; 0 pauses."""
        self.paused = speed == 0.0
        if not self.paused:
            self.speed = min(MAX_SPEED, max(MIN_SPEED, speed))

    def poll(self) -> Rows:
        """Return the rows up to the present time of the replay."""
        now = time.monotonic()
        step, self._polled = min(now - self._polled, _LONGEST_STEP_S), now
        if self._now is None:
            self._fill()
            if not len(self._waiting):
                return self._waiting
            self._now = float(self._waiting[0, self._time])
        if not self.paused:
            self._now += step * self.speed
        taken = []
        while True:
            count = int(np.searchsorted(self._waiting[:, self._time], self._now, side="right"))
            taken.append(self._waiting[:count])
            self._waiting = self._waiting[count:]
            if len(self._waiting) or self._ended:
                return np.concatenate(taken)
            self._fill()

    def start_utc_ns(self) -> int:
        """Return the UTC of run time zero, ns; 0 if the record does not have it."""
        recorded = run_info(self._run).metadata.get(CLOCK_RECORD, {}).get(START_KEY, "")
        return int(recorded) if recorded.isdigit() else 0

    def status(self) -> dict[str, Any]:
        """Return speed and pause of the replay, and whether all rows were shown."""
        return {
            "unsaved": 0,
            "dropped": 0,
            "torn": 0,
            "ended": self._ended and not len(self._waiting),
            "speed": 0.0 if self.paused else self.speed,
        }

    def _fill(self) -> None:
        following = next(self._blocks, None)
        if following is None:
            self._ended = True
        else:
            self._waiting = following

    def _numbers(self, block: Any) -> Rows:
        numbers = np.empty((len(block), len(self.leaves)))
        for at, leaf in enumerate(self.leaves):
            numbers[:, at] = block[leaf.name]
        return numbers
