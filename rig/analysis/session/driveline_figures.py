"""Figures 2.2 to 2.5 and 2.7 to 2.9 of the OSWEC thesis, redrawn from a driveline run."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import SubFigure

from rig.analysis.picture import INK, MARK, SOFT
from rig.analysis.session import periods, regressions, torque_map
from rig.analysis.session.deflection import Behind
from rig.analysis.session.drawing import BLUE, DEPTH, RED, axes_of, note, shade, trend
from rig.analysis.session.driveline import DEGREE, Driven, Found
from rig.analysis.session.linear_fit import Line
from rig.analysis.session.result import Picture

WIDE = (7.2, 4.4)


def pictures(found: Found) -> tuple[Picture, ...]:
    """What the run has data for."""
    made = []
    if found.trends is not None:
        one = _nearest(found.plain, 15.0, 83.3)
        told = f"{one.place[0]:g}°, R = {one.place[1]:g} N·m·s/rad"
        made += [
            Picture("fig_2_2", "Fig. 2.2: motor and shaft over a period",
                    f"{told}; the difference of both drawn 10 times as large.",
                    WIDE, partial(_parameters, one)),
            Picture("fig_2_3", "Fig. 2.3: deflection and torque, period by period",
                    f"{told}; later periods darker.", (7.2, 5.6), partial(_by_period, one)),
        ]  # fmt: skip
        made += _trends(found)
    if found.offline is not None:
        made += _offline(found)
    if found.plain:
        said = "Means over periods, darker for larger damping"
        said += "." if found.known is None else "; dashed: the fitted map."
        made.append(
            Picture("fig_2_9", "Fig. 2.9: deflection over torque", said, (7.2, 5.0),
                    partial(_over_torque, found))
        )  # fmt: skip
    if found.schemes:
        made += _corrections(found)
    return tuple(made)


def _corrections(found: Found) -> list[Picture]:
    pairs = [pair for scheme in found.schemes for pair in scheme.pairs]
    one = _nearest([other for _, other in pairs], 15.0, 83.3)
    told = f"{one.place[0]:g}°, R = {one.place[1]:g} N·m·s/rad, mean of the periods."
    made = [
        Picture("corrections_in_time", "Corrections in the loop, over time", told, (7.2, 5.4),
                partial(_in_time, found, one)),
    ]  # fmt: skip
    if len({other.place for _, other in pairs}) > 1:
        made.insert(0, Picture(
            "corrections", "Corrections in the loop: reference less shaft",
            "95th percentile of each set point, drift taken out.", (7.2, 4.6),
            partial(_schemes, found),
        ))  # fmt: skip
    return made


def _in_time(found: Found, base: Driven, body: SubFigure) -> None:
    upper, lower = body.subplots(2, 1, sharex=True, height_ratios=[1.0, 1.2])
    upper = axes_of(body, "", "reference, deg", upper)
    lower = axes_of(body, "time in the period, s", "less shaft, deg", lower)
    of = base.motion.of
    wanted = periods.mean_period(base.error + base.motion.shaft, of) / DEGREE
    t = of.dt * np.arange(len(wanted))
    upper.plot(t, wanted, color=INK, lw=1.2)
    lower.plot(t, periods.mean_period(base.error, of) / DEGREE, color=INK, label="uncorrected")
    for scheme, colour in zip(found.schemes, (BLUE, RED, DEPTH), strict=False):
        for one, other in scheme.pairs:
            if other.place == base.place:
                left = periods.mean_period(one.error, one.motion.of) / DEGREE
                at = one.motion.of.dt * np.arange(len(left))
                lower.plot(at, left, color=colour, label=scheme.name)
    lower.axhline(0.0, color=SOFT, lw=0.5)
    low, high = lower.get_ylim()
    lower.set_ylim(low, high + 0.2 * (high - low))  # room for the legend
    lower.legend(frameon=False, fontsize=8, loc="upper right", ncols=2)
    lower.margins(x=0.0)


def _nearest(among: Sequence[Driven], amplitude: float, damping: float) -> Driven:
    def far(each: Driven) -> float:
        a, r = each.place
        return abs(a / amplitude - 1.0) + abs(r / damping - 1.0)

    return min(among, key=far)


def _parameters(one: Driven, body: SubFigure) -> None:
    axes = axes_of(body, "time, s", "angle, deg")
    of = one.motion.of
    mean = {n: periods.mean_period(getattr(one.motion, n), of) / DEGREE for n in ("motor", "shaft")}
    t = of.dt * np.arange(len(mean["motor"]))
    shown = mean["motor"] - 10.0 * (mean["motor"] - mean["shaft"])
    axes.plot(t, mean["motor"], color=BLUE, lw=1.8, label="motor")
    axes.plot(t, shown, color=RED, lw=1.8, label="shaft")
    axes.axhline(mean["motor"].max(), color=SOFT, lw=0.6, ls=":")
    axes.axhline(shown.max(), color=SOFT, lw=0.6, ls=":")
    shift = 100.0 * one.behind.phase_shift.mean()
    loss = one.behind.amplitude_difference.mean() / DEGREE
    note(
        axes,
        f"phase shift {shift:.3f} % of period\namplitude difference {loss:.4f}°",
        "upper center",
    )
    axes.margins(x=0.0)
    axes.legend(frameon=False, fontsize=8, loc="lower left")


def _by_period(one: Driven, body: SubFigure) -> None:
    upper, lower = body.subplots(2, 1, sharex=True)
    upper = axes_of(body, "", "deflection, deg", upper)
    lower = axes_of(body, "time in the period, s", "torque, N·m", lower)
    of = one.motion.of
    for axes, values in ((upper, one.motion.deflection / DEGREE), (lower, one.motion.torque)):
        for i, piece in enumerate(periods.pieces(values, of)):
            t = of.dt * np.arange(len(piece))
            axes.plot(t, piece, color=shade(i, of.whole), lw=0.7)
        axes.axhline(0.0, color=SOFT, lw=0.5)
    lower.margins(x=0.0)


def _statistics(
    found: Found,
    fitted: Line,
    of: Callable[[Behind], tuple[float, Any]],
    labels: tuple[str, str],
    body: SubFigure,
) -> None:
    axes = axes_of(body, *labels)
    trend(axes, fitted, [of(each.behind)[0] for each in found.plain], _times(labels[1]))
    dampings = sorted({each.place[1] for each in found.plain})
    for each in found.plain:
        x, values = of(each.behind)
        values = _times(labels[1]) * values
        low, mid, high = np.percentile(values, 5), values.mean(), np.percentile(values, 95)
        colour = shade(dampings.index(each.place[1]) + 1, len(dampings) + 1)
        axes.errorbar(x, mid, [[mid - low], [high - mid]], fmt="o", ms=5, color=colour, capsize=3)
    for i, damping in enumerate(dampings):
        axes.plot([], [], "o", color=shade(i + 1, len(dampings) + 1), label=f"R = {damping:g}")
    axes.legend(frameon=False, fontsize=8)


def _times(label: str) -> float:
    return 100.0 if "%" in label else 1.0 / DEGREE


def _trends(found: Found) -> list[Picture]:
    assert found.trends is not None
    said = "Mean of the periods with 5th and 95th percentile; line with its 95 % band. R² {:.3f}; "
    amplitude, phase, delay = found.trends
    phase_label, loss_label = "phase shift, % of period", "amplitude difference, deg"
    speed, load = "rms motor velocity, rad/s", "rms torque, N·m"
    return [
        Picture("fig_2_4", "Fig. 2.4: phase shift over velocity",
                said.format(phase.r_squared) + "thesis 0.81.", WIDE,
                partial(_statistics, found, phase,
                        lambda b: (b.rms_velocity, b.phase_shift), (speed, phase_label))),
        Picture("fig_2_4_torque", "Phase shift over torque, beside Fig. 2.4",
                said.format(delay.r_squared) + "not in the thesis.", WIDE,
                partial(_statistics, found, delay,
                        lambda b: (b.rms_torque, b.phase_shift), (load, phase_label))),
        Picture("fig_2_5", "Fig. 2.5: amplitude difference over torque",
                said.format(amplitude.r_squared) + "thesis 0.97.", WIDE,
                partial(_statistics, found, amplitude,
                        lambda b: (b.rms_torque, b.amplitude_difference), (load, loss_label))),
    ]  # fmt: skip


def _offline(found: Found) -> list[Picture]:
    one = _nearest(found.plain, 20.0, 104.0)
    told = f"{one.place[0]:g}°, R = {one.place[1]:g} N·m·s/rad; below, what each is off the shaft."
    return [
        Picture("fig_2_7", "Fig. 2.7: motor corrected by equation 2.6", told,
                (7.2, 5.4), partial(_one_corrected, found, one)),
        Picture("fig_2_8", "Fig. 2.8: deflection, offline correction",
                "Mean, 5th and 95th percentile of each set point; the thesis says within 0.25° "
                "before, below 0.12° after.", (7.6, 4.6), partial(_before_after, found)),
    ]  # fmt: skip


def _one_corrected(found: Found, one: Driven, body: SubFigure) -> None:
    assert found.trends is not None
    upper, lower = body.subplots(2, 1, sharex=True, height_ratios=[1.2, 1.0])
    upper = axes_of(body, "", "angle, deg", upper)
    lower = axes_of(body, "time, s", "less shaft, deg", lower)
    by = regressions.predicted(found.trends, one.behind)
    of = one.motion.of
    moved = regressions.offline(one.motion, by, one.behind.amplitude)
    names = ((one.motion.motor, BLUE, "motor", "-"), (moved, DEPTH, "corrected motor", "--"))
    shaft = periods.mean_period(one.motion.shaft, of) / DEGREE
    t = of.dt * np.arange(len(shaft))
    for values, colour, name, style in names:
        here = periods.mean_period(values, of) / DEGREE
        upper.plot(t, here, style, color=colour, lw=1.6, label=name)
        lower.plot(t, here - shaft, style, color=colour, lw=1.4)
    upper.plot(t, shaft, color=RED, lw=1.2, label="shaft")
    lower.axhline(0.0, color=SOFT, lw=0.6)
    upper.legend(frameon=False, fontsize=8, loc="upper center")
    lower.margins(x=0.0)


def _before_after(found: Found, body: SubFigure) -> None:
    assert found.offline is not None
    axes = axes_of(body, "amplitude, deg   /   R, N·m·s/rad", "deflection, deg")
    sets = (
        ([each.motion.deflection for each in found.plain], BLUE, "before", -0.15),
        (found.offline.by_all, RED, "after", 0.15),
    )
    for errors, colour, name, aside in sets:
        for i, error in enumerate(errors):
            size = np.abs(error) / DEGREE
            low, high = np.percentile(size, [5, 95])
            mid = size.mean()
            bar = [[mid - low], [high - mid]]
            label = name if i == 0 else None
            axes.errorbar(
                i + aside, mid, bar, fmt="o", ms=4, color=colour, capsize=2.5, label=label
            )
    for level, name in ((0.25, "0.25°"), (0.12, "0.12°")):
        axes.axhline(level, color=SOFT, lw=0.8, ls="--")
        axes.annotate(name, (1.0, level), xycoords=("axes fraction", "data"), ha="right",
                      va="bottom", fontsize=7.5, color=SOFT)  # fmt: skip
    ticks = [f"{a:g}\n{r:g}" for a, r in (each.place for each in found.plain)]
    axes.set_xticks(range(len(ticks)), ticks)
    axes.set_ylim(0.0, 1.15 * max(0.25, axes.get_ylim()[1]))  # room for the legend
    axes.legend(frameon=False, fontsize=8, loc="upper left", ncols=2)


def _over_torque(found: Found, body: SubFigure) -> None:
    axes = axes_of(body, "driveline torque, N·m", "deflection, deg")
    ordered = sorted(found.plain, key=lambda each: each.behind.rms_torque)
    for i, each in enumerate(ordered):
        of = each.motion.of
        torque = periods.mean_period(each.motion.torque, of)
        bent = periods.mean_period(each.motion.deflection, of) / DEGREE
        axes.plot(torque, bent, color=shade(i + 1, len(ordered) + 1), lw=1.0)
    if found.known is not None:
        top = max(np.abs(each.motion.torque).max() for each in found.plain)
        for sign in (1.0, -1.0):
            x = sign * np.linspace(0.3, top, 200)
            label = "fitted map" if sign > 0 else None
            y = torque_map.deflection(found.known, x) / DEGREE
            axes.plot(x, y, "--", color=MARK, lw=1.6, label=label)
        axes.legend(frameon=False, fontsize=8, loc="upper left")
        known = found.known
        note(axes, f"half gap {known.half_gap.value / DEGREE:.4f}°\n"
             f"soft zone {known.soft_zone.value / DEGREE:.3f}° to {known.knee.value:.1f} N·m\n"
             f"stiffness {known.stiffness.value:.0f} N·m/rad", "lower right")  # fmt: skip
    axes.axhline(0.0, color=SOFT, lw=0.5)
    axes.axvline(0.0, color=SOFT, lw=0.5)


def _schemes(found: Found, body: SubFigure) -> None:
    axes = axes_of(body, "amplitude, deg   /   R, N·m·s/rad", "reference less shaft, 95th, deg")
    places = sorted({one.place for scheme in found.schemes for one, _ in scheme.pairs})
    base: dict[tuple[float, float], Driven] = {}
    for scheme in found.schemes:
        base |= {other.place: other for _, other in scheme.pairs}
    level = [np.percentile(np.abs(base[p].error), 95) / DEGREE for p in places]
    axes.plot(range(len(places)), level, "o", ms=6, color=INK, label="uncorrected")
    axes.plot(range(len(places)), np.array(level) / 2.0, "_", ms=12, color=SOFT, label="half of it")
    for scheme, colour, mark in zip(found.schemes, (BLUE, RED, DEPTH), "sD^", strict=False):
        at = [places.index(one.place) for one, _ in scheme.pairs]
        size = [np.percentile(np.abs(one.error), 95) / DEGREE for one, _ in scheme.pairs]
        axes.plot(at, size, mark, ms=5, color=colour, label=scheme.name)
    axes.set_xticks(range(len(places)), [f"{a:g}\n{r:g}" for a, r in places])
    axes.set_ylim(0.0, None)
    axes.legend(frameon=False, fontsize=8, ncols=2)
