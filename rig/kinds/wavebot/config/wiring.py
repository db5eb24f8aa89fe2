"""The wiring of a WaveBot: CAN bus with three drives, Modbus lines. A rehearsal needs no wiring."""

from collections.abc import Iterator
from typing import Annotated

from rig.config.model import RuleViolation
from rig.config.wiring import (
    PANEL_INPUTS,
    WAVE_TRIGGER,
    Actuator,
    BlockContent,
    CanBus,
    Registers,
    TorqueDrive,
    Wiring,
)


class WaveBotWiring(Wiring):
    """The wiring of the WaveBot.

    The heave drive's first two analog inputs read the column load cell and the shaft torque
    sensor; those of the surge drive read the string pot and the rotor angle. Slew and stator
    cells, wave probes, power analyser and digital inputs are read over Modbus.
    """

    can: CanBus
    heave: TorqueDrive
    surge: TorqueDrive
    stator: Actuator
    analyser: Annotated[
        Registers, BlockContent("power analyser", {"ac": "W", "dc": "W", "bus_voltage": "V"})
    ]
    cells: Annotated[
        Registers,
        BlockContent(
            "strain-gauge amplifier: load cells", {"slew": "N", "stator_a": "N", "stator_b": "N"}
        ),
    ]
    probes: Annotated[
        Registers,
        BlockContent(
            "strain-gauge amplifier: wave probes", {"probe_1": "m", "probe_2": "m", "probe_3": "m"}
        ),
    ]
    inputs: Annotated[Registers, PANEL_INPUTS]
    outputs: Annotated[Registers, WAVE_TRIGGER]

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the register blocks, the node numbers and the numbers of analog inputs."""
        yield from super().check_rules()
        for name in ("heave", "surge"):
            scales: tuple[float, ...] = getattr(self, name).analog_per_v
            if len(scales) != 2:
                yield RuleViolation((name, "analog_per_v"), "must be two scales", scales)
