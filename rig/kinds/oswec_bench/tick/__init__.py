"""The loop's part of a bench: signals, checks, reasons of a stop, its part of the cycle."""

from rig.kinds.oswec_bench.tick.cycle import find_kind
from rig.kinds.oswec_bench.tick.signals import SENSE_IN_ROW, Sense

__all__ = ["SENSE_IN_ROW", "Sense", "find_kind"]
