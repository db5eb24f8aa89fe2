"""What `rig sweep` does: check, compile, run, write, draw, and say what came out."""

import json
import sys
import time
from pathlib import Path
from threading import Timer
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rig import cli
from rig.analysis.phrases import POWER_NAMES, watts
from rig.cli import calibration_dates
from rig.cli.command_error import fail, in_words
from rig.cli.file_problems import REFUSED, refuse
from rig.cli.find_run import find_run
from rig.cli.sweep_progress import SweepProgress
from rig.recording.runs import RunError, facts
from rig.recording.runs.create import BusyError
from rig.sweep import executors, result_cache, sweep
from rig.sweep.cases import LEAD_IN
from rig.sweep.journal import NAME as CASES
from rig.sweep.result import FAILED

if TYPE_CHECKING:
    import xarray

_COMPILING = "compiling the loop, about a minute, once on this machine ..."
_SURELY_COMPILING = 8.0  # s; reading it from the cache takes one or two
_MOST_REASONS = 5


class SweepOptions(NamedTuple):
    """What the command line asks for beside the campaign."""

    overs: list[str]
    sequential: bool
    lead_in: float | None  # s
    jobs: int | None
    scheduler: str | None  # of a Dask cluster
    out: Path | None
    measured: Path | None
    sweeps: Path
    runs: Path


def main(path: Path, wanted: SweepOptions, *, as_json: bool) -> int:
    """Run the sweep, write its result and pictures; gives the exit code."""
    lead_in = LEAD_IN if wanted.lead_in is None else wanted.lead_in
    try:
        if wanted.sequential and wanted.lead_in is not None:
            raise ValueError("--lead-in: in sequence the campaign's own start.lead_in_s counts")
        measured = find_run(wanted.measured, wanted.runs) if wanted.measured else None
        if measured and "session" in facts(measured).config:
            raise RunError(f"--measured {measured}: a run of a bench, which has no campaign's rows")
        opened = sweep.open_sweep(
            path, wanted.overs, wanted.sweeps, sequential=wanted.sequential, lead_in=lead_in
        )
    except (*REFUSED, RunError) as error:
        return refuse("sweep", error, as_json=as_json)
    began = time.monotonic()
    warnings = calibration_dates.warn(opened.campaign, quiet=as_json, swept=opened.swept)
    executor = _executor(opened, wanted)
    view = SweepProgress(opened.folder.name, len(opened.cases), quiet=as_json)
    out, table = wanted.out or opened.folder / sweep.RESULT, None
    try:
        with sweep.hold(opened):
            left, damaged = sweep.left(opened)
            if damaged and not as_json:
                print(f"{damaged} bytes of {opened.folder}/{CASES} are no whole cases and are left "
                      "out", file=sys.stderr)  # fmt: skip
            told = result_cache.load(opened.folder, out) if not (left or measured) else None
            if told is not None:
                view.begin(len(opened.cases))
            else:
                if left and wanted.scheduler is None:  # workers compile for themselves
                    _compile(opened)
                with view:
                    table = sweep.run(opened, executor, view.see, view.begin)
                sweep.write(table, out)
    except BusyError as error:
        return fail("sweep", error, as_json=as_json, code=cli.FAILED)
    except KeyboardInterrupt:
        return _interrupted(opened.folder, as_json=as_json)
    except (OSError, ValueError, ArithmeticError) as error:
        kept = f"{view.kept} are kept in {opened.folder}/, the same command goes on"
        whole = RuntimeError(f"{in_words(error)}; {kept}")
        return fail("sweep", whole, as_json=as_json, code=cli.FAILED)
    if table is not None:
        try:
            pictures = _draw(table, opened.folder, measured, quiet=as_json)
            told = _told(opened.folder, out, pictures, table)
            result_cache.store(opened.folder, out, measured, [out, *pictures], told)
        except KeyboardInterrupt:
            return _interrupted(opened.folder, as_json=as_json)
        except (*REFUSED, RunError) as error:
            return refuse("sweep", error, as_json=as_json)
    told = (told or {}) | {
        "seconds": round(time.monotonic() - began, 3),
        "running_s": round(view.spent, 3),
        "simulated_s": view.simulated,
        "run_now": view.done,
        "warnings": warnings,
    }
    if as_json:
        print(json.dumps(told))
    else:
        _say(told)
    return cli.FAILED if told["failed"] else cli.OK


