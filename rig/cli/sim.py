"""`rig sim RIG`."""

import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from rig import cli
from rig.cli.command_error import fail
from rig.cli.file_problems import REFUSED, refuse
from rig.cli.sim_view import hanging, show
from rig.config.any_rig_file import AnyRigFile
from rig.config.bench_rig_file import BenchRigFile
from rig.execution.hardware.bench_job import job_of_bench
from rig.execution.hardware.job import WiringError, job_of
from rig.execution.rehearsal.addresses import AnyWiring, impossible, taken
from rig.execution.rehearsal.standalone import alone
from rig.planning.session.files import is_session
from rig.processes.io_processes import IoProcess, IoProcessError, IoProcesses

_LOOK = 0.05  # s
_PATIENCE = 5.0  # s for the devices to leave


def main(path: Path, campaign: Path | None, *, as_json: bool) -> int:
    """Be the devices of a rig until Ctrl-C; gives the exit code."""
    try:
        rig, devices, sea = _devices(path, campaign)
        wiring = _wiring(rig)
    except REFUSED as error:
        return refuse("sim", error, as_json=as_json)
    if held := taken(wiring):  # the devices look again; here it is known in no time
        busy = RuntimeError("\n".join(held))
        return fail("sim", busy, as_json=as_json, code=cli.FAILED)
    with _interrupts() as asked, tempfile.TemporaryDirectory(prefix="rig-sim-") as folder:
        companions = IoProcesses((devices,), Path(folder))
        try:
            if not as_json:
                print("starting the emulated devices ...", file=sys.stderr, flush=True)
            companions.start()
        except IoProcessError as error:
            companions.end(_PATIENCE)
            if asked():
                return cli.OK
            why = str(error).removeprefix(f"{devices.name}: ")
            return fail("sim", RuntimeError(why), as_json=as_json, code=cli.FAILED)
        try:
            show(rig.name, hanging(wiring), sea, as_json=as_json)
            trouble = _stay(companions, asked)
        finally:
            companions.end(_PATIENCE)
    if trouble:
        print(f"rig sim: {trouble}", file=sys.stderr)
        return cli.FAILED
    if not as_json:
        print("\nended; all addresses are free", file=sys.stderr)
    return cli.OK


def _devices(path: Path, campaign: Path | None) -> tuple[AnyRigFile, IoProcess, str]:
    """The rig, who plays its devices, and what they are in."""
    if campaign is None:
        rig, devices = alone(path)
        bench = isinstance(rig, BenchRigFile)
        return rig, devices, "a bench at rest, its servo drive set up for velocity" if bench else (
            "calm water"
        )  # fmt: skip
    if is_session(campaign):
        from rig.execution.rehearsal.bench_emulation import emulator_process
        from rig.execution.rehearsal.bench_job import problems_of_session
        from rig.planning.session import open_session

        session = open_session(campaign, problems_of_session, path)
        setting = f"a bench, its servo drive set up for {session.file.loop}"
        return session.rig, emulator_process(session), setting
    from rig.execution.rehearsal import emulation, job
    from rig.planning.campaign.files import open_campaign  # scipy: seconds

    opened = open_campaign(campaign, job.problems, path)
    sea = f"{opened.file.sea.description()}, once the rig's wave trigger is on"
    return opened.rig, emulation.emulator_process(opened), sea


def _wiring(rig: AnyRigFile) -> AnyWiring:
    """The wires of a rig whose devices can be emulated; WiringError says why not."""
    if rig.wiring is None:
        raise WiringError(f"{rig.name} has no wiring to hang emulated devices on")
    why = impossible(rig.wiring)
    if why:
        raise WiringError("\n".join(why))
    if isinstance(rig, BenchRigFile):
        job_of_bench(rig)
    else:
        job_of(rig)
    return rig.wiring


def _stay(companions: IoProcesses, asked: Callable[[], bool]) -> str:
    """Wait for Ctrl-C; why it ended without one, empty otherwise."""
    while not asked():
        trouble = companions.listen()
        for line in companions.said:
            print(line, file=sys.stderr, flush=True)
        companions.said.clear()
        if trouble:
            return trouble
        time.sleep(_LOOK)
    return ""


@contextmanager
def _interrupts() -> Iterator[Callable[[], bool]]:
    """Ctrl-C, termination and a closed terminal are one request: to end."""
    count = 0

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal count
        count += 1

    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, interrupt) for number in numbers}
    try:
        yield lambda: count > 0
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
