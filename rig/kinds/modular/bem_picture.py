"""One page of pictures of a plant from BEM coefficients: file and fit, excitation, passivity."""

import io
import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from rig.kinds.modular.from_bem import FittedPlant, PlantReport
from rig.presentation.picture import ACCENT, DARK, HIGHLIGHT, MUTED, lay_out, style_axes
from sim_plant.modes import radiation
from sim_plant.modes.bem import BemModes, impedance
from sim_plant.modes.bem_content import Floats, rotates

MAX_PAIRS = 12  # rows; with more, those with the largest errors, and it is said
MINUS_MATH = r"e^{-i\omega t}"
_WIDTH, _ROW, _HEAD, _FOOT = 11.7, 1.75, 0.75, 2.6  # in
_DPI = 130
_DECAY = 5.0  # time constants of the slowest notable pole that the impulse response shows
_FILE = {"linestyle": "", "marker": "o", "markersize": 2.4, "color": MUTED, "label": "BEM file"}
_FIT = {"color": ACCENT, "linewidth": 1.3, "label": "state space"}


def picture(fitted: FittedPlant) -> bytes:
    """Return the page as PNG."""
    bem, memory = fitted.bem, fitted.model.radiation
    pairs = _shown_pairs(fitted)
    height = _HEAD + _ROW * len(pairs) + _FOOT
    figure = Figure(figsize=(_WIDTH, height), layout="constrained")
    parts: Any = figure.subfigures(3, 1, height_ratios=[_HEAD, _ROW * len(pairs), _FOOT])
    _heading(parts[0], fitted.report)
    rows: Any = parts[1].subplots(len(pairs), 4, squeeze=False)
    fine = np.linspace(0.0, bem.frequency[-1], 400)[1:]
    omega = 2.0 * np.pi * fine
    curve = radiation.response(memory, omega)
    infinite = bem.added_mass_infinite + memory.added_mass
    times = np.linspace(0.0, _shown_seconds(fitted), 300)
    kernel = _impulse_response(fitted, times)
    lowest = rows[0][3]
    for row, (i, j) in zip(rows, pairs, strict=True):
        mass, damping, response, wave = row
        mass.plot(bem.frequency, bem.added_mass[:, i, j], **_FILE)
        mass.plot(fine, infinite[i, j] + curve[:, i, j].imag / omega, **_FIT)
        mass.axhline(infinite[i, j], color=HIGHLIGHT, lw=1.0, ls="--", zorder=0)
        damping.plot(bem.frequency, bem.damping[:, i, j], **_FILE)
        damping.plot(fine, curve[:, i, j].real, **_FIT)
        response.plot(times, kernel[:, i, j], **_FIT)
        mass_unit, damping_unit, kernel_unit = _units(bem.modes[i], bem.modes[j])
        name = bem.modes[i] if i == j else f"{bem.modes[i]}\nby {bem.modes[j]}"
        mass.set_ylabel(name, fontsize=9, fontweight="bold", color=DARK)
        for axes, text in (
            (mass, f"added mass, {mass_unit}"), (damping, f"damping, {damping_unit}"),
            (response, f"impulse response, {kernel_unit}"),
        ):  # fmt: skip
            axes.set_title(text, fontsize=8, color=DARK, loc="left")
        if i == j:
            _excitation(wave, bem, i)
            lowest = wave
        else:
            wave.set_axis_off()
        for axes in (mass, damping):
            _shade_irregular(axes, memory.left_out)
    for axes in (*rows[-1][:2], lowest):
        axes.set_xlabel("frequency, Hz", fontsize=8, color=DARK)
    rows[-1][2].set_xlabel("time, s", fontsize=8, color=DARK)
    rows[0][0].legend(fontsize=7, frameon=False, loc="best")
    foot: Any = parts[2].subplots(1, 3, width_ratios=[1.0, 1.0, 1.0])
    _errors(foot[0], fitted, pairs)
    _passivity(foot[1], fitted)
    _facts(foot[2], fitted.report)
    for axes in (*rows.ravel(), *foot):
        style_axes(axes)
    target = io.BytesIO()
    lay_out(figure, _DPI)
    figure.savefig(target, format="png", dpi=_DPI)
    return target.getvalue()


