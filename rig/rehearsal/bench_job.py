"""The supervisor's side of a rehearsed session: is the simulated bench in order."""

from collections.abc import Iterator
from typing import Any

from pydantic import ValidationError

from rig.config.problems import Problem, number_text, shown
from rig.config.source import KeyPath
from rig.config.translate import problems_from
from rig.session.files import Pieces, Session
from sim_plant.bench.parameters import BenchPlant

_SAME = 1e-6  # relative


def devices_of_session(session: Session) -> dict[str, Any]:
    """What `connect` needs to stand in for the bench, as JSON values."""
    return {"plant": session.plant, "seed": session.file.seed}


def problems_of_session(pieces: Pieces) -> tuple[Problem, ...]:
    """What is wrong with the simulated bench, by itself and beside the rig."""
    if pieces.plant is None:
        return ()
    try:
        plant = BenchPlant.model_validate(pieces.plant.mapping)
    except ValidationError as error:
        return problems_from(error, pieces.plant.locate, BenchPlant)
    return tuple(_mismatches(pieces, plant))


def _mismatches(pieces: Pieces, plant: BenchPlant) -> Iterator[Problem]:
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
                f"{number_text(ours)} is not the simulated bench's {number_text(theirs)} "
                f"({shown(place.path)}:{place.line}); the two must agree",
            )
