"""The twin as files: `plant.yaml`, which rehearsals, checks and sweeps take, and what it stands on.

Every number that was estimated says from which runs, from how many rows and how surely; every other
one keeps the source that it had.
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

from rig.identification.twin import drivetrain, electrics, seas
from rig.identification.twin.estimate import Template, Twin
from rig.identification.twin.group import Group
from rig.regular_file import MAX_TABLE_BYTES, open_regular, read_regular

PLANT, HEAVE_BEM, SURGE_BEM, NUMBERS = "plant.yaml", "heave_bem.npz", "surge_bem.npz", "twin.json"
FOLDER = "twin"  # in that of the run

_ENTRIES = {  # section and key of a plant file by the name of an estimate, and what it counts as
    "viscous": ("body", "viscous_linear"),
    "viscous_quadratic": ("body", "viscous_quadratic"),
    "hydrostatic": ("body", "hydrostatic"),
    drivetrain.VISCOUS: ("pto", "drivetrain_viscous"),
    drivetrain.WAVES: ("pto", "drivetrain_coulomb"),
    drivetrain.EFFECT: ("spring", "spring_effect"),
    electrics.RESISTANCE: ("pto", "winding_resistance"),
    "fixed_loss": ("drive", "fixed_loss"),
    "linear_loss": ("drive", "linear_loss"),
    electrics.CONDUCTION: ("drive", "conduction_loss"),
    electrics.SQUARE: ("drive", "square_loss"),
}
_LEAST = 1e-6  # of a value that must be above zero


def mapping(twin: Twin, shift: Mapping[str, float] | None = None) -> dict[str, Any]:
    """The plant of a twin; ``shift`` is added to estimates by their names.

    The factor of excitation stands in the BEM file and is not in it.
    """
    plant = copy.deepcopy(twin.template.plant)
    plant["name"] = f"twin of {plant['name']}"
    plant["bem"], plant["surge"]["bem"] = HEAVE_BEM, SURGE_BEM
    values = {name: v + (shift or {}).get(name, 0.0) for name, v in twin.values.items()}
    groups = {name: group for group in twin.groups for name in group.names}
    for name, (section, key) in _ENTRIES.items():
        if name in values:
            least = _LEAST if name in (electrics.RESISTANCE, "hydrostatic") else 0.0
            _put(plant[section], key, max(values[name], least), _said(twin, groups[name], name))
    _inertia(plant["body"], values["inertia"], _said(twin, groups["inertia"], "inertia"))
    _radiation(plant["body"]["radiation"], twin)
    _put(plant["pto"], "guide_friction", 0.0, "stands in drivetrain_coulomb, as rows in waves tell")
    _spring(plant["spring"], twin)
    if plant["drive"]["kind"] == "custom":
        _custom(plant["drive"], values, twin)
    return plant


def _put(section: dict[str, Any], key: str, value: Any, source: str) -> None:
    section[key] = {"value": value, "unit": section[key]["unit"], "source": source}


def _said(twin: Twin, group: Group, name: str) -> str:
    deviation = group.deviation(name)
    runs = ", ".join(twin.runs)
    return f"identified, {runs}: {group.source}; standard deviation {deviation:.3g}"


def _inertia(body: dict[str, Any], inertia: float, source: str) -> None:
    """Motion tells the sum of mass and added mass only: the added mass stays, the mass follows."""
    added = float(body["added_mass_infinite"]["value"])
    if inertia > added:
        _put(body, "mass", inertia - added, f"{source}; of mass and added mass together")
        return
    half = 0.5 * inertia
    _put(body, "mass", half, f"{source}; half of mass and added mass together")
    _put(body, "added_mass_infinite", half, "the other half")


def _radiation(radiation: dict[str, Any], twin: Twin) -> None:
    top, below = list(twin.hull.radiation.numerator), list(twin.hull.radiation.denominator)
    top[1] = min(top[1], below[0] * top[0])  # passive at high frequency to the last digit
    source = (
        f"identified, {', '.join(twin.runs)}: {twin.hull.linear.source}, "
        f"{100.0 * twin.hull.worst:.2g} % worst"
    )
    _put(radiation, "numerator", top, source)
    _put(radiation, "denominator", below, source)


def _spring(spring: dict[str, Any], twin: Twin) -> None:
    """The rates are those of the rig's own map, which a calibration has made."""
    stations = twin.config.get("rig", {}).get("spring", {}).get("map", [])
    if stations:
        said = "the rig file's spring map"
        _put(spring, "stator_positions", [float(s["stator_percent"]) for s in stations], said)
        _put(spring, "spring_rates", [float(s["rate_n_per_m"]) for s in stations], said)


