"""One campaign, from its checked file to its products: what `rig run` does."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple, Protocol

from rig import process, provenance, safety
from rig.assemble import wavebot_params
from rig.campaign import Campaign, Plan, resolved
from rig.campaign.windows import repeat_period
from rig.companions import Companion
from rig.hardware import job as hardware
from rig.rehearsal import emulation, job
from rig.runs import RunError, create, join
from rig.runs.folder import MCAP, PROGRESS, STATUS, files
from rig.supervisor import Outcome, Run, Setup, Snapshot
from rig.wavebot import KIND

ATTACHED = ("config.json", "plan.json", "code.json", "host.json")


class View(Protocol):
    """Who draws the run."""

    notice: str  # what was asked of the run, e.g. after Ctrl-C

    def __call__(self, snapshot: Snapshot) -> None:
        """Draw the run as it stands."""
        ...


class Ended(NamedTuple):
    """A run that has ended."""

    folder: Path
    outcome: Outcome
    trouble: str  # what could not be put on disk at the end; empty if nothing


class Rung(NamedTuple):
    """What a campaign is run on: nothing else differs between a rehearsal and the basin."""

    name: str  # rehearsal, hil, hardware
    real_clock: bool
    loop_module: str  # python -m ...: the loop process with its devices
    devices: dict[str, Any]  # for that module's connect()
    companions: tuple[Companion, ...] = ()


def rehearsal(campaign: Campaign, *, real_clock: bool) -> Rung:
    """The simulated plant in the loop's own process."""
    return Rung("rehearsal", real_clock, "rig.rehearsal", job.devices_of(campaign))


def wired(campaign: Campaign, *, emulated: bool) -> Rung:
    """The devices on the rig's wires, or emulated ones on the far end of the same wires.

    WiringError says, all at once, why these wires must not be powered.
    """
    made = hardware.job_of(campaign.rig)
    if not emulated:
        return Rung("hardware", True, "rig.hardware", made.devices, made.companions)
    companions = (emulation.companion(campaign), *made.companions)
    return Rung("hil", True, "rig.hardware", made.devices, companions)


def carry_out(campaign: Campaign, plan: Plan, runs: Path, view: View, rung: Rung) -> Ended:
    """Run a campaign to its end; raises BusyError when the real clock is taken.

    Ctrl-C asks for a controlled stop, a second one for power off at once; either way every row
    measured so far is kept.
    """
    with _interrupts(view) as asked, ExitStack() as locks:
        started = datetime.now(UTC)
        realtime = -1
        if rung.real_clock:
            realtime = locks.enter_context(create.hold_realtime(campaign.file.name)).fileno()
        folder = create.make(runs, campaign.file.name, started)
        held = locks.enter_context(create.hold_run(folder))
        _write_start(folder, campaign, plan, started, rung)
        run = Run(
            Setup(
                campaign.rig.kind,
                KIND,
                wavebot_params(
                    campaign.file, campaign.rig, campaign.limits, plan.segments, plan.setpoints
                ),
                rung.loop_module,
                rung.devices,
                plan.dt,
                rung.real_clock,
                campaign.rig.realtime == "required" and rung.real_clock,
                folder,
                ATTACHED,
                rung.name,
                held.fd,
                realtime,
                rung.companions,
            )
        )
        outcome = run.supervise(_shown(view), asked)
        trouble = _close_folder(folder, campaign, plan, outcome, started, rung)
    return Ended(folder, outcome, trouble)


def _shown(view: View) -> Callable[[Snapshot], None]:
    """The view, until drawing fails (a closed terminal): a run does not end for that."""
    broken = False

    def watch(snapshot: Snapshot) -> None:
        nonlocal broken
        if not broken:
            try:
                view(snapshot)
            except OSError:
                broken = True

    return watch


def _close_folder(
    folder: Path, campaign: Campaign, plan: Plan, outcome: Outcome, started: datetime, rung: Rung
) -> str:
    """One finished record and the run's status; what could not be done, in words.

    A full disk must not hide how the run ended, so nothing here raises for one.
    """
    trouble = []
    status = _status(folder, campaign, plan, started, rung) | {
        "status": outcome.status,
        "reason": outcome.reason,
        "ticks": outcome.ticks,
        "last_tick": outcome.last_row.get("tick"),
        "skipped": outcome.skipped,
        "dropped_rows": outcome.dropped,
        "unsaved_rows": outcome.unsaved,
        "logger_restarts": outcome.logger_restarts,
        "died": outcome.died,
        "said": list(outcome.said),
        "ended_utc": datetime.now(UTC).isoformat(),
    }
    try:
        _join_parts(folder)
    except (OSError, RunError) as error:
        trouble.append(str(error))
    try:
        create.write_json(folder, STATUS, status)
        (folder / PROGRESS).unlink(missing_ok=True)
    except OSError as error:
        trouble.append(str(error))
    return "; ".join(trouble)


def _status(
    folder: Path, campaign: Campaign, plan: Plan, started: datetime, rung: Rung
) -> dict[str, Any]:
    return {
        "run": folder.name,
        "status": "running",
        "rung": rung.name,
        "campaign": campaign.file.name,
        "rows_planned": len(plan.rows),
        "started_utc": started.isoformat(),
        "pid": os.getpid(),
        "pid_started": process.started(os.getpid()),
    }


def _write_start(
    folder: Path, campaign: Campaign, plan: Plan, started: datetime, rung: Rung
) -> None:
    (folder / "config.json").write_text(resolved(campaign) + "\n")
    sea = campaign.file.sea
    create.write_json(
        folder,
        "plan.json",
        {
            "dt": plan.dt,
            "rows": [
                {
                    "row": r.row,
                    "point": r.point,
                    "repetition": r.repetition,
                    "stator": r.stator_position,
                    **r.setting._asdict(),
                    "periods": r.periods,
                    "measure_s": r.measure,
                }
                for r in plan.rows
            ],
            "device": campaign.file.device,
            "repeat_s": repeat_period(sea),
            "sea": sea.model_dump(mode="json") | {"words": sea.words()},
            "spring_moves": plan.spring_moves,
            "duration_s": plan.duration,
        }
        | ({"asked_sea": job.asked_sea(campaign)} if campaign.file.device == "absent" else {}),
    )
    create.write_json(folder, "code.json", provenance.code())
    create.write_json(folder, "host.json", provenance.host())
    create.write_json(folder, STATUS, _status(folder, campaign, plan, started, rung))


def _join_parts(folder: Path) -> None:
    """One file out of what killed loggers left; the parts stay if they cannot be joined."""
    parts = files(folder)
    whole = folder / MCAP
    if whole in parts:
        return
    made = folder / f".{MCAP}.new"
    try:
        join(parts, made)
    except OSError:
        made.unlink(missing_ok=True)
        raise
    made.rename(whole)
    for part in parts:
        part.unlink()


@contextmanager
def _interrupts(view: View) -> Iterator[Callable[[], int]]:
    """Ctrl-C, termination and a closed terminal become requests; gives what is asked so far."""
    count = 0

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal count
        count += 1
        view.notice = (
            "stopping: damping, then power off (Ctrl-C again: off at once)"
            if count == 1
            else "power off; saving what was measured"
        )

    def asked() -> int:
        return (safety.REQUEST_NONE, safety.REQUEST_STOP, safety.REQUEST_ABORT)[min(count, 2)]

    asking = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as nohup leaves it
        asking.append(signal.SIGHUP)
    before = {number: signal.signal(number, interrupt) for number in asking}
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
