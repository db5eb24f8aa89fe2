"""The bench's compiled tick with bench or flap: the room that sweeps of sessions use
(`rig.sweeps.simulator`).

The module of the simulator imports the analysis of sessions, which takes a second. The function
here imports it when it needs it.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.config.yaml_source import KeyPath
from rig.kinds.oswec_bench.config.session_file import SessionFile
from rig.kinds.oswec_bench.recorded import resolved_session
from rig.kinds.oswec_bench.rehearsal.job import MATCHING_KEYS, problems
from rig.kinds.oswec_bench.sessions import files
from rig.kinds.oswec_bench.sessions.files import Session
from rig.planning.input_files import MappingLoader

if TYPE_CHECKING:
    from rig.kinds.oswec_bench.simulation.simulation import SessionSimulator

__all__ = ["SESSION_KEYS", "matching_keys", "open_session", "open_simulator", "resolved_session"]

SESSION_KEYS = tuple(
    key for key in SessionFile.model_fields if key not in ("name", "session", "rig", "plant")
)
"""Keys of a session file that may be swept."""


def matching_keys(rig: Mapping[str, Any]) -> dict[KeyPath, KeyPath]:
    """Return the keys of a rig file and those of its plant that must have the same value."""
    return MATCHING_KEYS


def open_session(path: Path, load: MappingLoader) -> Session:
    """Return a session whose files and simulated plant passed every check.

    ``load`` reads the files and may change their values. Raises `ConfigError` with every problem.
    """
    return files.open_session(path, problems, load=load)


def open_simulator(session: Session) -> "SessionSimulator":
    """Return the simulator of a session."""
    from rig.kinds.oswec_bench.simulation.simulation import SessionSimulator  # noqa: PLC0415

    return SessionSimulator(session)
