"""Emulated devices on the rig's wires: there are none yet."""

from typing import Any

from wec_winch.hardware.job import build_job


def emulate_rig(rig: Any, *options: Any) -> Any:
    return build_job(rig)


def emulate_task(task: Any, *options: Any) -> Any:
    return build_job(task.rig)
