"""The drivetrain between torque sensor and column load cell: friction, and what the spring does.

    F_TRS - F_LCB = B v + F_c tanh(v / v_c) + e K r sin(2 x / l)

line by line, with the lines of tanh and sine computed from the measured motion: B, F_c and the
share e of the spring map's rate that acts are least squares over all rows. Waves press the guide
sideways and add dry friction, so rows in waves have an F_c of their own: that is the twin's.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.identification.periods import Complexes, Floats
from rig.identification.twin.group import Group, least_squares
from rig.identification.twin.records import Record, analysed, synthesised

VISCOUS, CALM, WAVES, EFFECT = "drivetrain_viscous", "coulomb_calm", "coulomb", "spring_effect"
SURE = 0.05  # standard deviation of the spring's share below which it is believed


class Shape(NamedTuple):
    """What is known of spring and friction beside their size."""

    sine: bool  # the spring's law; else linear
    lever: float  # m/rad
    reach: float  # m, spring force amplitude per table rate
    coulomb_velocity: float  # m/s, width of the regularised sign


def shape_of(plant: dict[str, object]) -> Shape:
    """The shape that a plant file says, as its simulation has it."""

    def value(section: str, name: str) -> float:
        inside: object = plant[section]
        for key in (name, "value"):
            assert isinstance(inside, dict)
            inside = inside[key]
        return inside  # type: ignore[return-value]

    half, lever = float(value("spring", "fit_half_angle")), float(value("spring", "lever"))
    # Least-squares slope of sin 2 theta over +-half: what a spring map's rate means.
    slope = 1.5 * (0.5 * math.sin(2.0 * half) - half * math.cos(2.0 * half)) / half**3
    return Shape(
        str(value("spring", "law")) == "sine",
        lever,
        lever / slope,
        float(value("pto", "coulomb_velocity")),
    )


def drivetrain(records: Sequence[Record], shape: Shape) -> Group:
    """Viscous friction (N s/m), dry friction (N) and the share of the spring's rate that acts.

    ``coulomb`` is that of rows in waves, or of calm water where there are none. Raises ValueError
    where there are too few lines.
    """
    waves = any(one.sea is not None for one in records)
    calm = any(one.sea is None for one in records)
    names = [VISCOUS]
    names += [CALM] if calm else []
    names += [WAVES] if waves else []
    columns = [_columns(one, shape) for one in records]
    measured = np.concatenate([_parts(one.trs - one.lcb) for one in records])
    viscous, dry, spring = (np.concatenate(each) for each in zip(*columns, strict=True))
    still = np.concatenate(
        [np.full(2 * len(one.velocity), one.sea is None, dtype=np.bool_) for one in records]
    )
    parts = [viscous, *([dry * still] if calm else []), *([dry * ~still] if waves else [])]
    source = f"{len(records)} rows, torque sensor less load cell"
    free = least_squares((*names, EFFECT), np.array([*parts, spring]).T, measured, source)
    if 0.0 < free.deviation(EFFECT) < SURE and free.known[EFFECT] > 0.0:
        return _renamed(free)
    held = least_squares(tuple(names), np.array(parts).T, measured - spring, source)
    size = len(names)
    wider = np.zeros((size + 1, size + 1))
    wider[:size, :size] = held.covariance
    wider[size, size] = SURE * SURE
    return _renamed(Group((*names, EFFECT), (*held.values, 1.0), wider, source))


def _renamed(group: Group) -> Group:
    """With one dry friction: that of waves, or of calm water where there are no rows in waves."""
    if WAVES not in group.names:
        names = tuple(WAVES if name == CALM else name for name in group.names)
        return group._replace(names=names)
    if CALM not in group.names:
        return group
    kept = [i for i, name in enumerate(group.names) if name != CALM]
    return Group(
        tuple(group.names[i] for i in kept),
        tuple(group.values[i] for i in kept),
        group.covariance[np.ix_(kept, kept)],
        group.source,
    )


def _columns(record: Record, shape: Shape) -> tuple[Floats, Floats, Floats]:
    """What viscous friction, dry friction and the whole spring would give of the difference."""
    v = synthesised(record, record.velocity)
    position = record.velocity / (1j * record.omega)
    dry = analysed(record, np.tanh(v / shape.coulomb_velocity))
    rate = record.setting["spring_rate"]
    if shape.sine:
        bent = np.sin(2.0 * synthesised(record, position) / shape.lever)
        spring: Complexes = rate * shape.reach * analysed(record, bent)
    else:
        spring = np.asarray(rate * position, dtype=np.complex128)
    return _parts(record.velocity), _parts(dry), _parts(spring)


def _parts(lines: Complexes) -> Floats:
    """Real and imaginary parts one after the other."""
    return np.concatenate([lines.real, lines.imag])
