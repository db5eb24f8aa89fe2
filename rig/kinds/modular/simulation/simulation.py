"""Simulation of a campaign of a modular rig in its sea."""

from typing import Any

from rig.analysis.compared_rows import WAVE_CLOCK
from rig.analysis.rows import table_fields
from rig.compilation.column import Column
from rig.emulation import row_simulation
from rig.emulation.in_process import WholePlant
from rig.kinds.modular.build import campaign_composition, campaign_params
from rig.kinds.modular.rehearsal.coupled_plant import couple_world, plant_code
from rig.kinds.modular.rehearsal.coupling import couple
from rig.kinds.modular.rehearsal.devices import SensorScale, build_world, sensor_scales
from rig.kinds.modular.rehearsal.job import campaign_settings
from rig.kinds.modular.row_contents import row_contents
from rig.kinds.modular.simulation.waves import wave_sensors
from rig.kinds.modular.tick import compose
from rig.recording.row_layout import leaves
from rig.recording.runs.windows import REQUIRED_FIELDS


class CampaignSimulator(row_simulation.CampaignSimulator):
    """A campaign's rig in its sea; no part of a modular rig moves between rows."""

    def __init__(self, campaign: Any, plan: Any, sea: dict[str, Any] | None = None) -> None:
        """Set up for ``plan``, which has all points to be simulated and their reference tables.

        ``sea`` replaces the campaign's own; its keys are those of `build_sea`.

        Raises ValueError if plant or sea cannot be simulated.
        """
        composition = campaign_composition(campaign)
        settings = campaign_settings(campaign)
        if sea is not None:
            settings = settings | {"sea": sea}
        self._world = build_world(settings | {"compiled": False}, plan.dt)
        self._normals = Column(self._world.conditions().normals)
        given = [SensorScale(*each) for each in settings["sensors"]]
        self._sensors = sensor_scales(composition, given)
        contents = row_contents(campaign.rig, campaign.file.columns())
        logged = [leaf.name for leaf in leaves(compose(composition).Row)]
        waves = wave_sensors(campaign.rig).fields
        plant = campaign.plant
        conversion = couple(composition, tuple(plant["axes"]), tuple(plant.get("sensors", ())))
        super().__init__(
            "rig.kinds.modular.tick",
            composition.to_text(),
            plan,
            campaign_params(campaign, plan),
            plant_code(conversion),
            tuple(
                dict.fromkeys(
                    [*REQUIRED_FIELDS, *table_fields(contents, logged), *waves, WAVE_CLOCK]
                )
            ),
        )

    def coupling(self, place: float | None) -> WholePlant:
        """Return the plant at power-on; nothing has a place."""
        return WholePlant(*couple_world(self._world, self._sensors, self._normals))
