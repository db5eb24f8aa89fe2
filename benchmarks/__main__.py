"""`python -m benchmarks [NAME ...] [--short] [--json]`."""

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks import (
    adaptive,
    arithmetic,
    batch,
    bits,
    cluster,
    counterfactual,
    coupled,
    coverage,
    crash,
    ethercat,
    fast_loop,
    faults,
    hil,
    hil_tick,
    identification,
    lateness,
    logging,
    page,
    page_memory,
    reading,
    recommend,
    rehearsal,
    resume,
    ring,
    row_ends,
    row_ends_irregular,
    spring_map,
    start,
    tick,
    uncertainty,
)
from benchmarks.support import host, report
from benchmarks.support.fault_rigs import RIGS
from benchmarks.support.result import Result, format_table

RESULTS = Path(__file__).parent / "results"

MEASUREMENTS: dict[str, Callable[[bool], Result]] = {
    "tick": tick.measure,
    "coupled": coupled.measure,
    "rehearsal": rehearsal.measure,
    "identification": identification.measure,
    "recommend": recommend.measure,
    "lateness": lateness.measure,
    "fast_loop": fast_loop.measure,
    "hil": hil.measure,
    "hil_tick": hil_tick.measure,
    "ethercat": ethercat.measure,
    "ring": ring.measure,
    "logging": logging.measure,
    "page": page.measure,
    "page_memory": page_memory.measure,
    "crash": crash.measure,
    "row_ends": row_ends.measure,
    "adaptive": adaptive.measure,
    "row_ends_irregular": row_ends_irregular.measure,
    "uncertainty": uncertainty.measure,
    "resume": resume.measure,
    "reading": reading.measure,
    "start": start.measure,
    "batch": batch.measure,
    "arithmetic": arithmetic.measure,
    "bits": bits.measure,
    "cluster": cluster.measure,
    "counterfactual": counterfactual.measure,
    "spring_map": spring_map.measure,
    "faults": faults.measure,
    "coverage": coverage.measure,
}
STORED_NAMES = [*MEASUREMENTS, *(f"faults_{name}" for name in RIGS)]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure the targets of this project; the figures are stored in "
        "benchmarks/results/ unless the run is a short one.",
        epilog="\n".join(f"  {n:14} {_first_line(m)}" for n, m in MEASUREMENTS.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="what to measure (default: all)")
    parser.add_argument(
        "--short", action="store_true", help="short form: a minute or two instead of half an hour"
    )
    parser.add_argument(
        "--rig", choices=list(RIGS), default="wavebot", help="faults: rig whose table is measured"
    )
    parser.add_argument(
        "--missing",
        action="store_true",
        help="faults: only rows without a result; each result is stored at once",
    )
    parser.add_argument(
        "--rows",
        metavar="TEXT",
        default="",
        help="faults: only rows with this in their name; each result is stored at once",
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in MEASUREMENTS]
    if unknown:
        parser.error(f"no measurement {unknown[0]!r}; there are {', '.join(MEASUREMENTS)}")
    if (_selects_rows(options) or options.rig != "wavebot") and options.names != ["faults"]:
        parser.error("--rig, --missing and --rows go with faults alone")
    if _selects_rows(options) and options.short:
        parser.error("--missing and --rows do not go with --short")
    return options


def _selects_rows(options: argparse.Namespace) -> bool:
    """Return True for a part of a table, whose results are stored one by one."""
    return bool(options.missing or options.rows)


def _measure(name: str, options: argparse.Namespace) -> Result:
    if name != "faults":
        return MEASUREMENTS[name](options.short)
    rig = RIGS[options.rig]
    if _selects_rows(options):
        return faults.measure_some(rig, options.rows, options.missing)
    return faults.measure(options.short, rig)


def _first_line(measure: Callable[[bool], Result]) -> str:
    module = sys.modules[measure.__module__]
    return (module.__doc__ or "").strip().splitlines()[0]


def main() -> int:
    """Run the chosen measurements; return 0 unless one of them failed."""
    options = _arguments()
    names = options.names or list(MEASUREMENTS)
    results: dict[str, Any] = {}
    missed: list[str] = []
    failed: list[str] = []
    for name in names:
        if not options.json:
            print(f"{name} ...", file=sys.stderr, flush=True)
        before, began = host.ProcessorTime.now(), time.monotonic()
        try:
            result = _measure(name, options)
        except Exception as error:  # noqa: BLE001  the others are measured all the same
            failed.append(f"{name}: {type(error).__name__}: {error}")
            continue
        results[name] = {
            **result.as_dict(),
            "host": host.describe_host(),
            "load": host.other_load(before, host.ProcessorTime.now()),
            "took_s": round(time.monotonic() - began, 1),
        }
        missed += [f"{name}: {f.name.strip()}, {f.median:.3g} {f.unit}" for f in result.missed]
        if not options.json:
            print(format_table(result), end="\n\n", flush=True)
        if not (options.short or _selects_rows(options)):
            stored_name = name if options.rig == "wavebot" else f"{name}_{options.rig}"
            report.store(RESULTS, stored_name, results[name], STORED_NAMES)
    if options.json:
        print(json.dumps({"short": options.short, "results": results, "failed": failed}, indent=2))
    elif results:
        print(report.format_missed(missed))
    for line in failed:
        print(f"not measured: {line}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
