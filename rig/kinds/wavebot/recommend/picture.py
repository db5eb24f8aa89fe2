"""Picture of a recommendation: predicted power over Kp and Ki, with the recommended rows."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from scipy.interpolate import RectBivariateSpline

from rig.analysis.panel import POWER_COLOURS
from rig.kinds.wavebot.campaign.stability import largest_ki
from rig.kinds.wavebot.recommend.recommendation import Recommendation
from rig.kinds.wavebot.recommend.set_points import STATIONS, Gains, SetPointPrediction
from rig.presentation import picture

_SIDE = 15  # points of the surface along each axis
_NEAR = 100.0  # N/m: rows with a spring rate closer than this to the surface's are drawn filled


def write_surfaces(recommendation: Recommendation, path: Path) -> Path:
    """Draw the power at each station, at the recommended spring rate, as PNG."""
    best = recommendation.best.gains
    kp_axis, ki_axis, predictions = _predict_surface(recommendation, best.spring_rate)
    caption = (
        f"{recommendation.campaign.file.sea.description()}; spring {best.spring_rate:.0f} N/m; "
        "star: best for that station; dots: recommended rows, hollow at another spring rate; "
        "crosses: measured"
    )
    attributes = {
        "run": ", ".join(run.split("_")[0] for run in recommendation.twin.runs),
        "mode": "prediction",
        "campaign": recommendation.campaign.file.name,
    }
    title = (
        "Predicted on the identified twin, optimised for "
        f"{recommendation.options.station.name_in_text} power"
    )
    figure, body = picture.framed_figure(12.0, 4.1, title, attributes, subtitle=caption)
    panels: Any = body.subplots(1, len(STATIONS), sharey=True, squeeze=False)[0]
    for axes, station in zip(panels, STATIONS, strict=True):
        power = np.array([one.power(station) if one.allowed else np.nan for one in predictions])
        _draw_contours(
            axes, *_interpolate(kp_axis, ki_axis, power.reshape(len(ki_axis), len(kp_axis)))
        )
        axes.set_xlim(kp_axis[0], kp_axis[-1])  # rows beyond the surface are not drawn
        axes.set_ylim(ki_axis[0], ki_axis[-1])
        for gains in (row.prediction.gains for row in recommendation.rows):
            face = picture.ACCENT if abs(gains.spring_rate - best.spring_rate) < _NEAR else "none"
            axes.plot(gains.kp, gains.ki, "o", ms=5, mfc=face, mec=picture.ACCENT)
        marked = recommendation.best
        if station != recommendation.options.station:
            marked = predictions[int(np.nanargmin(power))]
        star = {"ms": 15, "mfc": picture.HIGHLIGHT, "mec": picture.DARK}
        axes.plot(marked.gains.kp, marked.gains.ki, "*", **star)
        for gains in (row.gains for row in recommendation.measured):
            if abs(gains.spring_rate - best.spring_rate) < _NEAR:
                axes.plot(gains.kp, gains.ki, "x", ms=7, mew=1.5, color="white")
        label = f"{station.name_in_text} power, {marked.power(station):.1f} W at the star"
        axes.set_title(label, fontsize=9, loc="left")
        axes.set_xlabel("Kp, N s/m", fontsize=8)
        picture.style_axes(axes)
        axes.xaxis.set_major_locator(MaxNLocator(5))
    panels[0].set_ylabel("Ki, N/m", fontsize=8)
    return picture.save(figure, path)


def _predict_surface(
    recommendation: Recommendation, rate: float
) -> tuple[Any, Any, list[SetPointPrediction]]:
    """Return Kp and Ki axes around the rows, and the predictions on their grid."""
    neighbours = [
        row.prediction.gains
        for row in recommendation.rows
        if abs(row.prediction.gains.spring_rate - rate) < 1e3
    ]
    kp_axis = np.linspace(*_span([one.kp for one in neighbours], 800.0), _SIDE)
    low, high = _span([one.ki for one in neighbours], 2500.0)
    largest = largest_ki(recommendation.campaign.rig.stability, rate)
    ki_axis = np.linspace(low, min(high, largest), _SIDE)
    gains = [Gains(min(kp, -100.0), ki, rate) for ki in ki_axis for kp in kp_axis]
    return np.minimum(kp_axis, -100.0), ki_axis, recommendation.predictor.quick.predict(gains)


def _span(values: Sequence[float], margin: float) -> tuple[float, float]:
    return min(values) - margin, max(values) + margin


def _interpolate(kp_axis: Any, ki_axis: Any, power: Any) -> tuple[Any, Any, Any]:
    """Return the surface on four times as many points by cubic splines; unchanged with gaps."""
    if not np.isfinite(power).all() or np.any(np.diff(kp_axis) <= 0.0):
        return kp_axis, ki_axis, power
    fine = [np.linspace(each[0], each[-1], 4 * _SIDE) for each in (kp_axis, ki_axis)]
    return (*fine, RectBivariateSpline(ki_axis, kp_axis, power)(fine[1], fine[0]))


def _draw_contours(axes: Axes, kp_axis: Any, ki_axis: Any, power: Any) -> None:
    """Draw filled contours with labelled lines."""
    lowest = float(np.nanmin(power))
    # Contours are dense near the optimum, where a watt matters, and sparse far from it.
    levels = lowest + np.array([0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0])
    levels = np.unique([*levels[levels < float(np.nanmax(power))], float(np.nanmax(power))])
    axes.contourf(kp_axis, ki_axis, power, levels=levels, cmap=POWER_COLOURS)
    style: dict[str, Any] = {"colors": "white", "linewidths": 0.7, "linestyles": "solid"}
    lines = axes.contour(kp_axis, ki_axis, power, levels=levels[1:-1], **style)
    axes.clabel(lines, fmt=lambda value: f"{value:.1f} W", fontsize=7)
