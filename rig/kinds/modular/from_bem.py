"""A plant file from the results of a BEM program: choice of modes, fit, report.

Nothing is guessed: several modes, wave directions, depths or bodies, and numbers that the file does
not state, are listed with the options that choose them.
"""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from ruamel.yaml import YAML

from rig.config.sea import MAX_AMPLITUDE_M
from rig.kinds.modular.new_rig import bem_copies, bem_key
from rig.kinds.modular.plant_checks import NEGLIGIBLE, plant_findings
from rig.kinds.modular.plant_text import (
    COUNTS,
    DAMPING_RATIO,
    PEAK_CURRENT,
    ModeEntry,
    PlantEntries,
    Pto,
    names_of_modes,
    plant_text,
    rounded,
)
from rig.kinds.new_files import write_new
from rig.planning.tank import wave_number
from sim_plant.modes import building, radiation, stored_radiation
from sim_plant.modes.bem import (
    BemModes,
    choose,
    impedance,
    open_choices,
    read_content,
    stated_mass,
)
from sim_plant.modes.bem_content import MINUS, BemContent, Floats, Water, rotates
from sim_plant.modes.building import PlantModel
from sim_plant.modes.parameters import Plant

OPEN_MASS_COUPLING = 0.01  # of the masses' geometric mean: a plant has a mass for each mode alone
NOTABLE_CORRECTION = 0.02  # of A_inf
_STEEPNESS = 0.1  # amplitude times wave number, of the waves that size the first motor
_MARGIN = 2.0  # of that motor
_TICK = 0.001  # s, of most rigs
_PASSIVITY_GRID = np.geomspace(1.0e-4, 1.0e5, 4001)  # rad/s


class PlantRequest(NamedTuple):
    """Options of `rig plant from-bem`; values are `MODE=NUMBER`, or a number for a single mode."""

    bem: Path
    output: Path  # of the plant file
    dofs: tuple[str, ...] = ()
    axes: tuple[str, ...] = ()  # modes with a PTO; all without
    masses: tuple[str, ...] = ()
    stiffnesses: tuple[str, ...] = ()
    direction: float | None = None
    water: Water = Water()


class ModeReport(NamedTuple):
    """One mode of the plant, with the sources of its numbers; SI units."""

    dof: str
    name: str  # in the plant file
    mass: float
    mass_source: str
    displaced_mass: float | None  # of a translation; None: the volume is not stated
    added_mass_infinite: float
    added_mass_source: str
    added_mass_correction: float  # by the fit
    stiffness: float
    stiffness_source: str
    natural_period_s: float | None  # of this mode alone; None: outside the file's band
    states: int  # of the radiation that its velocity drives
    has_pto: bool


class TermReport(NamedTuple):
    """Error of one term of the radiation in the wave band."""

    influenced: str
    radiating: str
    error: float  # by the peak of the two diagonal terms (`radiation.error_scale`)


class PlantReport(NamedTuple):
    """All that the command reports."""

    bem: str
    source: str
    scaling: str  # of the file
    phase: str
    density: float
    gravity: float
    depth: float
    direction_deg: float
    frequencies: int
    band_hz: tuple[float, float]
    wave_band_hz: tuple[float, float]  # where some mode radiates notable waves
    fixed_modes: tuple[str, ...]  # modes of the file that the plant does not have
    modes: tuple[ModeReport, ...]
    terms: tuple[TermReport, ...]
    irregular_hz: tuple[float, ...]
    states: int
    damping_margin: float  # smallest eigenvalue of Re K_r by the largest one; not negative: passive
    fastest_pole: float  # 1/s
    slowest_pole: float  # 1/s
    fit_seconds: float
    warnings: tuple[str, ...]


class FittedPlant(NamedTuple):
    """A plant with the fit of its radiation, before it is written."""

    report: PlantReport
    model: PlantModel
    bem: BemModes  # of the file, without the fit's correction of A_inf
    text: str  # of the plant file


