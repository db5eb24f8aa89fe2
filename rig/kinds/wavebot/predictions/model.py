"""Plant, sea and loop of a campaign, in the form that predictions need."""

import math
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controllers.signals import Modulation
from rig.campaign.set_points import row_setting
from rig.design.axis import Axis, reference_spectrum
from rig.design.axis_params import newtons_per_ampere
from rig.design.grid import MIN_RATE, Complexes, Grid, build_grid, spectrum_from_amplitudes
from rig.emulation.sea import build_sea
from rig.kinds.wavebot.build import number_of, reference_table
from rig.kinds.wavebot.campaign import Campaign
from rig.kinds.wavebot.campaign.set_points import RowSetting, drive_settings
from rig.kinds.wavebot.heave_loop import linear_body, loop_timing
from rig.kinds.wavebot.predictions.drive import electrics_at
from rig.kinds.wavebot.rehearsal.job import plant_settings
from rig.planning.reference import list_realisations
from sim_plant import sea_states
from sim_plant.bem import Bem, excitation_at, read_bem
from sim_plant.body import BodyParams
from sim_plant.electrics import ElectricsParams
from sim_plant.parameters import Plant
from sim_plant.parts.drive import DriveParams
from sim_plant.sea_states import Sea
from sim_plant.wavebot import WaveBotParams

MAX_PERIOD = 3600.0  # s, of the common repeat period of sea and reference


class Reference(NamedTuple):
    """The open-loop force of a campaign."""

    axis: str  # heave or surge
    realisations: tuple[int, ...]
    spectra: Complexes  # N, at a scale of 1; realisations by lines


class CampaignModel(NamedTuple):
    """Everything that the rows of a campaign share."""

    campaign: Campaign
    plant: Plant
    params: WaveBotParams
    grid: Grid
    heave: Axis
    surge: Axis
    reference: Reference
    scheme: int  # of the custom drive's modulation
    gating_current: float  # A

    @property
    def has_custom_drive(self) -> bool:
        """True if the heave drive is the custom drive with its own DC bus."""
        return self.params.electrics.custom == 1

    def electrics(self, setting: RowSetting) -> ElectricsParams:
        """Return drive and bus at a set point."""
        return electrics_at(self.plant, setting, self.scheme)


def build_model(campaign: Campaign, rate: float = MIN_RATE) -> CampaignModel:
    """Build the model of a checked campaign from the files that a rehearsal uses.

    ``rate`` (Hz) is the minimum sampling rate of a period; there is no excitation above 2 Hz.
    """
    devices = plant_settings(campaign)
    plant = Plant.model_validate(devices["plant"])
    params = plant.build()
    rig, bounds, dt = campaign.rig, campaign.limits, 1.0 / campaign.rig.rate_hz
    sea = build_sea(devices["sea"])
    settings = (row_setting(campaign.kind, campaign.file, rig, point) for point in campaign.points)
    realisations = list_realisations(one.realisation for one in settings)
    tables = [reference_table(campaign, (one,)) for one in realisations]
    common = _common_period(sea, tables[0], dt)
    grid = build_grid(common.period, rate)
    spectra = [reference_spectrum(grid, common.reference, table) for table in tables]

    def axis(hull: BodyParams, damping: float, drive: DriveParams, name: str, bem: Path) -> Axis:
        motor = getattr(rig, name)
        return Axis(
            linear_body(hull, damping),
            hull.quadratic,
            _excitation_spectrum(grid, common.sea, sea, read_bem(bem)),
            loop_timing(plant, drive, motor, dt),
            newtons_per_ampere(motor),
            min(getattr(bounds, name).current_peak_a, drive.current_limit),
        )

    heave_bem, surge_bem = Path(devices["bem"]), Path(devices["surge_bem"])
    drive = drive_settings(campaign.file, rig)
    return CampaignModel(
        campaign,
        plant,
        params,
        grid,
        axis(params.body, params.pto.viscous, params.electrics.drive, "heave", heave_bem),
        axis(params.surge.body, 0.0, params.surge.drive, "surge", surge_bem),
        Reference(campaign.file.excited_axis, realisations, np.array(spectra)),
        number_of(drive.modulation, Modulation) if drive else 0,
        drive.current_threshold_a if drive else 0.0,
    )


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
    return scales[:, None] * reference.spectra[indices]


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
    calm = not sea.cycles.size
    cycles_divisor = 1 if calm else int(np.gcd.reduce(sea.cycles))
    if not table:
        return _CommonPeriod(sea.repeat / cycles_divisor, Fraction(1, cycles_divisor), 1)
    if calm:
        return _CommonPeriod(len(table) * dt, Fraction(1), 1)
    sea_ticks = Fraction(round(sea.repeat / dt), cycles_divisor)
    common_multiple = math.lcm(sea_ticks.numerator, len(table) * sea_ticks.denominator)
    common_ticks = Fraction(common_multiple, sea_ticks.denominator)
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


def _excitation_spectrum(grid: Grid, repeats: Fraction, sea: Sea, bem: Bem) -> Complexes:
    """Return the excitation force on one axis, N, by line; waves above 2 Hz are ignored.

    ``repeats`` counts the sea's own periods in the period of the grid.
    """
    frequency = sea_states.frequencies(sea)
    in_band = frequency <= sea_states.MAX_FREQUENCY * (1.0 + 1.0e-12)
    force = excitation_at(bem, frequency[in_band]) * sea.amplitude[in_band]
    cycles = sea.cycles[in_band] * repeats.numerator // repeats.denominator
    return spectrum_from_amplitudes(grid, cycles, force)
