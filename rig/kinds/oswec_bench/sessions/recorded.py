"""Reconstruction of a session from the configuration in a run's record."""

from pathlib import Path
from typing import Any

from rig.config.limits_file import complete_limits
from rig.config.yaml_source import SourceMap
from rig.kinds.oswec_bench.config.limits_file import LATER_LIMITS, BenchLimitsFile
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.config.session_file import SessionFile
from rig.kinds.oswec_bench.sessions.constants import Constants
from rig.kinds.oswec_bench.sessions.correction import Correction, RowCorrection
from rig.kinds.oswec_bench.sessions.files import Session
from rig.kinds.oswec_bench.sessions.rows import session_points


def session_as_logged(config: dict[str, Any]) -> Session:
    """Return the session of a run, with the constants and the correction that it used.

    The locations of its values in files are unknown. Raises KeyError if the record lacks a part,
    ValueError if a part does not fit today's models.
    """
    no_location = SourceMap(Path("config.json"), {}, ())
    file = SessionFile.model_validate(config["session"])
    return Session(
        file,
        no_location,
        BenchRigFile.model_validate(config["rig"]),
        BenchLimitsFile.model_validate(complete_limits(config["limits"], LATER_LIMITS)),
        config["plant"],
        no_location,
        session_points(file, no_location),
        _constants(config["constants"]),
        _correction(config["correction"]),
        (),
    )


def _constants(recorded: dict[str, Any]) -> Constants:
    columns = {name: tuple(recorded[name]) for name in ("brake_currents", "brake_torques")}
    return Constants(**{name: recorded[name] for name in Constants._fields} | columns)


def _correction(recorded: dict[str, Any]) -> Correction:
    return Correction(
        tuple(RowCorrection(*row) for row in recorded["rows"]),
        tuple(recorded["torques"]),
        tuple(recorded["deflections"]),
        recorded["runs"],
    )
