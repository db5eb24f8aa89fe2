"""The examination of a host, and its verdict in one sentence."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from rig.config.rig_file import BaseRigFile
from rig.host import clocks, disk, memory, privileges, processor, software, timing, wires
from rig.host.finding import REALTIME, Finding, Host, Use, Verdict
from rig.realtime import scheduling

AreaCheck = tuple[str, Callable[[], list[Finding]]]
"""The name of an area, and the function that checks it."""

_MAX_REASONS = 4  # in the verdict


class DoctorOptions(NamedTuple):
    """Options of `rig doctor`."""

    runs: Path  # folder for the runs
    seconds: float  # of each of the two measurements of wake-ups; 0: none, beside a run
    rate_hz: float  # of the loop
    hours: float  # of logging that must fit on the disk
    rig: BaseRigFile | None = None  # also check the wires of this rig
    core: int | None = None  # of the loop if no wake-ups are measured; None: find it


class Examination(NamedTuple):
    """All findings."""

    findings: tuple[Finding, ...]
    has_wakeups: bool = True  # False: they were left out, during a run

    def obstacles(self, use: Use) -> list[Finding]:
        """Return the findings that forbid a use; empty if the host is fit for it."""
        return [finding for finding in self.findings if use in finding.forbids]

    def fit(self, use: Use) -> bool:
        """Return whether the host is fit for a use."""
        return not self.obstacles(use)

    @property
    def verdict(self) -> str:
        """The uses that the host is fit for, and the reasons against the others."""
        fit = [use for use in Use if self.fit(use)]
        parts = [f"fit for {' and for '.join(fit)}"] if fit else []
        unfit = [use for use in Use if not self.fit(use)]
        for use in unfit:
            reasons = [finding.cause for finding in self.obstacles(use)]
            more = (
                f"; and {len(reasons) - _MAX_REASONS} more" if len(reasons) > _MAX_REASONS else ""
            )
            parts.append(f"not fit for {use} because of {'; '.join(reasons[:_MAX_REASONS])}{more}")
        warned = sum(finding.verdict is Verdict.WARNING for finding in self.findings)
        if warned and not unfit:
            parts.append(f"with {warned} warnings" if warned > 1 else "with one warning")
        if not self.has_wakeups:
            parts.append("wake-ups were not measured")
        text = "; ".join(parts)
        return f"{text[0].upper()}{text[1:]}."

    def as_dict(self) -> dict[str, Any]:
        """Return the examination as JSON values."""
        return {
            "fit": {str(use): self.fit(use) for use in Use},
            "verdict": self.verdict,
            "findings": [
                {**finding._asdict(), "forbids": list(map(str, finding.forbids))}
                for finding in self.findings
            ],
        }


def examine(options: DoctorOptions, host: Host | None = None) -> Examination:
    """Run all checks of a host; a value that the host does not show never raises."""
    host = host or Host()
    clock_before, cpu_before = clocks.ClockReading.now(), processor.CpuTime.read(host)
    dt = 1.0 / options.rate_hz
    measured = timing.measure(dt, options.seconds) if options.seconds else None
    clock_after, cpu_after = clocks.ClockReading.now(), processor.CpuTime.read(host)
    wakeups = None if measured is None else measured.privileged
    core = scheduling.loop_core() if options.core is None else options.core
    core = core if wakeups is None else int(wakeups["core"])
    latest = None if wakeups is None else float(wakeups["max_us"]) * 1e-6 / dt
    rig_checks: list[AreaCheck] = []
    if options.rig is not None:
        check = partial(wires.rig_findings, host, options.rig)
        rig_checks.append((wires.rig_area(options.rig), check))
    timing_checks: list[AreaCheck] = []
    if measured is not None:
        timing_checks.append((timing.AREA, partial(timing.findings, measured, dt)))
    checks: tuple[AreaCheck, ...] = (
        *timing_checks,
        (privileges.AREA, lambda: privileges.findings(host, wakeups)),
        (processor.AREA, lambda: processor.findings(host, core, cpu_before, cpu_after, latest)),
        (clocks.AREA, lambda: clocks.findings(host, clock_before, clock_after)),
        (disk.AREA, lambda: disk.findings(host, options.runs, options.hours, options.rate_hz)),
        (memory.AREA, lambda: memory.findings(host)),
        (wires.AREA, lambda: wires.findings(host)),
        *rig_checks,
        (software.AREA, software.findings),
    )
    return Examination(
        tuple(finding for area, check in checks for finding in _run_check(area, check)),
        has_wakeups=measured is not None,
    )


def _run_check(area: str, check: Callable[[], list[Finding]]) -> list[Finding]:
    """Return the findings of an area; a failed check is a finding that forbids real time.

    The other areas still count.
    """
    try:
        return check()
    except Exception as error:  # noqa: BLE001
        message = f"{type(error).__name__}: {error}"
        advice = "this is a fault of the check itself; please report it"
        return [Finding(area, "the check", message, "", Verdict.UNKNOWN, advice, REALTIME)]
