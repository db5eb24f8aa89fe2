"""Identification of the drivetrain between torque sensor and load cell: friction and spring.

    F_TRS - F_LCB = B v + F_c tanh(v / v_c) + e K r sin(2 x / l)

line by line, with the lines of tanh and sine computed from the measured motion. B, F_c and the
share e of the spring map's rate that takes effect are least-squares estimates over all rows. Waves
load the guide sideways and add dry friction, so rows in waves have their own F_c, which the twin
uses.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.kinds.wavebot.twin.group import Group, least_squares
from rig.kinds.wavebot.twin.records import Record, analyse, synthesise
from rig.spectra.periods import Complexes, Floats

VISCOUS, CALM, WAVES, EFFECT = "drivetrain_viscous", "coulomb_calm", "coulomb", "spring_effect"
MAX_DEVIATION = 0.05  # largest standard deviation at which the estimated spring share is used


class DrivetrainShape(NamedTuple):
    """Known shape of the spring and friction laws, without their size."""

    sine: bool  # True: sine spring law, False: linear
    lever: float  # m/rad
    reach: float  # m, spring force amplitude divided by the map's rate
    coulomb_velocity: float  # m/s, width of the regularised sign


def read_shape(plant: dict[str, object]) -> DrivetrainShape:
    """Return the shape that a plant file defines, as in its simulation."""

    def value(section: str, name: str) -> float:
        entry: object = plant[section]
        for key in (name, "value"):
            assert isinstance(entry, dict)
            entry = entry[key]
        return entry  # type: ignore[return-value]

    half_angle, lever = float(value("spring", "fit_half_angle")), float(value("spring", "lever"))
    # Least-squares slope of sin 2 theta over +-half_angle, the definition of a spring map's rate.
    slope = (
        1.5
        * (0.5 * math.sin(2.0 * half_angle) - half_angle * math.cos(2.0 * half_angle))
        / half_angle**3
    )
    return DrivetrainShape(
        str(value("spring", "law")) == "sine",
        lever,
        lever / slope,
        float(value("pto", "coulomb_velocity")),
    )


def identify_drivetrain(records: Sequence[Record], shape: DrivetrainShape) -> Group:
    """Estimate viscous friction (N s/m), dry friction (N) and the share of the spring rate.

    ``coulomb`` is estimated from rows in waves, or from calm water if there are none. Raises
    ValueError if there are too few lines.
    """
    has_waves = any(record.sea is not None for record in records)
    has_calm = any(record.sea is None for record in records)
    names = [VISCOUS]
    names += [CALM] if has_calm else []
    names += [WAVES] if has_waves else []
    per_record = [_regressors(record, shape) for record in records]
    measured = np.concatenate([_real_and_imaginary(record.trs - record.lcb) for record in records])
    viscous, dry, spring = (np.concatenate(parts) for parts in zip(*per_record, strict=True))
    is_calm = np.concatenate(
        [
            np.full(2 * len(record.velocity), record.sea is None, dtype=np.bool_)
            for record in records
        ]
    )
    friction_columns = [
        viscous,
        *([dry * is_calm] if has_calm else []),
        *([dry * ~is_calm] if has_waves else []),
    ]
    source = f"{len(records)} rows, torque sensor minus load cell"
    with_spring = least_squares(
        (*names, EFFECT), np.array([*friction_columns, spring]).T, measured, source
    )
    if 0.0 < with_spring.deviation(EFFECT) < MAX_DEVIATION and with_spring.by_name[EFFECT] > 0.0:
        return _keep_one_friction(with_spring)
    without_spring = least_squares(
        tuple(names), np.array(friction_columns).T, measured - spring, source
    )
    count = len(names)
    covariance = np.zeros((count + 1, count + 1))
    covariance[:count, :count] = without_spring.covariance
    covariance[count, count] = MAX_DEVIATION * MAX_DEVIATION
    return _keep_one_friction(
        Group((*names, EFFECT), (*without_spring.values, 1.0), covariance, source)
    )


def _keep_one_friction(group: Group) -> Group:
    """Return the group with one dry friction: of rows in waves, or of calm water without them."""
    if WAVES not in group.names:
        names = tuple(WAVES if name == CALM else name for name in group.names)
        return group._replace(names=names)
    if CALM not in group.names:
        return group
    indices = [i for i, name in enumerate(group.names) if name != CALM]
    return Group(
        tuple(group.names[i] for i in indices),
        tuple(group.values[i] for i in indices),
        group.covariance[np.ix_(indices, indices)],
        group.source,
    )


def _regressors(record: Record, shape: DrivetrainShape) -> tuple[Floats, Floats, Floats]:
    """Return the regressors of viscous friction, dry friction and the full spring rate."""
    v = synthesise(record, record.velocity)
    position = record.velocity / (1j * record.omega)
    dry = analyse(record, np.tanh(v / shape.coulomb_velocity))
    rate = record.setting["spring_rate"]
    if shape.sine:
        sine = np.sin(2.0 * synthesise(record, position) / shape.lever)
        spring: Complexes = rate * shape.reach * analyse(record, sine)
    else:
        spring = np.asarray(rate * position, dtype=np.complex128)
    return (
        _real_and_imaginary(record.velocity),
        _real_and_imaginary(dry),
        _real_and_imaginary(spring),
    )


def _real_and_imaginary(lines: Complexes) -> Floats:
    """Return the real parts followed by the imaginary parts."""
    return np.concatenate([lines.real, lines.imag])
