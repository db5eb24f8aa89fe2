"""The registry of rig kinds, by their name in a rig file."""

from rig.kinds.oswec_bench import tick as oswec_bench
from rig.kinds.wavebot import tick as wavebot
from rig.realtime.cycle import Kind

KINDS: dict[str, Kind] = {"wavebot": wavebot.KIND, "oswec bench": oswec_bench.KIND}
