"""The loop process of a wired bench; the supervisor hands it a job on standard input."""

from rig import loop_process
from rig.bench import KIND
from rig.hardware.bench_devices import connect

if __name__ == "__main__":
    loop_process.main(KIND, connect)
