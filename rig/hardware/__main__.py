"""The loop process of a wired rig; the supervisor hands it a job on standard input."""

from rig import loop_process
from rig.hardware.devices import connect
from rig.wavebot import KIND

loop_process.main(KIND, connect)
