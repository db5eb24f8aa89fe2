"""Pictures of a two-port: effect of gains, spring and gear, power transfer, mismatch.

`write_effects` is after Figs. 5-1 and 5-2 of the MASK4 report (Sandia): the upper panels compare
Z_in with its matched value Z_i*, the lower panels Z_l with Z_out*. Gains change Z_in and Z_l but
not the targets, which are one dotted line each. Spring and gear also change Z_out, so each setting
has its own target, dashed in its colour.

`write_transfer` shows the share of the available power |F_e|^2/(8 Re Z_i) that reaches the column
and the motor's terminals, and the mismatch |reflection| at both ports, 0 for conjugate impedances.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from rig.design.twoport.network import (
    Motor,
    TwoPort,
    available_power,
    controller,
    electrically_matched,
    flow,
    geared,
    input_impedance,
    linear_drivetrain,
    load_of,
    mechanically_matched,
    mismatch,
    output_impedance,
    two_port,
)
from rig.presentation import picture
from rig.spectra.periods import Complexes, Floats

COLOURS = ("#0b6e99", "#2e933c", "#d1495b", "#8d5a97", "#c77d0a", "#5c6b73")
SUBTITLE = "theory, on measured impedances"
_LABELS = {
    "kp": "Kp {:g} N s/m",
    "ki": "Ki {:g} N/m",
    "spring_rate": "spring {:.5g} N/m",
    "gear": "gear {:.3g} rad/m",
}


class Case(NamedTuple):
    """One combination of gains, spring rate and gear ratio."""

    label: str
    kp: float  # N s/m
    ki: float  # N/m
    spring_rate: float  # N/m
    gear: float  # rad/m


class TakeOff(NamedTuple):
    """Hull and power take-off at each frequency."""

    omega: Floats  # rad/s
    z_i: Complexes  # N s/m
    drivetrain: Complexes  # N s/m, without spring, at the gear ratio of ``motor``
    motor: Motor

    def two_port(self, case: Case) -> TwoPort:
        """Return the two-port of a case."""
        spring = linear_drivetrain(self.omega, 0.0, 0.0, case.spring_rate)
        z11, scaled_motor = geared(self.drivetrain, spring, self.motor, case.gear)
        return two_port(self.omega, z11, scaled_motor)

    def load(self, case: Case) -> Complexes:
        """Return the load of a case's gains, ohm."""
        return load_of(self.two_port(case), controller(self.omega, case.kp, case.ki))


class Impedances(NamedTuple):
    """Impedances of a matching problem; Z_i is given."""

    z_in: Complexes  # N s/m
    load: Complexes  # ohm
    z_out: Complexes  # ohm


def impedances(take_off: TakeOff, case: Case) -> Impedances:
    """Return the impedances of a case."""
    z, load = take_off.two_port(case), take_off.load(case)
    return Impedances(input_impedance(z, load), load, output_impedance(z, take_off.z_i))


def vary(base: Case, **steps: float) -> list[Case]:
    """Return the base case and each field decreased (n) and increased (p) by its step."""
    cases = [base._replace(label="base")]
    for field, step in steps.items():
        value = float(getattr(base, field))
        for sign, suffix in ((-1.0, "n"), (1.0, "p")):
            fields = base._asdict() | {field: value + sign * step}
            cases.append(
                Case(**fields | {"label": f"{_LABELS[field].format(fields[field])} ({suffix})"})
            )
    return cases


