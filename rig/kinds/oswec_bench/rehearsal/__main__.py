"""The loop process of a rehearsed session; the supervisor sends it a job on standard input."""

from rig.kinds.oswec_bench.rehearsal.devices import connect
from rig.kinds.oswec_bench.tick import KIND
from rig.processes import loop_process

if __name__ == "__main__":
    loop_process.main(lambda law: KIND, connect)
