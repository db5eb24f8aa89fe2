"""How gains, spring and gear move the impedances, after Figs. 5-1 and 5-2 of the MASK4 report.

The upper panels show Z_in over Z_i*, which matches it; the lower ones Z_l over Z_out*. Gains move
Z_in and Z_l, and both targets stay: one dotted line each. Spring and gear move Z_out too: each
setting then has its own target in its colour, dashed.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from rig.analysis import picture
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

COLOURS = ("#0b6e99", "#2e933c", "#d1495b", "#8d5a97", "#c77d0a", "#5c6b73")
SAID = "theory, on measured impedances"
_SHOWN = {
    "kp": "Kp {:g} N s/m",
    "ki": "Ki {:g} N/m",
    "spring_rate": "spring {:.5g} N/m",
    "gear": "gear {:.3g} rad/m",
}


class Case(NamedTuple):
    """One setting of everything that can be tuned."""

    label: str
    kp: float  # N s/m
    ki: float  # N/m
    spring_rate: float  # N/m
    gear: float  # rad/m


class Impedances(NamedTuple):
    """The four that a match is about."""

    z_in: Complexes  # N s/m
    load: Complexes  # ohm
    z_out: Complexes  # ohm


def impedances(
    omega: Floats, z_i: Complexes, drivetrain: Complexes, motor: Motor, case: Case
) -> Impedances:
    """Impedances of a case; ``drivetrain`` (N s/m) is that at ``motor``'s gear without spring."""
    spring = linear_drivetrain(omega, 0.0, 0.0, case.spring_rate)
    z11, own = geared(drivetrain, spring, motor, case.gear)
    z = two_port(omega, z11, own)
    load = load_of(z, controller(omega, case.kp, case.ki))
    return Impedances(input_impedance(z, load), load, output_impedance(z, z_i))


def around(base: Case, **steps: float) -> list[Case]:
    """The base, and each named field less and more by its step: (n) and (p) of the report."""
    made = [base._replace(label="base")]
    for name, step in steps.items():
        here = float(getattr(base, name))
        for sign, mark in ((-1.0, "n"), (1.0, "p")):
            numbers = base._asdict() | {name: here + sign * step}
            made.append(
                Case(**numbers | {"label": f"{_SHOWN[name].format(numbers[name])} ({mark})"})
            )
    return made


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
    """Draw Z_in over what matches it and Z_l over what matches it, for each case, as PNG.

    ``attributes`` say run and mode.
    """
    figure, body = picture.framed_figure(10.0, 6.4, title, attributes, SAID)
    panels: Any = body.subplots(2, 2, sharex=True)
    f = omega / (2.0 * np.pi)
    found = [impedances(omega, z_i, drivetrain, motor, case) for case in cases]
    one_target = all(np.array_equal(each.z_out, found[0].z_out) for each in found)
    for i, (case, each) in enumerate(zip(cases, found, strict=True)):
        colour = COLOURS[i % len(COLOURS)]
        style = {"color": colour, "lw": 2.0 if i == 0 else 1.2}
        _parts(panels[0], f, each.z_in, label=case.label, **style)
        _parts(panels[1], f, each.load, **style)
        if not one_target:
            _parts(panels[1], f, np.conj(each.z_out), color=colour, lw=0.9, ls="--")
    _parts(panels[0], f, np.conj(z_i), color=picture.DARK, lw=1.4, ls=":", label="what matches")
    if one_target:
        _parts(panels[1], f, np.conj(found[0].z_out), color=picture.DARK, lw=1.4, ls=":")
    mark = "dotted" if one_target else "dashed"
    for axes, part in zip(panels.T, ("Re", "Im"), strict=True):
        _frame(axes[0], f"{part} Z_in, N s/m  (dotted: {part} Z_i*)")
        _frame(axes[1], f"{part} Z_l, ohm  ({mark}: {part} Z_out*)")
        axes[1].set_xlabel("frequency, Hz", fontsize=8)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    body.legend(handles, labels, loc="outside lower center", ncols=6, frameon=False, fontsize=8)
    return picture.save(figure, path)


def _parts(panels: Any, f: Floats, one: Complexes, **style: Any) -> None:
    """Real part into the left panel, imaginary part into the right one."""
    panels[0].plot(f, one.real, **style)
    panels[1].plot(f, one.imag, **style)


def _frame(axes: Axes, title: str) -> None:
    axes.set_title(title, fontsize=9, loc="left")
    axes.axhline(0.0, color=picture.FRAME, lw=0.8, zorder=0)
    axes.margins(x=0.0)
    picture.style_axes(axes)
