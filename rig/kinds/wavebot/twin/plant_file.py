"""Files of the twin: `plant.yaml` for rehearsals, checks and sweeps, its BEM files and estimates.

The source of every estimated number names the runs, the number of rows and the standard deviation.
All other numbers keep their source.
"""

import copy
import io
import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap

from rig.kinds.wavebot.twin import drivetrain, seas
from rig.kinds.wavebot.twin.estimate import Template, Twin
from rig.regular_file import MAX_TABLE_BYTES, read_regular
from sim_plant.bem import read_bem

PLANT, HEAVE_BEM, SURGE_BEM, NUMBERS = "plant.yaml", "heave_bem.npz", "surge_bem", "twin.json"
FOLDER = "twin"  # subfolder of the run folder

_PLANT_KEYS = {  # section and key of a plant file by the name of an estimate
    "viscous": ("body", "viscous_linear"),
    "viscous_quadratic": ("body", "viscous_quadratic"),
    "hydrostatic": ("body", "hydrostatic"),
    drivetrain.VISCOUS: ("pto", "drivetrain_viscous"),
    drivetrain.WAVES: ("pto", "drivetrain_coulomb"),
    drivetrain.EFFECT: ("spring", "spring_effect"),
    drivetrain.RESISTANCE: ("pto", "winding_resistance"),
    "fixed_loss": ("drive", "fixed_loss"),
    "linear_loss": ("drive", "linear_loss"),
    drivetrain.CONDUCTION: ("drive", "conduction_loss"),
    drivetrain.SQUARE: ("drive", "square_loss"),
}
_MIN_POSITIVE = 1e-6  # smallest value of a parameter that must be positive


def mapping(twin: Twin, shift: Mapping[str, float] | None = None) -> dict[str, Any]:
    """Return the plant of a twin; ``shift`` is added to the estimates of the given names.

    The scale factor of excitation is part of the BEM file and not of this mapping.
    """
    plant = copy.deepcopy(twin.template.plant)
    plant["name"] = f"twin of {plant['name']}"
    plant["bem"], plant["surge"]["bem"] = HEAVE_BEM, surge_bem(twin)
    values = {name: v + (shift or {}).get(name, 0.0) for name, v in twin.values.items()}
    for name, (section, key) in _PLANT_KEYS.items():
        if name in values:
            minimum = _MIN_POSITIVE if name in (drivetrain.RESISTANCE, "hydrostatic") else 0.0
            _set_entry(plant[section], key, max(values[name], minimum), twin.source(name))
    _set_inertia(plant["body"], values["inertia"], twin.source("inertia"))
    _set_radiation(plant["body"]["radiation"], twin)
    source = "included in drivetrain_coulomb, estimated from rows in waves"
    _set_entry(plant["pto"], "guide_friction", 0.0, source)
    _set_spring(plant["spring"], twin)
    if plant["drive"]["kind"] == "custom":
        _set_custom_drive(plant["drive"], values, twin)
    return plant


def _set_entry(section: dict[str, Any], key: str, value: Any, source: str) -> None:
    section[key] = {"value": value, "unit": section[key]["unit"], "source": source}


def _set_inertia(body: dict[str, Any], inertia: float, source: str) -> None:
    """Set mass and added mass; motion determines only their sum, so the added mass is kept."""
    added = float(body["added_mass_infinite"]["value"])
    if inertia > added:
        source += "; estimated as the sum of mass and added mass"
        _set_entry(body, "mass", inertia - added, source)
        return
    half = 0.5 * inertia
    _set_entry(body, "mass", half, f"{source}; half of the sum of mass and added mass")
    _set_entry(body, "added_mass_infinite", half, "the other half")


def _set_radiation(radiation: dict[str, Any], twin: Twin) -> None:
    numerator, denominator = map(list, twin.hull.radiation)
    # Exactly passive at high frequency.
    numerator[1] = min(numerator[1], denominator[0] * numerator[0])
    source = (
        f"identified, {', '.join(twin.runs)}: {twin.hull.linear.source}, "
        f"{100.0 * twin.hull.worst:.2g} % worst"
    )
    _set_entry(radiation, "numerator", numerator, source)
    _set_entry(radiation, "denominator", denominator, source)


def _set_spring(spring: dict[str, Any], twin: Twin) -> None:
    """Set the spring rates to those of the rig's own map, which comes from a calibration."""
    stations = twin.config.get("rig", {}).get("spring", {}).get("map", [])
    keys = {"stator_positions": "stator_percent", "spring_rates": "rate_n_per_m"}
    for key, name in keys.items() if stations else ():
        values = [float(station[name]) for station in stations]
        _set_entry(spring, key, values, "the rig file's spring map")