def _shown_pairs(fitted: FittedPlant) -> list[tuple[int, int]]:
    """Return the diagonal terms and those that couple notably, at most `MAX_PAIRS`."""
    size = len(fitted.bem.modes)
    target = np.abs(impedance(fitted.bem)).max(axis=0)
    scale = np.sqrt(np.outer(np.diag(target), np.diag(target)))
    pairs = [(i, j) for i in range(size) for j in range(i, size)]
    notable = [(i, j) for i, j in pairs if i == j or target[i, j] > 0.01 * scale[i, j]]
    error = fitted.model.radiation.error
    chosen = sorted(notable, key=lambda pair: (pair[0] != pair[1], -error[pair]))[:MAX_PAIRS]
    return [pair for pair in notable if pair in chosen]


def _units(one: str, other: str) -> tuple[str, str, str]:
    """Return the units of added mass, damping and impulse response of a term."""
    return {
        0: ("kg", "N·s/m", "N/m"),
        1: ("kg·m", "N·s", "N"),
        2: ("kg·m²", "N·m·s", "N·m"),
    }[rotates(one) + rotates(other)]


def _shown_seconds(fitted: FittedPlant) -> float:
    """Return the duration in which the impulse responses have died out, s."""
    memory = fitted.model.radiation
    notable = np.abs(memory.output).max(axis=0)
    slow = -memory.diagonal[notable > 0.05 * notable.max()]
    return float(min(_DECAY / slow.min(), 12.0 / fitted.report.wave_band_hz[0]))


def _impulse_response(fitted: FittedPlant, times: Floats) -> Floats:
    """Return K(t) of the state space, (times, n, n): every state pair decays in closed form."""
    memory = fitted.model.radiation
    size = len(fitted.bem.modes)
    kernel = np.zeros((times.size, size, size))
    for k, (source, partner) in enumerate(zip(memory.source, memory.partner, strict=True)):
        # z_k of a unit impulse at its source; a partner is driven by the other state alone.
        if memory.input[k] == 0.0:
            continue
        decay = memory.input[k] * np.exp(memory.diagonal[k] * times)
        kernel[:, :, source] += np.outer(
            decay * np.cos(memory.cross[k] * times) if partner != k else decay, memory.output[:, k]
        )
        if partner != k:
            turned = decay * np.sin(memory.cross[partner] * times)
            kernel[:, :, source] += np.outer(turned, memory.output[:, partner])
    return kernel


def _excitation(axes: Axes, bem: BemModes, mode: int) -> None:
    force = bem.excitation[:, mode]
    unit = "N·m/m" if rotates(bem.modes[mode]) else "N/m"
    axes.plot(bem.frequency, np.abs(force), color=DARK, lw=1.3)
    axes.set_title(f"excitation, {unit}", fontsize=8, color=DARK, loc="left")
    axes.set_ylim(bottom=0.0)
    phase = axes.twinx()
    notable = np.abs(force) > 1.0e-3 * np.abs(force).max()
    angle = np.where(notable, np.degrees(np.unwrap(np.angle(force))), np.nan)
    phase.plot(bem.frequency, angle, color=MUTED, lw=1.2, ls=":")
    phase.set_ylabel("phase (dotted), deg", fontsize=8, color=MUTED)
    style_axes(phase)


def _shade_irregular(axes: Axes, frequencies: Floats) -> None:
    for each in frequencies:
        axes.axvline(each, color=HIGHLIGHT, lw=0.8, alpha=0.7)


