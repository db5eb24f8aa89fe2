"""Static stability of the set points of a modular rig on its simulated plant.

Stiffness is that of the plant at rest: hydrostatics, linear mooring, tension and stiffness of taut
lines. A law counts with the position gain of its linear form at low frequency. A hydraulic PTO only
brakes, so it has none; rows of a rig with another axis whose law has no linear form are not judged.
"""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from controllers.law import Column
from rig.campaign import AnyCampaign
from rig.campaign.equilibrium import EquilibriumCheck, NoEquilibrium
from rig.config.law_settings import AxisLaw
from rig.config.problems import format_number
from rig.design.axis_params import newtons_per_ampere
from rig.design.static_stability import largest_gain, unstable_motion
from rig.kinds.modular.build import linear_response
from rig.kinds.modular.rehearsal.job import bem_path
from rig.kinds.modular.tick.composition import ROTATION
from rig.planning.input_files import ConfigSource
from rig.spectra.periods import Floats
from sim_plant.modes.building import factor_matrix, read_bem, stiffness_at_rest
from sim_plant.modes.parameters import Plant

_LOW = 1.0e-4  # rad/s: far below every wave and every filter of a law
_ROUNDING = 1.0e-6  # of a gain


class _AxisGain(NamedTuple):
    """The position gain of an axis as a function of the set point."""

    name: str
    law: AxisLaw
    ki: Callable[[Any], float]  # of an object with the columns of the matrix; N/m or N*m/rad
    factors: Floats  # position of the axis per position of each mode
    limits: "_AxisLimits"


class _AxisLimits(NamedTuple):
    """Limits that hold an axis which runs away; for a rotation read rad and N*m."""

    force: float  # N, continuous
    position: float  # m, at which the rig stops
    end_stop: float | None  # m; None: the plant has none
    rotates: bool


def equilibrium_check(campaign: AnyCampaign) -> EquilibriumCheck:
    """Return the check of a set point of a valid campaign.

    Raises ValueError or OSError if plant or BEM file cannot be read.
    """
    source = ConfigSource(campaign.plant, campaign.plant_locate)
    plant = Plant.model_validate(source.mapping)
    bem = read_bem(plant, bem_path(source))
    # Scaled by the masses, so that translations and rotations compare.
    scale = 1.0 / np.sqrt([mode.mass for mode in plant.modes.values()])
    stiffness = stiffness_at_rest(plant, bem) * np.outer(scale, scale)
    judged = [each for each in campaign.axis_laws if plant.axes[each].hydraulic is None]
    axes = [_axis_gain(campaign, plant, name, scale) for name in judged]

    def check(values: Any) -> NoEquilibrium | None:
        if any(axis.law.chosen(values).linear is None for axis in axes):
            return None
        gains = [axis.ki(values) for axis in axes]
        total = stiffness - sum(
            ki * np.outer(axis.factors, axis.factors) for ki, axis in zip(gains, axes, strict=True)
        )
        motion = unstable_motion(total)
        if motion is None:
            return None
        work = [
            ki * float(axis.factors @ motion) ** 2 for ki, axis in zip(gains, axes, strict=True)
        ]
        if not work:
            return None  # no gain: the plant alone
        worst = int(np.argmax(work))
        axis, ki = axes[worst], gains[worst]
        others = total + ki * np.outer(axis.factors, axis.factors)
        return _finding(axis, values, ki, largest_gain(others, axis.factors))

    return check


def _axis_gain(campaign: AnyCampaign, plant: Plant, name: str, scale: Floats) -> _AxisGain:
    """Return the gain of an axis whose law has a linear form; ``scale``: of the modes."""
    response = linear_response(campaign, name)

    def ki(values: Any) -> float:
        return float((1j * _LOW * response(values, _LOW)).real)

    factors = factor_matrix(plant)[list(plant.axes).index(name)] * scale
    return _AxisGain(name, campaign.axis_laws[name], ki, factors, _limits(campaign, plant, name))


def _limits(campaign: AnyCampaign, plant: Plant, name: str) -> _AxisLimits:
    bounds, motor, part = campaign.limits.axes[name], campaign.rig.axes[name], plant.axes[name]
    current = min(bounds.current_peak_a, bounds.current_rms_a)
    rotates = bounds.motion == ROTATION
    stop = bounds.position_stop_rad if rotates else bounds.position_stop_m
    ends = [part.end_stop.position] if part.end_stop is not None else []
    of_modes = [(plant.modes[mode].end_stop, factor) for mode, factor in part.moves_with.items()]
    if all(end is not None for end, _ in of_modes):
        ends.append(sum(abs(factor) * end.position for end, factor in of_modes if end is not None))
    force = current * newtons_per_ampere(motor)
    return _AxisLimits(force, stop, min(ends, default=None), rotates)


def _finding(axis: _AxisGain, values: Any, ki: float, largest: float | None) -> NoEquilibrium:
    """Return the finding for an axis with a gain; ``largest``: None if no gain of it is stable."""
    column, slope = _column(axis, values, ki)
    name = "" if column is None else column.name
    value = None if column is None else float(getattr(values, column.name))
    if largest is None:
        message = (
            "leaves the rig no equilibrium: the plant is unstable in more than the motion of axis "
            f"{axis.name}, whatever its position gain"
        )
        return NoEquilibrium(name, value, message, can_run=True)  # by what, is not known
    force, length = ("N*m/rad", "rad") if axis.limits.rotates else ("N/m", "m")
    given, allowed = f"the law {axis.law.law.name}: a position gain of {ki:.6g} {force}", ""
    if column is not None and value is not None:
        given = f"{column.label} {format_number(value)} {column.unit}"
        side, bound = "below" if slope > 0.0 else "above", value + (largest - ki) / slope
        allowed = f"; allowed {side} {bound:.4g} {column.unit}"
    rest, holder = _rest(axis.limits, largest)
    can_run = rest < axis.limits.position
    end = f"{holder} holds the axis at about {rest:.3g} {length}"
    end = end if can_run else f"the rig would stop at {axis.limits.position:g} {length}"
    message = (
        f"leaves no equilibrium: {given} exceeds the static stiffness {largest:.4g} {force} of the "
        f"motion of axis {axis.name}{allowed}; {end}"
    )
    return NoEquilibrium(name, value, message, can_run)


def _column(axis: _AxisGain, values: Any, ki: float) -> tuple[Column | None, float]:
    """Return the only column of the law that changes the gain, and the gain per value of it."""
    set_point = {each.name: getattr(values, each.name) for each in axis.law.columns}
    found: list[tuple[Column, float]] = []
    for each in axis.law.columns:
        if each.choices:
            continue
        changed = SimpleNamespace(**set_point | {each.name: set_point[each.name] + 1.0})
        slope = axis.ki(changed) - ki
        if abs(slope) > _ROUNDING * max(1.0, abs(ki)):
            found.append((each, slope))
    return found[0] if len(found) == 1 else (None, 0.0)


def _rest(limits: _AxisLimits, stiffness: float | None) -> tuple[float, str]:
    """Return where an axis that runs away comes to rest, m or rad, and what holds it there."""
    places = []
    if stiffness is not None and stiffness > 0.0:
        places.append((limits.force / stiffness, "the current limit"))
    if limits.end_stop is not None:
        places.append((limits.end_stop, "an end stop"))
    return min(places, default=(float("inf"), ""))
