"""How much of what waves offer goes into the take-off and into its load, and why no more.

Share of the power available, |F_e|^2/(8 Re Z_i), at the column and at the motor's terminals; and
the mismatch of both ends, |reflection|: 0 where they are conjugates.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.analysis import picture
from rig.design.twoport.figures import COLOURS, SAID, Case
from rig.design.twoport.network import (
    Complexes,
    Floats,
    Motor,
    TwoPort,
    controller,
    electrically_matched,
    geared,
    linear_drivetrain,
    load_of,
    mechanically_matched,
    mismatch,
    two_port,
)
from rig.design.twoport.power import available, flow


class Transfer(NamedTuple):
    """Shares of the available power and mismatch at each frequency."""

    label: str
    column: Floats  # 1, into the take-off at the column load cell
    load: Floats  # 1, into the load at the motor's terminals; below 0 it gives
    at_input: Floats  # |reflection| of Z_in against Z_i
    at_output: Floats  # |reflection| of Z_l against Z_out


def transfers(
    omega: Floats, z_i: Complexes, drivetrain: Complexes, motor: Motor, cases: Sequence[Case]
) -> list[Transfer]:
    """Of each case, then of both matched loads at the first case's spring and gear."""
    found = []
    for case in cases:
        z = _ports(omega, drivetrain, motor, case)
        load = load_of(z, controller(omega, case.kp, case.ki))
        found.append(_transfer(case.label, z, z_i, load))
    z = _ports(omega, drivetrain, motor, cases[0])
    found.append(_transfer("matched at the column", z, z_i, mechanically_matched(z, z_i)))
    found.append(_transfer("matched at the load", z, z_i, electrically_matched(z, z_i)))
    return found


def _ports(omega: Floats, drivetrain: Complexes, motor: Motor, case: Case) -> TwoPort:
    """``drivetrain`` is that at ``motor``'s gear without spring."""
    spring = linear_drivetrain(omega, 0.0, 0.0, case.spring_rate)
    z11, own = geared(drivetrain, spring, motor, case.gear)
    return two_port(omega, z11, own)


def _transfer(label: str, z: TwoPort, z_i: Complexes, load: Complexes) -> Transfer:
    one = np.ones_like(z_i)
    told, most, off = flow(z, z_i, load, one), available(z_i, one), mismatch(z, z_i, load)
    return Transfer(
        label,
        told.mechanical_1 / most,
        told.ac / most,
        np.abs(off.at_input),
        np.abs(off.at_output),
    )


def write_transfer(
    path: Path,
    omega: Floats,
    told: Sequence[Transfer],
    title: str,
    attributes: Mapping[str, Any],
) -> Path:
    """Draw shares above and mismatch below, over frequency, as PNG; as in `write_effects`."""
    figure, body = picture.framed_figure(10.0, 6.4, title, attributes, SAID)
    panels: Any = body.subplots(2, 2, sharex=True)
    f = omega / (2.0 * np.pi)
    names = ("column", "load", "at_input", "at_output")
    titles = (
        "into the take-off, share of what is available",
        "into the load (AC), share of what is available",
        "mismatch at the input, |Z_in against Z_i*|",
        "mismatch at the output, |Z_l against Z_out*|",
    )
    matched = len(told) - 2
    for axes, name, words in zip(panels.flat, names, titles, strict=True):
        for i, each in enumerate(told):
            style = {"color": COLOURS[i % len(COLOURS)], "lw": 2.0 if i == 0 else 1.2}
            if i >= matched:
                style = {"color": picture.DARK, "lw": 1.1, "ls": ":" if i == matched else "--"}
            axes.plot(f, getattr(each, name), label=each.label, **style)
        axes.set_title(words, fontsize=9, loc="left")
        axes.axhline(0.0, color=picture.FRAME, lw=0.8, zorder=0)
        axes.margins(x=0.0)
        axes.set_ylim(-0.5 if name == "load" else 0.0, 1.05 if name in names[:2] else 1.4)
        picture.style_axes(axes)
    for axes in panels[1]:
        axes.set_xlabel("frequency, Hz", fontsize=8)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    body.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return picture.save(figure, path)