def _executor(opened: sweep.Sweep, wanted: SweepOptions) -> executors.Executor:
    if wanted.scheduler is None:
        return executors.threads(wanted.jobs or executors.cores())
    from rig.sweep.cluster import cluster

    return cluster(wanted.scheduler, opened.cases.asked, opened.digest)


def _compile(opened: sweep.Sweep) -> None:
    """Compile the loop, or read it from the cache, and say so where it takes its time."""

    def say() -> None:
        print(_COMPILING, file=sys.stderr, flush=True)

    from rig.sweep import compiled  # numba
    from rig.sweep.simulation import KEPT

    late = Timer(_SURELY_COMPILING, say)  # a law of another shape is compiled, too
    late.daemon = True
    if compiled.is_compiled(KEPT):
        late.start()
    else:
        say()
    try:
        opened.cases.prepare()
    finally:
        late.cancel()


def _draw(
    table: "xarray.Dataset", folder: Path, measured: Path | None, *, quiet: bool
) -> list[Path]:
    from rig.sweep.pictures import write

    if not quiet:
        print("drawing ...", file=sys.stderr, flush=True)
    return write(table, folder, measured)


def _interrupted(folder: Path, *, as_json: bool) -> int:
    message = f"interrupted; what is finished is kept in {folder}/, the same command goes on"
    if as_json:
        print(json.dumps({"status": "stopped", "message": message, "folder": str(folder)}))
    else:
        print(f"\nrig sweep: {message}", file=sys.stderr)
    return cli.STOPPED


def _told(
    folder: Path, result: Path, pictures: list[Path], table: "xarray.Dataset"
) -> dict[str, Any]:
    state, why = table["state"].values, table["incomplete_reason"].values
    names, counts = np.unique(state.astype(str), return_counts=True)
    reasons = sorted({str(text) for text in why[state == FAILED]})
    return {
        "status": "failed cases" if reasons else "complete",
        "folder": str(folder),
        "result": str(result),
        "pictures": [str(picture) for picture in pictures],
        "rows": dict(zip(names.tolist(), counts.tolist(), strict=True)),
        "failed": reasons,
        "best": {kind: best for kind in POWER_NAMES if (best := _best(table, kind))},
    }


def _best(table: "xarray.Dataset", kind: str) -> dict[str, Any]:
    """The row with the least power (negative is absorbed), with all its inputs."""
    name = f"power_{kind}"
    if name not in table or not np.isfinite(table[name].values).any():
        return {}
    power = table[name].where(table["state"] == "complete")
    if not np.isfinite(power.values).any():
        return {}
    place: Any = power.argmin(...)
    found: Any = table.isel(place)
    inputs = [*map(str, table.sizes), *(key for key in ("spring_rate", "kp", "ki") if key in found)]
    values = {key: found[key].values.item() for key in inputs}
    return {"power_w": found[name].values.item(), **values}


def _say(told: dict[str, Any]) -> None:
    rows = ", ".join(f"{count} {state}" for state, count in told["rows"].items())
    pace = "nothing was left to run"
    if told["run_now"]:
        rate = told["simulated_s"] / told["running_s"]
        pace = f"the cases took {told['running_s']:.1f} s of it, {rate:.0f} times real time"
    print(f"{rows} in {told['seconds']:.1f} s; {pace}")
    print("Best rows (negative is absorbed)")
    for kind, best in told["best"].items():
        inputs = (f"{key} {value:g}" if isinstance(value, float) else f"{key} {value}"
                  for key, value in best.items() if key != "power_w")  # fmt: skip
        print(f"  {POWER_NAMES[kind]:<32} {watts(best['power_w']):>10}   {', '.join(inputs)}")
    for reason in told["failed"][:_MOST_REASONS]:
        print(f"failed: {reason}", file=sys.stderr)
    if len(told["failed"]) > _MOST_REASONS:
        print(f"and {len(told['failed']) - _MOST_REASONS} more reasons", file=sys.stderr)
    print(f"\n{told['result']}")
    for picture in told["pictures"]:
        print(picture)
