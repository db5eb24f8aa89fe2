"""Open a run in a new process, to measure the time and memory of that.

``python -m benchmarks.support.read_process [--alone] RUN [FIELD ...]``; all fields if none given.
"""

import json
import sys
from pathlib import Path
from time import perf_counter

# Packages that only the tests need: pandas and xarray import them if they are installed.
EXTRAS = ("dask", "distributed", "pyarrow")


def main() -> None:
    """Open the run of the command line, and print rows, seconds and peak memory.

    With ``--alone``, as if only the project's own dependencies were installed.
    """
    run, *fields = sys.argv[1:]
    if run == "--alone":
        run, *fields = fields
        sys.modules.update(dict.fromkeys(EXTRAS))  # type: ignore[arg-type]
    from rig.recording.runs import open_run  # noqa: PLC0415

    began = perf_counter()
    data = open_run(run, fields=fields or None)
    took = perf_counter() - began
    # The peak of getrusage starts with that of the parent process.
    status = Path("/proc/self/status").read_text()
    peak = int(status.split("VmHWM:")[1].split()[0]) * 1024
    total = sum(float(values.values[-1]) for values in data.values())
    print(json.dumps({"rows": data.sizes["time"], "seconds": took, "peak": peak, "sum": total}))


if __name__ == "__main__":
    main()
