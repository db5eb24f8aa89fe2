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

from rig.analysis import picture
from rig.design.twoport.network import (
    Complexes,
    Floats,
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
    z = _two_port_of_case(omega, drivetrain, motor, case)
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
    power_flow, available = flow(z, z_i, load, unit_force), available_power(z_i, unit_force)
    deviation = mismatch(z, z_i, load)
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
            style = {"color": COLOURS[i % len(COLOURS)], "lw": 2.0 if i == 0 else 1.2, "ls": "-"}
            if i >= first_matched:
                style |= {
                    "color": picture.DARK,
                    "lw": 1.1,
                    "ls": ":" if i == first_matched else "--",
                }
            axes.plot(frequency, getattr(transfer, name), label=transfer.label, **style)
        _format_axes(axes, panel_title)
        axes.set_ylim(-0.5 if name == "load" else 0.0, 1.05 if name in names[:2] else 1.4)
    for axes in panels[1]:
        axes.set_xlabel("frequency, Hz", fontsize=8)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    body.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
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
