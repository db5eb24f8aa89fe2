"""Figures of an identification, after Figs. 4-5 to 4-9 of the MASK4 report (Sandia), and its page
of runs, models, amplitudes, pictures and notes.
"""

import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from rig.emulation.bem_impedance import BemImpedance
from rig.identification import bem as bem_file
from rig.identification import report
from rig.identification.comparison import Comparison
from rig.identification.excitation import Excitation
from rig.identification.experiments import BODY
from rig.identification.fit import impedance
from rig.identification.identify import Identification
from rig.identification.impedances import Model
from rig.presentation import phrases, picture
from rig.spectra.periods import Complexes, Floats

COLOURS = ("#00798c", "#d1495b", "#4f772d", "#22303c", "#9a5b13", "#6a4c93", "#8d99ae", "#c77dff")
FITTED = "#ffb703"  # colour of fitted models, drawn over the measured curves
_FIT_STYLES = {"Z_i": (FITTED, "-"), "Z_id": ("#9a5b13", "--")}  # the second over the first
_BAND_OPACITY = 0.3  # opacity of a band
_LEGEND_COLUMNS = {0: 4, 1: 2, 2: 3}  # by columns of a journal page; 0: screen
_SERIES_STYLES = (
    (COLOURS[1], "-"), (COLOURS[0], "--"), (COLOURS[2], ":"), (COLOURS[4], "-."), (COLOURS[5], ":"),
)  # fmt: skip


class Curve(NamedTuple):
    """One response of a four-panel picture."""

    label: str
    frequency: Floats
    value: Complexes
    band: Floats | None = None
    colour: str = COLOURS[0]
    style: str = "-"


def four_panels(body: SubFigure, curves: list[Curve], symbol: str, unit: str) -> None:
    """Draw real part, magnitude, imaginary part and phase of responses, with their bands.

    The legend is below the panels; it has the median width of the bands, which may be narrower
    than the curves.
    """
    scale = 1e3 if " per k" in unit else 1.0  # an admittance, `AxisUnits.per_kilo`
    panels: Any = body.subplots(2, 2, sharex=True)
    parts = (
        (panels[0, 0], f"Re {symbol}, {unit}", np.real),
        (panels[0, 1], f"|{symbol}|, {unit}", np.abs),
        (panels[1, 0], f"Im {symbol}, {unit}", np.imag),
        (panels[1, 1], f"phase of {symbol}, °", lambda z: np.degrees(np.angle(z))),
    )
    for axes, label, part_of in parts:
        is_phase = axes is panels[1, 1]
        for curve in curves:
            values = part_of(curve.value) if is_phase else scale * part_of(curve.value)
            with_markers = curve.style == "-" and curve.frequency.size < 60
            axes.plot(
                curve.frequency, values, ls=curve.style, color=curve.colour, label=curve.label,
                lw=1.3 if curve.style == "-" else 1.0, marker="." if with_markers else None, ms=4,
            )  # fmt: skip
            if curve.band is not None and np.isfinite(curve.band).any():
                half_width = scale * curve.band
                if is_phase:
                    relative_radius = np.minimum(curve.band / np.abs(curve.value), 1.0)
                    half_width = np.degrees(np.arcsin(relative_radius))
                axes.fill_between(
                    curve.frequency, values - half_width, values + half_width, color=curve.colour,
                    alpha=_BAND_OPACITY, lw=0,
                )  # fmt: skip
        axes.set_ylabel(label, fontsize=8, color=picture.DARK)
        axes.grid(visible=True, color="#e6eaed", lw=0.6)
        picture.style_axes(axes)
    for axes in panels[1]:
        axes.set_xlabel("frequency, Hz", fontsize=8, color=picture.DARK)
    handles: list[Any] = panels[0, 0].get_legend_handles_labels()[0]
    if (width := _median_band(curves)) is not None:
        label = f"bands: 95 %, median ±{100.0 * width:.2g} %"
        handles.append(Patch(color=picture.MUTED, alpha=_BAND_OPACITY, lw=0, label=label))
    columns = _LEGEND_COLUMNS[picture.paper_columns()]
    body.legend(
        handles=handles, loc="outside lower center", ncols=columns, fontsize=7, frameon=False
    )


def _median_band(curves: Iterable[Curve]) -> float | None:
    """Return the median of all bands relative to their curves; None without a known band."""
    shares = [each.band / np.abs(each.value) for each in curves if each.band is not None]
    known = np.concatenate([share[np.isfinite(share)] for share in shares] or [np.zeros(0)])
    return float(np.median(known)) if known.size else None


