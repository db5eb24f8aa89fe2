"""Sessions of the bench: from the file a person writes to the table the loop walks.

Runs in the supervisor only; the loop gets the finished plan.
"""

from rig.planning.session.check import SessionReport, check_session
from rig.planning.session.files import Pieces, Session, is_session, open_session
from rig.planning.session.plan import SessionPlan, SessionRow, plan_session
from rig.planning.session.resolved import planned, resolved_session

__all__ = [
    "Pieces",
    "Session",
    "SessionPlan",
    "SessionReport",
    "SessionRow",
    "check_session",
    "is_session",
    "open_session",
    "plan_session",
    "planned",
    "resolved_session",
]
