"""The response session of the flap: its amplitude operator over wave period or frequency."""

from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.figure import SubFigure

from rig.analysis.session import flap_rao, periods
from rig.analysis.session.drawing import RED, axes_of, note, shade
from rig.analysis.session.estimate import Estimate
from rig.analysis.session.flap_rao import Line, Resonance
from rig.analysis.session.points import Point, Session
from rig.analysis.session.result import Column, Compared, Picture, Result, Table, number, words


class Height(NamedTuple):
    """All lines of one wave amplitude (regular), or of one row (irregular), by frequency."""

    said: str
    name: str  # of its constants
    lines: list[Line]
    fit: Resonance | None


def result(session: Session) -> Result:
    """Analyse a run in regular waves, or in an irregular sea."""
    found = [(point, responses(point)) for point in session.whole if point.asked.get("sea")]
    if not found:
        raise ValueError("no set point with waves was measured to its end")
    heights = _by_row(found) if session.irregular else _by_height(found)
    named: dict[str, Estimate] = {}
    for each in heights:
        if each.fit is not None:
            named[f"flap_rao_period{each.name}"] = each.fit.period
            named[f"flap_rao_top{each.name}"] = each.fit.top
    return Result(
        (_table(heights),),
        _compared(heights),
        named,
        (
            Picture("flap_rao", "Response amplitude operator of the flap",
                    "Points with 95 % intervals; lines: the fitted resonance.", (7.4, 5.8),
                    partial(_draw, heights)),
        ),
        (
            "Waves are those the wave maker was asked for, calibrated without the flap; a phase "
            "above zero leads the crest at the hinge.",
        ),
    )  # fmt: skip


def responses(point: Point) -> list[Line]:
    """The response at the lines of a set point's sea, drift taken out."""
    of = point.cut()
    edges = of.edges - of.edges[0]
    angle = periods.detrended(point.shaft, of)
    return flap_rao.lines(angle, edges, point.asked["sea"], point.clock - point.age, point.dt)


def _by_height(found: list[tuple[Point, list[Line]]]) -> list[Height]:
    waves: dict[float, list[Line]] = {}
    for point, lines in found:
        waves.setdefault(point.number("wave_amplitude_m"), []).extend(lines)
    out = []
    for wave, lines in sorted(waves.items()):
        lines.sort(key=lambda each: each.frequency)
        name = "" if len(waves) == 1 else f"_{round(1e3 * wave)}mm"
        out.append(Height(f"{1e3 * wave:g} mm", name, lines, flap_rao.resonance(lines)))
    return out


def _by_row(found: list[tuple[Point, list[Line]]]) -> list[Height]:
    out = []
    for point, lines in found:
        name = "" if len(found) == 1 else f"_row{point.row}"
        crest = 1e3 * point.number("wave_amplitude_m")
        out.append(Height(f"irregular, crest {crest:g} mm", name, lines, flap_rao.resonance(lines)))
    return out


def _table(heights: list[Height]) -> Table:
    rows = [(each, line) for each in heights for line in each.lines]
    lines = [line for _, line in rows]
    return Table(
        "flap_rao",
        "Response amplitude operator",
        (
            Column("waves", "", tuple(each.said for each, _ in rows)),
            Column("frequency", "Hz", tuple(line.frequency for line in lines)),
            Column("period", "s", tuple(1.0 / line.frequency for line in lines)),
            Column("wave amplitude", "m", tuple(line.wave for line in lines)),
            Column("amplitude of the flap", "deg",
                   tuple(float(np.degrees(line.wave * line.size.value)) for line in lines)),
            Column("response", "rad/m", tuple(line.size.value for line in lines)),
            Column("response ±", "rad/m", tuple(line.size.uncertainty for line in lines)),
            Column("phase", "deg", tuple(float(np.degrees(np.angle(e.response))) for e in lines)),
        ),
    )  # fmt: skip


def _compared(heights: list[Height]) -> tuple[Compared, ...]:
    out = []
    for each in heights:
        if each.fit is None:
            continue
        fit = each.fit
        said = f"{words(fit.top)} at {words(fit.period)}; points {number(100.0 * fit.off, 2)} % off"
        out.append(Compared(f"top of the response, waves {each.said}", "not run", "", said, None))
    return tuple(out)


def _draw(heights: list[Height], body: SubFigure) -> None:
    upper, lower = body.subplots(2, 1, sharex=True, height_ratios=[1.7, 1.0])
    upper = axes_of(body, "", "response, rad/m", upper)
    lower = axes_of(body, "frequency, Hz", "phase, deg", lower)
    for i, each in enumerate(heights):
        colour = shade(i + 1, len(heights) + 1) if len(heights) > 1 else "#0b6e99"
        f = np.array([line.frequency for line in each.lines])
        size = [line.size.value for line in each.lines]
        half = np.nan_to_num([line.size.uncertainty for line in each.lines])
        upper.errorbar(f, size, half, fmt="o", ms=4, capsize=2.5, color=colour, label=each.said)
        phase = np.degrees(np.unwrap([np.angle(line.response) for line in each.lines]))
        lower.plot(f, phase - 360.0 * np.round(phase[0] / 360.0), "o-", ms=4, lw=0.8, color=colour)
        if each.fit is not None:
            fine = np.linspace(f.min(), f.max(), 400)
            y = flap_rao.fitted_size(each.fit.unknowns, 2.0 * np.pi * fine)
            upper.plot(fine, y, color=RED if len(heights) == 1 else colour, lw=1.2)
    tops = [f"{each.said}: top {words(each.fit.top)} at {words(each.fit.period)}"
            for each in heights if each.fit is not None]  # fmt: skip
    note(upper, "\n".join(tops), "upper right")
    upper.set_ylim(0.0, None)
    upper.legend(frameon=False, fontsize=8, title="waves", title_fontsize=8, loc="lower left")