def admittances(
    model: Model, fits: Mapping[str, Any], bem: BemImpedance | None = None
) -> list[Curve]:
    """Return the curves of Fig. 4-5: command, current, sensors of drive and body; fits.

    The fit to the series of drivetrain and body, and ``bem``, are drawn dashed.
    """
    labels = {f"Y_id_{name}": label for name, label in model.labels.items()}
    curves = []
    series = [name for name in labels if name in model.responses]
    for name, (colour, style) in zip(series, _SERIES_STYLES, strict=False):
        response = model.responses[name]
        band = response.band if style == "-" else None
        curves.append(Curve(labels[name], model.frequency, response.value, band, colour, style))
    if "Y_i" in model.responses:
        response, label = model.responses["Y_i"], f"{model.labels[BODY]}: Y_i"
        curves.append(Curve(label, model.frequency, response.value, response.band, COLOURS[3]))
    for name, fits_of_response in fits.items():
        highest_order = fits_of_response[-1]
        fine_frequency = np.linspace(model.frequency[0], model.frequency[-1], 201)
        admittance = 1.0 / impedance(highest_order, fine_frequency)
        label = f"fit to {name.replace('Z', 'Y')}, order {highest_order.order}"
        curves.append(Curve(label, fine_frequency, admittance, None, *_FIT_STYLES[name]))
    if bem is not None:
        fine_frequency = np.linspace(model.frequency[0], model.frequency[-1], 201)
        label = f"{bem.name}: 1/Z, {bem.mode}"
        curves.append(
            Curve(label, fine_frequency, 1.0 / bem.at(fine_frequency), None, COLOURS[5], "--")
        )
    return curves


def largest(models: tuple[Model, ...]) -> list[Model]:
    """Return the model of the largest amplitude for each axis and spring rate."""
    best: dict[tuple[str, float], Model] = {}
    for model in models:
        key = (model.axis, model.spring_rate)
        if key not in best or model.peak > best[key].peak:
            best[key] = model
    return list(best.values())


def by_colour(models: Iterable[Model], name: str, label: str) -> list[Curve]:
    """Return the inverse of an impedance of several models, with its band, in a colour for each.

    ``label`` is a format of the model: ``"{0.peak_a:.3g} A"``.
    """
    curves = []
    for model, colour in zip(models, COLOURS * 4, strict=False):
        z, band = model.responses[name].value, model.responses[name].band
        band = band / np.abs(z) ** 2
        curves.append(Curve(label.format(model), model.frequency, 1.0 / z, band, colour))
    return curves


def write_pictures(identification: Identification, folder: Path) -> list[Path]:
    """Write all figures for which the identification has data; return the files."""
    paths = []
    units = identification.models[0].units
    per_kilo, stiffness = units.per_kilo, units.stiffness

    def draw(name: str, title: str, curves: list[Curve], symbol: str, unit: str = per_kilo) -> None:
        note = "force on the body; e^(+iωt); bands 95 %"
        figure, body = picture.framed_figure(9.0, 5.6, title, identification.attributes, note)
        four_panels(body, curves, symbol, unit)
        paths.append(picture.save(figure, folder / f"{name}.png"))

    for axis in dict.fromkeys(model.axis for model in identification.models):
        models = tuple(model for model in identification.models if model.axis == axis)
        largest_models = largest(models)
        first = largest_models[0]
        fits = identification.fits[identification.models.index(first)]
        spring = f"{first.spring_rate:g} {stiffness}, " if first.sprung else ""
        title = f"Admittance of {axis} at {spring}{first.peak_a:.3g} A"
        bem = identification.bem_impedances.get(axis)
        draw(f"admittance_{axis}", title, admittances(first, fits, bem), "Y")
        if not first.has_drivetrain:
            continue
        for key, name in (("Z_i", "intrinsic"), ("Z_d", "drivetrain")):
            label = f"{{0.spring_rate:g}} {stiffness}" if first.sprung else "{0.peak_a:.3g} A"
            curves = by_colour(largest_models, key, label)
            title = f"{name.capitalize()} admittance at the largest amplitude"
            title += ", by spring rate" if first.sprung else ""
            draw(name, title, curves, key.replace("Z", "Y"))
        family = [model for model in models if model.spring_rate == first.spring_rate]
        if len(family) > 1:
            title = "Drivetrain admittance by amplitude"
            title += f", {first.spring_rate:g} {stiffness}" if first.sprung else ""
            draw("amplitudes", title, by_colour(family, "Z_d", "{0.peak_a:.3g} A"), "Y_d")
    for i, excitation in enumerate(identification.excitations):
        title = f"Wave excitation; experiments: {excitation.experiments}, seas: {excitation.seas}"
        curves = excitation_curves(excitation, identification.bem)
        draw(f"excitation{'' if i == 0 else f'_{i + 1}'}", title, curves, "f_exc", "N/m")
    return paths