def _custom(drive: dict[str, Any], values: Mapping[str, float], twin: Twin) -> None:
    """Losses of the custom drive as they were at the modulation and frequency of the runs."""
    set_to = settings(twin)
    scheme = str(set_to["modulation"]).replace("-", "_")
    schemes = ("svpwm", "sine_triangle", "dpwm", "hysteresis")
    share = float(drive["scheme_switching"]["value"][schemes.index(scheme)])
    kilohertz = 0.001 / float(set_to["switching_period_s"]) * max(share, 1e-9)
    said = f"; of runs at {scheme}, {kilohertz:.3g} kHz: what rises with the bus voltage"
    groups = {name: group for group in twin.groups for name in group.names}
    for key, name in (
        ("switching_loss", electrics.SWITCHED),
        ("switching_linear_loss", electrics.SWITCHED_LINEAR),
    ):
        told = max(values.get(name, 0.0), 0.0)
        source = _said(twin, groups[name], name) + said if name in groups else "not told apart"
        _put(drive, key, told / kilohertz, source)
    _put(drive, "ripple_loss", 0.0, "stands in fixed_loss and switching_loss")


def settings(twin: Twin) -> dict[str, Any]:
    """What the custom drive was set to in the first run."""
    rig, campaign = twin.config.get("rig", {}), twin.config.get("campaign", {})
    own = {k: v for k, v in (campaign.get("drive") or {}).items() if v is not None}
    return {**rig.get("drive", {}), **own}


def write(twin: Twin, folder: Path) -> list[Path]:
    """Plant, excitation and numbers of a twin; gives the files, the plant first."""
    folder.mkdir(parents=True, exist_ok=True)
    plant, heave, surge, numbers = (folder / n for n in (PLANT, HEAVE_BEM, SURGE_BEM, NUMBERS))
    _write_bem(twin.template, twin, heave)
    if twin.template.surge_bem.resolve() != surge.resolve():
        shutil.copyfile(twin.template.surge_bem, surge)
    plant.write_text(_text(twin), encoding="utf-8")
    numbers.write_text(json.dumps(as_dict(twin), indent=1) + "\n", encoding="utf-8")
    return [plant, heave, surge, numbers]


def as_dict(twin: Twin) -> dict[str, Any]:
    """What was estimated, as JSON values."""
    return {
        "runs": list(twin.runs),
        "template": str(twin.template.path),
        "estimates": {
            name: {"value": value, "deviation": group.deviation(name), "source": group.source}
            for group in twin.groups
            for name, value in group.known.items()
        },
        "radiation": twin.hull.radiation._asdict(),
        "worst_line_of_hull": twin.hull.worst,
        "amplitudes": {
            name: [min(each), max(each)]
            for name in twin.records[0].amplitudes
            for each in ([record.amplitudes[name] for record in twin.records],)
        },
        "excitation": twin.coefficient.source,
        "notes": list(twin.notes),
    }


def identified_up_to(plant: Path) -> dict[str, tuple[float, float]]:
    """Least and greatest amplitudes that a twin was identified with; none of another plant file.

    By the names of `rig.identification.twin.records.Record.amplitudes`. Raises ValueError for a
    damaged file.
    """
    try:
        told = json.loads(read_regular(plant.with_name(NUMBERS), MAX_TABLE_BYTES))["amplitudes"]
    except (FileNotFoundError, KeyError):
        return {}
    return {name: (float(least), float(greatest)) for name, (least, greatest) in told.items()}


def _write_bem(template: Template, twin: Twin, path: Path) -> None:
    """The template's coefficients on the frequencies of the excitation, which takes its place.

    Whoever reads the file goes straight between its frequencies, and so is added mass and damping
    put on those that are new: they stay what they were.
    """
    with open_regular(template.heave_bem, MAX_TABLE_BYTES) as opened, np.load(opened) as file:
        fields = {name: file[name] for name in file.files}
    was, on = fields["f_hz"], twin.coefficient.frequency
    for name in ("omega", "A", "B"):
        fields[name] = np.interp(on, was, fields[name])
    fields["f_hz"] = on
    fields["Fe_complex"] = twin.values[seas.SCALE] * twin.coefficient.excitation
    np.savez(path, **fields)


def _text(twin: Twin) -> str:
    """YAML with one entry a line and a head that says what this is."""
    yaml = YAML()
    yaml.width = 1000
    out = io.StringIO()
    yaml.dump(_flowing(mapping(twin)), out)
    factor = next(group for group in twin.groups if seas.SCALE in group.names)
    head = [
        f"Identified twin of the device in {', '.join(twin.runs)}, written by rig twin.",
        f"What they do not tell is from {twin.template.path}, with the sources it had.",
        f"Excitation: {twin.values[seas.SCALE]:.4g} x {twin.coefficient.source}",
        f"  ({factor.source})",
        *twin.notes,
    ]
    return "".join(f"# {line}\n" for line in head) + out.getvalue()


def _flowing(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    made = CommentedMap((key, _flowing(each)) for key, each in value.items())
    if "value" in value:
        made.fa.set_flow_style()
    return made
