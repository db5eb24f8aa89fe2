"""The complete resolved configuration of a session, as each run stores it."""

import json
from typing import Any

from rig import stations
from rig.kinds.oswec_bench.sessions.assemble import analysis_scales
from rig.kinds.oswec_bench.sessions.files import Session
from rig.kinds.oswec_bench.sessions.flume import session_seas
from rig.kinds.oswec_bench.sessions.plan import SessionPlan
from rig.kinds.oswec_bench.tick.stations import STATIONS


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
