"""The WaveBot's own commands of `rig` (`rig.kinds.interface.Commands`)."""

from rig.kinds.registry import Command

KIND = "wavebot"  # of the runs that these commands read

_NAME_MODULE_HELP = (
    ("import", "import_run",
     "Convert a downloaded MASK4 file to a run for `rig show`, `plot`, `compare` and `merge`."),
    ("matrix", "matrix", "Read a gain matrix of an earlier rig, and convert it for wec-rig."),
    ("recommend", "recommend",
     "Recommend gains: best settings for a sea, and a campaign file of the rows to run next."),
    ("spring-map", "spring_map",
     "Map the magnetic spring from a hoist campaign, and write the map as a calibration file."),
    ("surge-damping", "surge_damping",
     "Determine the surge damping: the least drive force that keeps stroke and heave power."),
    ("testlog", "testlog",
     "Read the log of a test: its runs, their links, and every irregularity."),
    ("twin", "twin",
     "Write a plant file, identified from runs, for rehearsals, checks and sweeps."),
    ("twoport", "twoport",
     "Draw how gains, spring and gear change the impedance match and the transmitted power."),
)  # fmt: skip
COMMANDS = tuple(
    Command(name, f"{__name__}.{module}", text) for name, module, text in _NAME_MODULE_HELP
)
