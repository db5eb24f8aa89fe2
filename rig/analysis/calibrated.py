"""Rows of a run as they are read with other calibrations than it was made with.

The record stays as it is. A spring rate is corrected in itself, or by a spring map is that of the
stator position. If the torque constant was another
than the one that the run divided by, force was so many times the recorded one, and the gains were
so many times the planned ones. A position that was a factor off makes travel, velocity and the
power of load cells a factor larger, and the gains, which acted on it, smaller by it.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from rig.config.calibration_file import TORQUE_CONSTANT_KEY, OffsetCorrection, ScaleCorrection
from rig.recording.calibration import At, Known, OutsideError, apply, corrected
from rig.recording.calibration.correction import holds
from rig.recording.runs.folder import Facts
from rig.recording.runs.mcap_file import Records

ALONG = ("heave.estimate.velocity", "power.mechanical_1", "power.mechanical_2")
"""Fields that are a factor larger where the position is."""

POSITION = "heave.estimate.position"
GAINS = ("kp", "ki", "km")
FORCES = ("force_mean", "force_rms", "force_peak", "reference_scale")
RECORDED = "_recorded"  # behind the name of a column that was corrected: the value before

Row = dict[str, Any]


class Reading(NamedTuple):
    """What calibrations do to the rows of one run."""

    spring_rate: Known | None
    force: float  # factor on it
    position: ScaleCorrection | OffsetCorrection | None
    at: At
    names: tuple[str, ...]  # and versions of what was asked for
    said: tuple[str, ...]  # what each does, with its file

    @property
    def attributes(self) -> dict[str, str]:
        """Of a dataset that was read so; none where it is as recorded."""
        if not self.names:
            return {}
        return {"read_by": ", ".join(self.names), "calibration": "; ".join(self.said)}


AS_RECORDED = Reading(None, 1.0, None, At(), (), ())


def reading(calibrations: Sequence[Known], known: Facts) -> Reading:
    """How a run is read with these.

    Raises `OutsideError` where one does not hold for the run and its file says ``refuse``, where
    that cannot be told, and for a table of positions: gains would depend on where the body is.
    ValueError for two of one quantity.
    """
    at, made = At.on(known.started_utc), AS_RECORDED
    seen: dict[str, str] = {}
    for one in calibrations:
        file = one.file
        corrects = "spring_rate" if file.quantity == "spring_map" else file.quantity
        if corrects in seen:
            both = f"{seen[corrects]} and {file.title}"
            raise ValueError(f"{both} both correct {corrects}: give one of them")
        seen[corrects] = file.title
        try:
            inside = holds(file.valid, at)
        except OutsideError as error:
            raise OutsideError(f"{file.title}: {error}") from None
        if not inside and file.outside == "refuse":
            raise OutsideError(
                f"{file.title} does not hold for {at.description()}: valid for {file.valid.description()}"
            )
        said = f"{one.description()}: {file.quantity.replace('_', ' ')}"
        said += "" if inside else f" as recorded, outside {file.valid.description()}"
        name = file.title if inside else f"{file.title} (outside its range)"
        made = made._replace(names=(*made.names, name), said=(*made.said, said))
        if inside:
            made = _with(made, one, known)
    return made._replace(at=at)


def _with(made: Reading, one: Known, known: Facts) -> Reading:
    correction = one.file.correction
    if one.file.quantity in ("spring_rate", "spring_map"):
        return made._replace(spring_rate=one)
    if one.file.quantity == "torque_constant":
        value = known.configured(*TORQUE_CONSTANT_KEY)
        if not value:
            raise OutsideError(f"{one.file.title}: the run does not say its torque constant")
        return made._replace(force=apply(correction, value) / value)
    if not isinstance(correction, ScaleCorrection | OffsetCorrection):
        raise OutsideError(
            f"{one.file.title} is a table of positions; with it gains depend on the position, and "
            "a row has no one value of them"
        )
    return made._replace(position=correction)


def ticks(read: Reading, data: Records) -> Records:
    """The ticks of a window with positions, velocities and power as they are read; a copy."""
    if read.position is None:
        return data
    made = data.copy()
    if isinstance(read.position, OffsetCorrection):
        made[POSITION] += read.position.offset
        return made
    for name in (POSITION, *ALONG):
        made[name] *= read.position.factor
    return made


def row(read: Reading, recorded: Row) -> Row:
    """A row's settings and forces as they are read; a setting's recorded value stands beside it."""
    made = dict(recorded)

    def setting(name: str, value: float) -> None:
        made[name + RECORDED] = recorded[name]
        made[name] = value

    if read.spring_rate is not None:
        rate = recorded["spring_rate"]
        if read.spring_rate.file.quantity == "spring_map":
            rate = recorded["stator"]
        if not math.isnan(rate):  # as of a run without a plan that did not log it
            rate = corrected(read.spring_rate.file, rate, read.at).value
        setting("spring_rate", rate)
    scale = read.position.factor if isinstance(read.position, ScaleCorrection) else 1.0
    if read.force != 1.0:
        for name in FORCES:
            made[name] = recorded[name] * read.force
    if read.force != 1.0 or scale != 1.0:
        for name in GAINS:
            setting(name, recorded[name] * read.force / scale)
    return made
