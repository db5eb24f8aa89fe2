"""The WaveBot's own commands of `rig` (`rig.kinds.interface.Commands`)."""

from rig.kinds import Command

COMMANDS = (
    Command(
        "import",
        "rig.kinds.wavebot.commands.import_run",
        "Convert a downloaded MASK4 file to a run for `rig show`, `plot`, `compare` and `merge`.",
    ),
    Command(
        "matrix",
        "rig.kinds.wavebot.commands.matrix",
        "Read a gain matrix of an earlier rig, and convert it for wec-rig.",
    ),
    Command(
        "recommend",
        "rig.kinds.wavebot.commands.recommend",
        "Recommend gains: best settings for a sea, and a campaign file of the rows to run next.",
    ),
    Command(
        "spring-map",
        "rig.kinds.wavebot.commands.spring_map",
        "Map the magnetic spring from a hoist campaign, and write the map as a calibration file.",
    ),
    Command(
        "surge-damping",
        "rig.kinds.wavebot.commands.surge_damping",
        "Determine the surge damping: the least drive force that keeps stroke and heave power.",
    ),
    Command(
        "testlog",
        "rig.kinds.wavebot.commands.testlog",
        "Read the log of a test: its runs, their links, and every irregularity.",
    ),
    Command(
        "twin",
        "rig.kinds.wavebot.commands.twin",
        "Write a plant file, identified from runs, for rehearsals, checks and sweeps.",
    ),
    Command(
        "twoport",
        "rig.kinds.wavebot.commands.twoport",
        "Draw how gains, spring and gear change the impedance match and the transmitted power.",
    ),
)
