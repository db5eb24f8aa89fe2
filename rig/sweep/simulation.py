"""What is simulated: a campaign's rig, plant and sea as the numbers that compiled code takes."""

from collections.abc import Callable, Iterator
from itertools import groupby, pairwise
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from controllers.signals import DriveSettings
from rig.analysis import quality
from rig.analysis.rows import FIELDS, LOGGED_SETTINGS
from rig.analysis.windows import REQUIRED_FIELDS, Window
from rig.execution.rehearsal import job
from rig.execution.rehearsal.devices import build_world
from rig.kinds.wavebot import KIND, Setpoints, WaveBotRow
from rig.kinds.wavebot.build import index_realisations, list_realisations, wavebot_params
from rig.planning.campaign import Campaign, Plan
from rig.realtime import cycle
from rig.realtime.loop import LINGER_TICKS
from rig.realtime.safety import Reason
from rig.realtime.sequence import MEASURE, Segments
from rig.recording.row_layout import leaves
from rig.recording.runs.mcap_file import Records
from rig.sweep import InterruptedSweepError, compiled
from rig.sweep.column import Column
from rig.sweep.noise import interleaved
from rig.sweep.pages import TICKS
from rig.sweep.plant_coupling import Machine
from sim_plant import custom_drive, wave_maker, wavebot
from sim_plant.parameters import Plant
from sim_plant.signals import OFF

_THERE = tuple(leaf.name for leaf in leaves(WaveBotRow))
_WAVES = ("plan.wave_clock", "heave.sense.counts", "heave.sense.encoder_age", "load.age",
          "wave.elevation")  # fmt: skip
KEPT = tuple(
    dict.fromkeys(
        [
            *REQUIRED_FIELDS,
            "time",
            *FIELDS,
            *LOGGED_SETTINGS.values(),
            *quality.required_fields(_THERE),
            *_WAVES,
        ]
    )
)
"""The fields of a tick that a row table is made of, and those that waves are recovered from."""

_AS_LOGGED = np.dtype(
    [(leaf.name, "<f8" if leaf.code == "d" else "<i8") for leaf in leaves(WaveBotRow)
     if leaf.name in KEPT]
)  # fmt: skip
_AT_A_TIME = 200_000  # ticks between two looks at whether to go on: a tenth of a second
_TICK, _ROW = KEPT.index("tick"), KEPT.index("plan.row")
_NO_SETTINGS = DriveSettings(0, 0.0, 0.0, 0.0, 0.0, 0)
_Floats = npt.NDArray[np.float64]
_SPARE: list[_Floats] = []  # memory of walks that are over: new one costs a tenth of a walk


class Kept:
    """Measured ticks of one row by field, as the analysis takes them of a log."""

    dtype = _AS_LOGGED

    def __init__(self, columns: _Floats) -> None:
        self._columns = columns

    def __len__(self) -> int:
        return len(self._columns[0])

    def __getitem__(self, name: str) -> Any:
        column = self._columns[KEPT.index(name)]
        return column if self.dtype[name].kind == "f" else column.astype(np.int64)


class Subject:
    """One campaign's rig in its sea; every walk starts it anew, from threads at a time, too."""

    def __init__(self, campaign: Campaign, plan: Plan, sea: dict[str, Any] | None = None) -> None:
        """``plan`` is of all points that are to be walked, whose references are in its tables.

        ``sea`` stands in for the campaign's own, in the words of `build_sea`.

        Raises ValueError where plant or sea cannot be simulated.
        """
        devices = job.plant_settings(campaign)
        if sea is not None:
            devices["sea"] = sea
        self.plant = Plant.model_validate(devices["plant"])
        self.dt = plan.dt
        self.begin = begin = build_world(devices | {"compiled": False}, plan.dt).beginning()
        self.params = wavebot_params(
            campaign.file, campaign.rig, campaign.limits, plan.segments, plan.setpoints,
            campaign.record,
        )  # fmt: skip
        self._realisations = list_realisations(plan.setpoints.realisation)
        elevation, heave, surge, onset, onset_ticks = begin.tables
        waves: Any = [Column(table) for table in (elevation, heave, surge)]
        self.tables = wave_maker.Tables(waves[0], waves[1], waves[2], onset, onset_ticks)
        self._sensors, self.normals = interleaved(begin.params.sensors, begin.normals)
        self.constants = begin.params._replace(sensors=self._sensors)  # of the plant
        self.advance = compiled.load(KEPT)

    def walk(
        self, plan: Plan, go_on: Callable[[], bool] = lambda: True, stator: float | None = None
    ) -> "RowSimulation":
        """A plan walked from power-on to its end or a trip.

        ``stator`` is where it stands when power comes on (%), the plant's own start if not given.
        ``go_on`` is asked now and then; when it says no, the walk raises `InterruptedWalkError`.
        """
        return RowSimulation(self, plan, go_on, stator)

    def prepare(self, plan: Plan) -> None:
        """Have the loop compiled, or read from the cache, for what this subject is made of."""
        RowSimulation(self, plan, lambda: True, None).tick(0)

    def columns(self, plan: Plan) -> cycle.Params:
        """The loop's parameters for a plan, its tables as columns."""
        rig = self.params.rig
        segments: Any = [Column(column) for column in plan.segments]
        placed_ones = index_realisations(plan.setpoints, self._realisations)
        setpoints: Any = [Column(column) for column in placed_ones]
        return self.params._replace(
            segments=Segments(*segments),
            rig=rig._replace(
                setpoints=Setpoints(*setpoints),
                reference=rig.reference._replace(table=Column(rig.reference.table)),
            ),
        )

    def start(self, stator: float | None = None) -> Machine:
        """Loop and plant before the first tick."""
        begin, state, line = self.begin, self.begin.state, self.begin.line
        if stator is not None:
            there = wavebot.initial(begin.params, float(stator), 0.0)
            state = there._replace(probes=state.probes)
            still = wavebot.sample(begin.params, state, 0, 0.0, begin.normals)
            line = (still,) * len(line)
        loop = cycle.start(KIND, self.params, 0)
        return Machine(0, loop, state, wave_maker.STILL, line, OFF, 0, _NO_SETTINGS, 0)

    def set_drive(self, settings: DriveSettings) -> wavebot.WaveBotParams:
        """The plant's constants with the custom drive set so; ValueError where it refuses."""
        if self.constants.electrics.custom == 0:
            return self.constants
        scheme, voltage, period, tolerance, _, level = settings
        told = custom_drive.DriveSettings(scheme, voltage, period, tolerance, level)
        custom_drive.check(told)
        return self.plant.build(told)._replace(sensors=self._sensors)


