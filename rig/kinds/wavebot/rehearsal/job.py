"""The supervisor's side of a rehearsal: settings and checks of the simulated plant."""

import zipfile
import zlib
from collections.abc import Iterator
from typing import Any

from pydantic import TypeAdapter

from rig.campaign import CampaignParts
from rig.campaign.files import valid_key
from rig.campaign.law_checks import DEFAULT_RATE_HZ, law_problems, reference_problems
from rig.config.problems import ConfigError, Problem, format_number
from rig.config.rig_file import Axis, mismatches
from rig.config.yaml_source import KeyPath
from rig.design.axis_params import estimator_params
from rig.emulation.campaign_sea import campaign_sea, sea_problems
from rig.kinds.wavebot.campaign import Campaign
from rig.kinds.wavebot.config.campaign_file import TURNAROUND_S, CampaignFile
from rig.kinds.wavebot.rehearsal.bem_files import bem_settings
from rig.planning.input_files import ConfigSource, FileReader
from rig.regular_file import MAX_TABLE_BYTES, open_regular
from sim_plant import sea_states
from sim_plant.bem import Bem, read_bem
from sim_plant.parameters import Plant
from sim_plant.world import World

# Errors of numpy, zipfile and zlib for files of another format, empty or truncated ones.
_UNREADABLE = (
    OSError, ValueError, KeyError, TypeError, IndexError, EOFError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
_HEAVE: TypeAdapter[Axis] = TypeAdapter(Axis)

MATCHING_KEYS: dict[KeyPath, KeyPath] = {
    ("heave", "counts_per_revolution"): ("sensors", "encoder_counts", "value"),
    ("heave", "gear_ratio_rad_per_m"): ("pto", "gear_ratio", "value"),
    ("heave", "torque_constant_n_m_per_a"): ("pto", "torque_constant", "value"),
}
"""Keys of the rig and the plant's keys that must have the same value, or commands would mean other
things."""

_DEFAULT_RAMP_S = 0.1  # where the rig's heave axis is invalid
_DEFAULT_SEED = 0  # no check depends on phases or noise


def plant_settings(campaign: Campaign) -> dict[str, Any]:
    """Return the simulated plant's configuration for `connect`, as JSON values."""
    return {
        "plant": campaign_plant(campaign),
        **bem_settings(campaign.plant, campaign.plant_locate),
        "sea": campaign_sea(campaign),
        "seed": campaign.seed,
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


def problems(pieces: CampaignParts) -> tuple[Problem, ...]:
    """Return all problems that would keep loop or plant from starting; build everything once."""
    heave = valid_key(pieces.rig, "heave", _HEAVE)
    ramp = heave.gain_ramp_s if heave is not None else _DEFAULT_RAMP_S
    found = [*_estimator_problems(pieces, heave), *law_problems(pieces, {"heave": ramp})]
    found += reference_problems(pieces, dict.fromkeys(CampaignFile.reference_axes, False))
    bem = None
    if pieces.plant is not None:
        reader = FileReader()
        plant = reader.validated(pieces.plant, Plant)
        bem, unreadable = _load_bem(pieces.plant, ("bem",))
        surge, unreadable_too = _load_bem(pieces.plant, ("surge", "bem"))
        found += [*reader.problems, *unreadable, *unreadable_too]
        if plant is not None and heave is not None and pieces.rig is not None:
            found += mismatches(
                {"heave": heave}, pieces.rig.locate, plant, pieces.plant.locate, MATCHING_KEYS,
                "simulated plant",
            )  # fmt: skip
        if plant is not None and bem is not None and surge is not None:
            impossible = _world_problems(pieces, plant, (bem, surge), pieces.plant)
            bem = None if impossible else bem  # so that the sea is not blamed
            found += impossible
    locate = pieces.campaign.locate
    return (*found, *sea_problems(pieces.sea, pieces.elevation, locate, bem, pieces.rate_hz))


def _estimator_problems(pieces: CampaignParts, heave: Axis | None) -> Iterator[Problem]:
    if pieces.rig is None or heave is None:
        return
    try:
        estimator_params(heave, 1.0 / (pieces.rate_hz or DEFAULT_RATE_HZ))
    except ValueError as error:
        value = heave.jerk_density_m2_per_s5
        message = f"{format_number(value)}: {error}"
        yield pieces.rig.locate.problem(("heave", "jerk_density_m2_per_s5"), value, message)


def _load_bem(source: ConfigSource, key: KeyPath) -> tuple[Bem | None, tuple[Problem, ...]]:
    """Read one of the plant's BEM files."""
    name = _file_name(source, key)
    if name is None:
        return None, ()  # already reported for the plant
    try:
        path = source.locate.existing_path(key, name)
    except ConfigError as error:
        return None, error.problems
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
    dt = 1.0 / (pieces.rate_hz or DEFAULT_RATE_HZ)
    try:
        World(plant, sea_states.calm(), *bem, dt=dt, seed=_DEFAULT_SEED)
    except (ValueError, ArithmeticError) as error:
        return (source.locate.problem((), None, f"cannot be simulated: {error}"),)
    return ()
