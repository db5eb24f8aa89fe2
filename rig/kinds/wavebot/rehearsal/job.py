"""The supervisor's side of a rehearsal: settings and checks of the simulated plant."""

import math
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from functools import reduce
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from rig.config.law_settings import find_law, law_model
from rig.config.matching import SharedValue, mismatches
from rig.config.problems import Problem, format_number
from rig.config.pydantic_errors import problems_from
from rig.config.reference import AnyReference, Reference
from rig.config.sea import AnySea, CalmSea, JonswapSea, RegularSea
from rig.config.yaml_source import KeyPath
from rig.design.axis_params import estimator_params
from rig.design.law_params import law_params
from rig.emulation.sea import build_sea
from rig.kinds.wavebot.campaign.files import Campaign
from rig.kinds.wavebot.campaign.pieces import CampaignParts
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.config.columns import COLUMNS
from rig.kinds.wavebot.config.hoist import TURNAROUND_S
from rig.laws import LawError
from rig.planning.designed_sea import DesignedSea, design_sea
from rig.planning.elevation import Elevation
from rig.planning.input_files import ConfigSource
from rig.planning.reference import repeat_ticks
from rig.regular_file import MAX_TABLE_BYTES, open_regular
from sim_plant import waves
from sim_plant.bem import Bem, read_bem
from sim_plant.parameters import Plant
from sim_plant.world import World

