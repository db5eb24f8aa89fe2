"""What the loop runs of a bench: its signals, its checks, its reasons, its part of the cycle."""

from rig.kinds.oswec_bench.tick.cycle import find_kind
from rig.kinds.oswec_bench.tick.signals import SENSE_IN_ROW, Sense

__all__ = ["SENSE_IN_ROW", "Sense", "find_kind"]
