"""Simulation of a campaign: rig, plant and sea as the numbers that compiled code takes."""

from collections.abc import Callable
from typing import Any

from controllers import impedance
from controllers.signals import DriveSettings
from rig.analysis.rows import table_fields
from rig.compilation.column import Column
from rig.compilation.row_simulation import Progress, RowSimulation, Stored, as_columns
from rig.kinds.wavebot.build import index_realisations, list_realisations, wavebot_params
from rig.kinds.wavebot.campaign import Campaign, Plan
from rig.kinds.wavebot.rehearsal import job
from rig.kinds.wavebot.rehearsal.devices import build_world
from rig.kinds.wavebot.row_contents import row_contents
from rig.kinds.wavebot.simulation import compiled
from rig.kinds.wavebot.simulation.noise import interleaved
from rig.kinds.wavebot.simulation.plant_coupling import CoupledState
from rig.kinds.wavebot.tick import WaveBotRow, kind_with_law
from rig.kinds.wavebot.tick.reasons import REASONS
from rig.realtime import cycle
from rig.realtime.reasons import reason_table
from rig.recording.row_layout import leaves
from rig.recording.runs.windows import REQUIRED_FIELDS
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

_STORED = Stored.of_row(WaveBotRow, KEPT_FIELDS)
_NO_SETTINGS = DriveSettings(0, 0.0, 0.0, 0.0, 0.0, 0)
_REASONS = reason_table(REASONS)


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
        self.params = wavebot_params(campaign, plan.segments, plan.setpoints)
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
        ticks = _Ticks(self, plan, place)
        return RowSimulation(ticks, _STORED, plan.segments, self.dt, _REASONS, check)

    def prepare(self, plan: Plan) -> None:
        """Compile the loop for the types of this simulator, or read it from the cache."""
        self.simulate(plan).tick(0)

    def column_params(self, plan: Plan) -> cycle.Params:
        """Return the loop's parameters for a plan, with its tables as `Column`."""
        rig, placed = self.params.rig, index_realisations(plan.setpoints, self._realisations)
        law = tuple(map(Column, placed.law))
        return self.params._replace(
            segments=as_columns(plan.segments),
            rig=rig._replace(
                setpoints=as_columns(placed._replace(law=()))._replace(law=law),
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


class _Ticks:
    """The compiled loop in the course of one simulation."""

    def __init__(self, simulator: CampaignSimulator, plan: Plan, place: float | None) -> None:
        self._simulator, self._coupled = simulator, simulator.start(place)
        self._params, self._plant = simulator.column_params(plan), simulator.constants

    def __call__(self, until: int, page: Column, columns: Column, filled: int) -> Progress:
        simulator, settings = self._simulator, self._coupled.settings
        self._coupled, filled = simulator.advance(
            self._params, self._plant, simulator.tables, simulator.normals, simulator.dt,
            simulator.begin.delay, self._coupled, until, page, columns, filled,
        )  # fmt: skip
        coupled = self._coupled
        if coupled.settings != settings:
            self._plant = simulator.set_drive(coupled.settings)
        return Progress(coupled.tick, coupled.linger, coupled.loop.safety.reason, int(filled))
