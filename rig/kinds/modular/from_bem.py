"""A plant file from the results of a BEM program: fit of the radiation, file, report."""

import math
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from ruamel.yaml import YAML
from scipy.optimize import brentq

from rig.kinds.modular.first_values import first_pto, first_values
from rig.kinds.modular.mode_choice import ChosenModes, ModeOptions, choose_modes
from rig.kinds.modular.new_rig import bem_copies, bem_key
from rig.kinds.modular.plant_checks import NEGLIGIBLE, plant_findings
from rig.kinds.modular.plant_text import PlantEntries, plant_text
from rig.kinds.new_files import write_new
from sim_plant.modes import building, radiation, stored_radiation
from sim_plant.modes.bem import BemModes, impedance
from sim_plant.modes.bem_content import MINUS, Floats, rotates
from sim_plant.modes.building import PlantModel
from sim_plant.modes.parameters import Plant

NOTABLE_CORRECTION = 0.02  # of A_inf
_TICK = 0.001  # s, of most rigs
_PASSIVITY_GRID = np.geomspace(1.0e-4, 1.0e5, 4001)  # rad/s


class PlantRequest(NamedTuple):
    """Options of `rig plant from-bem`."""

    modes: ModeOptions
    output: Path  # of the plant file


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
    natural_period_s: float | None  # undamped, of this mode alone; None: outside the file's band
    added_mass_at_resonance: float | None  # of the file, at the natural period
    damping_at_resonance: float | None  # radiation damping of the file, N*s/m or N*m*s
    states: int  # of the radiation that its velocity drives


class TermReport(NamedTuple):
    """Error of one term of the radiation in the wave band."""

    influenced: str
    radiating: str
    error: float  # by the peak of the two diagonal terms (`radiation.error_scale`)


class AxisReport(NamedTuple):
    """The PTO of one axis."""

    name: str
    moves_with: dict[str, float]  # factors by the modes' names in the plant file


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
    axes: tuple[AxisReport, ...]
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
        **bem_copies(request.modes.bem, output.parent),
    }
    return write_new(texts)


def radiation_path(output: Path) -> Path:
    """Return the path of the stored radiation next to a plant file."""
    return output.with_suffix(stored_radiation.SUFFIX)


def fit_plant(request: PlantRequest) -> FittedPlant:
    """Return the plant of a request; ValueError with everything that it leaves open."""
    output, options = request.output, request.modes
    own = (output, radiation_path(output), output.with_suffix(".png"))
    existing = [f"{path}: exists; nothing is overwritten" for path in own if path.exists()]
    chosen = choose_modes(options, existing, pto_of_each=True)
    bem = chosen.bem
    grids = first_values(chosen).axes
    begin = time.perf_counter()
    memory = radiation.fit(bem)
    seconds = time.perf_counter() - begin
    entries = PlantEntries(
        bem_key(options.bem, output.parent),
        (float(bem.frequency[0]), float(bem.frequency[-1])),
        options.water,
        options.direction,
        radiation_path(output).name,
        chosen.modes,
        {name: first_pto(motion, grids[name]) for name, motion in chosen.axes.items()},
    )
    text = plant_text(output.stem, entries)
    plant = Plant.model_validate(YAML(typ="safe", pure=True).load(text))
    model = building.assemble(plant, bem, memory)
    return FittedPlant(_report(options, chosen, model, seconds), model, bem, text)


def natural_period(bem: BemModes, mode: int, mass: float, stiffness: float) -> float | None:
    """Return the period (s) of a mode alone, with the added mass there; None outside the band.

    The added mass is linear between the file's frequencies, as `coefficient_at` has it.
    """
    hertz, added = bem.frequency, bem.added_mass[:, mode, mode]

    def surplus(frequency: float) -> float:
        """Return inertial less restoring force per motion, N/m or N*m/rad."""
        inertia = mass + float(np.interp(frequency, hertz, added))
        return (2.0 * math.pi * frequency) ** 2 * inertia - stiffness

    surpluses = np.array([surplus(each) for each in hertz])
    for k in np.flatnonzero((surpluses[:-1] < 0.0) & (surpluses[1:] >= 0.0)):
        return 1.0 / float(brentq(surplus, hertz[k], hertz[k + 1]))
    return None


def coefficient_at(bem: BemModes, values: Floats, period: float) -> float:
    """Return a coefficient over the file's frequencies at a period (s), linear between them."""
    return float(np.interp(1.0 / period, bem.frequency, values))


