"""The losses session: behind the load cell by its torque, before it by the motor's current.

    T_cell            = c+ [v > 0] - c- [v < 0] + b v + J a + z t + z' t^2
    K i - T_cell      = (d + s |T_cell|) sign(v) + b' v + J' a

The acceleration separates inertia. The time t since the tare separates a difference between
directions from a drift of the cell's zero: the zero was correct at the tare, and the bearing does
not change. The first equation describes the bearing and, if present, the seal (OSWEC thesis,
section 3.2.2 and chapter 4); the second the motor and its gearbox. Intervals are by leaving out one
group of samples (a set point, or a period if there are few set points) at a time.
"""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from rig.kinds.oswec_bench.products import figures, periods
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, jackknifed, mean, solve_groups
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.result import Columns, Result, compare, table

MIN_GROUPS = 4
WINDOW = 0.03  # s, of the differentiator
_MAX_BEARING_TORQUE = 1.0  # N*m: a larger torque comes from a brake, not a bearing


class MovingSamples(NamedTuple):
    """A group of samples of a moving driveline, (samples,)."""

    velocity: Floats  # rad/s
    acceleration: Floats  # rad/s^2
    torque: Floats  # N*m, of the load cell
    current: Floats  # A, of the motor
    time: Floats  # s since the tare


class LossesBehindCell(NamedTuple):
    """Losses behind the load cell."""

    positive: Estimate  # N*m, dry, rotation to positive angles
    negative: Estimate  # N*m, dry, opposite rotation
    viscous: Estimate  # N*m*s/rad
    inertia: Estimate  # kg*m^2
    drift: Estimate  # N*m, of the cell's zero from the tare to the last sample
    drift_curvature: Estimate  # N*m, four times the drift's lag behind a straight line at half time


class LossesBeforeCell(NamedTuple):
    """Losses before the load cell."""

    dry: Estimate  # N*m
    share: Estimate  # share of the load; NaN if the load hardly varies
    viscous: Estimate  # N*m*s/rad
    inertia: Estimate  # kg*m^2


def _fit_groups(
    groups: list[tuple[Floats, Floats]], units: tuple[str, ...], group_name: str
) -> list[Estimate]:
    """Return coefficients of design (samples, unknowns) and value (samples,), group by group."""
    values, *left_out = solve_groups(groups, lambda g, r: np.linalg.lstsq(g, r, rcond=1e-12)[0])
    method = f"least squares, jackknife over {len(groups)} {group_name}"
    return jackknifed(values, left_out, units, method)


def losses_behind_cell(groups: list[MovingSamples], group_name: str) -> LossesBehindCell:
    """Return the losses behind the cell; ``group_name`` names the groups."""
    end_time = max(float(each.time.max()) for each in groups)
    designs = []
    for v, a, torque, _, time in groups:
        t = time / end_time
        columns = [(v > 0.0) * 1.0, -1.0 * (v < 0.0), v, a, t, t * t - t]
        designs.append((np.stack(columns, axis=1), torque))
    units = ("N*m", "N*m", "N*m*s/rad", "kg*m^2", "N*m", "N*m")
    return LossesBehindCell(*_fit_groups(designs, units, group_name))


def zero_drift(losses: LossesBehindCell, time: Floats, end_time: float) -> Floats:
    """Return the drift (N*m) of the cell's zero by ``time``; ``end_time`` is that of the last
    sample.
    """
    t = time / end_time
    return losses.drift.value * t + losses.drift_curvature.value * (t * t - t)


def losses_before_cell(
    groups: list[MovingSamples], torque_constant: Estimate, group_name: str
) -> LossesBeforeCell:
    """Return the losses before the cell.

    ``torque_constant`` (N*m/A) is the motor's own at the output; the intervals include the effect
    of its uncertainty.
    """
    value, half_width = torque_constant.value, torque_constant.uncertainty
    losses = _fit_losses_before_cell(groups, value, group_name)
    if not half_width > 0.0:
        return losses
    shifted = _fit_losses_before_cell(groups, value + half_width, group_name)
    pairs = zip(losses, shifted, strict=True)
    return LossesBeforeCell(*(each.widened(other.value - each.value) for each, other in pairs))


