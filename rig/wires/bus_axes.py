"""The drives of a rig in the loop, whichever bus they are on."""

from collections.abc import Mapping
from typing import Any

from rig.wires import can_axes, segment_axes
from rig.wires.drive_axes import DriveAxes


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