def write_effects(
    path: Path, take_off: TakeOff, cases: Sequence[Case], title: str, attributes: Mapping[str, Any]
) -> Path:
    """Draw Z_in and Z_l with their matched values for each case, as PNG.

    ``attributes`` hold run and mode.
    """
    figure, body = picture.framed_figure(10.0, 6.4, title, attributes, SUBTITLE)
    panels: Any = body.subplots(2, 2, sharex=True)

    def plot(row: int, impedance: Complexes, **style: Any) -> None:
        """Plot the real part in the left panel and the imaginary part in the right panel."""
        for axes, part in zip(panels[row], (impedance.real, impedance.imag), strict=True):
            axes.plot(take_off.omega / (2.0 * np.pi), part, **style)

    results = [impedances(take_off, case) for case in cases]
    single_target = all(np.array_equal(result.z_out, results[0].z_out) for result in results)
    for i, (case, result) in enumerate(zip(cases, results, strict=True)):
        style = _case_style(i)
        plot(0, result.z_in, label=case.label, **style)
        plot(1, result.load, **style)
        if not single_target:
            plot(1, np.conj(result.z_out), color=style["color"], lw=0.9, ls="--")
    target = {"color": picture.DARK, "lw": 1.4, "ls": ":"}
    plot(0, np.conj(take_off.z_i), label="matched", **target)
    if single_target:
        plot(1, np.conj(results[0].z_out), **target)
    line_style = "dotted" if single_target else "dashed"
    for axes, part in zip(panels.T, ("Re", "Im"), strict=True):
        _format_axes(axes[0], f"{part} Z_in, N s/m  (dotted: {part} Z_i*)")
        _format_axes(axes[1], f"{part} Z_l, ohm  ({line_style}: {part} Z_out*)")
    return _save(figure, body, panels, 6, path)


def write_transfer(
    path: Path, take_off: TakeOff, cases: Sequence[Case], title: str, attributes: Mapping[str, Any]
) -> Path:
    """Draw power shares (top) and mismatch (bottom) over frequency, as PNG; see `write_effects`.

    Each case is one line; then come both matched loads at the first case's settings.
    """
    z_i, z = take_off.z_i, take_off.two_port(cases[0])
    lines = [(case.label, take_off.two_port(case), take_off.load(case)) for case in cases]
    lines.append(("matched at the column", z, mechanically_matched(z, z_i)))
    lines.append(("matched at the load", z, electrically_matched(z, z_i)))
    figure, body = picture.framed_figure(10.0, 6.4, title, attributes, SUBTITLE)
    panels: Any = body.subplots(2, 2, sharex=True)
    unit_force = np.ones_like(z_i)
    available = available_power(z_i, unit_force)
    for i, (label, z, load) in enumerate(lines):
        style = _case_style(i)
        if i >= len(cases):
            style = {"color": picture.DARK, "lw": 1.1, "ls": ":" if i == len(cases) else "--"}
        power, deviation = flow(z, z_i, load, unit_force), mismatch(z, z_i, load)
        curves = (
            power.mechanical_1 / available,
            power.ac / available,
            np.abs(deviation.at_input),
            np.abs(deviation.at_output),
        )
        for axes, curve in zip(panels.flat, curves, strict=True):
            axes.plot(take_off.omega / (2.0 * np.pi), curve, label=label, **style)
    titles = {
        "power into the take-off / available power": (0.0, 1.05),
        "power into the load (AC) / available power": (-0.5, 1.05),  # negative if it drives
        "mismatch at the input, |reflection of Z_in against Z_i|": (0.0, 1.4),
        "mismatch at the output, |reflection of Z_l against Z_out|": (0.0, 1.4),
    }
    for axes, (panel_title, span) in zip(panels.flat, titles.items(), strict=True):
        _format_axes(axes, panel_title)
        axes.set_ylim(*span)
    return _save(figure, body, panels, 4, path)


def _case_style(number: int) -> dict[str, Any]:
    return {"color": COLOURS[number % len(COLOURS)], "lw": 2.0 if number == 0 else 1.2}


def _format_axes(axes: Axes, title: str) -> None:
    axes.set_title(title, fontsize=9, loc="left")
    axes.axhline(0.0, color=picture.FRAME, lw=0.8, zorder=0)
    axes.margins(x=0.0)
    picture.style_axes(axes)


def _save(figure: Any, body: Any, panels: Any, columns: int, path: Path) -> Path:
    for axes in panels[1]:
        axes.set_xlabel("frequency, Hz", fontsize=8)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    style = {"loc": "outside lower center", "frameon": False, "fontsize": 8}
    ncols = min(columns, 3 * picture.paper_columns() - 2) if picture.for_paper() else columns
    body.legend(handles, labels, ncols=ncols, **style)
    return picture.save(figure, path)
