"""Opening a run in a process of its own, to see what that costs a fresh one.

``python -m benchmarks.support.read_process RUN [FIELD ...]``; without fields, all of them.
"""

import json
import sys
from pathlib import Path
from time import perf_counter

from rig.runs import open_run


def main() -> None:
    """Open the run named on the command line and print rows, seconds and peak memory."""
    run, *fields = sys.argv[1:]
    began = perf_counter()
    data = open_run(run, fields=fields or None)
    took = perf_counter() - began
    # Not getrusage: its peak begins with that of the process that started this one.
    status = Path("/proc/self/status").read_text()
    peak = int(status.split("VmHWM:")[1].split()[0]) * 1024
    total = sum(float(values.values[-1]) for values in data.values())
    told = {"rows": data.sizes["time"], "seconds": took, "peak": peak, "sum": total}
    print(json.dumps(told))


if __name__ == "__main__":
    main()