def excitation_curves(excitation: Excitation, bem: bem_file.Bem | None) -> list[Curve]:
    """Return the curves of Fig. 4-9: identified where the sea is strong enough, and BEM."""
    good = excitation.good
    label = f"identified, eta from {excitation.probe}"
    frequency = excitation.frequency[good]
    curves = [Curve(label, frequency, excitation.value[good], excitation.band[good])]
    if bem is not None:
        expected = bem_file.excitation_at(bem, excitation.frequency)
        curves.append(Curve(bem.name, excitation.frequency, expected, None, COLOURS[1], "--"))
    return curves


def write_comparison(comparison: Comparison, path: Path) -> Path:
    """Draw the pair of models with the largest amplitude, response by response, A over B."""
    last_difference = comparison.differences[-1]
    differences = [
        difference
        for difference in comparison.differences
        if (difference.a, difference.b) == (last_difference.a, last_difference.b)
    ]
    mode_a, mode_b = comparison.modes
    attributes = {
        "run": comparison.b,
        "mode": mode_b if mode_a == mode_b else f"{mode_a} and {mode_b}",
    }
    subtitle = f"compared with {comparison.a}"
    title = "Two identifications, A and B"
    figure, body = picture.framed_figure(9.0, 2.6 * len(differences), title, attributes, subtitle)
    panels: Any = body.subplots(len(differences), 2, sharex=True, squeeze=False)
    for difference, panel_row in zip(differences, panels, strict=True):
        for axes, part, part_of in zip(panel_row, ("Re", "Im"), (np.real, np.imag), strict=True):
            for name, values, band, colour, style in (
                (f"A: {difference.a}", difference.values_a, difference.bands[0], COLOURS[0], ".-"),
                (f"B: {difference.b}", difference.values_b, difference.bands[1], COLOURS[1], ".--"),
            ):  # A remains visible under an equal B
                shown, half_width = part_of(values), np.nan_to_num(band)
                axes.plot(
                    difference.frequency, shown, style, color=colour, lw=1.4, ms=4, label=name
                )
                axes.fill_between(
                    difference.frequency,
                    shown - half_width,
                    shown + half_width,
                    color=colour,
                    alpha=_BAND_OPACITY,
                    lw=0,
                )
            axes.set_ylabel(f"{part} {difference.response}, N·s/m", fontsize=8)
            axes.grid(visible=True, color="#e6eaed", lw=0.6)
            picture.style_axes(axes)
    panels[0, 0].legend(fontsize=7, frameon=False)
    for axes in panels[-1]:
        axes.set_xlabel("frequency, Hz", fontsize=8)
    return picture.save(figure, path)


_LEFT, _RIGHT, _LINE = 0.06, 0.94, 0.0145
_MAX_ROWS = 12  # rows of a table; further rows are only in the JSON file
_MAX_NOTES = 4


@picture.drawn_as(picture.DrawStyle())  # always the same page, in both formats
def write_page(identification: Identification, folder: Path) -> list[Path]:
    """Write ``identification.pdf`` and the same page as ``identification.png``."""
    figure = Figure(figsize=picture.A4, layout="constrained")
    _header(figure, identification)
    heads, *cells = report.model_table(identification)
    y = _table(figure, "Models of the impedance", heads, cells, 0.9)
    heads, *cells = report.family_table(identification)
    y = _table(figure, "With amplitude", heads, cells, y - 0.01)
    bottom = _notes(figure, identification)
    _pictures(figure, identification, bottom, y - 0.01)
    out = [folder / "identification.pdf", folder / "identification.png"]
    picture.save(figure, out[1])
    picture.save(figure, out[0], 100.0)
    return out


def _header(figure: Figure, identification: Identification) -> None:
    figure.add_artist(Rectangle((0.0, 0.937), 1.0, 0.063, color=picture.DARK, lw=0))
    title = f"Identification: {picture.campaign_name(identification.attributes)}"
    style: dict[str, Any] = {"color": "white", "fontweight": "bold", "va": "center"}
    figure.text(_LEFT, 0.975, title, fontsize=min(16.0, 620.0 / len(title)), **style)
    runs = textwrap.shorten("runs " + ", ".join(identification.runs), 130, placeholder=" …")
    figure.text(_LEFT, 0.950, runs, color="#c9d3db", fontsize=7.5, va="center")
    stamp = phrases.mode_stamp(str(identification.attributes.get("mode", "")))
    box = {"boxstyle": "round,pad=0.45", "fc": picture.HIGHLIGHT, "ec": "none"}
    style = {"fontsize": 8.5, "fontweight": "bold", "ha": "right", "va": "center", "bbox": box}
    figure.text(_RIGHT, 0.975, stamp, color=picture.DARK, **style)


