"""The loop process of a rehearsal; the supervisor hands it a job on standard input."""

from rig import loop_process
from rig.rehearsal.devices import connect
from rig.wavebot import KIND

loop_process.main(KIND, connect)
