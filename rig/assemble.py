"""From validated files to the loop's parameters: the one place where names and units are turned."""

import math

from controllers import estimator, impedance, magnetic_spring
from rig import axis, cycle, limits, safety, wavebot
from rig.config.limits_file import LimitsFile
from rig.config.rig_file import HeaveAxis, RigFile
from rig.estimator_design import design
from rig.sequence import Segments


def newtons_per_ampere(rig: RigFile) -> float:
    """Force on the body per ampere of drive current, Kt N (N/A)."""
    return rig.heave.torque_constant_n_m_per_a * rig.heave.gear_ratio_rad_per_m


def metres_per_count(rig: RigFile) -> float:
    """Heave per encoder count (m)."""
    return _count(rig.heave)


def estimator_params(heave: HeaveAxis, dt: float) -> estimator.Params:
    """The estimator designed for a period ``dt`` (s); ValueError if its gain does not settle."""
    return design(_count(heave), heave.encoder_noise_counts, heave.jerk_density_m2_per_s5, dt)


def _count(heave: HeaveAxis) -> float:
    turn = 2.0 * math.pi / heave.gear_ratio_rad_per_m
    return turn / heave.counts_per_revolution


def wavebot_params(
    rig: RigFile, bounds: LimitsFile, segments: Segments, setpoints: wavebot.Setpoints
) -> cycle.Params:
    """Everything the cycle of a WaveBot needs, designed estimator included."""
    dt = 1.0 / rig.rate_hz
    heave = bounds.heave
    rates, positions = rig.spring.by_rate()
    return cycle.Params(
        segments=segments,
        safety=safety.Params(
            enable_ticks=round(rig.drive_enable_timeout_s / dt),
            stop_ticks=round(rig.stop.duration_s / dt),
        ),
        lost_ticks_stop=bounds.loop.lost_ticks_stop,
        rig=wavebot.Params(
            heave=axis.Params(
                metres_per_count=metres_per_count(rig),
                estimator=estimator_params(rig.heave, dt),
                law=impedance.Params(ramp=rig.heave.gain_ramp_s),
                limits=limits.AxisLimits(
                    position_warn=heave.position_warn_m,
                    position_stop=heave.position_stop_m,
                    velocity_stop=heave.velocity_stop_m_per_s,
                    current_peak=heave.current_peak_a,
                    current_rms=heave.current_rms_a,
                    current_rms_time=heave.current_rms_time_s,
                    force_slew=heave.force_slew_n_per_s,
                    encoder_age_stop=heave.encoder_age_stop_s,
                    encoder_jump_stop=heave.encoder_jump_stop_m,
                    drive_age_stop=heave.drive_age_stop_s,
                    newtons_per_ampere=newtons_per_ampere(rig),
                ),
                stop_damping=rig.stop.damping_n_s_per_m,
                stop_ramp=rig.stop.ramp_s,
            ),
            spring=magnetic_spring.Params(
                rates=rates,
                positions=positions,
                tolerance=rig.spring.arrival_tolerance_percent,
            ),
            limits=wavebot.Limits(
                string_pot_difference_stop=heave.string_pot_difference_stop_m,
                rotor_travel_stop=bounds.spring.rotor_travel_stop_m,
                metres_per_radian=rig.spring.metres_per_radian,
                stator_age_stop=bounds.spring.stator_age_stop_s,
                load_cell_age_stop=bounds.loop.load_cell_age_stop_s,
                analyser_age_stop=bounds.loop.analyser_age_stop_s,
                tare_span_stop=bounds.tare.position_span_stop_m,
            ),
            setpoints=setpoints,
        ),
    )
