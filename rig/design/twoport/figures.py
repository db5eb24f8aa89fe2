"""Effect of gains, spring and gear on the impedances, after Figs. 5-1 and 5-2 of the MASK4 report.

The upper panels compare Z_in with its matched value Z_i*, the lower panels Z_l with Z_out*. Gains
change Z_in and Z_l but not the targets, which are one dotted line each. Spring and gear also change
Z_out, so each setting has its own target, dashed in its colour.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from rig.design.twoport.network import (
    Complexes,
    Floats,
    Motor,
    controller,
    geared,
    input_impedance,
    linear_drivetrain,
    load_of,
    output_impedance,
    two_port,
)
from rig.presentation import picture

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


class Impedances(NamedTuple):
    """Impedances of a matching problem; Z_i is given."""

    z_in: Complexes  # N s/m
    load: Complexes  # ohm
    z_out: Complexes  # ohm


def impedances(
    omega: Floats, z_i: Complexes, drivetrain: Complexes, motor: Motor, case: Case
) -> Impedances:
    """Return the impedances of a case.

    ``drivetrain`` (N s/m) is without spring, at the gear ratio of ``motor``.
    """
    spring = linear_drivetrain(omega, 0.0, 0.0, case.spring_rate)
    z11, scaled_motor = geared(drivetrain, spring, motor, case.gear)
    z = two_port(omega, z11, scaled_motor)
    load = load_of(z, controller(omega, case.kp, case.ki))
    return Impedances(input_impedance(z, load), load, output_impedance(z, z_i))


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
    path: Path,
    omega: Floats,
    z_i: Complexes,
    drivetrain: Complexes,
    motor: Motor,
    cases: Sequence[Case],
    title: str,
    attributes: Mapping[str, Any],
) -> Path:
    """Draw Z_in and Z_l with their matched values for each case, as PNG.

    ``attributes`` hold run and mode.
    """
    figure, body = picture.framed_figure(10.0, 6.4, title, attributes, SUBTITLE)
    panels: Any = body.subplots(2, 2, sharex=True)
    frequency = omega / (2.0 * np.pi)
    results = [impedances(omega, z_i, drivetrain, motor, case) for case in cases]
    single_target = all(np.array_equal(result.z_out, results[0].z_out) for result in results)
    for i, (case, result) in enumerate(zip(cases, results, strict=True)):
        colour = COLOURS[i % len(COLOURS)]
        style = {"color": colour, "lw": 2.0 if i == 0 else 1.2}
        _plot_parts(panels[0], frequency, result.z_in, label=case.label, **style)
        _plot_parts(panels[1], frequency, result.load, **style)
        if not single_target:
            _plot_parts(panels[1], frequency, np.conj(result.z_out), color=colour, lw=0.9, ls="--")
    _plot_parts(
        panels[0], frequency, np.conj(z_i), color=picture.DARK, lw=1.4, ls=":", label="matched"
    )
    if single_target:
        _plot_parts(
            panels[1], frequency, np.conj(results[0].z_out), color=picture.DARK, lw=1.4, ls=":"
        )
    line_style = "dotted" if single_target else "dashed"
    for axes, part in zip(panels.T, ("Re", "Im"), strict=True):
        _format_axes(axes[0], f"{part} Z_in, N s/m  (dotted: {part} Z_i*)")
        _format_axes(axes[1], f"{part} Z_l, ohm  ({line_style}: {part} Z_out*)")
        axes[1].set_xlabel("frequency, Hz", fontsize=8)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    body.legend(handles, labels, loc="outside lower center", ncols=6, frameon=False, fontsize=8)
    return picture.save(figure, path)


def _plot_parts(panels: Any, frequency: Floats, impedance: Complexes, **style: Any) -> None:
    """Plot the real part in the left panel and the imaginary part in the right panel."""
    panels[0].plot(frequency, impedance.real, **style)
    panels[1].plot(frequency, impedance.imag, **style)


def _format_axes(axes: Axes, title: str) -> None:
    axes.set_title(title, fontsize=9, loc="left")
    axes.axhline(0.0, color=picture.FRAME, lw=0.8, zorder=0)
    axes.margins(x=0.0)
    picture.style_axes(axes)
