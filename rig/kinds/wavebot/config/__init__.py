"""The models of a WaveBot's configuration files."""

from rig.kinds.wavebot.config.limits_file import LimitsFile
from rig.kinds.wavebot.config.rig_file import RigFile

__all__ = ["LimitsFile", "RigFile"]
