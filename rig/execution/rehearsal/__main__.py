"""The loop process of a rehearsal; the supervisor sends it a job on standard input."""

from rig.execution.rehearsal.devices import connect
from rig.kinds.wavebot import KIND
from rig.processes import loop_process

loop_process.main(KIND, connect)
