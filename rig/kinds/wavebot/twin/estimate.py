"""Identification of the twin of a device from runs."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rig.config.shipped_files import PLANTS
from rig.config.yaml_source import load_mapping
from rig.identification.identify import IdentificationOptions, identify
from rig.kinds.wavebot.rehearsal.bem_files import bem_paths
from rig.kinds.wavebot.twin import drivetrain, needed_runs, seas
from rig.kinds.wavebot.twin.group import Group
from rig.kinds.wavebot.twin.hull import Hull, identify_hull
from rig.kinds.wavebot.twin.records import Record, read_records
from rig.recording.runs import RunError, RunInfo, run_info
from rig.regular_file import MAX_TABLE_BYTES, read_regular
from rig.spectra import wave_calibration
from sim_plant.bem import read_bem

GUIDE_FRICTION_DEVIATION = 20.0
"""N, engineering choice: uncertainty of the dry friction that lateral load on the guide adds in
waves, used if no row in waves was measured."""


_MAX_NOTES = 3  # in a message


class Template(NamedTuple):
    """The plant file that replaced the hardware; source of parameters that no run determines."""

    path: Path
    plant: dict[str, Any]
    heave_bem: Path
    surge_bem: Path


class Twin(NamedTuple):
    """A device as identified from runs."""

    runs: tuple[str, ...]
    template: Template
    config: dict[str, Any]  # of the first run
    hull: Hull
    groups: tuple[Group, ...]  # all estimates, the hull's linear part first
    coefficient: seas.Coefficient  # of excitation, before the scale factor
    records: tuple[Record, ...]  # as measured, with the lag of their forces
    notes: tuple[str, ...]  # excluded data, with reasons

    @property
    def values(self) -> dict[str, float]:
        """Every estimate by name."""
        return {name: value for group in self.groups for name, value in group.by_name.items()}

    def source(self, name: str) -> str:
        """Return the source of an estimate as text."""
        group = next(group for group in self.groups if name in group.names)
        deviation = group.deviation(name)
        runs = ", ".join(self.runs)
        return f"identified, {runs}: {group.source}; standard deviation {deviation:.3g}"


def identify_twin(
    runs: Sequence[Path],
    plant: Path | None = None,
    probe: str = "",
    *,
    incomplete_rows: bool = False,
) -> Twin:
    """Identify the twin of the device in ``runs``.

    At least one run must be in calm water with an open-loop reference. Runs in waves add
    excitation, dry friction and the drive's losses at their bus voltages; wave calibrations among
    the runs allow the identification of excitation. ``plant`` replaces the plant file that the
    first run names. ``incomplete_rows`` includes rows with missing ticks. Raises RunError or
    ValueError if the runs are not sufficient.
    """
    run_facts = [run_info(run) for run in runs]
    calibrations = [wave_calibration.is_calibration(item.plan) for item in run_facts]
    measured_runs = [run for run, sea in zip(runs, calibrations, strict=True) if not sea]
    if not measured_runs:
        names = ", ".join(map(str, runs))
        needed = needed_runs.identification_text(run_facts)
        raise RunError(f"{names}: no run with the device in the water; {needed}")
    runs_read = [read_records(run, incomplete_rows=incomplete_rows) for run in measured_runs]
    measured = [record for item in runs_read for record in item.records]
    notes = [message for item in runs_read for message in item.excluded]
    first = runs_read[0].facts
    template = _template(first, plant)
    records = [record.without_lag(_force_lag(template)) for record in measured]
    drive, rated_voltage = template.plant["drive"], None
    if drive["kind"] == "custom":
        rated_voltage = float(drive["rated_voltage"]["value"])
    if not any(each.has_excitation and each.sea is None for each in records):
        in_waves = sum(each.sea is not None for each in records)
        names = ", ".join(item.facts.run for item in runs_read)
        message = needed_runs.no_calm_water_text(run_facts, in_waves)
        raise RunError("; ".join([f"{names}: {message}", *_first(notes)]))
    try:
        hull = identify_hull(records)
        mechanics = drivetrain.identify_drivetrain(records, drivetrain.read_shape(template.plant))
        motor = drivetrain.identify_winding(records)
        loss = drivetrain.identify_drive_loss(records, rated_voltage)
    except ValueError as error:
        names = ", ".join(item.facts.run for item in runs_read)
        needed = needed_runs.identification_text(run_facts)
        raise RunError("; ".join([f"{names}: {error}; {needed}", *_first(notes)])) from None
    if not any(item.sea is not None for item in records):
        mechanics = mechanics.with_uncertainty(drivetrain.WAVES, GUIDE_FRICTION_DEVIATION)
        notes.append(
            "no row in waves: dry friction is that of calm water; the guide's share in waves is "
            f"included as uncertainty only ({GUIDE_FRICTION_DEVIATION:g} N)"
        )
    coefficient = _coefficient(template, runs, run_facts, any(calibrations), probe, notes)
    factor = seas.excitation_scale(records, hull, coefficient)
    return Twin(
        tuple(item.run for item in run_facts),
        template,
        first.config,
        hull,
        (hull.linear, hull.quadratic, mechanics, motor, loss, factor),
        coefficient,
        tuple(measured),
        tuple(notes),
    )


def _first(notes: Sequence[str]) -> list[str]:
    """Return the first few notes on excluded rows, for a message."""
    more = [f"and {len(notes) - _MAX_NOTES} more"] if len(notes) > _MAX_NOTES else []
    return [*(f"left out: {note}" for note in notes[:_MAX_NOTES]), *more]


def _template(run_facts: RunInfo, plant: Path | None) -> Template:
    """Return the given plant file, or the one that the run's configuration names."""
    if plant is None:
        files = run_facts.config.get("files", [])
        plant = next((Path(file["path"]) for file in files if file["role"] == "plant"), None)
        problem = "its configuration names no plant file"
        if plant is not None:
            problem = "" if plant.is_file() else f"its plant file {plant} does not exist"
        if plant is None or problem:
            raise RunError(f"{run_facts.run}: {problem}; give --plant FILE")
    mapping, locate = load_mapping(plant, kinds=(PLANTS,))
    return Template(plant, mapping, *bem_paths(mapping, locate))


def _force_lag(template: Template) -> float:
    """Return the time constant of the amplifiers of load cell and torque sensor, s."""
    return float(template.plant["sensors"]["heave_force_lag"]["value"])


def _coefficient(
    template: Template,
    runs: Sequence[Path],
    run_facts: Sequence[RunInfo],
    calibrated: bool,
    probe: str,
    notes: list[str],
) -> seas.Coefficient:
    """Return excitation by frequency: identified with wave calibrations, else from BEM."""
    coefficients = read_bem(template.heave_bem)
    frequency, force = coefficients.frequency, coefficients.excitation
    digest = hashlib.sha256(read_regular(template.heave_bem, MAX_TABLE_BYTES)).hexdigest()[:12]
    bem = seas.Coefficient(frequency, force, f"BEM {template.heave_bem.name} (sha256 {digest})")
    if not calibrated:
        return bem
    usable_runs = [
        run for run, facts_of_run in zip(runs, run_facts, strict=True)
        if facts_of_run.plan.get("reference") or wave_calibration.is_calibration(facts_of_run.plan)
    ]  # fmt: skip
    try:
        identified = identify(usable_runs, IdentificationOptions(probe=probe))
    except RunError as error:
        needed = "leave out the wave calibrations for the excitation of the BEM file, or "
        needed += needed_runs.identification_text(run_facts)
        raise RunError(f"{error}; {needed}") from None
    notes += identified.notes
    return seas.merge_identified(bem, identified.excitations, _force_lag(template))