def _table(
    figure: Figure, heading: str, heads: tuple[str, ...], rows: list[tuple[str, ...]], top: float
) -> float:
    """Draw a table over the page's width; return the y position below it."""
    style: dict[str, Any] = {"fontsize": 7.5, "va": "top"}
    soft = {**style, "color": picture.MUTED}
    figure.text(_LEFT, top + 0.012, heading.upper(), fontweight="bold", **soft)
    step = (_RIGHT - _LEFT) / len(heads)
    places = [_LEFT + step * (i + 1) for i in range(len(heads))]
    y = top - 0.006
    for x, head in zip(places, heads, strict=True):
        figure.text(x, y, head, ha="right", **{**soft, "fontsize": 7})
    y -= 0.013
    figure.add_artist(Line2D((_LEFT, _RIGHT), (y, y), color="#cfd6dc", lw=0.7))
    y -= 0.003
    for row in rows[:_MAX_ROWS]:
        for x, cell in zip(places, row, strict=True):
            figure.text(x, y, cell, ha="right", color=picture.DARK, **style)
        y -= _LINE
    if len(rows) > _MAX_ROWS:
        more = f"and {len(rows) - _MAX_ROWS} more: see {report.JSON}"
        figure.text(_LEFT, y, more, **soft)
        y -= _LINE
    return y - 0.012


def _notes(figure: Figure, identification: Identification) -> float:
    """Draw the notes and the legend of the page; return the y position above them."""
    lines: list[str] = []
    for note in identification.notes[:_MAX_NOTES]:
        lines += textwrap.wrap(note, 130, initial_indent="• ", subsequent_indent="   ")
    if len(identification.notes) > _MAX_NOTES:
        lines.append(f"and {len(identification.notes) - _MAX_NOTES} more in {report.JSON}")
    remarks = [report.NOT_CONSTANTS, *report.bem_lines(identification)[:_MAX_NOTES]]
    lines += [line for remark in remarks for line in textwrap.wrap(remark, 130)]
    lines.append(
        "Z = F/v, force on the body, e^(+iωt). Bands: 95 %, from the scatter of periods; "
        "distortion: scatter of realisations in excess of it."
    )
    y = 0.02 + _LINE * len(lines)
    colour = picture.ACCENT if identification.notes else picture.MUTED
    figure.text(_LEFT, y, "\n".join(lines), fontsize=7.5, color=colour, va="top")
    return y + 0.015


def _pictures(figure: Figure, identification: Identification, bottom: float, top: float) -> None:
    """Draw the admittances, and the excitation if identified, else the drivetrain."""
    largest_model = largest(identification.models)[0]
    fits = identification.fits[identification.models.index(largest_model)]
    bem = identification.bem_impedances.get(largest_model.axis)
    curves, per_kilo = admittances(largest_model, fits, bem), largest_model.units.per_kilo
    figures: list[tuple[str, list[Curve], str, str]] = [
        (f"Admittance, {largest_model.name}", curves, "Y", per_kilo)
    ]
    if identification.excitations:
        curves = excitation_curves(identification.excitations[0], identification.bem)
        figures.append(("Wave excitation", curves, "f_exc", "N/m"))
    elif largest_model.has_drivetrain:
        family = [
            model
            for model in identification.models
            if (model.axis, model.spring_rate) == (largest_model.axis, largest_model.spring_rate)
        ]
        curves = by_colour(family, "Z_d", "{0.peak_a:.3g} A")
        figures.append(("Drivetrain admittance by amplitude", curves, "Y_d", per_kilo))
    heights = [1.0 - top, *[(top - bottom) / len(figures)] * len(figures), bottom]
    bands: Any = figure.subfigures(
        len(heights), 3, height_ratios=heights, width_ratios=[0.03, 0.94, 0.03]
    )
    for panel, (title, curves, symbol, unit) in zip(bands[1:-1, 1], figures, strict=True):
        panel.suptitle(title, fontsize=8.5, fontweight="bold", color=picture.MUTED)
        four_panels(panel, curves, symbol, unit)