def write_plant(request: PlantRequest, fitted: FittedPlant, picture: bytes) -> list[Path]:
    """Write plant file, stored radiation, picture, and a copy of the BEM files; return the paths.

    ValueError if one of them exists.
    """
    output = request.output
    texts: Mapping[Path, str | bytes] = {
        output: fitted.text,
        radiation_path(output): stored_radiation.to_text(fitted.bem, fitted.model.radiation),
        output.with_suffix(".png"): picture,
        **bem_copies(request.bem, output.parent),
    }
    return write_new(texts)


def radiation_path(output: Path) -> Path:
    """Return the path of the stored radiation next to a plant file."""
    return output.with_suffix(stored_radiation.SUFFIX)


def fit_plant(request: PlantRequest) -> FittedPlant:
    """Return the plant of a request; ValueError with everything that it leaves open."""
    content = read_content(request.bem, request.water)
    chosen = _chosen_modes(content, request)
    problems = [
        *chosen.problems,
        *open_choices(content, chosen.dofs or None, request.direction),
    ]
    if chosen.dofs and set(chosen.dofs) <= set(content.modes):
        problems += _missing_numbers(content, chosen)
    problems = [f"{request.bem}: {each}" for each in problems]
    own = (request.output, radiation_path(request.output), request.output.with_suffix(".png"))
    problems += [f"{path}: exists; nothing is overwritten" for path in own if path.exists()]
    if problems:
        raise ValueError("\n".join(problems))
    bem = choose(request.bem, content, chosen.dofs, request.direction)
    rigid = [_rigid_body(bem, k, chosen) for k in range(len(bem.modes))]
    begin = time.perf_counter()
    memory = radiation.fit(bem)
    seconds = time.perf_counter() - begin
    names = names_of_modes(bem.modes)
    infinite = np.diag(bem.added_mass_infinite + memory.added_mass)
    modes = []
    for k, (name, body) in enumerate(zip(names, rigid, strict=True)):
        damping = (
            2.0 * DAMPING_RATIO * math.sqrt(max(body.stiffness, 0.0) * (body.mass + infinite[k]))
        )
        modes.append(
            ModeEntry(
                name, bem.modes[k], body.mass, body.mass_source, body.stiffness,
                body.stiffness_source, rounded(damping),
            )
        )  # fmt: skip
    axes = {name: _first_pto(bem, k) for k, name in enumerate(names) if bem.modes[k] in chosen.axes}
    folder = request.output.parent
    band = (float(bem.frequency[0]), float(bem.frequency[-1]))
    stored = radiation_path(request.output).name
    entries = PlantEntries(
        bem_key(request.bem, folder), band, request.water, request.direction, stored,
        tuple(modes), axes,
    )  # fmt: skip
    text = plant_text(request.output.stem, entries)
    plant = Plant.model_validate(YAML(typ="safe", pure=True).load(text))
    model = building.assemble(plant, bem, memory)
    report = _report(request, content, bem, model, entries, seconds)
    return FittedPlant(report, model, bem, text)


class _Choice(NamedTuple):
    dofs: tuple[str, ...]
    axes: tuple[str, ...]
    masses: dict[str, float]
    stiffnesses: dict[str, float]
    problems: tuple[str, ...]


def _chosen_modes(content: BemContent, request: PlantRequest) -> _Choice:
    """Return modes, axes and numbers of a request, with what is wrong in it."""
    listed = ", ".join(content.modes)
    problems = []
    dofs = request.dofs
    if not dofs and len(content.modes) == 1:
        dofs = content.modes
    if not dofs:
        bodies = sorted({mode.rpartition("__")[0] for mode in content.modes} - {""})
        several = f" of the bodies {', '.join(bodies)}" if len(bodies) > 1 else ""
        problems.append(f"has several modes{several}: {listed}; choose some with --dof")
    problems += [
        f"--dof {dof} is given twice" for dof in dict.fromkeys(dofs) if dofs.count(dof) > 1
    ]
    problems += [
        f"--axis {axis!r} is no chosen mode; allowed: {', '.join(dofs)}"
        for axis in request.axes
        if axis not in dofs
    ]
    masses, wrong_masses = _numbers("--mass", request.masses, dofs)
    stiffnesses, wrong_stiffnesses = _numbers("--stiffness", request.stiffnesses, dofs)
    problems += [*wrong_masses, *wrong_stiffnesses]
    problems += [
        f"--mass {dof}={mass:g}: allowed above 0" for dof, mass in masses.items() if not mass > 0.0
    ]
    return _Choice(tuple(dofs), request.axes or tuple(dofs), masses, stiffnesses, tuple(problems))


