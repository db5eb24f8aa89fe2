"""The drives of a rig in the loop, whichever bus they are on."""

from collections.abc import Callable, Mapping
from typing import Any

from rig.processes.mailbox import Mailbox
from rig.realtime.devices import FlatDevices
from rig.wires import can_axes, segment_axes
from rig.wires.drive_axes import DriveAxes
from rig.wires.messages import wait_for_values


class BusDevices(FlatDevices):
    """The devices of a rig with its drives on a bus; a kind exchanges their values."""

    def __init__(
        self,
        drives: DriveAxes,
        polled: Mapping[str, Mailbox],
        trigger: Mailbox | None,
        trigger_divider: int,
        *records: type,
    ) -> None:
        """``polled``: mailboxes of the other inputs; ``trigger``: of the wave trigger, if any.

        ``trigger_divider``: ticks between two posts of it; ``records``: those of `FlatDevices`.
        """
        self._drives, self._inputs, self._trigger = drives, polled, trigger
        self.clock_correction = drives.clock_correction
        self._trigger_divider, self._writes = trigger_divider, 0
        super().__init__(*records)

    def warm_up(self, dt: float) -> None:
        """Wait for a value of every input and for an answer of every drive in every tick.

        OSError names those without one.
        """
        wait_for_values(self._inputs, dt)
        self._drives.warm_up(dt)

    def _send_waves(self, read: Callable[[], tuple[int]]) -> None:
        """Post the wave trigger that ``read`` returns, if it is time to."""
        if self._trigger is not None and self._writes % self._trigger_divider == 0:
            self._trigger.post((*read(), self._drives.time))
        self._writes += 1

    def stop(self, reason: int) -> None:
        """Command no current and no waves."""
        self._drives.release()
        if self._trigger is not None:
            self._trigger.post((0, self._drives.time))

    def wire_report(self) -> dict[str, Any]:
        """Return what the record keeps of the drives' bus."""
        return self._drives.wire_report()

    def close(self) -> None:
        """Give the bus back."""
        self._drives.close()


def connect(
    config: dict[str, Any], slots: Mapping[str, Any]
) -> tuple[DriveAxes, Mapping[str, Any]]:
    """Return the drives of a job's bus, and the mailboxes with the blocks of terminals.

    ``config``: the devices' part of `rig.wires.job.wired_job`, with the facts of its services.
    LinkError if the bus cannot be opened.
    """
    if "ethercat" in config:
        segment = segment_axes.connect(config["ethercat"], config["facts"]["ethercat"], slots)
        return segment, {**slots, **segment.terminals}
    return can_axes.connect(config["can"], config["facts"]["can"], slots), slots
