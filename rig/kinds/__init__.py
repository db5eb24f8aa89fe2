"""The kinds of rig there are, by the name a rig file gives."""

from rig.kinds import oswec_bench, wavebot
from rig.realtime.cycle import Kind

KINDS: dict[str, Kind] = {"wavebot": wavebot.KIND, "oswec bench": oswec_bench.KIND}