def _fit_losses_before_cell(
    groups: list[MovingSamples], torque_constant: float, group_name: str
) -> LossesBeforeCell:
    loads = [float(np.median(np.abs(each.torque))) for each in groups]
    # 2 N*m: a smaller range does not separate dry friction from the load share.
    load_varies = max(loads) - min(loads) > 2.0
    designs = []
    for v, a, torque, current, _ in groups:
        sign = np.sign(v)
        columns = [sign, v, a, *([np.abs(torque) * sign] if load_varies else [])]
        designs.append((np.stack(columns, axis=1), torque_constant * current - torque))
    units = ("N*m", "N*m*s/rad", "kg*m^2", *(("1",) if load_varies else ()))
    dry, viscous, inertia, *shares = _fit_groups(designs, units, group_name)
    share = shares[0] if shares else mean([], "1", "the load hardly varied")
    return LossesBeforeCell(dry, share, viscous, inertia)


class LossPoint(NamedTuple):
    """A set point with its samples at speed, by period."""

    point: SetpointData
    groups: list[MovingSamples]

    @property
    def all_samples(self) -> MovingSamples:
        """All periods in one group."""
        return MovingSamples(*(np.concatenate(column) for column in zip(*self.groups, strict=True)))

    @property
    def is_unbraked(self) -> bool:
        """Whether only bearing and seal load the shaft."""
        load = float(np.median(np.abs(self.all_samples.torque)))
        commands = ("brake_current_a", "damping_n_m_s_per_rad")
        has_brake_command = sum(self.point.plan_value(each, 0.0) for each in commands) > 0
        return load < _MAX_BEARING_TORQUE or not has_brake_command


def analyse_session(session: SessionRun, torque_constant: Estimate | None = None) -> Result:
    """Analyse a run; ``torque_constant`` is the motor's own (N*m/A), from a torque constant
    session.

    By default the constant in use in the run is taken, and its error is not in the intervals.
    """
    points = [each for p in session.complete_points if (each := _loss_point(p)).groups]
    if not points:
        raise ValueError("no set point has a moving shaft")
    constant = torque_constant or Estimate(
        session.torque_constant, 0.0, "N*m/A", "in use in the run"
    )
    constants: dict[str, Estimate] = {}
    comparisons, specs = [], []
    if unbraked := [each for each in points if each.is_unbraked]:
        behind = losses_behind_cell(*_group_samples(unbraked))
        zero_half_width = _zero_half_width(unbraked)
        behind = behind._replace(
            positive=behind.positive.widened(zero_half_width),
            negative=behind.negative.widened(zero_half_width),
        )
        constants |= {f"bearing_{name}": each for name, each in behind._asdict().items()}
        del constants["bearing_drift_curvature"]
        cell = "behind the cell"
        comparisons += [
            compare(f"{cell}, clockwise (dry)", behind.positive, "mostly below 0.15 N·m"),
            compare(f"{cell}, counter-clockwise (dry)", behind.negative, "larger than clockwise"),
            compare(f"{cell}, viscous", behind.viscous, "grows with speed"),
            compare("drift of the cell's zero", behind.drift),
            compare(f"{cell}, inertia", behind.inertia),
        ]
        specs.append(losses_behind(unbraked, behind))
    groups, group_name = _group_samples(points)
    before = losses_before_cell(groups, constant, group_name)
    shown = {name: each for name, each in before._asdict().items() if np.isfinite(each.value)}
    constants |= {f"gearbox_{name}": each for name, each in shown.items()}
    share = shown.get("share", "included in the dry part: the load did not vary")
    comparisons += [
        compare("before the cell, dry", before.dry),
        compare("before the cell, share of the load", share),
        compare("before the cell, viscous", before.viscous),
        compare("before the cell, inertia", before.inertia),
    ]
    specs.append(losses_before(points, constant.value, before))
    rows = [(each.point, each.all_samples) for each in points]
    title = "Losses by set point, mean at speed"
    return Result(
        (table("losses_points", title, rows, _columns(constant.value)),),
        tuple(comparisons),
        constants,
        tuple(specs),
        (
            f"Losses before the cell use the torque constant {constant}, {constant.method}"
            + ("." if torque_constant else "; its error is not in their intervals."),
            "A difference between directions is separated from a drift of the cell's zero: it is "
            "constant over the run, and the zero is correct at the tare.",
        ),
    )


def _zero_half_width(points: list[LossPoint]) -> float:
    """Return the 95 % half width of the cell's zero, by its noise over the ticks of the tare."""
    noise = float(np.mean([np.std(np.diff(each.point.torque)) for each in points])) / np.sqrt(2.0)
    samples = max(1, min(each.point.tare_samples for each in points))
    return float(1.96 * noise / np.sqrt(samples))


