"""Opening a run in a process of its own, to see what that costs a fresh one.

``python -m benchmarks.support.read_process [--alone] RUN [FIELD ...]``; all fields if none given.
"""

import json
import sys
from pathlib import Path
from time import perf_counter

# What the project does not need, but its tests do: pandas and xarray load it where it lies.
EXTRAS = ("dask", "distributed", "pyarrow")


def main() -> None:
    """Open the run named on the command line and print rows, seconds and peak memory.

    With ``--alone``, as where nothing but the project and what it needs is installed.
    """
    run, *fields = sys.argv[1:]
    if run == "--alone":
        run, *fields = fields
        sys.modules.update(dict.fromkeys(EXTRAS))  # type: ignore[arg-type]
    from rig.recording.runs import open_run  # noqa: PLC0415

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
