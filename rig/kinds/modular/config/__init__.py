"""The models of a modular rig's files."""

from rig.kinds.modular.config.limits_file import LimitsFile
from rig.kinds.modular.config.rig_file import RigFile
from rig.kinds.modular.config.wiring import ModularWiring

__all__ = ["LimitsFile", "ModularWiring", "RigFile"]
