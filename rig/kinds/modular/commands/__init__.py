"""The commands of `rig` that write files of modular rigs (`rig.kinds.interface.Commands`)."""

from rig.kinds.registry import Command

COMMANDS = (
    Command(
        "new rig",
        f"{__name__}.new_rig",
        "Write rig, limits, plant and campaign file of a body with one axis, from its BEM file.",
    ),
)
