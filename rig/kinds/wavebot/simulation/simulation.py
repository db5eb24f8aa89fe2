"""Simulation of a campaign: rig, plant and sea as the numbers that compiled code takes."""

from collections.abc import Callable, Iterator
from itertools import groupby, pairwise
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from controllers import impedance
from controllers.signals import DriveSettings
from rig.analysis.rows import table_fields
from rig.compilation.column import Column
from rig.kinds.wavebot.build import index_realisations, list_realisations, wavebot_params
from rig.kinds.wavebot.campaign import Campaign, Plan
from rig.kinds.wavebot.rehearsal import job
from rig.kinds.wavebot.rehearsal.devices import build_world
from rig.kinds.wavebot.row_contents import row_contents
from rig.kinds.wavebot.simulation import compiled
from rig.kinds.wavebot.simulation.noise import interleaved
from rig.kinds.wavebot.simulation.pages import PAGE_TICKS
from rig.kinds.wavebot.simulation.plant_coupling import CoupledState
from rig.kinds.wavebot.tick import WaveBotRow, kind_with_law
from rig.kinds.wavebot.tick.reasons import REASONS
from rig.realtime import cycle
from rig.realtime.loop import LINGER_TICKS
from rig.realtime.reasons import Reason, reason_table
from rig.realtime.sequence import MEASURE
from rig.recording.row_layout import leaves
from rig.recording.runs.mcap_file import Records
from rig.recording.runs.windows import REQUIRED_FIELDS, Window
from sim_plant import custom_drive, wave_maker, wavebot
from sim_plant.parameters import Plant
from sim_plant.signals import OFF

_LOG_FIELDS = tuple(leaf.name for leaf in leaves(WaveBotRow))
_WAVES = ("plan.wave_clock", "heave.sense.counts", "heave.sense.encoder_age", "load.age",
          "wave.elevation")  # fmt: skip
KEPT_FIELDS = tuple(
    dict.fromkeys(
        [
            *REQUIRED_FIELDS,
            *table_fields(row_contents(impedance.COLUMNS), _LOG_FIELDS),
            *_WAVES,
        ]
    )
)
"""Fields of a tick that the row table and the recovery of waves need."""

_LOG_DTYPE = np.dtype(
    [(leaf.name, "<f8" if leaf.code == "d" else "<i8") for leaf in leaves(WaveBotRow)
     if leaf.name in KEPT_FIELDS]
)  # fmt: skip
_TICKS_PER_CALL = 200_000  # ticks between two checks for an interrupt: a tenth of a second
_TICK, _ROW = KEPT_FIELDS.index("tick"), KEPT_FIELDS.index("plan.row")
_NO_SETTINGS = DriveSettings(0, 0.0, 0.0, 0.0, 0.0, 0)
_Floats = npt.NDArray[np.float64]
_SPARE_BUFFERS: list[_Floats] = []  # of finished simulations: allocation costs a tenth of one

_REASONS = reason_table(REASONS)


class WindowColumns:
    """Measured ticks of one row by field, with the interface of a log's records."""

    dtype = _LOG_DTYPE

    def __init__(self, columns: _Floats) -> None:
        self._columns = columns

    def __len__(self) -> int:
        return len(self._columns[0])

    def __getitem__(self, name: str) -> Any:
        column = self._columns[KEPT_FIELDS.index(name)]
        return column if self.dtype[name].kind == "f" else column.astype(np.int64)


class CampaignSimulator:
    """A campaign's rig in its sea; each simulation starts anew. Threads may share a simulator."""

    def __init__(self, campaign: Campaign, plan: Plan, sea: dict[str, Any] | None = None) -> None:
        """Set up for ``plan``, which has all points to be simulated and their reference tables.

        ``sea`` replaces the campaign's own; its keys are those of `build_sea`.

        Raises ValueError if plant or sea cannot be simulated.
        """
        devices = job.plant_settings(campaign)
        if sea is not None:
            devices["sea"] = sea
        self.plant = Plant.model_validate(devices["plant"])
        self.dt = plan.dt
        self.begin = begin = build_world(
            devices | {"compiled": False}, plan.dt
        ).initial_conditions()
        self.params = wavebot_params(
            campaign.file, campaign.rig, campaign.limits, plan.segments, plan.setpoints,
            campaign.record,
        )  # fmt: skip
        self._realisations = list_realisations(plan.setpoints.realisation)
        elevation, heave, surge, onset, onset_ticks = begin.tables
        waves: Any = [Column(table) for table in (elevation, heave, surge)]
        self.tables = wave_maker.WaveMakerTables(waves[0], waves[1], waves[2], onset, onset_ticks)
        self._sensors, self.normals = interleaved(begin.params.sensors, begin.normals)
        self.constants = begin.params._replace(sensors=self._sensors)  # of the plant
        self.kind = kind_with_law(campaign.file.heave_law.module)
        self.advance = compiled.load(KEPT_FIELDS, campaign.file.heave_law)

    def simulate(
        self,
        plan: Plan,
        check: Callable[[], None] = lambda: None,
        place: float | None = None,
    ) -> "RowSimulation":
        """Return the simulation of a plan from power-on to its end or a trip.

        ``place`` is the stator's position at power-on (%); default is the plant's own start. The
        simulation calls ``check`` about ten times per second; an exception of it ends the
        simulation.
        """
        return RowSimulation(self, plan, check, place)

    def prepare(self, plan: Plan) -> None:
        """Compile the loop for the types of this simulator, or read it from the cache."""
        RowSimulation(self, plan, lambda: None, None).tick(0)

    def column_params(self, plan: Plan) -> cycle.Params:
        """Return the loop's parameters for a plan, with its tables as `Column`."""
        rig, placed = self.params.rig, index_realisations(plan.setpoints, self._realisations)
        law = tuple(map(Column, placed.law))
        return self.params._replace(
            segments=_as_columns(plan.segments),
            rig=rig._replace(
                setpoints=_as_columns(placed._replace(law=()))._replace(law=law),
                reference=rig.reference._replace(table=Column(rig.reference.table)),
            ),
        )

    def start(self, place: float | None = None) -> CoupledState:
        """Return the state of loop and plant before the first tick."""
        begin, state, line = self.begin, self.begin.state, self.begin.delay_line
        if place is not None:
            initial = wavebot.initial(begin.params, float(place), 0.0)
            state = initial._replace(probes=state.probes)
            reading = wavebot.sample(begin.params, state, 0, 0.0, begin.normals)
            line = (reading,) * len(line)
        loop = cycle.start(self.kind, self.params, 0)
        return CoupledState(0, loop, state, wave_maker.STILL_WATER, line, OFF, 0, _NO_SETTINGS, 0)

    def set_drive(self, settings: DriveSettings) -> wavebot.WaveBotParams:
        """Return the plant's constants for settings of the custom drive; ValueError if invalid."""
        if self.constants.electrics.custom == 0:
            return self.constants
        scheme, voltage, period, tolerance, _, level = settings
        drive_settings = custom_drive.DriveSettings(scheme, voltage, period, tolerance, level)
        custom_drive.check_settings(drive_settings)
        return self.plant.build(drive_settings)._replace(sensors=self._sensors)


