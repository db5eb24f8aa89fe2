"""Conversion of validated files to the loop's parameters, with all changes of names and units."""

from collections.abc import Sequence
from enum import IntEnum

from controllers import (
    drive_gating,
    magnetic_spring,
    open_loop,
    position_hold,
    station_keeping,
)
from controllers.signals import Modulation
from rig.campaign.assessed import assessment_params
from rig.campaign.record import RecordedCampaign
from rig.config.reference import MultisineReference
from rig.design.axis_params import axis_params, motor_power_params, newtons_per_ampere
from rig.design.law_params import law_params
from rig.kinds.wavebot import tick as wavebot
from rig.kinds.wavebot.campaign import Campaign
from rig.kinds.wavebot.campaign.set_points import drive_settings
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.config.limits_file import LimitsFile, PowerLimits
from rig.kinds.wavebot.config.rig_file import RigFile
from rig.kinds.wavebot.tick import power_checks
from rig.kinds.wavebot.tick.state import ReferenceAxis, SurgeUse
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.planning.reference import force_table, index_realisations, list_realisations
from rig.realtime import average, cycle, safety
from rig.realtime.sequence import Segments


def number_of(choice: str, numbers: type[IntEnum]) -> int:
    """Return the loop's number of a choice in a file: the choice is its name in lower case."""
    return int(numbers[choice.upper().replace(" ", "_").replace("-", "_")])


def reference_table(
    campaign: Campaign | RecordedCampaign, realisations: Sequence[int] = (1,)
) -> tuple[float, ...]:
    """Return one repeat period of the open-loop force of each realisation (N, one value a tick).

    ValueError if it repeats on no whole tick.
    """
    file, rig = campaign.file, campaign.rig
    scale = newtons_per_ampere(getattr(rig, file.excited_axis))
    return force_table(
        file.reference, scale, rig.rate_hz, campaign.seed, realisations, campaign.record
    )


def wavebot_params(
    campaign: Campaign | RecordedCampaign, segments: Segments, setpoints: wavebot.Setpoints
) -> cycle.Params:
    """Return all parameters of a WaveBot's cycle, with designed estimators and references."""
    file: CampaignFile = campaign.file
    rig: RigFile = campaign.rig
    bounds: LimitsFile = campaign.limits
    dt = 1.0 / rig.rate_hz
    realisations = list_realisations(setpoints.realisation)
    forces = reference_table(campaign, realisations)
    table_count = len(realisations) if isinstance(file.reference, MultisineReference) else 1
    rates, positions = rig.spring.by_rate()
    drive = drive_settings(file, rig)
    stop = (rig.stop.damping_n_s_per_m, rig.stop.ramp_s)
    return cycle.Params(
        segments=segments,
        safety=safety.Params(
            enable_ticks=round(rig.drive_enable_timeout_s / dt),
            stop_ticks=round(rig.stop.duration_s / dt),
        ),
        lost_ticks_stop=bounds.loop.lost_ticks_stop,
        rig=wavebot.Params(
            heave=axis_params(rig.heave, bounds.heave, *stop, dt),
            heave_law=law_params(file.heave_law, file.law, rig.heave.gain_ramp_s, dt),
            reference=open_loop.Params(forces, rig.heave.gain_ramp_s, table_count),
            reference_axis=number_of(file.excited_axis, ReferenceAxis),
            gate=drive_gating.Params(drive.current_threshold_a if drive else 0.0, 0.0),
            modulation=number_of(drive.modulation, Modulation) if drive else 0,
            surge=axis_params(rig.surge, bounds.surge, *stop, dt),
            surge_use=number_of(file.surge.use, SurgeUse),
            station_keeping=station_keeping.Params(
                ramp=rig.surge.gain_ramp_s,
                station=0.0,
                reach=rig.station_keeping.reach_m,
                soft_stiffness=rig.station_keeping.soft_stop_n_per_m,
                soft_damping=rig.station_keeping.soft_stop_n_s_per_m2,
            ),
            surge_hold=position_hold.Params(
                ramp=rig.surge.gain_ramp_s,
                stiffness=rig.surge_hold.stiffness_n_per_m,
                damping=rig.surge_hold.damping_n_s_per_m,
                speed=rig.surge_hold.speed_m_per_s,
                acceleration=rig.surge_hold.acceleration_m_per_s2,
            ),
            spring=magnetic_spring.Params(
                rates=rates,
                positions=positions,
                tolerance=rig.spring.arrival_tolerance_percent,
            ),
            limits=wavebot.Limits(
                string_pot_difference_stop=bounds.heave.string_pot_difference_stop_m,
                rotor_travel_stop=bounds.spring.rotor_travel_stop_m,
                metres_per_radian=rig.spring.metres_per_radian,
                bus_voltage_stop=bounds.bus.voltage_stop_v,
                stator_age_stop=bounds.spring.stator_age_stop_s,
                load_cell_age_stop=bounds.loop.load_cell_age_stop_s,
                analyser_age_stop=bounds.loop.analyser_age_stop_s,
                panel_age_stop=bounds.loop.panel_age_stop_s,
                tare_span_stop=bounds.tare.position_span_stop_m,
            ),
            power_checks=_power_checks(file, rig, bounds.power, dt),
            setpoints=index_realisations(setpoints, realisations),
        ),
        assessed=assessment_params(file, rig.rate_hz, STATIONS),
    )


def _power_checks(
    campaign: CampaignFile, rig: RigFile, bounds: PowerLimits, dt: float
) -> power_checks.Params:
    return power_checks.Params(
        absorbs=1 if campaign.uses_gains_only else 0,
        motor=motor_power_params(bounds, dt),
        slow_weight=average.weight_of_tick(bounds.balance_time_s, dt),
        balance_stop=bounds.balance_stop_w,
        friction=bounds.friction_n_s_per_m,
        loss=bounds.loss_w_per_a2,
        newtons_per_ampere=newtons_per_ampere(rig.heave),
    )
