"""What is predicted: plant, sea and loop of a campaign, as the numbers that a prediction needs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controllers.signals import Gains
from rig.assemble import estimator_params, newtons_per_ampere, zc_sections
from rig.campaign import Campaign
from rig.campaign.settings import Setting, drive_settings
from rig.config.limits_file import AxisLimits
from rig.config.rig_file import Axis as Motor
from rig.predict import electrics, plant
from rig.predict.axis import Axis
from rig.predict.grid import Complexes, Grid, grid, lines
from rig.predict.loop import Law, Timing
from rig.rehearsal.devices import build_sea
from rig.rehearsal.job import devices_of
from sim_plant import waves
from sim_plant.bem import Bem, excitation_at, read_bem
from sim_plant.waves import Sea

_SCHEMES = ("svpwm", "sine-triangle", "dpwm", "hysteresis")


class Subject(NamedTuple):
    """All that rows of a campaign have in common."""

    campaign: Campaign
    plant: plant.Given
    grid: Grid
    heave: Axis
    surge: Axis
    motor: electrics.Motor  # of heave


def subject_of(campaign: Campaign) -> Subject:
    """The subject of a checked campaign; the same files as a rehearsal's."""
    devices = devices_of(campaign)
    given = plant.given(devices["plant"])
    sea = build_sea(devices["sea"])
    common = int(np.gcd.reduce(sea.cycles)) if sea.cycles.size else 1
    on = grid(sea.repeat / common)
    path = Path(devices["bem"])
    rig, bounds = campaign.rig, campaign.limits

    def axis(name: str, bem: Bem, motor: Motor, limits: AxisLimits) -> Axis:
        side = plant.side(given, name)
        dt = 1.0 / rig.rate_hz
        timing = Timing(dt, plant.delay_ticks(given), side.lag, estimator_params(motor, dt))
        return Axis(
            *plant.hull(given, name),
            _excitation(on, common, sea, bem),
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
    )


def law_of(subject: Subject, settings: Sequence[Setting]) -> Law:
    """The heave law of each setting."""
    kp, ki, km = (np.array([getattr(one, name) for one in settings]) for name in Gains._fields)
    return Law(kp, ki, km, zc_sections(subject.campaign.file.law, subject.heave.timing.dt))


def switching(subject: Subject) -> tuple[int, float]:
    """The custom drive's modulation scheme, and the current below which it may rest, A."""
    told = drive_settings(subject.campaign.file, subject.campaign.rig)
    return (_SCHEMES.index(told.modulation), told.current_threshold_a) if told else (0, 0.0)


def _excitation(on: Grid, common: int, sea: Sea, bem: Bem) -> Complexes:
    """Excitation force of a sea on one axis; nothing above 2 Hz excites."""
    frequency = waves.frequencies(sea)
    excites = frequency <= waves.HIGHEST * (1.0 + 1.0e-12)
    force = excitation_at(bem, frequency[excites]) * sea.amplitude[excites]
    return lines(on, sea.cycles[excites] // common, force)