class RowSimulation:
    """The windows of a plan's rows as they are measured; ``reason`` says how it ended.

    A window's data are valid until the next one is asked for.
    """

    def __init__(
        self, subject: Subject, plan: Plan, go_on: Callable[[], bool], stator: float | None
    ) -> None:
        self._subject, self._go_on = subject, go_on
        self._machine = subject.start(stator)
        self._params, self._plant = subject.columns(plan), subject.constants
        self._page = Column(np.empty(len(KEPT) * TICKS))
        self._kept = _room(_longest(plan) + 1)
        self._filed = Column(self._kept.ravel())
        self.reason = Reason.NONE

    @property
    def seconds(self) -> float:
        """Simulated so far."""
        return self._machine.tick * self._subject.dt

    def __iter__(self) -> Iterator[Window]:
        filled = 0
        while self._machine.linger < LINGER_TICKS:
            if not self._go_on():
                raise InterruptedSweepError
            filled = self.tick(self._machine.tick + _AT_A_TIME, filled)
            machine, last = self._machine, self._kept[_TICK, filled - 1]
            if filled and (machine.linger == LINGER_TICKS or last != machine.tick - 1):
                yield from _windows(self._kept[:, :filled], machine)
                filled = 0
        self.reason = Reason(self._machine.loop.safety.reason)
        _SPARE.append(cast(_Floats, self._kept.base))

    def tick(self, until: int, filled: int = 0) -> int:
        """Tick up to ``until`` or less far; gives how many ticks of windows are kept by then."""
        subject, settings = self._subject, self._machine.settings
        self._machine, filled = subject.advance(
            self._params, self._plant, subject.tables, subject.normals, subject.dt,
            subject.begin.delay, self._machine, until, self._page, self._filed, filled,
        )  # fmt: skip
        if self._machine.settings != settings:
            self._plant = subject.set_drive(self._machine.settings)
        return int(filled)


def _room(ticks: int) -> _Floats:
    """Room for so many ticks, of memory that a walk has left if there is as much."""
    size = len(KEPT) * ticks
    try:
        spare = _SPARE.pop()
    except IndexError:
        spare = np.empty(0)
    if len(spare) < size:
        spare = np.empty(size)
    return spare[:size].reshape(len(KEPT), ticks)


def _longest(plan: Plan) -> int:
    """Ticks of the longest stretch of windows that follow each other without a gap."""
    by_phase = groupby(zip(plan.segments.phase, plan.segments.ticks, strict=True), lambda s: s[0])
    return max((sum(n for _, n in run) for phase, run in by_phase if phase == MEASURE), default=0)


def _windows(columns: _Floats, machine: Machine) -> Iterator[Window]:
    guard = machine.loop.safety
    stopped = guard.reason not in (Reason.NONE, Reason.PLAN_END)
    rows = columns[_ROW]
    edges = [0, *(np.flatnonzero(rows[1:] != rows[:-1]) + 1).tolist(), len(rows)]
    for begin, end in pairwise(edges):
        data = Kept(columns[:, begin:end])
        why = f"run stopped: {Reason(guard.reason).name}" if stopped and end == len(rows) else ""
        row, attempt = (int(data[f"plan.{name}"][0]) for name in ("row", "attempt"))
        yield Window(row, attempt, cast(Records, data), why)
