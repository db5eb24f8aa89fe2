"""From runs to everything that a twin is made of."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.analysis import wave_calibration
from rig.config.yaml_source import load_mapping
from rig.identification.identify import IdentificationOptions, identify
from rig.identification.twin import drivetrain, electrics, seas
from rig.identification.twin.group import Group, allowance
from rig.identification.twin.hull import Hull, hull
from rig.identification.twin.records import Record, read
from rig.recording.runs import RunError
from rig.recording.runs.folder import RunInfo, run_info
from rig.regular_file import MAX_TABLE_BYTES, open_regular, read_regular

GUIDE = 20.0
"""N, engineering choice: dry friction that waves may add by pressing the guide sideways, where no
row in waves has told."""


class Template(NamedTuple):
    """The plant file that stood in for the hardware: what no run tells is taken from it."""

    path: Path
    plant: dict[str, Any]
    heave_bem: Path
    surge_bem: Path


class Twin(NamedTuple):
    """A device as measured."""

    runs: tuple[str, ...]
    template: Template
    config: dict[str, Any]  # of the first run
    hull: Hull
    groups: tuple[Group, ...]  # all that was estimated, the hull's linear part first
    coefficient: seas.Coefficient  # of excitation, before its factor
    records: tuple[Record, ...]
    notes: tuple[str, ...]  # what was left out, and why

    @property
    def values(self) -> dict[str, float]:
        """Every estimate by name."""
        return {name: value for group in self.groups for name, value in group.known.items()}


def twin(
    runs: Sequence[Path],
    plant: Path | None = None,
    probe: str = "",
    *,
    incomplete_rows: bool = False,
) -> Twin:
    """The twin of the device in ``runs``, one of them in calm water with an open-loop reference.

    Runs in waves add excitation, dry friction and what the drive loses at their bus voltages; wave
    calibrations among the runs let excitation be identified. ``plant`` stands in for the plant file
    that the first run names. ``incomplete_rows``: also rows of which the record lacks
    ticks. Raises RunError or ValueError where the runs do not tell enough.
    """
    known = [run_info(run) for run in runs]
    calibrations = [wave_calibration.is_calibration(one.plan) for one in known]
    measured = [run for run, sea in zip(runs, calibrations, strict=True) if not sea]
    if not measured:
        raise RunError(f"{', '.join(map(str, runs))}: no run with the device in the water")
    found = [read(run, incomplete_rows=incomplete_rows) for run in measured]
    records = [record for one in found for record in one.records]
    notes = [note for one in found for note in one.left_out]
    first = found[0].facts
    template = _template(first, plant)
    try:
        body = hull(records)
        mechanics = drivetrain.drivetrain(records, drivetrain.shape_of(template.plant))
        motor = electrics.winding(records)
        loss = electrics.drive_loss(records, _rated(template.plant))
    except ValueError as error:
        raise RunError(f"{', '.join(one.facts.run for one in found)}: {error}") from None
    if not any(one.sea is not None for one in records):
        mechanics = allowance(mechanics, drivetrain.WAVES, GUIDE)
        notes.append(
            "no row in waves: dry friction is that of calm water, and the guide's share in waves "
            f"is only allowed for ({GUIDE:g} N)"
        )
    coefficient = _coefficient(template, runs, known, any(calibrations), probe, notes)
    doubt = seas.BEM_DEVIATION if coefficient.source.startswith("BEM") else 0.01
    factor = seas.scale(records, body, coefficient, doubt)
    return Twin(
        tuple(one.run for one in known),
        template,
        first.config,
        body,
        (body.linear, body.quadratic, mechanics, motor, loss, factor),
        coefficient,
        tuple(records),
        tuple(notes),
    )


def _template(known: RunInfo, plant: Path | None) -> Template:
    """The plant file given, or that the run's configuration names."""
    if plant is None:
        named = [one["path"] for one in known.config.get("files", []) if one["role"] == "plant"]
        if not named:
            raise RunError(f"{known.run}: its configuration names no plant file; give --plant FILE")
        plant = Path(named[0])
        if not plant.is_file():
            raise RunError(f"{known.run}: its plant file {plant} is not there; give --plant FILE")
    mapping, locate = load_mapping(plant)
    bem = locate.resolve_path(("bem",), mapping["bem"])
    return Template(plant, mapping, bem, bem.with_name(mapping["surge"]["bem"]))


def _rated(plant: dict[str, Any]) -> float | None:
    """Rated bus voltage of a custom drive, V."""
    drive = plant["drive"]
    return float(drive["rated_voltage"]["value"]) if drive["kind"] == "custom" else None


def _coefficient(
    template: Template,
    runs: Sequence[Path],
    known: Sequence[RunInfo],
    calibrated: bool,
    probe: str,
    notes: list[str],
) -> seas.Coefficient:
    """Excitation by frequency: identified where there are wave calibrations, else BEM."""
    with open_regular(template.heave_bem, MAX_TABLE_BYTES) as opened, np.load(opened) as file:
        frequency, force = np.array(file["f_hz"]), np.array(file["Fe_complex"])
    digest = hashlib.sha256(read_regular(template.heave_bem, MAX_TABLE_BYTES)).hexdigest()[:12]
    bem = seas.Coefficient(frequency, force, f"BEM {template.heave_bem.name} (sha256 {digest})")
    if not calibrated:
        return bem
    used = [
        run for run, one in zip(runs, known, strict=True)
        if one.plan.get("reference") or wave_calibration.is_calibration(one.plan)
    ]  # fmt: skip
    identified = identify(used, IdentificationOptions(probe=probe))
    notes += identified.notes
    return seas.identified(bem, identified.excitations)
