"""The registry of rig kinds, by their name in a rig file."""

from rig.kinds import oswec_bench, wavebot
from rig.realtime.cycle import Kind

KINDS: dict[str, Kind] = {"wavebot": wavebot.KIND, "oswec bench": oswec_bench.KIND}
