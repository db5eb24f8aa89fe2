"""The loop process of a rehearsal; the supervisor sends it a job on standard input."""

from rig.kinds.wavebot.rehearsal.devices import connect
from rig.kinds.wavebot.tick import find_kind
from rig.processes import loop_process

loop_process.main(find_kind, connect)
