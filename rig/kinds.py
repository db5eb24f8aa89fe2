"""The kinds of rig there are, by the name a rig file gives."""

from rig import bench, wavebot
from rig.cycle import Kind

KINDS: dict[str, Kind] = {"wavebot": wavebot.KIND, "oswec bench": bench.KIND}