def _numbers(
    option: str, texts: Sequence[str], dofs: Sequence[str]
) -> tuple[dict[str, float], list[str]]:
    """Return the numbers of a repeated option by mode, and what is wrong with them."""
    found: dict[str, float] = {}
    problems = []
    for text in texts:
        dof, equals, number = text.rpartition("=")
        if not equals and len(dofs) == 1:
            dof = dofs[0]
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if dof not in dofs or not math.isfinite(value):
            names = ", ".join(dofs) or "the modes of --dof"
            problems.append(f"{option} {text}: expected MODE=NUMBER with a mode of {names}")
        elif dof in found:
            problems.append(f"{option} of {dof} is given twice")
        found[dof] = value
    return found, problems


class _RigidBody(NamedTuple):
    mass: float
    mass_source: str
    stiffness: float
    stiffness_source: str


def _missing_numbers(content: BemContent, chosen: _Choice) -> Iterator[str]:
    """Yield the masses and stiffnesses that neither file nor options state."""
    for dof in chosen.dofs:
        k = content.modes.index(dof)
        units = ("kg*m2", "N*m/rad") if rotates(dof) else ("kg", "N/m")
        if dof not in chosen.masses and stated_mass(content, k)[0] is None:
            yield f"does not state the mass of {dof}: give --mass {dof}=... ({units[0]})"
        if dof not in chosen.stiffnesses and _own_stiffness(content, k) is None:
            yield (
                f"states no stiffness of {dof}: give --stiffness {dof}=... ({units[1]}), with that "
                "of the mooring; 0 lets it drift"
            )
    yield from _mass_couplings(content, chosen)


def _own_stiffness(bem: BemContent | BemModes, mode: int) -> float | None:
    """Return the file's hydrostatic stiffness of a mode; None if it has none or only rounding."""
    if bem.stiffness is None:
        return None
    own = float(bem.stiffness[mode, mode])
    largest = float(np.nanmax(np.abs(bem.stiffness)))
    return own if abs(own) > NEGLIGIBLE * largest else None


def _rigid_body(bem: BemModes, mode: int, chosen: _Choice) -> _RigidBody:
    """Return mass and stiffness of a mode with their sources; both are stated."""
    dof = bem.modes[mode]
    mass, mass_source = chosen.masses.get(dof), "given"
    if mass is None:
        mass, mass_source = stated_mass(bem, mode)
    stiffness, source = chosen.stiffnesses.get(dof), "given"
    if stiffness is None:
        stiffness, source = _own_stiffness(bem, mode), "hydrostatic, of the BEM file"
    assert mass is not None
    assert stiffness is not None
    return _RigidBody(rounded(mass, 6), mass_source, rounded(stiffness, 6), source)


def _mass_couplings(content: BemContent, chosen: _Choice) -> Iterator[str]:
    """Yield the terms of the file's inertia that a plant cannot have."""
    if content.inertia is None:
        return
    for i, j in zip(*np.triu_indices(len(content.modes), 1), strict=True):
        one, other = content.modes[i], content.modes[j]
        term = float(content.inertia[i, j])
        size = math.sqrt(abs(float(content.inertia[i, i] * content.inertia[j, j])))
        open_pair = {one, other} <= set(chosen.dofs) and not {one, other} <= chosen.masses.keys()
        if math.isfinite(term) and open_pair and abs(term) > OPEN_MASS_COUPLING * size:
            yield (
                f"couples {one} and {other} by a mass of {term:.4g}, which a plant has not; rotate "
                "about the centre of mass, or give --mass of both to leave it out"
            )


