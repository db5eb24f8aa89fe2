"""What is simulated: a campaign's rig, plant and sea as the numbers that compiled code takes."""

from collections.abc import Callable, Iterator
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from controllers.signals import DriveSettings
from rig import cycle
from rig.analysis import quality
from rig.analysis.rows import FIELDS, LOGGED
from rig.analysis.windows import ALWAYS, Window
from rig.assemble import wavebot_params
from rig.batch import compiled
from rig.batch.column import Column
from rig.batch.wires import Machine
from rig.campaign import Campaign, Plan
from rig.record import leaves
from rig.rehearsal import job
from rig.rehearsal.devices import build_world
from rig.runs.mcap_file import Records
from rig.safety import Reason
from rig.sequence import MEASURE
from rig.wavebot import KIND, WaveBotRow
from sim_plant import custom_drive, wave_maker
from sim_plant.parameters import Plant
from sim_plant.words import OFF

_THERE = tuple(leaf.name for leaf in leaves(WaveBotRow))
KEPT = tuple(dict.fromkeys([*ALWAYS, "time", *FIELDS, *LOGGED.values(), *quality.fields(_THERE)]))
"""The fields of a tick that a row table is made of."""

_AS_LOGGED = np.dtype(
    [(leaf.name, "<f8" if leaf.code == "d" else "<i8") for leaf in leaves(WaveBotRow)
     if leaf.name in KEPT]
)  # fmt: skip
_AT_A_TIME = 200_000  # ticks between two looks at whether to go on: a tenth of a second
_TICK = KEPT.index("tick")
_NO_SETTINGS = DriveSettings(0, 0.0, 0.0, 0.0, 0.0, 0)


class InterruptedWalk(Exception):
    """Somebody asked to stop."""


class Kept:
    """Measured ticks of one row by field, as the analysis takes them of a log."""

    dtype = _AS_LOGGED

    def __init__(self, columns: npt.NDArray[np.float64]) -> None:
        self._columns = columns

    def __len__(self) -> int:
        return self._columns.shape[1]

    def __getitem__(self, name: str) -> Any:
        column = self._columns[KEPT.index(name)]
        return column if self.dtype[name].kind == "f" else column.astype(np.int64)


class Subject:
    """One campaign's rig in its sea; every plan for it starts it anew."""

    def __init__(self, campaign: Campaign, plan: Plan) -> None:
        """Raises ValueError where plant or sea cannot be simulated."""
        devices = job.devices_of(campaign)
        self._plant = Plant.model_validate(devices["plant"])
        self._dt = plan.dt
        self._begin = begin = build_world(devices | {"compiled": False}, plan.dt).beginning()
        self._params = wavebot_params(
            campaign.file, campaign.rig, campaign.limits, plan.segments, plan.setpoints
        )
        elevation, heave, surge, onset, onset_ticks = begin.tables
        self._tables = wave_maker.Tables(
            Column(elevation), Column(heave), Column(surge), onset, onset_ticks
        )
        self._normals = Column(begin.normals)
        self._advance = compiled.load(KEPT)
        self.reason = ""  # why the last walk ended

    def measured(self, plan: Plan, go_on: Callable[[], bool] = lambda: True) -> Iterator[Window]:
        """Walk a plan from power-on to its end or a trip; its rows' windows as they are measured.

        A window's data are valid until the next one is asked for. Raises `Interrupted` when
        ``go_on`` says no.
        """
        segments = plan.segments
        lengths = [n for n, p in zip(segments.ticks, segments.phase, strict=True) if p == MEASURE]
        kept = np.empty((len(KEPT), max(lengths, default=0) + 1))
        params, plant, filled = self._columns(plan), self._begin.params, 0
        machine = self._start()
        while machine.linger < compiled.LINGER:
            if not go_on():
                raise Interrupted
            settings, until = machine.settings, machine.tick + _AT_A_TIME
            machine, filled = self._advance(
                params, plant, self._tables, self._normals, self._dt, self._begin.delay,
                machine, until, kept, filled,
            )  # fmt: skip
            if machine.settings != settings:
                plant = self._plant.build(
                    custom_drive.DriveSettings(*machine.settings[:4], int(machine.settings[5]))
                )
            newest = kept[_TICK, filled - 1] if filled else machine.tick - 1
            if newest != machine.tick - 1 or (filled and machine.linger == compiled.LINGER):
                yield _window(kept[:, :filled], machine)
                filled = 0
        self.reason = Reason(machine.loop.safety.reason).name

    def _columns(self, plan: Plan) -> cycle.Params:
        """The loop's parameters for a plan, its tables as columns."""
        rig = self._params.rig
        return self._params._replace(
            segments=type(plan.segments)(*(Column(column) for column in plan.segments)),
            rig=rig._replace(
                setpoints=type(plan.setpoints)(*(Column(column) for column in plan.setpoints)),
                reference=rig.reference._replace(table=Column(rig.reference.table)),
            ),
        )

    def _start(self) -> Machine:
        begin = self._begin
        return Machine(
            0,
            cycle.start(KIND, self._params, 0),
            begin.state,
            wave_maker.STILL,
            begin.line,
            OFF,
            0,
            _NO_SETTINGS,
            0,
        )


def _window(columns: npt.NDArray[np.float64], machine: Machine) -> Window:
    data = Kept(columns)
    guard = machine.loop.safety
    stopped = guard.reason not in (Reason.NONE, Reason.PLAN_END)
    why = f"run stopped: {Reason(guard.reason).name}" if stopped else ""
    row, attempt = (int(data[f"plan.{name}"][0]) for name in ("row", "attempt"))
    return Window(row, attempt, cast(Records, data), why)
