"""The WaveBot's formats of `rig export` (`rig.kinds.interface.Exports`)."""

from rig.kinds.wavebot.mask4 import export as mask4

FORMATS = {"mat": mask4}
