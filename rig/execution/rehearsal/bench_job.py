"""The supervisor's side of a rehearsed session: is the simulated bench in order."""

from collections.abc import Iterator
from typing import Any

from pydantic import ValidationError

from rig.config.problems import Problem, display_path, format_number
from rig.config.pydantic_errors import problems_from
from rig.config.session_kinds import SESSION_KINDS
from rig.config.yaml_source import KeyPath
from rig.planning.session.files import Session, SessionParts
from rig.planning.session.flume import sea_as_dict, session_seas
from sim_plant.bench.parameters import BenchPlant
from sim_plant.flap.parameters import FlapPlant

_SAME = 1e-6  # relative


def devices_of_session(session: Session) -> dict[str, Any]:
    """What `connect` needs to stand in for the bench, as JSON values."""
    told: dict[str, Any] = {"plant": session.plant, "seed": session.file.seed}
    found = session_seas(session.file, session.points)
    return told | {"seas": [sea_as_dict(sea) for sea in found]} if found else told


def problems_of_session(pieces: SessionParts) -> tuple[Problem, ...]:
    """What is wrong with the simulated bench, by itself and beside the rig."""
    if pieces.plant is None:
        return ()
    model = FlapPlant if "flap" in pieces.plant.mapping else BenchPlant
    try:
        plant = model.model_validate(pieces.plant.mapping)
    except ValidationError as error:
        return problems_from(error, pieces.plant.locate, model)
    return (*_mismatches(pieces, plant), *_wrong_flap(pieces, plant))


def _wrong_flap(pieces: SessionParts, plant: BenchPlant) -> Iterator[Problem]:
    """A session of the flap without a flap, or with its rigid coupling where it must not be."""
    if pieces.file is None or pieces.plant is None:
        return
    kind = pieces.file.session
    wanted = SESSION_KINDS[kind].flap_coupling
    if not wanted:
        return
    found = ""
    if isinstance(plant, FlapPlant):
        found = "coupled" if plant.flap.coupled.value == 1 else "free"
    if found != wanted:
        words = {
            "": "has no flap",
            "free": "has its coupling out",
            "coupled": "has its coupling in",
        }
        coupling = "out" if wanted == "free" else "in"
        yield pieces.session.locate.problem(
            ("session",),
            kind,
            f"the simulated plant {words[found]} ({display_path(pieces.plant.locate.path)}); a session "
            f"{kind} needs a flap with its rigid coupling {coupling}",
        )


def _mismatches(pieces: SessionParts, plant: BenchPlant) -> Iterator[Problem]:
    """Scales that the rig and the bench must share, or counts mean other things.

    The constants are not among them: to find them is what sessions are for.
    """
    if pieces.rig is None or pieces.rig_file is None or pieces.plant is None:
        return
    rig, sensors = pieces.rig_file, plant.sensors
    pairs: tuple[tuple[KeyPath, float, KeyPath, float], ...] = (
        (("servo", "gear_ratio"), rig.servo.gear_ratio,
         ("motor", "gear_ratio", "value"), plant.motor.gear_ratio.value),
        (("servo", "encoder", "counts_per_revolution"), rig.servo.encoder.counts_per_revolution,
         ("sensors", "motor_counts", "value"), sensors.motor_counts.value),
        (("shaft_encoder", "counts_per_revolution"), rig.shaft_encoder.counts_per_revolution,
         ("sensors", "shaft_counts", "value"), sensors.shaft_counts.value),
    )  # fmt: skip
    for name, ours, key, theirs in pairs:
        if abs(ours - theirs) > _SAME * abs(theirs):
            place = pieces.plant.locate(key)
            yield pieces.rig.locate.problem(
                name,
                ours,
                f"{format_number(ours)} is not the simulated bench's {format_number(theirs)} "
                f"({display_path(place.path)}:{place.line}); the two must agree",
            )