def _first_pto(bem: BemModes, mode: int) -> Pto:
    """Return a motor for twice the largest excitation by waves of moderate steepness."""
    omega = 2.0 * np.pi * bem.frequency
    steep = [_STEEPNESS / wave_number(float(w), bem.depth, bem.gravity) for w in omega]
    amplitude = np.minimum(steep, MAX_AMPLITUDE_M)
    forces = np.abs(bem.excitation[:, mode]) * amplitude
    at = int(forces.argmax())
    force = _MARGIN * float(forces[at])
    gear = rounded(max(force / PEAK_CURRENT, 1.0))
    current = max(force / gear, 1.0)
    resistance = 0.1 * force * float(omega[at] * amplitude[at]) / (current * current)
    return Pto(1.0, gear, COUNTS, 1.25 * current, resistance)


def natural_period(bem: BemModes, mode: int, mass: float, stiffness: float) -> float | None:
    """Return the period (s) of a mode alone, with the added mass there; None outside the band."""
    omega = 2.0 * np.pi * bem.frequency
    reactance = omega * omega * (mass + bem.added_mass[:, mode, mode]) - stiffness
    for k in np.flatnonzero((reactance[:-1] < 0.0) & (reactance[1:] >= 0.0)):
        share = -reactance[k] / (reactance[k + 1] - reactance[k])
        return float(2.0 * np.pi / (omega[k] + share * (omega[k + 1] - omega[k])))
    return None


def wave_band(bem: BemModes) -> Floats:
    """Return the frequencies (Hz) at which some mode radiates notable waves."""
    band: Floats = bem.frequency[radiation.wave_band(impedance(bem))]
    return band


def _report(
    request: PlantRequest,
    content: BemContent,
    bem: BemModes,
    model: PlantModel,
    entries: PlantEntries,
    seconds: float,
) -> PlantReport:
    """Return the report of a fitted plant."""
    memory = model.radiation
    modes = tuple(
        ModeReport(
            mode.dof,
            mode.name,
            mode.mass,
            mode.mass_source,
            None if volume is None or rotates(mode.dof) else bem.density * volume,
            float(bem.added_mass_infinite[k, k]),
            bem.infinite_method,
            float(memory.added_mass[k, k]),
            mode.stiffness,
            mode.stiffness_source,
            natural_period(bem, k, mode.mass, mode.stiffness),
            memory.source.count(k),
            mode.name in entries.axes,
        )
        for k, (mode, volume) in enumerate(zip(entries.modes, bem.volume, strict=True))
    )
    terms = tuple(
        TermReport(bem.modes[i], bem.modes[j], float(memory.error[i, j]))
        for i, j in zip(*np.triu_indices(len(bem.modes)), strict=True)
    )
    band = wave_band(bem)
    poles = np.abs(memory.diagonal + 1j * memory.cross)
    return PlantReport(
        str(request.bem),
        content.source,
        content.scaling,
        content.phase,
        bem.density,
        bem.gravity,
        bem.depth,
        bem.direction,
        bem.frequency.size,
        (float(bem.frequency[0]), float(bem.frequency[-1])),
        (float(band[0]), float(band[-1])),
        tuple(mode for mode in content.modes if mode not in bem.modes),
        modes,
        terms,
        tuple(memory.left_out.tolist()),
        len(memory.source),
        radiation.smallest_damping(memory, _PASSIVITY_GRID),
        float(poles.max()),
        float(poles.min()),
        seconds,
        tuple(_warnings(bem, model)),
    )


