"""The bench's own commands of `rig` (`rig.kinds.interface.Commands`)."""

from rig.kinds.registry import Command

COMMANDS = (
    Command(
        "bench",
        "rig.kinds.oswec_bench.commands.bench",
        "Run a session of the OSWEC bench, analyse it, and write its report and calibration file.",
    ),
)