def wave_band(bem: BemModes) -> Floats:
    """Return the frequencies (Hz) at which some mode radiates notable waves."""
    return bem.frequency[radiation.wave_band(impedance(bem))]


def _report(
    options: ModeOptions, chosen: ChosenModes, model: PlantModel, seconds: float
) -> PlantReport:
    """Return the report of a fitted plant."""
    bem, content = chosen.bem, chosen.content
    memory = model.radiation
    periods = [
        natural_period(bem, k, mode.mass, mode.stiffness) for k, mode in enumerate(chosen.modes)
    ]
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
            period,
            None if period is None else coefficient_at(bem, bem.added_mass[:, k, k], period),
            None if period is None else coefficient_at(bem, bem.damping[:, k, k], period),
            memory.source.count(k),
        )
        for k, (mode, volume, period) in enumerate(
            zip(chosen.modes, bem.volume, periods, strict=True)
        )
    )
    terms = tuple(
        TermReport(bem.modes[i], bem.modes[j], float(memory.error[i, j]))
        for i, j in zip(*np.triu_indices(len(bem.modes)), strict=True)
    )
    band = wave_band(bem)
    poles = np.abs(memory.diagonal + 1j * memory.cross)
    return PlantReport(
        str(options.bem),
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
        tuple(AxisReport(name, axis.moves_with) for name, axis in chosen.axes.items()),
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
        if (mode.stiffness or 0.0) < 0.0:
            yield (
                f"{dof}: a stiffness of {mode.stiffness:g} is below 0: without a mooring or a "
                "spring that holds it, the mode capsizes"
            )
        if not (mode.linear_damping > 0.0 or mode.quadratic_damping > 0.0):
            yield (
                f"{dof}: no viscous damping, because the first value is a share of critical, which "
                "is 0 without stiffness; choose linear_damping"
            )
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


def _sum_text(factors: Mapping[str, float]) -> str:
    """Return the motion of an axis as a sum of modes: `float - 0.5 * spar`."""
    text = " ".join(
        f"{'-' if factor < 0.0 else '+'} "
        f"{'' if abs(factor) == 1.0 else f'{abs(factor):g} * '}{mode}"
        for mode, factor in factors.items()
    )
    return text.removeprefix("+ ")


def _resonance_text(mode: ModeReport) -> str:
    """Return the coefficients of the file at the undamped resonance, to verify them."""
    assert mode.natural_period_s is not None
    units = ("kg*m2", "N*m*s") if rotates(mode.dof) else ("kg", "N*s/m")
    return (
        f"{mode.dof:18}undamped resonance at {1.0 / mode.natural_period_s:.4g} Hz: "
        f"A = {mode.added_mass_at_resonance:.5g} {units[0]}, "
        f"B = {mode.damping_at_resonance:.5g} {units[1]}"
    )


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
        f"{'period':>9}{'states':>8}",
    ]
    for mode in report.modes:
        displaced = "" if mode.displaced_mass is None else f"{mode.displaced_mass:.5g}"
        period = "-" if mode.natural_period_s is None else f"{mode.natural_period_s:.3f} s"
        share = mode.added_mass_correction / mode.added_mass_infinite
        lines.append(
            f"{mode.dof:18}{mode.mass:11.5g}{displaced:>11}{mode.added_mass_infinite:11.5g}"
            f"{share:+8.1%}{mode.stiffness:12.5g}{period:>9}{mode.states:8d}"
        )
    lines.append("")
    lines += [f"{'PTO':12} {axis.name} = {_sum_text(axis.moves_with)}" for axis in report.axes]
    lines.append("")
    lines += [
        f"{mode.dof:18}mass: {mode.mass_source}; A_inf: {mode.added_mass_source}; stiffness: "
        f"{mode.stiffness_source}"
        for mode in report.modes
    ]
    lines += [_resonance_text(mode) for mode in report.modes if mode.natural_period_s is not None]
    lines += ["", f"{'radiation':12} {report.states} states, fitted in {report.fit_seconds:.2f} s; "
              f"poles {report.slowest_pole:.3g} .. {report.fastest_pole:.3g} rad/s, stable",
              f"{'passive':12} the fit's damping is nowhere negative; its smallest value is "
              f"{report.damping_margin:.1e} of its peak"]  # fmt: skip
    for term in report.terms:
        if term.error > 5.0e-5 or term.influenced == term.radiating:
            pair = f"{term.influenced}, {term.radiating}"
            lines.append(f"{'error':12} {pair:32} {term.error:7.2%} of the peak")
    lines += [f"warning: {warning}" for warning in report.warnings]
    return "\n".join(lines)