def _errors(axes: Axes, fitted: FittedPlant, pairs: list[tuple[int, int]]) -> None:
    """Draw the errors of all terms over frequency, by what `radiation.error_scale` measures."""
    bem, memory = fitted.bem, fitted.model.radiation
    target = impedance(bem)
    scale = np.sqrt(radiation.error_scale(bem, target))
    gap = radiation.total_response(memory, 2.0 * np.pi * bem.frequency) - target
    error = 100.0 * np.abs(gap) / np.outer(scale, scale)
    for i, j in pairs:
        label = bem.modes[i] if i == j else f"{bem.modes[i]}, {bem.modes[j]}"
        axes.plot(bem.frequency, error[:, i, j], lw=1.0, label=label)
    axes.axhline(100.0 * radiation.TOLERANCE, color=MUTED, lw=0.8, ls="--")
    axes.axvspan(*fitted.report.wave_band_hz, color=HIGHLIGHT, alpha=0.12, lw=0)
    drawn = max(float(error[:, i, j].max()) for i, j in pairs)
    axes.set_ylim(0.0, 1.25 * max(100.0 * radiation.TOLERANCE, drawn))  # room for the legend
    axes.set_xlim(0.0, float(bem.frequency[-1]))
    title = "error of the fit, % of the peak; shaded: wave band"
    axes.set_title(title, fontsize=8, color=DARK, loc="left")
    axes.set_xlabel("frequency, Hz", fontsize=8, color=DARK)
    axes.legend(fontsize=6, frameon=False, loc="upper right", ncols=2)


def _passivity(axes: Axes, fitted: FittedPlant) -> None:
    """Draw the eigenvalues of the damping of fit and file by the largest one, on a log grid."""
    bem, memory = fitted.bem, fitted.model.radiation
    omega = np.geomspace(2.0e-2 * np.pi * bem.frequency[0], 2.0e2 * np.pi * bem.frequency[-1], 1500)
    scale = np.sqrt(radiation.error_scale(bem, impedance(bem)))
    damping = radiation.response(memory, omega).real / np.outer(scale, scale)
    own = np.linalg.eigvalsh(damping)
    of_file = np.linalg.eigvalsh(bem.damping / np.outer(scale, scale))
    axes.loglog(omega / (2.0 * np.pi), np.maximum(own, 1.0e-12), color=ACCENT, lw=1.1)
    axes.loglog(bem.frequency, np.where(of_file > 0.0, of_file, np.nan), **(_FILE | {"label": ""}))
    axes.set_ylim(1.0e-8, 3.0)
    axes.xaxis.set_major_locator(LogLocator(numticks=6))
    axes.yaxis.set_major_locator(LogLocator(numticks=6))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_locator(NullLocator())
    title = "eigenvalues of the damping, of the peak: positive, so passive"
    axes.set_title(title, fontsize=8, color=DARK, loc="left")
    axes.set_xlabel("frequency, Hz", fontsize=8, color=DARK)


def _heading(head: Any, report: PlantReport) -> None:
    modes = ", ".join(mode.dof for mode in report.modes)
    title = f"{report.bem.rpartition('/')[2]}: {modes}"
    size = min(14.0, 1300.0 / max(len(title), 1))
    head.text(0.012, 0.68, title, fontsize=size, fontweight="bold", color=DARK, va="center")
    depth = "infinite depth" if math.isinf(report.depth) else f"depth {report.depth:g} m"
    phase = report.phase.replace(" omega ", r"\omega ")
    text = (
        f"{report.source}; {report.density:g} kg/m³, {report.gravity:g} m/s², {depth}; waves to "
        f"{report.direction_deg:g}°; phases ${phase}$ in the file, ${MINUS_MATH}$ here. Dashed: "
        "added mass at infinite frequency"
    )
    head.text(0.012, 0.26, text, fontsize=8.5, color=MUTED, va="center")


def _facts(axes: Axes, report: PlantReport) -> None:
    """Write masses, periods and the numbers of the fit."""
    axes.set_axis_off()
    lines = [f"{'mode':14}{'mass':>10}{'A_inf':>10}{'stiffness':>10}{'period':>8}"]
    for mode in report.modes[:8]:
        period = "" if mode.natural_period_s is None else f"{mode.natural_period_s:.2f} s"
        lines.append(
            f"{mode.dof[:13]:14}{mode.mass:10.5g}{mode.added_mass_infinite:10.5g}"
            f"{mode.stiffness:10.5g}{period:>8}"
        )
    worst = max(term.error for term in report.terms)
    lines += [
        "",
        f"{report.states} states,",
        f"poles {report.slowest_pole:.2g} .. {report.fastest_pole:.2g} rad/s",
        f"largest error {worst:.2%} of the peak",
        f"damping at least {report.damping_margin:.0e} of its peak",
    ]
    axes.text(0.0, 1.0, "\n".join(lines), fontsize=7.5, family="monospace", color=DARK, va="top",
              transform=axes.transAxes)  # fmt: skip
