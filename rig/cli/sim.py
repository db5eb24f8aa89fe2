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
from rig.cli.file_problems import INPUT_ERRORS, refuse
from rig.cli.input_files import CAMPAIGNS, RIGS, SESSIONS, input_file
from rig.cli.sim_view import emulated_devices, show
from rig.config.rig_file import BaseRigFile
from rig.emulation.addresses import AnyWiring, occupied_addresses, unreachable_addresses
from rig.emulation.standalone import load_standalone
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.hardware.job import build_bench_job
from rig.kinds.oswec_bench.sessions.files import is_session
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.hardware.job import WiringError, build_job
from rig.processes.io_processes import IoProcess, IoProcessError, IoProcesses

_POLL_INTERVAL_S = 0.05
_STOP_TIMEOUT_S = 5.0


def main(path: Path, campaign: Path | None, *, as_json: bool) -> int:
    """Emulate the devices of a rig until Ctrl-C, and return the exit code."""
    try:
        rig, devices, sea = _open_devices(path, campaign)
        wiring = _checked_wiring(rig)
    except INPUT_ERRORS as error:
        return refuse("sim", error, as_json=as_json)
    if taken_addresses := occupied_addresses(
        wiring
    ):  # the devices check again, but only after their start
        busy = RuntimeError("\n".join(taken_addresses))
        return fail("sim", busy, as_json=as_json, code=cli.FAILED)
    with (
        _stop_signals() as stop_requested,
        tempfile.TemporaryDirectory(prefix="rig-sim-") as folder,
    ):
        io_processes = IoProcesses((devices,), Path(folder))
        try:
            if not as_json:
                print("starting the emulated devices ...", file=sys.stderr, flush=True)
            io_processes.start()
        except IoProcessError as error:
            io_processes.end(_STOP_TIMEOUT_S)
            if stop_requested():
                return cli.OK
            message = str(error).removeprefix(f"{devices.name}: ")
            return fail("sim", RuntimeError(message), as_json=as_json, code=cli.FAILED)
        try:
            show(rig.name, emulated_devices(wiring), sea, as_json=as_json)
            trouble = _wait_for_end(io_processes, stop_requested)
        finally:
            io_processes.end(_STOP_TIMEOUT_S)
    if trouble:
        print(f"rig sim: {trouble}", file=sys.stderr)
        return cli.FAILED
    if not as_json:
        print("\nended; all addresses are free again", file=sys.stderr)
    return cli.OK


def _open_devices(path: Path, campaign: Path | None) -> tuple[BaseRigFile, IoProcess, str]:
    """Return the rig, the process that emulates its devices, and their setting in words."""
    path = input_file(path, RIGS)
    if campaign is None:
        rig, devices = load_standalone(path)
        bench = isinstance(rig, BenchRigFile)
        return rig, devices, "a bench at rest, its servo drive set up for velocity" if bench else (
            "calm water"
        )  # fmt: skip
    campaign = input_file(campaign, CAMPAIGNS, SESSIONS)
    if is_session(campaign):
        from rig.kinds.oswec_bench.rehearsal.emulation import emulator_process
        from rig.kinds.oswec_bench.rehearsal.job import session_problems
        from rig.kinds.oswec_bench.sessions import open_session

        session = open_session(campaign, session_problems, path)
        setting = f"a bench, its servo drive set up for {session.file.loop}"
        return session.rig, emulator_process(session), setting
    from rig.kinds.wavebot.rehearsal import emulation, job
    from rig.planning.campaign.files import open_campaign  # scipy: seconds

    checked_campaign = open_campaign(campaign, job.problems, path)
    sea = f"{checked_campaign.file.sea.description()}, once the rig's wave trigger is on"
    return checked_campaign.rig, emulation.emulator_process(checked_campaign), sea


def _checked_wiring(rig: BaseRigFile) -> AnyWiring:
    """Return the wiring of a rig whose devices can be emulated; WiringError gives the reason."""
    if rig.wiring is None:
        raise WiringError(f"{rig.name} has no wiring, so no devices can be emulated")
    reasons = unreachable_addresses(rig.wiring)
    if reasons:
        raise WiringError("\n".join(reasons))
    if isinstance(rig, BenchRigFile):
        build_bench_job(rig)
    else:
        assert isinstance(rig, RigFile)
        build_job(rig)
    wiring: AnyWiring = rig.wiring
    return wiring


def _wait_for_end(io_processes: IoProcesses, stop_requested: Callable[[], bool]) -> str:
    """Wait for Ctrl-C; return the trouble that ended the devices before it (empty: none)."""
    while not stop_requested():
        trouble = io_processes.check()
        for line in io_processes.messages:
            print(line, file=sys.stderr, flush=True)
        io_processes.messages.clear()
        if trouble:
            return trouble
        time.sleep(_POLL_INTERVAL_S)
    return ""


@contextmanager
def _stop_signals() -> Iterator[Callable[[], bool]]:
    """Catch SIGINT, SIGTERM and SIGHUP; yield a function that returns whether one came."""
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
