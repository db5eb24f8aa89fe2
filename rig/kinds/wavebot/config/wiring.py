"""The wiring of a WaveBot: CAN bus with three drives, Modbus lines. A rehearsal needs no wiring."""

import math
from collections.abc import Iterator
from typing import Annotated

from rig.config.model import RuleViolation
from rig.config.wiring import Actuator, BlockContent, CanBus, Registers, TorqueDrive, Wiring


class WaveBotWiring(Wiring):
    """The wiring of the WaveBot.

    The heave drive's first two analog inputs read the column load cell and the shaft torque
    sensor; those of the surge drive read the string pot and the rotor angle. Slew and stator
    cells, wave probes, power analyser and digital inputs are read over Modbus. The digital inputs
    are for monitoring only: the stop chain is hard-wired.
    """

    can: CanBus
    heave: TorqueDrive
    surge: TorqueDrive
    stator: Actuator
    analyser: Annotated[Registers, BlockContent("power analyser", ("ac", "dc", "bus_voltage"))]
    cells: Annotated[
        Registers,
        BlockContent("strain-gauge amplifier: load cells", ("slew", "stator_a", "stator_b")),
    ]
    probes: Annotated[
        Registers,
        BlockContent("strain-gauge amplifier: wave probes", ("probe_1", "probe_2", "probe_3")),
    ]
    inputs: Annotated[
        Registers, BlockContent("I/O coupler: digital inputs", ("e_stop", "limit_switch"))
    ]
    outputs: Annotated[
        Registers, BlockContent("I/O coupler: digital outputs", ("wave_trigger",), written=True)
    ]

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the register blocks, the scales of the analog inputs and the node numbers."""
        yield from super().check_rules()
        for name in ("heave", "surge"):
            scales: tuple[float, ...] = getattr(self, name).analog_per_v
            if len(scales) != 2 or not all(scales) or not all(map(math.isfinite, scales)):
                yield RuleViolation(
                    (name, "analog_per_v"), "must be two scales other than 0", scales
                )
        nodes = [self.can.own_node, *(drive.node for drive in self.drives().values())]
        if len(set(nodes)) != len(nodes):
            yield RuleViolation(("can", "own_node"), "two nodes have the same number", nodes)
