"""Conversion of a modular rig's validated files to its composition and the loop's parameters."""

from collections.abc import Callable, Mapping
from typing import Any

from controllers import open_loop
from rig import laws
from rig.campaign import AnyCampaign, AnyPlan
from rig.campaign.assessed import assessment_params
from rig.config.law_settings import LawSettings
from rig.config.reference import MultisineReference
from rig.design.axis_params import axis_params, newtons_per_ampere
from rig.design.law_params import law_params
from rig.kinds.modular.config.limits_file import LimitsFile, RotationLimits
from rig.kinds.modular.config.rig_file import RigFile, Rotation
from rig.kinds.modular.tick import AxisPart, Composition, SensorLimits, SensorPart, compose
from rig.laws import Law
from rig.planning.reference import force_table, index_realisations, list_realisations
from rig.realtime import cycle, safety
from rig.realtime.sequence import Segments


def composition(rig: RigFile, axis_laws: Mapping[str, Law]) -> Composition:
    """Return the composition of a rig file with a law for each axis."""
    return Composition(
        tuple(
            AxisPart(name, axis.motion, laws.to_request(axis_laws[name]))
            for name, axis in rig.axes.items()
        ),
        tuple(SensorPart(name, each.unit, each.tare) for name, each in rig.sensors.items()),
        rig.power_stations,
    )


def campaign_composition(campaign: Any) -> Composition:
    """Return the composition of a campaign's rig with the campaign's laws."""
    laws = {name: each.law for name, each in campaign.file.axis_laws.items()}
    return composition(campaign.rig, laws)


def campaign_params(campaign: Any, plan: AnyPlan) -> cycle.Params:
    """Return the loop's parameters of a campaign, also of a recorded one."""
    file, rig = campaign.file, campaign.rig
    reference = file.reference
    axis = reference.axis if reference is not None else next(iter(rig.axes))
    realisations = list_realisations(plan.setpoints.realisation)
    table = force_table(
        reference,
        newtons_per_ampere(rig.axes[axis]),
        rig.rate_hz,
        campaign.seed,
        realisations,
        campaign.record,
    )
    count = len(realisations) if isinstance(reference, MultisineReference) else 1
    return modular_params(
        rig,
        campaign.limits,
        {name: (each.law, file.law_settings(name)) for name, each in file.axis_laws.items()},
        plan.segments,
        index_realisations(plan.setpoints, realisations),
        open_loop.Params(table, rig.axes[axis].gain_ramp_s, count),
        axis,
    )._replace(assessed=assessment_params(file, rig.rate_hz, rig.power_stations))


def modular_params(
    rig: RigFile,
    bounds: LimitsFile,
    axis_laws: Mapping[str, tuple[Law, LawSettings]],
    segments: Segments,
    setpoints: Any,
    reference: open_loop.Params,
    reference_axis: str,
) -> cycle.Params:
    """Return all parameters of a modular rig's cycle.

    ``axis_laws``: law and settings of each axis; ``setpoints``: the composed `Setpoints`.
    ValueError for an estimator that does not converge or settings that do not fit together.
    """
    dt = 1.0 / rig.rate_hz
    composed = compose(composition(rig, {name: law for name, (law, _) in axis_laws.items()}))
    parts: dict[str, Any] = {}
    for name, motor in rig.axes.items():
        limits, (law, settings) = bounds.axes[name], axis_laws[name]
        damping = (
            motor.stop_damping_n_m_s_per_rad
            if isinstance(motor, Rotation)
            else motor.stop_damping_n_s_per_m
        )
        span = (
            limits.tare_span_stop_rad
            if isinstance(limits, RotationLimits)
            else limits.tare_span_stop_m
        )
        parts |= {
            name: axis_params(motor, limits, damping, rig.stop.ramp_s, dt),
            f"{name}_law": law_params(law, settings, motor.gain_ramp_s, dt),
            f"{name}_span_stop": span,
        }
    for name, sensor in rig.sensors.items():
        low, high = sensor.range
        parts[name] = SensorLimits(low, high, sensor.age_limit_s)
    return cycle.Params(
        segments,
        safety.Params(
            enable_ticks=round(rig.drive_enable_timeout_s / dt),
            stop_ticks=round(rig.stop.duration_s / dt),
        ),
        bounds.loop.lost_ticks_stop,
        composed.Params(
            **parts,
            reference=reference,
            reference_axis=list(rig.axes).index(reference_axis),
            panel_age_stop=bounds.loop.panel_age_stop_s,
            setpoints=setpoints,
        ),
    )


def limits_problems(rig: RigFile, bounds: LimitsFile) -> list[tuple[tuple[str, ...], str]]:
    """Return key and message of each axis that rig file and limits file do not share."""
    problems: list[tuple[tuple[str, ...], str]] = []
    for name, axis in rig.axes.items():
        if name not in bounds.axes:
            problems.append((("axes",), f"the rig's axis {name} has no limits here"))
        elif bounds.axes[name].motion != axis.motion:
            message = f"the axis is a {axis.motion} in the rig file; allowed {axis.motion}"
            problems.append((("axes", name, "motion"), message))
    known = ", ".join(rig.axes)
    problems += [
        (("axes", name), f"the rig has no axis {name}; allowed {known}")
        for name in bounds.axes
        if name not in rig.axes
    ]
    return problems


def linear_response(campaign: AnyCampaign, axis: str) -> Callable[[Any, float], complex]:
    """Return the force per velocity of an axis' law: a function of set point and omega, rad/s.

    The law in force at the set point must have a linear form. N*s/m or N*m*s/rad.
    """
    axis_law, ramp = campaign.axis_laws[axis], campaign.kind.gain_ramp(campaign.rig, axis)
    settings = campaign.file.law_settings(axis)
    params = law_params(axis_law.law, settings, ramp, 1.0 / campaign.rig.rate_hz)

    def response(values: Any, omega: float) -> complex:
        law, own, set_point = axis_law.law.in_force(params, axis_law.set_point(values))
        return complex(law.module.linear(own, set_point, omega))

    return response