def _set_custom_drive(section: dict[str, Any], values: Mapping[str, float], twin: Twin) -> None:
    """Set the losses of the custom drive at the modulation and frequency of the runs."""
    drive = drive_settings(twin)
    scheme = str(drive["modulation"]).replace("-", "_")
    schemes = ("svpwm", "sine_triangle", "dpwm", "hysteresis")
    share = float(section["scheme_switching"]["value"][schemes.index(scheme)])
    kilohertz = 0.001 / float(drive["switching_period_s"]) * max(share, 1e-9)
    suffix = f"; of runs at {scheme}, {kilohertz:.3g} kHz: the part that depends on the bus voltage"
    for key, name in (
        ("switching_loss", drivetrain.SWITCHED),
        ("switching_linear_loss", drivetrain.SWITCHED_LINEAR),
    ):
        loss = max(values.get(name, 0.0), 0.0)
        source = twin.source(name) + suffix if name in values else "not estimated separately"
        _set_entry(section, key, loss / kilohertz, source)
    _set_entry(section, "ripple_loss", 0.0, "included in fixed_loss and switching_loss")


def drive_settings(twin: Twin) -> dict[str, Any]:
    """Return the settings of the custom drive in the first run."""
    rig, campaign = twin.config.get("rig", {}), twin.config.get("campaign", {})
    campaign_drive = {k: v for k, v in (campaign.get("drive") or {}).items() if v is not None}
    return {**rig.get("drive", {}), **campaign_drive}


def write(twin: Twin, folder: Path) -> list[Path]:
    """Write plant, excitation and estimates of a twin; return the paths, the plant first."""
    folder.mkdir(parents=True, exist_ok=True)
    files = (PLANT, HEAVE_BEM, surge_bem(twin), NUMBERS)
    plant, heave, surge, numbers = (folder / name for name in files)
    _write_bem(twin.template, twin, heave)
    if twin.template.surge_bem.resolve() != surge.resolve():
        shutil.copyfile(twin.template.surge_bem, surge)
    plant.write_text(_yaml_text(twin), encoding="utf-8")
    numbers.write_text(json.dumps(as_dict(twin), indent=1) + "\n", encoding="utf-8")
    return [plant, heave, surge, numbers]


def surge_bem(twin: Twin) -> str:
    """Return the name of the copy of the template's BEM file of surge, which keeps its format."""
    return f"{SURGE_BEM}{twin.template.surge_bem.suffix}"


def as_dict(twin: Twin) -> dict[str, Any]:
    """Return the estimates as JSON values."""
    return {
        "runs": list(twin.runs),
        "template": str(twin.template.path),
        "estimates": {
            name: {"value": value, "deviation": group.deviation(name), "source": group.source}
            for group in twin.groups
            for name, value in group.by_name.items()
        },
        "radiation": twin.hull.radiation._asdict(),
        "worst_line_of_hull": twin.hull.worst,
        "amplitudes": {
            name: [min(each), max(each)]
            for name in twin.records[0].amplitudes
            for each in ([record.amplitudes[name] for record in twin.records],)
        },
        "excitation": twin.coefficient.source,
        "excitation_measured_hz": seas.measured_bands(twin.records, twin.coefficient),
        "notes": list(twin.notes),
    }


def amplitude_range(plant: Path) -> dict[str, tuple[float, float]]:
    """Return the range of amplitudes in which a twin was identified; empty for other plant files.

    Keys are those of `rig.kinds.wavebot.twin.records.Record.amplitudes`. Raises ValueError for a
    damaged file.
    """
    try:
        numbers = json.loads(read_regular(plant.with_name(NUMBERS), MAX_TABLE_BYTES))
        amplitudes = numbers["amplitudes"]
    except (FileNotFoundError, KeyError):
        return {}
    return {name: (float(lowest), float(highest)) for name, (lowest, highest) in amplitudes.items()}


def _write_bem(template: Template, twin: Twin, path: Path) -> None:
    """Write the template's coefficients at the frequencies of the excitation, with that excitation.

    Readers of the file interpolate linearly between its frequencies. Linear interpolation of added
    mass and damping at the new frequencies therefore does not change them.
    """
    bem, frequency = read_bem(template.heave_bem), twin.coefficient.frequency
    np.savez(
        path,
        f_hz=frequency,
        A=np.interp(frequency, bem.frequency, bem.added_mass),
        B=np.interp(frequency, bem.frequency, bem.damping),
        Fe_complex=twin.values[seas.SCALE] * twin.coefficient.excitation,
        Ainf=bem.added_mass_infinite,
        K_h=bem.stiffness,
        depth=bem.depth,
    )


def _yaml_text(twin: Twin) -> str:
    """Return the plant as YAML with one entry per line and a header comment."""
    yaml = YAML()
    yaml.width = 1000
    stream = io.StringIO()
    yaml.dump(_to_flow_style(mapping(twin)), stream)
    factor = next(group for group in twin.groups if seas.SCALE in group.names)
    header = [
        f"Identified twin of the device in {', '.join(twin.runs)}, written by rig twin.",
        f"All other parameters are from {twin.template.path}, with their sources.",
        f"Excitation: {twin.values[seas.SCALE]:.4g} x {twin.coefficient.source}",
        f"  ({factor.source})",
        *twin.notes,
    ]
    return "".join(f"# {line}\n" for line in header) + stream.getvalue()


def _to_flow_style(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    commented = CommentedMap((key, _to_flow_style(each)) for key, each in value.items())
    if "value" in value:
        commented.fa.set_flow_style()
    return commented
