"""The power take-off session of the flap: power over the motor's damping, and the optimal damping.

Between flap and load cell the motor is a load R + i X. A flap of intrinsic impedance Z under a
moment F delivers to it the power

    P = |F|^2 R / (2 |Z + i X + R|^2) = a R / (R^2 + 2 b R + c^2)

so a fit of a, b = Re Z and c = |Z + i X| over the measured R gives the optimal damping, c, and its
power a / (2 (b + c)): equation 2.2 of the OSWEC thesis (University of Washington), with the
frequency omega where the thesis prints the velocity, and including the motor's own inertia. If the
loop's delay makes X grow with R, as k R, the form is the same and c = |Z| / sqrt(1 + k^2). R is
measured by load cell and shaft, friction of the gearbox included; it is not the requested damping.
Intervals are by leaving out one damping at a time.
"""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from scipy.optimize import least_squares

from rig.kinds.oswec_bench.products import figures, periods
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, jackknifed, mean
from rig.kinds.oswec_bench.products.periods import PeriodCut
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.result import Columns, Result, compare, table
from rig.kinds.oswec_bench.tick import stations
from rig.kinds.oswec_bench.tick.stations import STATIONS
from rig.realtime.sequence import Phase

IDEAL_DAMPING = (42.0, 104.0)
"""N*m*s/rad: ideal dampings in waves of 1 to 2 s and 0.1 m (OSWEC thesis, section 2.1)."""

WINDOW = 0.02
"""Window of the moving-window differentiator, s."""

MIN_DAMPINGS = 5
"""Minimum number of dampings for a fit of three unknowns."""


class PtoPoint(NamedTuple):
    """Results of one set point."""

    damping: float  # N*m*s/rad, R by the fundamentals of torque and velocity at the cell
    reactance: float  # N*m*s/rad, X
    power: Estimate  # W, absorbed from the flap, interval by scatter of the periods
    motor_power: Estimate  # W, part of it that reaches the motor's shaft
    amplitude: float  # rad, of the flap's motion


class OptimalDamping(NamedTuple):
    """Results of the fit."""

    unknowns: Floats  # a, b, c
    damping: Estimate  # N*m*s/rad
    power: Estimate  # W


def pto_point(
    shaft: Floats, motor: Floats, torque: Floats, motor_torque: Floats, cut: PeriodCut
) -> PtoPoint:
    """Return the results of a set point.

    Angles (rad) and torques (N*m, positive as the motor's on the flap) are as measured.
    """
    shaft_velocity, motor_velocity = (
        cut.trim(periods.velocity(each, cut.dt, WINDOW)) for each in (shaft, motor)
    )
    cell_torque = cut.trim(torque)
    power = stations.step(
        stations.start(),
        cell_torque=cell_torque,
        shaft_velocity=shaft_velocity,
        motor_torque=cut.trim(motor_torque),
        motor_velocity=motor_velocity,
        phase=Phase.SETTLE,
    )
    powers = []
    for station in STATIONS:
        parts = periods.split_periods(getattr(power, station.name), cut)
        method = f"at the {station.heading}, {cut.period_count} periods by their scatter"
        powers.append(mean([-float(np.mean(part)) for part in parts], "W", method))
    torque_wave, velocity_wave = (
        periods.fundamentals(each, cut).mean() for each in (cell_torque, shaft_velocity)
    )
    ratio = -(torque_wave / velocity_wave)
    amplitude = abs(periods.fundamentals(periods.detrend(shaft, cut), cut).mean())
    return PtoPoint(float(ratio.real), float(ratio.imag), powers[0], powers[1], float(amplitude))


def expected_power(unknowns: Floats, damping: Floats) -> Floats:
    """Return the power by the fit, W."""
    a, b, c = unknowns
    power: Floats = a * damping / (damping * damping + 2.0 * b * damping + c * c)
    return power


def optimal_damping(points: list[PtoPoint]) -> OptimalDamping | None:
    """Return the fit over dampings in one sea; None for fewer than `MIN_DAMPINGS`."""
    if len(points) < MIN_DAMPINGS:
        return None
    damping = np.array([each.damping for each in points])
    power = np.array([each.power.value for each in points])
    largest = int(np.argmax(power))
    best = damping[largest]
    start = np.array([3.0 * power[largest] * best, 0.5 * best, best])
    unknowns = _fit_unknowns(damping, power, start)
    left_out = [
        _optimum(_fit_unknowns(damping[kept], power[kept], unknowns))
        for kept in ~np.eye(len(points), dtype=bool)
    ]
    method = f"power of a damper through {len(points)} dampings, jackknife over them"
    units = ("N*m*s/rad", "W")
    return OptimalDamping(unknowns, *jackknifed(_optimum(unknowns), left_out, units, method))


def _fit_unknowns(damping: Floats, power: Floats, start: Floats) -> Floats:
    max_power = float(power.max())
    solved = least_squares(
        lambda x: (expected_power(x, damping) - power) / max_power,
        start,
        bounds=([0.0, 0.0, 1e-6], [np.inf, np.inf, np.inf]),
        x_scale="jac",
    )
    unknowns: Floats = solved.x
    return unknowns


def _optimum(unknowns: Floats) -> Floats:
    a, b, c = unknowns
    return np.array([c, a / (2.0 * (b + c))])