class RowSimulation:
    """Iterator over the windows of a plan's rows; afterwards ``reason`` is the reason of the end.

    The data of a window are valid until the iterator advances.
    """

    def __init__(
        self,
        simulator: CampaignSimulator,
        plan: Plan,
        check: Callable[[], None],
        place: float | None,
    ) -> None:
        self._simulator, self._check = simulator, check
        self._coupled = simulator.start(place)
        self._params, self._plant = simulator.column_params(plan), simulator.constants
        self._page = Column(np.empty(len(KEPT_FIELDS) * PAGE_TICKS))
        self._columns = _take_buffer(_longest_stretch(plan) + 1)
        self._flat_columns = Column(self._columns.ravel())
        self.reason = Reason.NONE.name  # of the stop

    @property
    def seconds(self) -> float:
        """Simulated time so far, s."""
        return self._coupled.tick * self._simulator.dt

    def __iter__(self) -> Iterator[Window]:
        filled = 0
        while self._coupled.linger < LINGER_TICKS:
            self._check()
            filled = self.tick(self._coupled.tick + _TICKS_PER_CALL, filled)
            coupled, last = self._coupled, self._columns[_TICK, filled - 1]
            if filled and (coupled.linger == LINGER_TICKS or last != coupled.tick - 1):
                yield from _windows(self._columns[:, :filled], coupled)
                filled = 0
        self.reason = _REASONS.name(self._coupled.loop.safety.reason)
        _SPARE_BUFFERS.append(cast(_Floats, self._columns.base))

    def tick(self, until: int, filled: int = 0) -> int:
        """Simulate at most up to tick ``until``; return the number of stored ticks of windows."""
        simulator, settings = self._simulator, self._coupled.settings
        self._coupled, filled = simulator.advance(
            self._params, self._plant, simulator.tables, simulator.normals, simulator.dt,
            simulator.begin.delay, self._coupled, until, self._page, self._flat_columns, filled,
        )  # fmt: skip
        if self._coupled.settings != settings:
            self._plant = simulator.set_drive(self._coupled.settings)
        return int(filled)


def _as_columns(table: Any) -> Any:
    """Return a table of the loop with each of its columns as `Column`."""
    return type(table)(*map(Column, table))


def _take_buffer(ticks: int) -> _Floats:
    """Return a buffer for so many ticks, reusing that of a finished simulation if large enough."""
    size = len(KEPT_FIELDS) * ticks
    try:
        buffer = _SPARE_BUFFERS.pop()
    except IndexError:
        buffer = np.empty(0)
    if len(buffer) < size:
        buffer = np.empty(size)
    return buffer[:size].reshape(len(KEPT_FIELDS), ticks)


def _longest_stretch(plan: Plan) -> int:
    """Return the ticks of the longest sequence of windows without a gap."""
    by_phase = groupby(zip(plan.segments.phase, plan.segments.ticks, strict=True), lambda s: s[0])
    return max((sum(n for _, n in run) for phase, run in by_phase if phase == MEASURE), default=0)


def _windows(columns: _Floats, coupled: CoupledState) -> Iterator[Window]:
    safety = coupled.loop.safety
    stopped = safety.reason not in (Reason.NONE, Reason.PLAN_END)
    rows = columns[_ROW]
    edges = [0, *(np.flatnonzero(rows[1:] != rows[:-1]) + 1).tolist(), len(rows)]
    for begin, end in pairwise(edges):
        data = WindowColumns(columns[:, begin:end])
        incomplete_reason = (
            f"run stopped: {_REASONS.name(safety.reason)}" if stopped and end == len(rows) else ""
        )
        row, attempt = (int(data[f"plan.{name}"][0]) for name in ("row", "attempt"))
        yield Window(row, attempt, cast(Records, data), incomplete_reason)
