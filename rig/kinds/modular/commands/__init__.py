"""The commands of `rig` that write files of modular rigs (`rig.kinds.interface.Commands`)."""

from rig.kinds.registry import Command

COMMANDS = (
    Command(
        "new rig",
        f"{__name__}.new_rig",
        "Write rig, limits, plant and campaign file of one body or several, from a BEM file.",
    ),
    Command(
        "plant from-bem",
        f"{__name__}.plant_from_bem",
        "Write a plant file of any number of modes from a BEM file, with fit, report and pictures.",
    ),
)
