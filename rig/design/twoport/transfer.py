"""Share of the available wave power that reaches the take-off and its load, and the mismatch.

The available power is |F_e|^2/(8 Re Z_i); shares are given at the column and at the motor's
terminals. The mismatch at both ports is |reflection|, 0 for conjugate impedances.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.design.twoport.figures import COLOURS, SUBTITLE, Case
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
from rig.design.twoport.power import available_power, flow
from rig.presentation import picture


class Transfer(NamedTuple):
    """Shares of the available power and mismatch at each frequency."""

    label: str
    column: Floats  # 1, power into the take-off at the column load cell
    load: Floats  # 1, power into the load at the motor's terminals; negative if it drives
    at_input: Floats  # |reflection| of Z_in against Z_i
    at_output: Floats  # |reflection| of Z_l against Z_out


def transfers(
    omega: Floats, z_i: Complexes, drivetrain: Complexes, motor: Motor, cases: Sequence[Case]
) -> list[Transfer]:
    """Return the transfer of each case, then of both matched loads at the first case's settings."""
    results = []
    for case in cases:
        z = _two_port_of_case(omega, drivetrain, motor, case)
        load = load_of(z, controller(omega, case.kp, case.ki))
        results.append(_transfer_of_load(case.label, z, z_i, load))
    z = _two_port_of_case(omega, drivetrain, motor, cases[0])
    results.append(_transfer_of_load("matched at the column", z, z_i, mechanically_matched(z, z_i)))
    results.append(_transfer_of_load("matched at the load", z, z_i, electrically_matched(z, z_i)))
    return results


def _two_port_of_case(omega: Floats, drivetrain: Complexes, motor: Motor, case: Case) -> TwoPort:
    """Return the two-port of a case; ``drivetrain`` is without spring, at ``motor``'s gear."""
    spring = linear_drivetrain(omega, 0.0, 0.0, case.spring_rate)
    z11, scaled_motor = geared(drivetrain, spring, motor, case.gear)
    return two_port(omega, z11, scaled_motor)


def _transfer_of_load(label: str, z: TwoPort, z_i: Complexes, load: Complexes) -> Transfer:
    unit_force = np.ones_like(z_i)
    power_flow, available, deviation = (
        flow(z, z_i, load, unit_force),
        available_power(z_i, unit_force),
        mismatch(z, z_i, load),
    )
    return Transfer(
        label,
        power_flow.mechanical_1 / available,
        power_flow.ac / available,
        np.abs(deviation.at_input),
        np.abs(deviation.at_output),
    )


def write_transfer(
    path: Path,
    omega: Floats,
    transfers_: Sequence[Transfer],
    title: str,
    attributes: Mapping[str, Any],
) -> Path:
    """Draw power shares (top) and mismatch (bottom) over frequency, as PNG; see `write_effects`."""
    figure, body = picture.framed_figure(10.0, 6.4, title, attributes, SUBTITLE)
    panels: Any = body.subplots(2, 2, sharex=True)
    frequency = omega / (2.0 * np.pi)
    names = ("column", "load", "at_input", "at_output")
    titles = (
        "power into the take-off / available power",
        "power into the load (AC) / available power",
        "mismatch at the input, |reflection of Z_in against Z_i|",
        "mismatch at the output, |reflection of Z_l against Z_out|",
    )
    first_matched = len(transfers_) - 2
    for axes, name, panel_title in zip(panels.flat, names, titles, strict=True):
        for i, transfer in enumerate(transfers_):
            style = {"color": COLOURS[i % len(COLOURS)], "lw": 2.0 if i == 0 else 1.2}
            if i >= first_matched:
                style = {
                    "color": picture.DARK,
                    "lw": 1.1,
                    "ls": ":" if i == first_matched else "--",
                }
            axes.plot(frequency, getattr(transfer, name), label=transfer.label, **style)
        axes.set_title(panel_title, fontsize=9, loc="left")
        axes.axhline(0.0, color=picture.FRAME, lw=0.8, zorder=0)
        axes.margins(x=0.0)
        axes.set_ylim(-0.5 if name == "load" else 0.0, 1.05 if name in names[:2] else 1.4)
        picture.style_axes(axes)
    for axes in panels[1]:
        axes.set_xlabel("frequency, Hz", fontsize=8)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    body.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return picture.save(figure, path)
