"""Six-axis load cell: side loads of the test stand, cross-talk, drift, noise. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant import sensors
from sim_plant.sensors import Channel
from sim_plant.units import Newton, NewtonMetre, Radian, Ratio, Second

SixAxes = tuple[float, float, float, float, float, float]


class LoadCellParams(NamedTuple):
    """Errors of the cell; `cross_talk` holds the reading per unit of wrench, row by row."""

    cross_talk: tuple[SixAxes, SixAxes, SixAxes, SixAxes, SixAxes, SixAxes]
    weight: Newton  # of the parts at the cell: a force that rotates in its axes
    weight_arm: float  # m, lever of the weight for bending
    misalignment: Ratio  # bending moment per torque about the shaft
    drift: SixAxes  # final level of the zero drift
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
    """Return the wrench on the cell at a shaft angle under a torque about the shaft."""
    bounded_angle = angle if abs(angle) < 1.0e6 else 0.0
    sine, cosine = -math.sin(bounded_angle), -math.cos(bounded_angle)
    bending = params.misalignment * torque
    arm = params.weight_arm
    return Wrench(
        params.weight * sine,
        params.weight * cosine,
        0.0,
        -arm * params.weight * cosine + bending,
        arm * params.weight * sine,
        torque,
    )


def drift_step(params: LoadCellParams, share: Ratio, dt: Second) -> Ratio:
    """Advance the completed fraction of the drift, 0 to 1, by dt."""
    return share + (1.0 - share) * min(dt / params.drift_time, 1.0)


def read(
    params: LoadCellParams, load: Wrench, drift: Ratio, tick: int, normals: Sequence[float]
) -> Wrench:
    """Return the cell's reading of a wrench at a tick."""
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
    reading = row[0] * load.fx + row[1] * load.fy + row[2] * load.fz
    reading += row[3] * load.tx + row[4] * load.ty + row[5] * load.tz
    return sensors.measure(
        params.channels[axis], reading + drift * params.drift[axis], tick, normals
    )
