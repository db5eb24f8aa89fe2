"""Figures of an identification, in kind those of the MASK4 report (Sandia): 4-5 to 4-9."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.figure import SubFigure

from rig.analysis import picture
from rig.identification import bem as bem_file
from rig.identification.excitation import Excitation
from rig.identification.fit import impedance
from rig.identification.identify import Identification
from rig.identification.impedances import Model
from rig.identification.periods import Complexes, Floats

if TYPE_CHECKING:
    from rig.identification.comparison import Comparison

COLOURS = ("#00798c", "#d1495b", "#4f772d", "#22303c", "#9a5b13", "#6a4c93", "#8d99ae", "#c77dff")
FITTED = "#ffb703"  # of models: over the curves that they are fitted to
PER_KILONEWTON = "m/s per kN"
"""The unit that admittances are drawn in."""

_BANDED = 0.18  # opacity of a band


class Curve(NamedTuple):
    """One response of a four-panel picture."""

    label: str
    frequency: Floats
    value: Complexes
    band: Floats | None = None
    colour: str = COLOURS[0]
    style: str = "-"


def four_panels(body: SubFigure, curves: list[Curve], what: str, unit: str) -> None:
    """Real part, magnitude, imaginary part and phase of responses, with their bands."""
    scale = 1e3 if unit == PER_KILONEWTON else 1.0
    panels: Any = body.subplots(2, 2, sharex=True)
    parts = (
        (panels[0, 0], f"Re {what}, {unit}", np.real),
        (panels[0, 1], f"|{what}|, {unit}", np.abs),
        (panels[1, 0], f"Im {what}, {unit}", np.imag),
        (panels[1, 1], f"phase of {what}, °", lambda z: np.degrees(np.angle(z))),
    )
    for axes, label, of in parts:
        is_phase = axes is panels[1, 1]
        for curve in curves:
            values = of(curve.value) if is_phase else scale * of(curve.value)
            few = curve.style == "-" and curve.frequency.size < 60
            axes.plot(
                curve.frequency, values, ls=curve.style, color=curve.colour, label=curve.label,
                lw=1.3 if curve.style == "-" else 1.0, marker="." if few else None, ms=4,
            )  # fmt: skip
            if curve.band is not None and np.isfinite(curve.band).any():
                wide = scale * curve.band
                if is_phase:
                    share = np.minimum(curve.band / np.abs(curve.value), 1.0)
                    wide = np.degrees(np.arcsin(share))
                axes.fill_between(
                    curve.frequency, values - wide, values + wide, color=curve.colour,
                    alpha=_BANDED, lw=0,
                )  # fmt: skip
        axes.set_ylabel(label, fontsize=8, color=picture.DARK)
        axes.grid(visible=True, color="#e6eaed", lw=0.6)
        picture.style_axes(axes)
    for axes in panels[1]:
        axes.set_xlabel("frequency, Hz", fontsize=8, color=picture.DARK)
    panels[1, 1].legend(fontsize=6.5, frameon=False)


def admittances(model: Model, fits: Mapping[str, Any]) -> list[Curve]:
    """Fig. 4-5: from command, current, torque sensor and load cell, fits dotted."""
    told = (
        ("Y_id_command", "command", COLOURS[1], "-"),
        ("Y_id_current", "current", COLOURS[0], "--"),
        ("Y_id_trs", "torque sensor", COLOURS[2], ":"),
        ("Y_i", "load cell: Y_i", COLOURS[3], "-"),
    )
    curves = []
    for name, label, colour, style in told:
        if name in model.responses:
            r = model.responses[name]
            band = r.band if style == "-" else None
            curves.append(Curve(label, model.frequency, r.value, band, colour, style))
    for name, several in fits.items():
        best = several[-1]
        fine = np.linspace(model.frequency[0], model.frequency[-1], 201)
        made = 1.0 / impedance(best, fine)
        label = f"fit to {name.replace('Z', 'Y')}, order {best.order}"
        curves.append(Curve(label, fine, made, None, FITTED, ":" if name == "Z_i" else "-."))
    return curves


def inverse(model: Model, name: str, label: str, colour: str) -> Curve:
    """An admittance from an impedance, with its band carried over."""
    r = model.responses[name]
    return Curve(label, model.frequency, 1.0 / r.value, r.band / np.abs(r.value) ** 2, colour)


def largest(models: tuple[Model, ...]) -> list[Model]:
    """Of each axis and spring rate the model of the largest amplitude."""
    best: dict[tuple[str, float], Model] = {}
    for model in models:
        key = (model.axis, model.spring_rate)
        if key not in best or model.peak > best[key].peak:
            best[key] = model
    return list(best.values())


def write_pictures(found: Identification, folder: Path) -> list[Path]:
    """All figures that the identification has something for; returns the files."""
    made = []
    for axis in dict.fromkeys(model.axis for model in found.models):
        of_axis = tuple(m for m in found.models if m.axis == axis)
        main = largest(of_axis)
        first = main[0]
        fits = found.fits[found.models.index(first)]
        title = f"Admittance of {axis} at {first.spring_rate:g} N/m, {first.peak_a:.3g} A"
        curves = admittances(first, fits)
        made.append(
            _figure(found, folder / f"admittance_{axis}.png", title, curves, "Y", PER_KILONEWTON)
        )
        if "Z_d" not in first.responses:
            continue
        by_spring = [(m, f"{m.spring_rate:g} N/m", c) for m, c in zip(main, _cycle(), strict=False)]
        for key, name in (("Z_i", "intrinsic"), ("Z_d", "drivetrain")):
            curves = [inverse(m, key, label, colour) for m, label, colour in by_spring]
            title = f"{name.capitalize()} admittance at the largest amplitude, by spring rate"
            what = key.replace("Z", "Y")
            made.append(_figure(found, folder / f"{name}.png", title, curves, what))
        family = [m for m in of_axis if m.spring_rate == first.spring_rate]
        if len(family) > 1:
            curves = [
                inverse(m, "Z_d", f"{m.peak_a:.3g} A", c)
                for m, c in zip(family, _cycle(), strict=False)
            ]
            title = f"Drivetrain admittance by amplitude, {first.spring_rate:g} N/m"
            made.append(
                _figure(found, folder / "amplitudes.png", title, curves, "Y_d", PER_KILONEWTON)
            )
    for i, one in enumerate(found.excitations):
        path = folder / f"excitation{'' if i == 0 else f'_{i + 1}'}.png"
        title = f"Wave excitation; experiments: {one.experiments}, seas: {one.seas}"
        curves = excitation_curves(one, found.bem)
        made.append(_figure(found, path, title, curves, "f_exc", "N/m"))
    return made


def _cycle() -> list[str]:
    return list(COLOURS) * 4


def excitation_curves(one: Excitation, bem: bem_file.Bem | None) -> list[Curve]:
    """Fig. 4-9: identified where the sea is strong enough, and by BEM."""
    good = one.good
    label = f"identified, eta from {one.probe}"
    curves = [Curve(label, one.frequency[good], one.value[good], one.band[good], COLOURS[0])]
    if bem is not None:
        expected = bem_file.at(bem, one.frequency)
        curves.append(Curve(bem.name, one.frequency, expected, None, COLOURS[1], "--"))
    return curves


def _figure(
    found: Identification,
    path: Path,
    title: str,
    curves: list[Curve],
    what: str,
    unit: str = PER_KILONEWTON,
) -> Path:
    said = "force on the body; e^(+iωt); bands 95 %"
    figure, body = picture.framed_figure(9.0, 5.6, title, found.attributes, said)
    four_panels(body, curves, what, unit)
    return picture.save(figure, path)


def write_comparison(told: "Comparison", path: Path) -> Path:
    """The pair of the largest amplitude, response by response: A and B over one another."""
    last = told.differences[-1]
    pair = [d for d in told.differences if (d.a, d.b) == (last.a, last.b)]
    one, other = told.modes
    attributes = {"run": told.b, "mode": other if one == other else f"{one} and {other}"}
    said = f"compared with {told.a}"
    title = "Two identifications, A and B"
    figure, body = picture.framed_figure(9.0, 2.6 * len(pair), title, attributes, said)
    panels: Any = body.subplots(len(pair), 2, sharex=True, squeeze=False)
    for d, line in zip(pair, panels, strict=True):
        for axes, part, of in zip(line, ("Re", "Im"), (np.real, np.imag), strict=True):
            for which, z, band, c in (
                ("A", d.one, d.bands[0], COLOURS[0]),
                ("B", d.other, d.bands[1], COLOURS[1]),
            ):
                name = f"{which}: {d.a if which == 'A' else d.b}"
                style = ".-" if which == "A" else ".--"  # A is seen beneath an equal B
                axes.plot(d.frequency, of(z), style, color=c, lw=1.4, ms=4, label=name)
                wide = np.nan_to_num(band)
                axes.fill_between(
                    d.frequency, of(z) - wide, of(z) + wide, color=c, alpha=_BANDED, lw=0
                )
            axes.set_ylabel(f"{part} {d.response}, N·s/m", fontsize=8)
            axes.grid(visible=True, color="#e6eaed", lw=0.6)
            picture.style_axes(axes)
    panels[0, 0].legend(fontsize=7, frameon=False)
    for axes in panels[-1]:
        axes.set_xlabel("frequency, Hz", fontsize=8)
    return picture.save(figure, path)
