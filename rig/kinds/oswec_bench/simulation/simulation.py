"""Simulation of a session, and its results by the analysis of recorded runs."""

import json
from collections.abc import Callable
from typing import Any

from rig.analysis.rows import COMPLETE, INTERRUPTED
from rig.emulation import row_simulation
from rig.kinds.oswec_bench.products import session_result
from rig.kinds.oswec_bench.products.points import (
    FIELDS,
    NO_POINTS,
    SessionRun,
    session_run,
    setpoints,
)
from rig.kinds.oswec_bench.recorded import plan_as_dict, resolved_session
from rig.kinds.oswec_bench.rehearsal.devices import connect
from rig.kinds.oswec_bench.rehearsal.job import plant_settings
from rig.kinds.oswec_bench.sessions.assemble import bench_params
from rig.kinds.oswec_bench.sessions.files import Session
from rig.kinds.oswec_bench.sessions.plan import plan_session
from rig.realtime.coupled_ticks import Coupling
from rig.realtime.reasons import Reason
from rig.recording.runs import RunInfo
from rig.recording.runs import state as record
from rig.recording.runs.windows import REQUIRED_FIELDS


class SessionSimulator(row_simulation.Simulator):
    """A session on its simulated bench or flap."""

    def __init__(self, session: Session) -> None:
        plan = plan_session(session)
        self._plan, self._row_count = plan, len(plan.rows)
        self._devices = connect(plant_settings(session) | {"compiled": False}, plan.dt)
        self._metadata = RunInfo(
            session.file.name,
            "batch",
            session.file.name,
            config=json.loads(resolved_session(session)),
            plan=json.loads(json.dumps(plan_as_dict(session, plan))),
        )
        super().__init__(
            "rig.kinds.oswec_bench.tick",
            "",
            bench_params(session, plan),
            self._devices.plant_code(),
            (*REQUIRED_FIELDS, *FIELDS),
        )

    def coupling(self, place: float | None) -> Coupling:
        """Return bench or flap at power-on; no part of it moves between rows."""
        return self._devices.coupling()

    def run(self, check: Callable[[], None]) -> tuple[SessionRun, str, float]:
        """Return the simulated run, the reason of its end and its duration, s."""
        simulation = self.simulate(self._plan, check)
        kept = (window._replace(data=window.data.copy()) for window in simulation)
        points = setpoints(self._metadata, kept)
        ticks = round(simulation.seconds / self._plan.dt)
        state = record.RecordState(
            record.COMPLETE, 0, ticks, at_least=False, missing_ticks=(), damage=()
        )
        return session_run(self._metadata, points, state), simulation.reason, simulation.seconds

    def results(self, check: Callable[[], None]) -> tuple[dict[str, Any], float]:
        """Return the results of a simulation as of `rig.sweeps.simulator`, and its duration, s.

        Raises ValueError if a session that was not cut short gives none.
        """
        run, reason, seconds = self.run(check)
        tripped = reason != Reason.PLAN_END.name
        rows = f"{len(run.complete_points)} of {self._row_count} rows complete"
        results: dict[str, Any] = {
            "state": INTERRUPTED if tripped else COMPLETE,
            "incomplete_reason": f"run stopped: {reason}, {rows}" if tripped else "",
        }
        try:
            if not run.points:
                raise ValueError(NO_POINTS)
            result = session_result(run)
        except ValueError:
            if not tripped:
                raise
            return results, seconds
        missed = [each.quantity for each in result.comparisons if each.target_met is False]
        results["targets_missed"] = "; ".join(missed)
        units = results["units"] = {}
        for name, each in {**result.constants, **result.errors}.items():
            results |= {name: each.value, f"{name}_uncertainty": each.uncertainty}
            units |= dict.fromkeys((name, f"{name}_uncertainty"), each.unit)
        return results, seconds
