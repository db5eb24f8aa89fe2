"""Plant, sea and loop of a campaign, in the form that predictions need."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controllers.signals import Gains
from rig.design import loop
from rig.design.grid import MIN_RATE, Complexes, Grid, build_grid, spectrum_from_amplitudes
from rig.design.loop import Law, Timing
from rig.kinds.wavebot.build import (
    estimator_params,
    list_realisations,
    newtons_per_ampere,
    reference_table,
)
from rig.kinds.wavebot.config.limits_file import AxisLimits
from rig.kinds.wavebot.config.rig_file import Axis as Motor
from rig.kinds.wavebot.law_params import zc_sections
from rig.kinds.wavebot.predictions import electrics, plant
from rig.kinds.wavebot.predictions.axis import Axis
from rig.kinds.wavebot.predictions.linear_form import row_gains
from rig.kinds.wavebot.rehearsal.devices import build_sea
from rig.kinds.wavebot.rehearsal.job import plant_settings
from rig.planning.campaign import Campaign
from rig.planning.campaign.set_points import RowSetting, drive_settings, row_setting
from sim_plant import waves
from sim_plant.bem import Bem, excitation_at, read_bem
from sim_plant.waves import Sea

MAX_PERIOD = 3600.0  # s, of the common repeat period of sea and reference
_SCHEMES = ("svpwm", "sine-triangle", "dpwm", "hysteresis")


class Reference(NamedTuple):
    """The open-loop force of a campaign."""

    axis: str  # heave or surge
    realisations: tuple[int, ...]
    spectra: Complexes  # N, at a scale of 1; realisations by lines


class CampaignModel(NamedTuple):
    """Everything that the rows of a campaign share."""

    campaign: Campaign
    plant: plant.PlantModel
    grid: Grid
    heave: Axis
    surge: Axis
    motor: electrics.Motor  # of heave
    reference: Reference


def build_model(campaign: Campaign, rate: float = MIN_RATE) -> CampaignModel:
    """Build the model of a checked campaign from the files that a rehearsal uses.

    ``rate`` (Hz) is the minimum sampling rate of a period; there is no excitation above 2 Hz.
    """
    devices = plant_settings(campaign)
    plant_model = plant.build_plant_model(devices["plant"])
    sea = build_sea(devices["sea"])
    settings = point_settings(campaign)
    realisations = list_realisations(one.realisation for one in settings)
    tables = [
        reference_table(campaign.file, campaign.rig, (one,), campaign.record)
        for one in realisations
    ]
    common = _common_period(sea, tables[0], 1.0 / campaign.rig.rate_hz)
    grid = build_grid(common.period, rate)
    path = Path(devices["bem"])
    rig, bounds = campaign.rig, campaign.limits

    def axis(name: str, bem: Bem, motor: Motor, limits: AxisLimits) -> Axis:
        current_loop = plant.current_loop(plant_model, name)
        dt = 1.0 / rig.rate_hz
        timing = Timing(
            dt, plant.delay_ticks(plant_model), current_loop.lag, estimator_params(motor, dt)
        )
        return Axis(
            *plant.hull(plant_model, name),
            _excitation_spectrum(grid, common.sea, sea, bem),
            timing,
            newtons_per_ampere(motor),
            min(limits.current_peak_a, current_loop.current_limit),
        )

    return CampaignModel(
        campaign,
        plant_model,
        grid,
        axis("heave", read_bem(path), rig.heave, bounds.heave),
        axis("surge", read_bem(plant.surge_bem(plant_model, path)), rig.surge, bounds.surge),
        plant.motor(plant_model),
        Reference(
            campaign.file.reference.axis if campaign.file.reference else "heave",
            realisations,
            np.array([loop.reference_spectrum(grid, common.reference, table) for table in tables]),
        ),
    )


def point_settings(campaign: Campaign) -> list[RowSetting]:
    """Return the set point of every point of the matrix."""
    return [row_setting(campaign.file, campaign.rig, point) for point in campaign.points]


def open_loop_force(model: CampaignModel, axis: str, settings: Sequence[RowSetting]) -> Complexes:
    """Return the open-loop force on an axis, N; rows by lines."""
    reference = model.reference
    if reference.axis != axis:
        return np.zeros((len(settings), model.grid.omega.size), dtype=np.complex128)
    realisations = [int(one.realisation) for one in settings]
    indices = [
        reference.realisations.index(one) if one in reference.realisations else 0
        for one in realisations
    ]
    scales = np.array([one.reference_scale for one in settings])
    forces: Complexes = scales[:, None] * reference.spectra[indices]
    return forces


def heave_law(model: CampaignModel, settings: Sequence[RowSetting]) -> Law:
    """Return the heave law of each setting."""
    file, dt = model.campaign.file, model.heave.timing.dt
    ramp = model.campaign.rig.heave.gain_ramp_s
    gains = [row_gains(file, one, ramp, dt) for one in settings]
    kp, ki, km = (np.array([getattr(one, name) for one in gains]) for name in Gains._fields)
    return Law(kp, ki, km, zc_sections(file.law, dt))


def drive_switching(model: CampaignModel) -> tuple[int, float]:
    """Return the custom drive's modulation scheme and its gating current, A."""
    settings = drive_settings(model.campaign.file, model.campaign.rig)
    return (
        (_SCHEMES.index(settings.modulation), settings.current_threshold_a)
        if settings
        else (0, 0.0)
    )


