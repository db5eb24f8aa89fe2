"""The supervisor's side of a rehearsed session: settings and checks of the simulated bench."""

from collections.abc import Iterator
from typing import Any

from pydantic import ValidationError

from rig.config.problems import Problem, display_path
from rig.config.pydantic_errors import problems_from
from rig.config.rig_file import mismatches
from rig.config.yaml_source import KeyPath
from rig.kinds.oswec_bench.config.session_file import SESSION_KINDS
from rig.kinds.oswec_bench.sessions.files import Session, SessionParts
from rig.kinds.oswec_bench.sessions.plan import session_seas
from sim_plant.bench.parameters import BenchPlant
from sim_plant.flap.parameters import FlapPlant

MATCHING_KEYS: dict[KeyPath, KeyPath] = {
    ("servo", "gear_ratio"): ("motor", "gear_ratio", "value"),
    ("servo", "encoder", "counts_per_revolution"): ("sensors", "motor_counts", "value"),
    ("shaft_encoder", "counts_per_revolution"): ("sensors", "shaft_counts", "value"),
}
"""Keys of the rig and the plant's keys that must have the same value, or counts would have other
meanings. Constants that sessions identify are not among them."""


def plant_settings(session: Session) -> dict[str, Any]:
    """Return the simulated bench's configuration for `connect`, as JSON values."""
    settings: dict[str, Any] = {"plant": session.plant, "seed": session.file.seed}
    seas = session_seas(session.file, session.points)
    return settings | ({"seas": [sea._asdict() for sea in seas]} if seas else {})


def problems(pieces: SessionParts) -> tuple[Problem, ...]:
    """Return the problems of the simulated bench, by itself and compared with the rig."""
    if pieces.plant is None:
        return ()
    model = FlapPlant if "flap" in pieces.plant.mapping else BenchPlant
    try:
        plant = model.model_validate(pieces.plant.mapping)
    except ValidationError as error:
        return problems_from(error, pieces.plant.locate, model)
    found: list[Problem] = []
    if pieces.rig is not None and pieces.rig_file is not None:
        found += mismatches(
            pieces.rig_file, pieces.rig.locate, plant, pieces.plant.locate, MATCHING_KEYS,
            "simulated bench",
        )  # fmt: skip
    return (*found, *_flap_problems(pieces, plant))


def _flap_problems(pieces: SessionParts, plant: BenchPlant) -> Iterator[Problem]:
    """Yield a problem if a flap session's plant has no flap or the wrong state of its coupling."""
    if pieces.file is None or pieces.plant is None:
        return
    kind = pieces.file.session
    required = SESSION_KINDS[kind].flap_coupling
    if not required:
        return
    coupling_state = "has no flap"
    if isinstance(plant, FlapPlant):
        coupling_state = f"has its coupling {'in' if plant.flap.coupled.value == 1 else 'out'}"
    coupling = {"free": "out", "coupled": "in"}[required]
    if coupling_state != f"has its coupling {coupling}":
        plant_path = display_path(pieces.plant.locate.path)
        message = f"the simulated plant {coupling_state} ({plant_path}); a session {kind} "
        message += f"needs a flap with its rigid coupling {coupling}"
        yield pieces.session.locate.problem(("session",), kind, message)
