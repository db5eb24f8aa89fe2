"""The models of a bench's configuration files."""

from rig.kinds.oswec_bench.config.limits_file import BenchLimitsFile as LimitsFile
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile as RigFile

__all__ = ["LimitsFile", "RigFile"]