class _CommonPeriod(NamedTuple):
    """The common repeat period of sea and reference."""

    period: float  # s
    sea: Fraction  # repeats of the sea's own period in it
    reference: int  # repeats of the reference in it


def _common_period(sea: Sea, table: Sequence[float], dt: float) -> _CommonPeriod:
    """Return the shortest common period.

    If that is longer than `MAX_PERIOD`, the period is the largest whole number of sea periods that
    fits, and the reference frequency is shifted to repeat with it, by 1.4e-4 Hz at most.
    """
    cycles_divisor = int(np.gcd.reduce(sea.cycles)) if sea.cycles.size else 1
    calm = not sea.cycles.size
    if not table:
        return _CommonPeriod(sea.repeat / cycles_divisor, Fraction(1, cycles_divisor), 1)
    if calm:
        return _CommonPeriod(len(table) * dt, Fraction(1), 1)
    sea_ticks = Fraction(round(sea.repeat / dt), cycles_divisor)  # ticks
    common_ticks = sea_ticks * len(table) / fraction_gcd(sea_ticks, Fraction(len(table)))
    if common_ticks * dt <= MAX_PERIOD:
        return _CommonPeriod(
            float(common_ticks) * dt,
            common_ticks / sea_ticks / cycles_divisor,
            round(common_ticks / len(table)),
        )
    sea_periods = max(1, int(MAX_PERIOD / (float(sea_ticks) * dt)))
    repeats = max(1, round(sea_periods * float(sea_ticks) / len(table)))
    return _CommonPeriod(
        sea_periods * float(sea_ticks) * dt, Fraction(sea_periods, cycles_divisor), repeats
    )


def fraction_gcd(a: Fraction, b: Fraction) -> Fraction:
    """Return the greatest common divisor of two fractions."""
    denominator = math.lcm(a.denominator, b.denominator)
    return Fraction(math.gcd(int(a * denominator), int(b * denominator)), denominator)


def _excitation_spectrum(grid: Grid, repeats: Fraction, sea: Sea, bem: Bem) -> Complexes:
    """Return the excitation force on one axis, N, by line; waves above 2 Hz are ignored.

    ``repeats`` counts the sea's own periods in the period of the grid.
    """
    frequency = waves.frequencies(sea)
    in_band = frequency <= waves.MAX_FREQUENCY * (1.0 + 1.0e-12)
    force = excitation_at(bem, frequency[in_band]) * sea.amplitude[in_band]
    cycles = sea.cycles[in_band] * repeats.numerator // repeats.denominator
    return spectrum_from_amplitudes(grid, cycles, force)
