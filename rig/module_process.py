"""Command lines of processes that run a module of wec-rig."""

import os
import sys
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[1]  # source tree, or site-packages


def module_command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module with this interpreter.

    `python -m` imports from the working directory first, where a person may keep a `signal.py`.
    The option -P prevents this, except in the source tree, whose modules come from there.
    """
    in_source_tree = Path(os.getcwd()).resolve() == _ROOT
    return [sys.executable, *([] if in_source_tree else ["-P"]), "-m", module, *arguments]
