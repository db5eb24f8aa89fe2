"""The complete resolved configuration of a session, as it is stored in each run."""

import json
from typing import Any

from rig.config.problems import display_path
from rig.planning.session.assemble import scales
from rig.planning.session.files import Session
from rig.planning.session.flume import as_mapping, seas
from rig.planning.session.plan import SessionPlan


def resolved_session(session: Session) -> str:
    """JSON text: every key of every file with its default filled in, the constants and the
    correction that come of them, files and sha256.

    Equal sessions give equal text.
    """
    whole: dict[str, Any] = {
        "session": session.file.model_dump(mode="json"),
        "rig": session.rig.model_dump(mode="json"),
        "limits": session.limits.model_dump(mode="json"),
        "plant": session.plant,
        "constants": session.constants._asdict(),
        "correction": session.correction._asdict(),
        "calibration_runs": session.correction.runs,
        "files": [
            {"role": file.role, "path": display_path(file.path), "sha256": file.sha256}
            for file in session.files
        ],
    }
    return json.dumps(whole, ensure_ascii=False, indent=2)


def planned(session: Session, plan: SessionPlan) -> dict[str, Any]:
    """What a run says of its plan."""
    waves = seas(session.file, session.points)
    return {
        "dt": plan.dt,
        "session": session.file.session,
        "rows": [
            {
                "row": row.row,
                "point": row.point,
                "repetition": row.repetition,
                **row.given,
                **({"sea": as_mapping(waves[row.point])} if waves else {}),
                "correction": session.file.correction.kind,
                "control": session.file.control,
                "periods": row.periods,
                "measure_s": row.measure,
            }
            for row in plan.rows
        ],
        "scales": scales(session),
        "duration_s": plan.duration,
    }
