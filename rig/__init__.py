"""The loop of a test rig and everything around it (docs/explanation/structure.md).

`import rig` is the Python API: the names below are imported when they are used, so that the
processes of a run, which import modules of this package, stay light.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rig.api.errors import RigError
    from rig.api.identification import Identification, identify
    from rig.api.progress import Progress
    from rig.api.rehearsal import Check, check, rehearse
    from rig.api.run import Run, RunOutcome, open
    from rig.api.run_list import runs
    from rig.api.section import Section
    from rig.api.sweeps import SweepResult, sweep

__all__ = [
    "Check",
    "Identification",
    "Progress",
    "RigError",
    "Run",
    "RunOutcome",
    "Section",
    "SweepResult",
    "check",
    "identify",
    "open",
    "rehearse",
    "runs",
    "sweep",
]

_MODULES = {
    "Check": "rehearsal",
    "Identification": "identification",
    "Progress": "progress",
    "RigError": "errors",
    "Run": "run",
    "RunOutcome": "run",
    "Section": "section",
    "SweepResult": "sweeps",
    "check": "rehearsal",
    "identify": "identification",
    "open": "run",
    "rehearse": "rehearsal",
    "runs": "run_list",
    "sweep": "sweeps",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'rig' has no attribute {name!r}")
    return getattr(import_module(f"rig.api.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