class Sweep(NamedTuple):
    """All dampings in one sea."""

    label: str
    suffix: str  # of the names of its constants
    rows: list[tuple[SetpointData, PtoPoint]]  # in the order of damping
    optimum: OptimalDamping | None

    @property
    def summary(self) -> str:
        """Optimal damping and its power."""
        if self.optimum is None:
            return f"too few dampings for a fit ({len(self.rows)} of {MIN_DAMPINGS})"
        return f"{self.optimum.damping}, {self.optimum.power}"


def analyse_session(session: SessionRun) -> Result:
    """Analyse a run of the session."""
    if not session.complete_points:
        raise ValueError("no set point was measured completely")
    sweeps = _sweeps(session)
    constants: dict[str, Estimate] = {}
    for each in sweeps:
        if each.optimum is not None:
            constants[f"flap_best_damping{each.suffix}"] = each.optimum.damping
            constants[f"flap_best_power{each.suffix}"] = each.optimum.power
    low, high = IDEAL_DAMPING
    thesis = f"{low:g} to {high:g} N·m·s/rad in waves of 1 to 2 s"
    rows = [(each.label, *row) for each in sweeps for row in each.rows]
    return Result(
        (table("flap_power", "Power by set point", rows, COLUMNS),),
        tuple(
            compare(f"optimal damping and its power, waves {each.label}", each.summary, thesis)
            for each in sweeps
        ),
        constants,
        (flap_power(sweeps), flap_damping(sweeps)),
        (
            "Positive power is absorbed from the waves. The motor's power follows from its "
            "measured current and the constant in use, before electrical losses.",
            "The optimal damping is the one at the load cell; the motor's inertia is part of the "
            "flap's impedance.",
        ),
    )


def _sweeps(session: SessionRun) -> list[Sweep]:
    seas: dict[tuple[float, float], list[tuple[SetpointData, PtoPoint]]] = {}
    for each in session.complete_points:
        motor_torque = session.torque_constant * each.current
        cut = each.whole_periods()
        result = pto_point(each.shaft, each.motor, each.torque, motor_torque, cut)
        sea = each.plan_value("wave_amplitude_m"), each.period
        seas.setdefault(sea, []).append((each, result))
    sweeps = []
    for (wave, period), rows in sorted(seas.items()):
        rows.sort(key=lambda row: row[1].damping)
        label = f"{1e3 * wave:g} mm, " + ("irregular" if session.irregular else f"{period:g} s")
        suffix = "" if len(seas) == 1 else f"_{round(1e3 * wave)}mm_{round(1e3 * period)}ms"
        optimum = optimal_damping([result for _, result in rows])
        sweeps.append(Sweep(label, suffix, rows, optimum))
    return sweeps


COLUMNS: Columns[tuple[str, SetpointData, PtoPoint]] = {
    "row": lambda r: r[1].row,
    "waves": lambda r: r[0],
    "requested damping [N*m*s/rad]": lambda r: r[1].plan_value("pto_damping_n_m_s_per_rad"),
    "measured damping [N*m*s/rad]": lambda r: r[2].damping,
    "reactance [N*m*s/rad]": lambda r: r[2].reactance,
    "amplitude [deg]": lambda r: float(np.degrees(r[2].amplitude)),
    "power of the flap [W]": lambda r: r[2].power,
    "power of the motor [W]": lambda r: r[2].motor_power.value,
}


@figures.figure(
    "Power of the flap over the damping at the load cell",
    "Points: measured at the load cell, 95 %; lines: the fit; crosses: power at the motor.",
    axes=("damping at the load cell, N·m·s/rad", "mean power, W"),
    size=(7.4, 4.8),
)
def flap_power(axes: Axes, sweeps: list[Sweep]) -> None:
    max_power = 0.0
    for each, colour in figures.shaded(sweeps):
        points = [point for _, point in each.rows]
        damping = [point.damping for point in points]
        max_power = max(max_power, *(point.power.value for point in points))
        label = each.label
        if each.optimum is not None:
            label += f": {each.summary}"
            grid = np.linspace(0.0, 1.05 * max(damping), 300)
            axes.plot(grid, expected_power(each.optimum.unknowns, grid), lw=1.2, color=colour)
            optimum = each.optimum.damping.value, each.optimum.power.value
            axes.plot(*optimum, "*", ms=11, color=figures.RED, zorder=5)
        power = [point.power for point in points]
        figures.draw_intervals(axes, damping, power, color=colour, label=label)
        motor_power = [point.motor_power.value for point in points]
        axes.plot(damping, motor_power, "x", ms=4, color=colour)
    axes.set_xlim(0.0, None)
    axes.set_ylim(0.0, 1.35 * max_power)
    figures.legend(axes, "upper right", title="waves: optimal damping and its power (stars)")


@figures.figure(
    "Damping at the load cell over requested damping",
    "Above the dashed line the gearbox's friction adds to the motor.",
    axes=("requested damping of the motor, N·m·s/rad", "measured damping, N·m·s/rad"),
    size=(6.4, 4.2),
)
def flap_damping(axes: Axes, sweeps: list[Sweep]) -> None:
    max_requested = 0.0
    for each, colour in figures.shaded(sweeps):
        requested = [row.plan_value("pto_damping_n_m_s_per_rad") for row, _ in each.rows]
        measured = [point.damping for _, point in each.rows]
        max_requested = max(max_requested, *requested)
        axes.plot(requested, measured, "o", ms=4, color=colour, label=each.label)
    axes.plot([0.0, max_requested], [0.0, max_requested], "k--", lw=0.9)
    axes.set_xlim(0.0, None)
    axes.set_ylim(0.0, None)
    figures.legend(axes, title="waves")
