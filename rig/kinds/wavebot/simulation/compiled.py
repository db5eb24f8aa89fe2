"""The WaveBot's loop and plant as one compiled function (rig/compilation/coupled_loop.py).

The plant is `sim_plant.wavebot.step`, the function that a rehearsal runs.
"""

import sys
from functools import lru_cache
from types import ModuleType

from controllers import drive_gating, magnetic_spring, position_hold, station_keeping
from rig.analysis.rows import table_fields
from rig.compilation.coupled_loop import LoopSource
from rig.config.law_settings import IMPEDANCE
from rig.kinds.wavebot.rehearsal import noise, plant_coupling
from rig.kinds.wavebot.rehearsal.compiled_plant import LIFTED_MODULES as PLANT
from rig.kinds.wavebot.rehearsal.coupled_plant import PLANT_CODE
from rig.kinds.wavebot.row_contents import row_contents
from rig.kinds.wavebot.tick import WaveBotRow, tare
from rig.kinds.wavebot.tick import reasons as wavebot_reasons
from rig.kinds.wavebot.tick import signals as wavebot_signals
from rig.laws import Law, helper_modules
from rig.realtime import average, motor_power
from rig.recording.row_layout import leaves
from rig.recording.runs.windows import REQUIRED_FIELDS
from sim_plant import signals as plant_signals
from sim_plant import wave_maker

_WAVEBOT = ("check", "cycle", "law_columns", "power_checks", "state", "stations")
_LIFTED: tuple[ModuleType, ...] = (
    drive_gating, magnetic_spring, position_hold, station_keeping, average, motor_power, tare,
    *(sys.modules[f"rig.kinds.wavebot.tick.{name}"] for name in _WAVEBOT),
    *PLANT, wave_maker, plant_coupling, noise,
)  # fmt: skip
_TYPES = (wavebot_signals, wavebot_reasons, plant_signals)
_IMPORTS = """\
import {law} as heave_law
from rig.kinds.wavebot.tick import kind_with_law"""

_WAVES = ("plan.wave_clock", "heave.sense.counts", "heave.sense.encoder_age", "load.age",
          "wave.elevation")  # fmt: skip
_TABLE = table_fields(row_contents(IMPEDANCE.columns), [leaf.name for leaf in leaves(WaveBotRow)])
KEPT_FIELDS = tuple(dict.fromkeys([*REQUIRED_FIELDS, *_TABLE, *_WAVES]))
"""Fields of a tick that the row table and the recovery of waves need."""


@lru_cache(8)
def loop_source(law: Law) -> LoopSource:
    """Return the source of loop and plant with a heave law."""
    return LoopSource(
        name=f"batch_{law.module.__name__.rpartition('.')[2]}",
        imports=_IMPORTS.format(law=law.module.__name__),
        kind="kind_with_law(heave_law)",
        plant=PLANT_CODE,
        fields=KEPT_FIELDS,
        lifted=(*_LIFTED, *helper_modules(law)),
        types=_TYPES,
    )
