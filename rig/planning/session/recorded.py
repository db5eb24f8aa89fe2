"""A session again from the configuration in a run's record, for who asks what it was told to do."""

from pathlib import Path
from typing import Any

from rig.config.bench_limits_file import BenchLimitsFile
from rig.config.bench_rig_file import BenchRigFile
from rig.config.recorded_limits import complete_bench_limits
from rig.config.session_file import SessionFile
from rig.config.yaml_source import SourceMap
from rig.planning.session.constants import Constants
from rig.planning.session.correction import Ahead, Correction
from rig.planning.session.files import Session
from rig.planning.session.rows import points


def session_as_logged(config: dict[str, Any]) -> Session:
    """The session of a run, of the constants and the correction that it worked with then.

    Nothing knows where its values stood in files. Raises KeyError where the record lacks a part,
    ValueError where it is none of today's.
    """
    nowhere = SourceMap(Path("config.json"), {}, ())
    file = SessionFile.model_validate(config["session"])
    return Session(
        file,
        nowhere,
        BenchRigFile.model_validate(config["rig"]),
        BenchLimitsFile.model_validate(complete_bench_limits(config["limits"])),
        config["plant"],
        nowhere,
        points(file, nowhere),
        _constants(config["constants"]),
        _correction(config["correction"]),
        (),
    )


def _constants(told: dict[str, Any]) -> Constants:
    columns = {name: tuple(told[name]) for name in ("brake_currents", "brake_torques")}
    return Constants(**{name: told[name] for name in Constants._fields} | columns)


def _correction(told: dict[str, Any]) -> Correction:
    return Correction(
        tuple(Ahead(*one) for one in told["rows"]),
        tuple(told["torques"]),
        tuple(told["deflections"]),
        told["runs"],
    )