def _warnings(bem: BemModes, model: PlantModel) -> Iterator[str]:
    memory = model.radiation
    for key, _, message in plant_findings(model.plant, bem):
        yield f"{'.'.join(map(str, key))}: {message}"
    for k, (dof, mode) in enumerate(zip(bem.modes, model.plant.modes.values(), strict=True)):
        infinite = float(bem.added_mass_infinite[k, k])
        share = float(memory.added_mass[k, k]) / infinite
        if abs(share) > NOTABLE_CORRECTION and infinite > NEGLIGIBLE * mode.mass:
            yield (
                f"{dof}: the fit needs an A_inf of {1.0 + share:.1%} of the file's; is its mesh "
                "fine enough at infinite frequency?"
            )
    try:
        building.check_step(model, _TICK)
    except ValueError as error:
        yield f"at 1 kHz: {error}"
    worst = float(memory.error.max())
    if worst > radiation.TOLERANCE:
        yield (
            f"the radiation is fitted within {worst:.1%} of its peak, not "
            f"{radiation.TOLERANCE:.0%}: the file scatters by more than further states would gain"
        )
    if memory.left_out.size:
        listed = ", ".join(f"{each:.4g}" for each in memory.left_out)
        yield f"irregular frequencies are left out of the fit: {listed} Hz"


def report_text(report: PlantReport) -> str:
    """Return the report for people."""
    same = "as in the plant" if report.phase == MINUS else f"conjugated to {MINUS} for the plant"
    low, high = report.band_hz
    lines = [
        f"{'file':12} {report.bem} ({report.source})",
        f"{'values':12} {report.scaling} in the file; dimensional, SI in the plant",
        f"{'water':12} {report.density:g} kg/m3, {report.gravity:g} m/s2, "
        f"{'infinitely deep' if math.isinf(report.depth) else f'{report.depth:g} m deep'}",
        f"{'phases':12} {report.phase} in the file, {same}; waves to "
        f"{report.direction_deg:g} degrees (0: +x)",
        f"{'frequencies':12} {report.frequencies}, {low:.4g} .. {high:.4g} Hz; waves are radiated "
        f"at {report.wave_band_hz[0]:.3g} .. {report.wave_band_hz[1]:.3g} Hz",
        f"{'held fixed':12} {', '.join(report.fixed_modes) or 'no mode of the file'}",
        "",
        f"{'mode':18}{'mass':>11}{'displaced':>11}{'A_inf':>11}{'by fit':>8}{'stiffness':>12}"
        f"{'period':>9}{'states':>8}{'PTO':>5}",
    ]
    for mode in report.modes:
        displaced = "" if mode.displaced_mass is None else f"{mode.displaced_mass:.5g}"
        period = "-" if mode.natural_period_s is None else f"{mode.natural_period_s:.3f} s"
        share = mode.added_mass_correction / mode.added_mass_infinite
        lines.append(
            f"{mode.dof:18}{mode.mass:11.5g}{displaced:>11}{mode.added_mass_infinite:11.5g}"
            f"{share:+8.1%}{mode.stiffness:12.5g}{period:>9}{mode.states:8d}"
            f"{'yes' if mode.has_pto else 'no':>5}"
        )
    lines.append("")
    lines += [
        f"{mode.dof:18}mass: {mode.mass_source}; A_inf: {mode.added_mass_source}; stiffness: "
        f"{mode.stiffness_source}"
        for mode in report.modes
    ]
    lines += ["", f"{'radiation':12} {report.states} states, fitted in {report.fit_seconds:.2f} s; "
              f"poles {report.slowest_pole:.3g} .. {report.fastest_pole:.3g} rad/s, stable",
              f"{'passive':12} at all frequencies: the smallest damping is "
              f"{report.damping_margin:.1e} of the largest"]  # fmt: skip
    for term in report.terms:
        if term.error > 5.0e-5 or term.influenced == term.radiating:
            pair = f"{term.influenced}, {term.radiating}"
            lines.append(f"{'error':12} {pair:32} {term.error:7.2%} of the peak")
    lines += [f"warning: {warning}" for warning in report.warnings]
    return "\n".join(lines)
