"""Sessions of the bench: from the session file to the table that the loop runs.

This package runs in the supervisor only; the loop receives the finished plan.
"""

from rig.kinds.oswec_bench.sessions.check import SessionReport, check_session
from rig.kinds.oswec_bench.sessions.files import (
    Session,
    SessionParts,
    is_session,
    open_session,
)
from rig.kinds.oswec_bench.sessions.plan import SessionPlan, SessionRow, plan_session
from rig.kinds.oswec_bench.sessions.resolved import plan_as_dict, resolved_session

__all__ = [
    "Session",
    "SessionParts",
    "SessionPlan",
    "SessionReport",
    "SessionRow",
    "check_session",
    "is_session",
    "open_session",
    "plan_as_dict",
    "plan_session",
    "resolved_session",
]
