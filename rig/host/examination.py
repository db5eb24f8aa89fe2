"""The whole examination of a host, and its verdict in one sentence."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from rig.config.any_rig_file import AnyRigFile
from rig.host import clocks, disk, memory, privileges, processor, rig_wires, software, timing, wires
from rig.host.finding import REALTIME, Finding, Host, Use, Verdict
from rig.realtime import scheduling

Room = tuple[str, Callable[[], list[Finding]]]
"""An area, and who looks at it."""

_SHOWN = 4  # reasons in the verdict


class DoctorOptions(NamedTuple):
    """What is to be examined."""

    runs: Path  # folder for the runs
    seconds: float  # of each of the two measurements of wake-ups
    rate_hz: float  # of the loop
    hours: float  # of logging there must be room for
    rig: AnyRigFile | None = None  # whose wires are to be looked at too


class Examination(NamedTuple):
    """What was found."""

    findings: tuple[Finding, ...]

    def against(self, use: Use) -> list[Finding]:
        """What stands against a use; empty if the host is fit for it."""
        return [finding for finding in self.findings if use in finding.forbids]

    def fit(self, use: Use) -> bool:
        """Whether the host is fit for a use."""
        return not self.against(use)

    @property
    def verdict(self) -> str:
        """What the host is fit for, and if not, why."""
        fit = [use for use in Use if self.fit(use)]
        parts = [f"fit for {' and for '.join(fit)}"] if fit else []
        unfit = [use for use in Use if not self.fit(use)]
        for use in unfit:
            reasons = [finding.cause for finding in self.against(use)]
            more = f"; and {len(reasons) - _SHOWN} more" if len(reasons) > _SHOWN else ""
            parts.append(f"not fit for {use} because of {'; '.join(reasons[:_SHOWN])}{more}")
        warned = sum(finding.verdict is Verdict.WARNING for finding in self.findings)
        if warned and not unfit:
            parts.append(f"with {warned} warnings" if warned > 1 else "with one warning")
        text = "; ".join(parts)
        return f"{text[0].upper()}{text[1:]}."

    def as_dict(self) -> dict[str, Any]:
        """The examination as JSON values."""
        return {
            "fit": {str(use): self.fit(use) for use in Use},
            "verdict": self.verdict,
            "findings": [
                {**finding._asdict(), "forbids": list(map(str, finding.forbids))}
                for finding in self.findings
            ],
        }


def examine(asked: DoctorOptions, host: Host | None = None) -> Examination:
    """Look at everything; never raises for what the host does not show."""
    seen = host or Host()
    moment, busy = clocks.Moment.now(), processor.Busy.of(seen)
    dt = 1.0 / asked.rate_hz
    measured = timing.measure(dt, asked.seconds)
    later, busier = clocks.Moment.now(), processor.Busy.of(seen)
    woken = measured.privileged
    core = scheduling.core() if woken is None else int(woken["core"])
    latest = None if woken is None else float(woken["max_us"]) * 1e-6 / dt
    rooms: tuple[Room, ...] = (
        (timing.AREA, lambda: timing.findings(measured, dt)),
        (privileges.AREA, lambda: privileges.findings(seen, woken)),
        (processor.AREA, lambda: processor.findings(seen, core, busy, busier, latest)),
        (clocks.AREA, lambda: clocks.findings(seen, moment, later)),
        (disk.AREA, lambda: disk.findings(seen, asked.runs, asked.hours, asked.rate_hz)),
        (memory.AREA, lambda: memory.findings(seen)),
        (wires.AREA, lambda: wires.findings(seen)),
        *_of_the_rig(seen, asked.rig),
        (software.AREA, software.findings),
    )
    return Examination(tuple(one for area, room in rooms for one in _looked_at(area, room)))


def _of_the_rig(host: Host, rig: AnyRigFile | None) -> list[Room]:
    if rig is None:
        return []
    return [(rig_wires.area(rig), lambda: rig_wires.findings(host, rig))]


def _looked_at(area: str, room: Callable[[], list[Finding]]) -> list[Finding]:
    """What a room finds; if it fails, that is the finding, and the host is not known to be fit.

    The other rooms still count.
    """
    try:
        return room()
    except Exception as error:  # noqa: BLE001
        words = f"{type(error).__name__}: {error}"
        advice = "this is a fault of the check itself; please report it"
        return [Finding(area, "the check", words, "", Verdict.UNKNOWN, advice, REALTIME)]