# Errors of numpy, zipfile and zlib for files of another format, empty or truncated ones.
_UNREADABLE = (
    OSError, ValueError, KeyError, TypeError, IndexError, EOFError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
_REFERENCE: TypeAdapter[AnyReference] = TypeAdapter(Reference | None)

MATCHING_KEYS: dict[str, tuple[str, ...]] = {
    "counts_per_revolution": ("sensors", "encoder_counts", "value"),
    "gear_ratio_rad_per_m": ("pto", "gear_ratio", "value"),
    "torque_constant_n_m_per_a": ("pto", "torque_constant", "value"),
}
"""Keys of the rig's heave axis and the plant's keys that must have the same value."""

_DEFAULT_RATE_HZ = 1000  # where the rig's own rate is invalid
_DEFAULT_RAMP_S = 0.1  # where the rig's heave axis is invalid
_DEFAULT_SEED = 0  # no check depends on phases or noise


def plant_settings(campaign: Campaign) -> dict[str, Any]:
    """Return the simulated plant's configuration for `connect`, as JSON values."""
    return {
        "plant": campaign_plant(campaign),
        "bem": str(campaign.plant_locate.resolve_path(("bem",), campaign.plant["bem"])),
        "sea": _sea_settings(campaign.file.sea, campaign.file.sea_seed, campaign.elevation),
        "seed": campaign.file.seed,
        "device": campaign.file.device,
        **_hoist_settings(campaign.file),
    }


def _hoist_settings(file: CampaignFile) -> dict[str, Any]:
    """Return the motion of the simulated body by a chain hoist; empty without one."""
    if file.hoist is None:
        return {}
    return {"hoist": file.hoist.model_dump(mode="json") | {"turn_s": TURNAROUND_S}}


def campaign_plant(campaign: Campaign) -> dict[str, Any]:
    """Return the campaign's plant, with the drive's supply as the campaign has it."""
    drive = campaign.plant.get("drive")
    if campaign.file.drive.supply == "connected" or not isinstance(drive, dict):
        return campaign.plant
    supply = {"value": "disconnected", "unit": "1", "source": "the campaign's drive.supply"}
    return {**campaign.plant, "drive": {**drive, "supply": supply}}


def requested_sea(campaign: Campaign) -> dict[str, Any]:
    """Return the spectral lines that the wave maker is to make, as JSON values.

    Elevation is sum amplitude_m cos(2 pi cycles t / repeat_s + phase_rad), t on the wave clock. A
    recorded sea is reduced to the lines of its repeat period that can excite.
    """
    sea_file = campaign.file.sea
    sea = build_sea(_sea_settings(sea_file, campaign.file.sea_seed, campaign.elevation))
    repeat = (
        sea_file.period
        if isinstance(sea_file, RegularSea)
        else getattr(sea_file, "repeat", sea.repeat)
    )
    periods = round(sea.repeat / repeat)  # a recorded window may hold several
    frequency = waves.frequencies(sea)
    kept = (
        (sea.cycles % periods == 0)
        & (frequency >= waves.MIN_FREQUENCY)
        & (frequency <= waves.MAX_FREQUENCY)
    )
    return {
        "repeat_s": sea.repeat / periods,
        "cycles": (sea.cycles[kept] // periods).tolist(),
        "amplitude_m": np.abs(sea.amplitude[kept]).tolist(),
        "phase_rad": (-np.angle(sea.amplitude[kept])).tolist(),
    }


def problems(pieces: CampaignParts) -> tuple[Problem, ...]:
    """Return all problems that would keep loop or plant from starting; build everything once."""
    found = [*_estimator_problems(pieces), *_law_problems(pieces)]
    bem = None
    if pieces.plant is not None:
        plant, bad = _load_plant(pieces.plant)
        bem, unreadable = _load_bem(pieces.plant, ("bem",))
        surge, unreadable_too = _load_bem(pieces.plant, ("surge", "bem"))
        found += [*bad, *unreadable, *unreadable_too]
        if plant is not None:
            found += _mismatches(pieces, plant, pieces.plant)
        if plant is not None and bem is not None and surge is not None:
            impossible = _world_problems(pieces, plant, (bem, surge), pieces.plant)
            bem = None if impossible else bem  # so that the sea is not blamed
            found += impossible
    return (*found, *_sea_problems(pieces, bem))


def _estimator_problems(pieces: CampaignParts) -> Iterator[Problem]:
    if pieces.rig is None or pieces.heave is None:
        return
    try:
        estimator_params(pieces.heave, 1.0 / (pieces.rate_hz or _DEFAULT_RATE_HZ))
    except ValueError as error:
        value = pieces.heave.jerk_density_m2_per_s5
        message = f"{format_number(value)}: {error}"
        yield pieces.rig.locate.problem(("heave", "jerk_density_m2_per_s5"), value, message)


def _law_problems(pieces: CampaignParts) -> Iterator[Problem]:
    """Yield problems of the campaign's law and reference beyond those of single keys."""
    campaign, rate = pieces.campaign, pieces.rate_hz or _DEFAULT_RATE_HZ
    with suppress(ValidationError, LawError):
        law = find_law(campaign.mapping, campaign.locate, COLUMNS)
        given = campaign.mapping.get("law", {})
        mapping = {"use": given} if isinstance(given, str) else given
        settings = law_model(law).model_validate(mapping)
        ramp = pieces.heave.gain_ramp_s if pieces.heave is not None else _DEFAULT_RAMP_S
        try:
            law_params(law, settings, ramp, 1.0 / rate)
        except ValueError as error:
            key = ("law", "zc") if "zc" in mapping else ("law",)
            yield campaign.locate.problem(key, None, str(error))
    with suppress(ValidationError):
        reference = _REFERENCE.validate_python(campaign.mapping.get("reference"), strict=True)
        try:
            if reference is not None:
                repeat_ticks(reference, rate)
        except ValueError as error:
            yield campaign.locate.problem(("reference",), None, str(error))


def _load_plant(source: ConfigSource) -> tuple[Plant | None, tuple[Problem, ...]]:
    try:
        return Plant.model_validate(source.mapping), ()
    except ValidationError as error:
        return None, problems_from(error, source.locate, Plant)


def _load_bem(source: ConfigSource, key: KeyPath) -> tuple[Bem | None, tuple[Problem, ...]]:
    """Read one of the plant's BEM files; that of surge is in the folder of that of heave."""
    name, heave = _file_name(source, key), _file_name(source, ("bem",))
    if name is None or heave is None:
        return None, ()  # already reported for the plant
    path = source.locate.resolve_path(("bem",), heave).with_name(name)
    try:
        with open_regular(path, MAX_TABLE_BYTES) as file:
            if path.suffix == ".npz":
                zipfile.ZipFile(file).close()  # numpy would leave a file open that is no archive
        return read_bem(path), ()
    except _UNREADABLE as error:
        message = f"cannot be read: {error or type(error).__name__}"
        return None, (source.locate.problem(key, name, message),)


def _file_name(source: ConfigSource, key: KeyPath) -> str | None:
    """Return the file name at a key of the plant's file."""
    value: Any = source.mapping
    for part in key:
        value = value.get(part) if isinstance(value, dict) else None
    return value if isinstance(value, str) and value.strip() else None


def _world_problems(
    pieces: CampaignParts, plant: Plant, bem: tuple[Bem, Bem], source: ConfigSource
) -> tuple[Problem, ...]:
    dt = 1.0 / (pieces.rate_hz or _DEFAULT_RATE_HZ)
    try:
        World(plant, waves.calm(), *bem, dt=dt, seed=_DEFAULT_SEED)
    except (ValueError, ArithmeticError) as error:
        return (source.locate.problem((), None, f"cannot be simulated: {error}"),)
    return ()


def _mismatches(pieces: CampaignParts, plant: Plant, source: ConfigSource) -> Iterator[Problem]:
    """Yield the scales in which rig and plant differ: commands would mean other things."""
    if pieces.rig is None or pieces.heave is None:
        return
    shared = (
        SharedValue(
            ("heave", name),
            float(getattr(pieces.heave, name)),
            key,
            float(reduce(getattr, key, plant)),  # type: ignore[arg-type]
        )
        for name, key in MATCHING_KEYS.items()
    )
    yield from mismatches(pieces.rig.locate, source.locate, shared, "simulated plant")


def _sea_problems(pieces: CampaignParts, bem: Bem | None) -> Iterator[Problem]:
    sea, locate = pieces.sea, pieces.campaign.locate
    if sea is None or (sea.kind == "recorded" and pieces.elevation is None):
        return
    if isinstance(sea, RegularSea) and (nearest_frequencies := _nearest_repeating(sea.frequency)):
        key, unit, value = "frequency_hz", "Hz", sea.frequency
        nearest = [(float(f), f.denominator) for f in nearest_frequencies]
        if sea.period_s is not None:
            key, unit, value = "period_s", "s", sea.period_s
            nearest = [(float(1 / f), f.denominator) for f in reversed(nearest_frequencies)]
        suggestions = [f"{one!r} {unit} (repeats after {repeat} s)" for one, repeat in nearest]
        message = (
            f"{value!r} {unit} repeats on no whole second up to {waves.MAX_REPEAT} s; "
            f"the nearest allowed are {' and '.join(suggestions)}"
        )
        yield locate.problem(("sea", key), value, message)
        return
    try:
        built = build_sea(_sea_settings(sea, _DEFAULT_SEED, pieces.elevation))
        if bem is not None and pieces.rate_hz is not None:
            waves.tables(built, bem, 1.0 / pieces.rate_hz)
    except ValueError as error:
        yield locate.problem(("sea",), sea.description(), str(error))


def _nearest_repeating(frequency: float) -> list[Fraction]:
    """Return the nearest frequencies (Hz) below and above that repeat in time; none if it does."""
    try:
        waves.regular(0.0, frequency)
    except ValueError:
        seconds = range(1, waves.MAX_REPEAT + 1)
        exact = Fraction(frequency)
        return [
            max(Fraction(math.floor(exact * length), length) for length in seconds),
            min(Fraction(math.ceil(exact * length), length) for length in seconds),
        ]
    return []


def _sea_settings(sea: AnySea, seed: int, elevation: Elevation | None) -> dict[str, Any]:
    if isinstance(sea, CalmSea):
        return {"kind": "calm"}
    if isinstance(sea, RegularSea):
        return {
            "kind": "regular",
            "amplitude_m": sea.amplitude_m,
            "frequency_hz": sea.frequency,
        }
    if isinstance(sea, JonswapSea):
        return {
            "kind": "jonswap",
            "hs_m": sea.hs_m,
            "tp_s": sea.tp_s,
            "gamma": sea.gamma,
            "repeat_s": sea.repeat_s,
            "seed": seed,
        }
    if isinstance(sea, DesignedSea):
        lines = design_sea(sea, seed)
        return {
            "kind": "components",
            "repeat_s": lines.repeat,
            "cycles": lines.cycles.tolist(),
            "amplitude_m": lines.amplitude.tolist(),
            "phase_rad": lines.phase.tolist(),
        }
    assert elevation is not None
    return {
        "kind": "recorded",
        "elevation_m": elevation.elevation.tolist(),
        "rate_hz": elevation.rate_hz,
    }
