"""Six-axis load cell: side loads that a test stand puts on it, cross-talk, drift, noise. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant import sensors
from sim_plant.sensors import Channel
from sim_plant.units import Newton, NewtonMetre, Radian, Ratio, Second

Six = tuple[float, float, float, float, float, float]


class LoadCellParams(NamedTuple):
    """Errors of the cell; `cross_talk` is what is read of each unit of wrench, row by row."""

    cross_talk: tuple[Six, Six, Six, Six, Six, Six]
    weight: Newton  # hanging at the cell: a force that turns in its axes
    weight_arm: float  # m, from the cell: what the weight bends
    misalignment: Ratio  # bending moment per torque about the shaft
    drift: Six  # level that the zeros drift to
    drift_time: Second
    channels: tuple[Channel, Channel, Channel, Channel, Channel, Channel]


class Wrench(NamedTuple):
    """Force and torque in axes that turn with the shaft; z along it."""

    fx: Newton
    fy: Newton
    fz: Newton
    tx: NewtonMetre
    ty: NewtonMetre
    tz: NewtonMetre


def wrench(params: LoadCellParams, angle: Radian, torque: NewtonMetre) -> Wrench:
    """Give what the cell carries at a shaft angle under a torque about the shaft."""
    turned = angle if abs(angle) < 1.0e6 else 0.0
    across, down = -math.sin(turned), -math.cos(turned)
    bending = params.misalignment * torque
    arm = params.weight_arm
    return Wrench(
        params.weight * across,
        params.weight * down,
        0.0,
        -arm * params.weight * down + bending,
        arm * params.weight * across,
        torque,
    )


def drifted(params: LoadCellParams, share: Ratio, dt: Second) -> Ratio:
    """Advance the share of the drift that has come about, 0 to 1, by dt."""
    return share + (1.0 - share) * min(dt / params.drift_time, 1.0)


def read(
    params: LoadCellParams, load: Wrench, drift: Ratio, tick: int, normals: Sequence[float]
) -> Wrench:
    """Give what the cell tells of a wrench at a tick."""
    return Wrench(
        _axis(params, 0, load, drift, tick, normals),
        _axis(params, 1, load, drift, tick, normals),
        _axis(params, 2, load, drift, tick, normals),
        _axis(params, 3, load, drift, tick, normals),
        _axis(params, 4, load, drift, tick, normals),
        _axis(params, 5, load, drift, tick, normals),
    )


def _axis(
    params: LoadCellParams,
    axis: int,
    load: Wrench,
    drift: Ratio,
    tick: int,
    normals: Sequence[float],
) -> float:
    row = params.cross_talk[axis]
    told = row[0] * load.fx + row[1] * load.fy + row[2] * load.fz
    told += row[3] * load.tx + row[4] * load.ty + row[5] * load.tz
    return sensors.measure(params.channels[axis], told + drift * params.drift[axis], tick, normals)
