"""The record of a session: the resolved configuration and the plan that each run stores.

A session is reconstructed from the configuration in a run's record.
"""

import json
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from rig import stations
from rig.config.limits_file import complete_limits
from rig.config.yaml_source import SourceMap
from rig.kinds.oswec_bench.config.limits_file import LATER_LIMITS, BenchLimitsFile
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.config.session_file import SessionFile
from rig.kinds.oswec_bench.sessions.assemble import analysis_scales, bench_params
from rig.kinds.oswec_bench.sessions.correction import Correction
from rig.kinds.oswec_bench.sessions.files import Constants, Session, session_points
from rig.kinds.oswec_bench.sessions.plan import SessionPlan, plan_session, session_seas
from rig.kinds.oswec_bench.tick.cycle import KIND
from rig.kinds.oswec_bench.tick.stations import STATIONS
from rig.processes.run_types import RecordedTask
from rig.recording.runs import RunInfo

_CONSTANTS, _CORRECTION = TypeAdapter(Constants), TypeAdapter(Correction)


def resolved_session(session: Session) -> str:
    """Return JSON text with every key of every file, and defaults filled in.

    The text includes the constants and the correction that result from them, and files with their
    sha256. Equal sessions give equal text.
    """
    document: dict[str, Any] = {
        "session": session.file.model_dump(mode="json"),
        "rig": session.rig.model_dump(mode="json"),
        "limits": session.limits.model_dump(mode="json"),
        "plant": session.plant,
        "constants": session.constants._asdict(),
        "correction": session.correction._asdict(),
        "calibration_runs": session.correction.runs,
        "files": [file.as_dict() for file in session.files],
    }
    return json.dumps(document, ensure_ascii=False, indent=2)


def plan_as_dict(session: Session, plan: SessionPlan) -> dict[str, Any]:
    """Return the plan of a run as its record stores it."""
    seas = session_seas(session.file, session.points)
    return {
        "dt": plan.dt,
        "session": session.file.session,
        "rows": [
            {
                "row": row.row,
                "point": row.point,
                "repetition": row.repetition,
                **row.values,
                **({"sea": seas[row.point]._asdict()} if seas else {}),
                "correction": session.file.correction.kind,
                "control": session.file.control,
                "periods": row.periods,
                "measure_s": row.measure,
            }
            for row in plan.rows
        ],
        "scales": analysis_scales(session),
        "stations": stations.as_records(STATIONS),
        "duration_s": plan.duration,
    }


def session_as_logged(config: dict[str, Any]) -> Session:
    """Return the session of a run, with the constants and the correction that it used.

    The locations of its values in files are unknown. Raises KeyError if the record lacks a part,
    ValueError if a part does not fit today's models.
    """
    file = SessionFile.model_validate(config["session"])
    return Session(
        file,
        BenchRigFile.model_validate(config["rig"]),
        BenchLimitsFile.model_validate(complete_limits(config["limits"], LATER_LIMITS)),
        config["plant"],
        session_points(file, SourceMap(Path("config.json"), {}, ())),
        _CONSTANTS.validate_python(config["constants"]),
        _CORRECTION.validate_python(config["correction"]),
        (),
    )


def recorded_task(run: RunInfo) -> RecordedTask:
    """Return the session of a run as a task.

    Raises KeyError if the record lacks a part, ValueError if a part is not valid today.
    """
    session = session_as_logged(run.config)
    plan = plan_session(session)
    return RecordedTask(KIND, bench_params(session, plan), plan.dt)
