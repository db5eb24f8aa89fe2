"""What is predicted: plant, sea and loop of a campaign, as the numbers that a prediction needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controllers.signals import Gains
from rig.config.limits_file import AxisLimits
from rig.config.rig_file import Axis as Motor
from rig.design.predictions import electrics, loop, plant
from rig.design.predictions.axis import Axis
from rig.design.predictions.grid import RATE, Complexes, Grid, grid, lines
from rig.design.predictions.loop import Law, Timing
from rig.execution.rehearsal.devices import build_sea
from rig.execution.rehearsal.job import plant_settings
from rig.kinds.wavebot.build import (
    estimator_params,
    list_realisations,
    newtons_per_ampere,
    reference_table,
    zc_sections,
)
from rig.planning.campaign import Campaign
from rig.planning.campaign.set_points import RowSetting, drive_settings, row_setting
from sim_plant import waves
from sim_plant.bem import Bem, excitation_at, read_bem
from sim_plant.waves import Sea

LONGEST = 3600.0  # s, of the period in which sea and reference repeat together
_SCHEMES = ("svpwm", "sine-triangle", "dpwm", "hysteresis")


class Reference(NamedTuple):
    """The open-loop force of a campaign."""

    axis: str  # heave or surge
    realisations: tuple[int, ...]
    lines: Complexes  # N, at a scale of 1; realisations by lines


class Subject(NamedTuple):
    """All that rows of a campaign have in common."""

    campaign: Campaign
    plant: plant.Given
    grid: Grid
    heave: Axis
    surge: Axis
    motor: electrics.Motor  # of heave
    reference: Reference


def subject_of(campaign: Campaign, rate: float = RATE) -> Subject:
    """The subject of a checked campaign; the same files as a rehearsal's.

    ``rate`` (Hz) is the least at which a period is sampled; nothing excites above 2 Hz.
    """
    devices = plant_settings(campaign)
    given = plant.given(devices["plant"])
    sea = build_sea(devices["sea"])
    asked = settings_of(campaign)
    several = list_realisations(one.realisation for one in asked)
    tables = [
        reference_table(campaign.file, campaign.rig, (one,), campaign.record) for one in several
    ]
    shared = _shared(sea, tables[0], 1.0 / campaign.rig.rate_hz)
    on = grid(shared.period, rate)
    path = Path(devices["bem"])
    rig, bounds = campaign.rig, campaign.limits

    def axis(name: str, bem: Bem, motor: Motor, limits: AxisLimits) -> Axis:
        side = plant.side(given, name)
        dt = 1.0 / rig.rate_hz
        timing = Timing(dt, plant.delay_ticks(given), side.lag, estimator_params(motor, dt))
        return Axis(
            *plant.hull(given, name),
            _excitation(on, shared.sea, sea, bem),
            timing,
            newtons_per_ampere(motor),
            min(limits.current_peak_a, side.most),
        )

    return Subject(
        campaign,
        given,
        on,
        axis("heave", read_bem(path), rig.heave, bounds.heave),
        axis("surge", read_bem(plant.surge_bem(given, path)), rig.surge, bounds.surge),
        plant.motor(given),
        Reference(
            campaign.file.reference.axis if campaign.file.reference else "heave",
            several,
            np.array([loop.reference(on, shared.reference, table) for table in tables]),
        ),
    )


def settings_of(campaign: Campaign) -> list[RowSetting]:
    """The set point of every point of the matrix."""
    return [row_setting(campaign.file, campaign.rig, point) for point in campaign.points]


def has_excitation(subject: Subject, axis: str, settings: Sequence[RowSetting]) -> Complexes:
    """Open-loop force on an axis, N; rows by lines."""
    told = subject.reference
    if told.axis != axis:
        return np.zeros((len(settings), subject.grid.omega.size), dtype=np.complex128)
    numbers = [int(one.realisation) for one in settings]
    which = [told.realisations.index(one) if one in told.realisations else 0 for one in numbers]
    scales = np.array([one.reference_scale for one in settings])
    forces: Complexes = scales[:, None] * told.lines[which]
    return forces


def law_of(subject: Subject, settings: Sequence[RowSetting]) -> Law:
    """The heave law of each setting."""
    kp, ki, km = (np.array([getattr(one, name) for one in settings]) for name in Gains._fields)
    return Law(kp, ki, km, zc_sections(subject.campaign.file.law, subject.heave.timing.dt))


def switching(subject: Subject) -> tuple[int, float]:
    """The custom drive's modulation scheme, and the current below which it may rest, A."""
    told = drive_settings(subject.campaign.file, subject.campaign.rig)
    return (_SCHEMES.index(told.modulation), told.current_threshold_a) if told else (0, 0.0)


class _Shared(NamedTuple):
    """The period in which sea and reference repeat together."""

    period: float  # s
    sea: Fraction  # repeats of the sea's own period in it
    reference: int  # and of the reference's


def _shared(sea: Sea, table: Sequence[float], dt: float) -> _Shared:
    """The shortest common period.

    Where that is longer than `LONGEST`, the reference is taken at the nearest rate that repeats
    with as many of the sea's periods as fit: 1.4e-4 Hz off at most.
    """
    common = int(np.gcd.reduce(sea.cycles)) if sea.cycles.size else 1
    still = not sea.cycles.size
    if not table:
        return _Shared(sea.repeat / common, Fraction(1, common), 1)
    if still:
        return _Shared(len(table) * dt, Fraction(1), 1)
    once = Fraction(round(sea.repeat / dt), common)  # ticks
    both = once * len(table) / gcd_of(once, Fraction(len(table)))
    if both * dt <= LONGEST:
        return _Shared(float(both) * dt, both / once / common, round(both / len(table)))
    many = max(1, int(LONGEST / (float(once) * dt)))
    repeats = max(1, round(many * float(once) / len(table)))
    return _Shared(many * float(once) * dt, Fraction(many, common), repeats)


def gcd_of(one: Fraction, other: Fraction) -> Fraction:
    """Greatest common divisor of two fractions."""
    below = math.lcm(one.denominator, other.denominator)
    return Fraction(math.gcd(int(one * below), int(other * below)), below)


def _excitation(on: Grid, repeats: Fraction, sea: Sea, bem: Bem) -> Complexes:
    """Excitation force on one axis of a sea that repeats so often; nothing above 2 Hz excites."""
    frequency = waves.frequencies(sea)
    excites = frequency <= waves.HIGHEST * (1.0 + 1.0e-12)
    force = excitation_at(bem, frequency[excites]) * sea.amplitude[excites]
    cycles = sea.cycles[excites] * repeats.numerator // repeats.denominator
    return lines(on, cycles, force)