def _loss_point(point: SetpointData) -> LossPoint:
    cut = point.whole_periods()
    velocity = periods.velocity(periods.detrend(point.motor, cut), cut.dt, WINDOW)
    acceleration = periods.velocity(velocity, cut.dt, WINDOW)
    moving = periods.moving_samples(velocity, round(WINDOW / cut.dt))
    time = point.start_time + cut.dt * np.arange(len(velocity))
    signals = [velocity, acceleration, cut.trim(point.torque), cut.trim(point.current), time]
    groups = [MovingSamples(*each) for each in periods.split_moving(signals, moving, cut)]
    return LossPoint(point, [each for each in groups if len(each.velocity) > 20])


def _group_samples(points: list[LossPoint]) -> tuple[list[MovingSamples], str]:
    if len(points) >= MIN_GROUPS:
        return [each.all_samples for each in points], "set points"
    return [group for each in points for group in each.groups], "periods"


def _columns(constant: float) -> Columns[tuple[SetpointData, MovingSamples]]:
    def before_cell(row: tuple[SetpointData, MovingSamples]) -> float:
        samples = row[1]
        loss = np.sign(samples.velocity) * (constant * samples.current - samples.torque)
        return float(loss.mean())

    return {
        "row": lambda r: r[0].row,
        "amplitude [deg]": lambda r: r[0].plan_value("amplitude_deg"),
        "brake current [A]": lambda r: r[0].plan_value("brake_current_a", 0.0),
        "rms velocity [rad/s]": lambda r: periods.rms(r[1].velocity),
        "behind the cell, positive [N*m]": lambda r: float(r[1].torque[r[1].velocity > 0.0].mean()),
        "behind the cell, negative [N*m]": lambda r: float(
            -r[1].torque[r[1].velocity < 0.0].mean()
        ),
        "before the cell [N*m]": before_cell,
    }


@figures.figure(
    "Losses behind the load cell over velocity",
    "Some of the samples at speed, drift of the cell removed; red: the fit.",
    axes=("velocity, rad/s", "torque of the load cell, N·m"),
    size=(7.2, 4.6),
)
def losses_behind(axes: Axes, points: list[LossPoint], fit: LossesBehindCell) -> None:
    end_time = max(float(each.all_samples.time.max()) for each in points)
    for each, colour in figures.shaded(points):
        velocity, _, torque, _, time = each.all_samples
        some = slice(None, None, max(1, len(velocity) // 1500))
        torque = torque - zero_drift(fit, time, end_time)
        axes.plot(velocity[some], torque[some], ".", ms=1.5, color=colour, alpha=0.35)
    x = np.linspace(0.0, _max_velocity(points), 50)
    axes.plot(x, fit.positive.value + fit.viscous.value * x, color=figures.RED, lw=1.6)
    axes.plot(-x, -fit.negative.value - fit.viscous.value * x, color=figures.RED, lw=1.6)
    text = f"clockwise {fit.positive}\ncounter-clockwise {fit.negative}\nviscous {fit.viscous}"
    figures.annotate_corner(axes, text, "upper left")


@figures.figure(
    "Losses before the load cell over velocity",
    lambda points, constant, fit: (
        f"Current times {constant:.2f} N·m/A minus cell torque and inertia; red: the fit."
    ),
    axes=("velocity, rad/s", "motor torque minus cell torque minus inertia, N·m"),
    size=(7.2, 4.6),
)
def losses_before(
    axes: Axes, points: list[LossPoint], constant: float, fit: LossesBeforeCell
) -> None:
    for each, colour in figures.shaded(points):
        velocity, acceleration, torque, current, _ = each.all_samples
        loss = constant * current - torque - fit.inertia.value * acceleration
        edges = np.linspace(-np.abs(velocity).max(), np.abs(velocity).max(), 41)
        bins = np.digitize(velocity, edges)
        filled = [inside for k in range(1, 41) if (inside := bins == k).sum() > 10]
        means = [(velocity[inside].mean(), loss[inside].mean()) for inside in filled]
        axes.plot(*zip(*means, strict=True), ".", ms=4, color=colour)
    axes.axhline(0.0, color=figures.BLUE, lw=0.5)
    text = f"dry {fit.dry}\nviscous {fit.viscous}"
    if np.isfinite(fit.share.value):
        text += f"\nshare of load {fit.share}"
    else:  # a single load has a single line
        x = np.array([0.0, _max_velocity(points)])
        line = fit.dry.value + fit.viscous.value * x
        axes.plot(x, line, color=figures.RED, lw=1.2)
        axes.plot(-x, -line, color=figures.RED, lw=1.2)
    figures.annotate_corner(axes, text, "upper left")


def _max_velocity(points: list[LossPoint]) -> float:
    return max(float(np.abs(each.all_samples.velocity).max()) for each in points)
