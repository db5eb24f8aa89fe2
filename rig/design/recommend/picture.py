"""The recommendation as a picture: predicted power over Kp and Ki, the rows on it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from scipy.interpolate import RectBivariateSpline

from rig.analysis import picture
from rig.design.recommend.matrix import words
from rig.design.recommend.recommendation import Recommendation
from rig.design.recommend.search import STATIONS
from rig.design.recommend.trial import Bench, Gains, Tried
from rig.planning.campaign.stability import largest_ki

_SIDE = 15  # points of the surface along each axis
_NEAR = 100.0  # N/m: rows whose spring is nearer to the surface's are drawn filled


def write_surfaces(advice: Recommendation, path: Path) -> Path:
    """Draw mechanical, AC and DC power at the recommended spring rate, as PNG."""
    best = advice.best.gains
    kps, reaches, tried = _surface(advice, best.spring_rate)
    beneath = (
        f"{advice.campaign.file.sea.description()}; spring {best.spring_rate:.0f} N/m; star: best for "
        "that station there; dots: recommended rows, hollow at another spring; crosses: measured"
    )
    told = {**_attributes(advice), "campaign": advice.campaign.file.name}
    title = f"Predicted on the identified twin: {words(advice.asked.station)} looked for"
    figure, body = picture.framed_figure(12.0, 4.1, title, told, subtitle=beneath)
    panels: Any = body.subplots(1, 3, sharey=True)
    for axes, station in zip(panels, STATIONS, strict=True):
        power = np.array([one.power(station) for one in tried]).reshape(len(reaches), len(kps))
        allowed = np.array([one.allowed for one in tried]).reshape(power.shape)
        _panel(axes, *_smooth(kps, reaches, np.where(allowed, power, np.nan)))
        _rows(axes, [row.tried.gains for row in advice.rows], best.spring_rate)
        least = min((one for one in tried if one.allowed), key=lambda one: one.power(station))
        star = advice.best if station == advice.asked.station else least
        axes.plot(star.gains.kp, star.gains.ki, "*", ms=15, mfc=picture.HIGHLIGHT, mec=picture.DARK)
        for one in advice.measured:
            if abs(one.gains.spring_rate - best.spring_rate) < _NEAR and _inside(axes, one.gains):
                axes.plot(one.gains.kp, one.gains.ki, "x", ms=7, mew=1.5, color="white")
        name = words(station)
        axes.set_title(f"{name}, {star.power(station):.1f} W at the star", fontsize=9, loc="left")
        axes.set_xlabel("Kp, N s/m", fontsize=8)
        picture.style_axes(axes)
    panels[0].set_ylabel("Ki, N/m", fontsize=8)
    return picture.save(figure, path)


def _attributes(advice: Recommendation) -> dict[str, str]:
    return {"run": ", ".join(run.split("_")[0] for run in advice.twin.runs), "mode": "prediction"}


def _surface(advice: Recommendation, rate: float) -> tuple[Any, Any, list[Tried]]:
    """Kp and Ki around the rows, and what is predicted there."""
    near = [row.tried.gains for row in advice.rows if abs(row.tried.gains.spring_rate - rate) < 1e3]
    kps = np.linspace(*_span([one.kp for one in near], 800.0), _SIDE)
    low, high = _span([one.ki for one in near], 2500.0)
    kis = np.linspace(low, min(high, largest_ki(advice.campaign.rig.stability, rate)), _SIDE)
    quick = Bench(advice.campaign, advice.twin, quick=True)
    gains = [Gains(min(kp, -100.0), ki, rate) for ki in kis for kp in kps]
    return np.minimum(kps, -100.0), kis, quick.tried(gains)


def _span(values: Sequence[float], margin: float) -> tuple[float, float]:
    return min(values) - margin, max(values) + margin


def _smooth(kps: Any, kis: Any, power: Any) -> tuple[Any, Any, Any]:
    """The surface on four times as many points, cubic between them; as it is where it has holes."""
    if not np.isfinite(power).all() or np.any(np.diff(kps) <= 0.0):
        return kps, kis, power
    fine = [np.linspace(each[0], each[-1], 4 * _SIDE) for each in (kps, kis)]
    return (*fine, RectBivariateSpline(kis, kps, power)(fine[1], fine[0]))


def _panel(axes: Axes, kps: Any, kis: Any, power: Any) -> None:
    """Filled contours with their values written on lines."""
    least = float(np.nanmin(power))
    # Fine beneath, coarse above: what is a watt from the best counts, not what is forty.
    levels = least + np.array([0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0])
    levels = np.unique([*levels[levels < float(np.nanmax(power))], float(np.nanmax(power))])
    axes.contourf(kps, kis, power, levels=levels, cmap="viridis")
    lines = axes.contour(
        kps, kis, power, levels=levels[1:-1], colors="white", linewidths=0.7, linestyles="solid"
    )
    axes.clabel(lines, fmt=lambda value: f"{value:.1f} W", fontsize=7)


def _rows(axes: Axes, rows: Sequence[Gains], rate: float) -> None:
    for gains in rows:
        near = abs(gains.spring_rate - rate) < _NEAR
        face = picture.ACCENT if near else "none"
        if _inside(axes, gains):
            axes.plot(gains.kp, gains.ki, "o", ms=5, mfc=face, mec=picture.ACCENT)


def _inside(axes: Axes, gains: Gains) -> bool:
    """Whether a set point lies on the surface."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    return left <= gains.kp <= right and low <= gains.ki <= high
