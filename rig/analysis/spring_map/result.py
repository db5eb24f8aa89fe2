"""The map of a run: one dataset over stator position and rotor angle, and what it says in words."""

import math
import os
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.analysis.phrases import signed
from rig.analysis.spring_map import passes
from rig.analysis.spring_map.passes import FIT, SMALL, Curve, Line, Reversal, Samples, Sine
from rig.analysis.windows import LeftOut, Window, windows
from rig.realtime.sequence import Phase
from rig.recording.runs import RunError, reader
from rig.recording.runs.folder import Facts, facts
from rig.recording.runs.state import Reading

DISAGREE = 0.05  # of the larger: rates by the two load cells that differ by more are told
_MOVING = 0.2  # of the hoist's speed: a body that is slower turns round
_FIELDS = (
    "load.rotor_angle", "load.slew", "load.lcb", "load.stator_a", "load.stator_b",
    "heave.estimate.velocity", "spring_sense.position", "tare.slew", "tare.lcb", "tare.samples",
)  # fmt: skip


class _Rig(NamedTuple):
    """Constants of the rig, as the run's configuration has them; NaN where it does not."""

    metres_per_radian: float
    slew_lever: float  # m
    hydrostatic: float  # N/m
    moving_mass: float  # kg


class _Station(NamedTuple):
    """One stator position."""

    stator: float  # %, measured
    curve: Curve
    rate: Line  # N/m, by the slew cell
    column: Line  # N/m, by the column load cell
    small: float  # N/m
    sine: Sine
    reversal: Reversal
    friction: float  # N, in the drivetrain


def is_hoisted(plan: dict[str, Any]) -> bool:
    """True for the plan of a run in which a hoist moved the body."""
    return bool(plan.get("hoist"))


def spring_map(run: str | os.PathLike[str], *, incomplete_rows: bool = False) -> xarray.Dataset:
    """The map of a run: curves by station and angle, rates by station; units in the attributes.

    The attribute ``left_out`` names rows that do not enter it. ``incomplete_rows``: rows of which
    the record lacks ticks do.
    RunError if no hoist moved the body, the rig file lacks `spring.mapping`, or no station
    was walked through to its end.
    """
    source = reader.source(run)
    known = facts(run, source.contents)
    if not is_hoisted(known.plan):
        raise RunError(f"{run}: no spring map (its campaign has no hoist)")
    rig = _rig(known)
    zero = _balance(source)
    found, left_out = _stations(run, source, known, rig, zero, incomplete_rows)
    stations = sorted(found, key=lambda one: one.stator)
    if not stations:
        said = "; ".join(["no station was walked through to its end", *left_out])
        raise RunError(f"{run}: {said}")
    return _dataset(stations, rig).assign_attrs(
        known.attributes()
        | {"balance_rad": zero, "hoist": str(known.plan["hoist"].get("words", ""))}
        | ({"left_out": "; ".join(left_out)} if left_out else {})
    )


def _rig(known: Facts) -> _Rig:
    def told(*keys: str) -> float:
        value = known.configured("rig", *keys)
        return math.nan if value is None else value

    found = _Rig(
        told("spring", "metres_per_radian"),
        told("spring", "mapping", "slew_lever_m"),
        told("stability", "hydrostatic_stiffness_n_per_m"),
        told("spring", "mapping", "moving_mass_kg"),
    )
    if math.isnan(found.slew_lever) or math.isnan(found.metres_per_radian):
        raise RunError(
            f"{known.run}: its rig file does not say spring.mapping.slew_lever_m, the lever (m) "
            "of the load cell that takes the spring's torque"
        )
    return found


def _balance(source: reader.Source) -> float:
    """Rotor angle of the floating body (rad): mean over the tare; 0 where there was none."""
    total, count = 0.0, 0
    for block in reader.blocks(source):
        tared = block["plan.phase"] == Phase.TARE
        total += float(block["load.rotor_angle"][tared].sum())
        count += int(tared.sum())
        if count and not tared.any():
            break
    return total / count if count else 0.0


def _stations(
    run: str | os.PathLike[str],
    source: reader.Source,
    known: Facts,
    rig: _Rig,
    zero: float,
    incomplete_rows: bool,
) -> tuple[list[_Station], tuple[str, ...]]:
    """One for each stator position, and what was left out.

    A station that was repeated is one, of all that was seen.
    """
    point = {row["row"]: row["point"] for row in known.plan["rows"]}
    whole: dict[int, list[Window]] = {}
    seen, left = Reading(source.contents, source.damage), LeftOut()
    for window in windows(
        source, list(_FIELDS), known.plan, incomplete_rows=incomplete_rows, reading=seen
    ):
        if left.whole(window):
            whole.setdefault(point[window.row], []).append(window)
    speed = float(known.plan["hoist"]["speed_m_per_s"])
    stations = []
    for several in whole.values():
        parts = [_samples(window, rig, zero, _MOVING * speed) for window in several]
        samples = Samples(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
        stator = np.mean([window.data["spring_sense.position"].mean() for window in several])
        stations.append(_station(float(stator), samples, rig))
    return stations, left.notes(known.plan, seen.state(run))


def _samples(window: Window, rig: _Rig, zero: float, moving: float) -> Samples:
    data = window.data
    velocity = data["heave.estimate.velocity"]
    way = np.where(velocity > moving, 1, np.where(velocity < -moving, -1, 0))
    return Samples(
        data["load.rotor_angle"] - zero,
        way.astype(np.int64),
        (data["load.slew"] - data["tare.slew"]) * rig.slew_lever,
        data["load.lcb"] - data["tare.lcb"],
        data["load.stator_a"] + data["load.stator_b"],
    )


def _station(stator: float, samples: Samples, rig: _Rig) -> _Station:
    found = passes.curve(samples)
    lever = rig.metres_per_radian
    torque = passes.rate_line(samples, found, found.torque, samples.torque)
    column = passes.rate_line(samples, found, found.column, samples.column)
    small = passes.slope_within(found, found.torque, SMALL)
    return _Station(
        stator,
        found,
        Line(torque.slope / (lever * lever), torque.interval / (lever * lever), torque.passes),
        Line(-column.slope / lever, column.interval / lever, column.passes),
        small / (lever * lever),
        passes.sine(found),
        passes.reversal(found),
        float(np.nanmean(found.friction)),
    )


def natural_frequency(rate: Any, hydrostatic: float, mass: float) -> Any:
    """Hz, sqrt((K_h + K_s) / (A + m)) / 2 pi: MASK4 report (Sandia), eq. 3.1; NaN if it falls."""
    stiffness = np.asarray(hydrostatic + rate, dtype=np.float64)
    return np.sqrt(np.where(stiffness > 0.0, stiffness, np.nan) / mass) / (2.0 * math.pi)


def _dataset(stations: list[_Station], rig: _Rig) -> xarray.Dataset:
    low = min(int(one.curve.bins[0]) for one in stations)
    high = max(int(one.curve.bins[-1]) for one in stations)
    index = np.arange(low, high + 1)
    both, each = ("station", "angle"), ("station",)

    def surface(name: str) -> Any:
        made = np.full((len(stations), len(index)), np.nan)
        for i, one in enumerate(stations):
            first = int(one.curve.bins[0]) - low
            values = getattr(one.curve, name)
            made[i, first : first + len(values)] = values
        return made

    def column(of: Any, unit: str, words: str) -> Any:
        values = np.array([of(one) for one in stations], dtype=np.float64)
        return each, values, {"units": unit, "long_name": words}

    lever = rig.metres_per_radian
    rates = np.array([one.rate.slope for one in stations])
    travel = [lever * float(np.nanmax(np.abs(one.curve.angle))) for one in stations]
    reversed_at = [lever * one.reversal.nearest for one in stations]
    return xarray.Dataset(
        {
            "torque": (both, surface("torque"), {"units": "N*m", "long_name": "spring torque"}),
            "stator_force": (both, surface("stator"), {"units": "N", "long_name": "axial"}),
            "column_force": (both, surface("column"), {"units": "N", "long_name": "on the body"}),
            "rate": column(lambda s: s.rate.slope, "N/m", "spring rate, by the slew load cell"),
            "rate_interval": column(lambda s: s.rate.interval, "N/m", "95 % either way"),
            "rate_column": column(lambda s: s.column.slope, "N/m", "by the column load cell"),
            "rate_small": column(lambda s: s.small, "N/m", "small-displacement rate"),
            "passes": (each, np.array([one.rate.passes for one in stations])),
            "peak": column(lambda s: s.sine.peak, "N*m", "Tp of T = Tp sin 2 theta"),
            "departure": column(lambda s: s.sine.departure, "N*m", "rms, of that law"),
            "friction": column(lambda s: s.friction, "N", "of the drivetrain, at this speed"),
            "reversal_below": column(lambda s: s.reversal.below, "rad", "stator force reverses"),
            "reversal_above": column(lambda s: s.reversal.above, "rad", "stator force reverses"),
            "reversal_stroke": (each, np.array(reversed_at), {"units": "m"}),
            "travel": (each, np.array(travel), {"units": "m", "long_name": "either way, seen"}),
            "natural_frequency": (
                each,
                natural_frequency(rates, rig.hydrostatic, rig.moving_mass),
                {"units": "Hz"},
            ),
        },
        {
            "station": (each, np.array([one.stator for one in stations]), {"units": "%"}),
            "angle": ("angle", passes.middle(index), {"units": "rad"}),
        },
        {
            "fit_half_angle_rad": FIT,
            "metres_per_radian": lever,
            "hydrostatic_n_per_m": rig.hydrostatic,
            "moving_mass_kg": rig.moving_mass,
            "convention": "rate > 0 restores; torque restores at a positive angle; "
            "column force on the body, heave up positive",
        },
    )


def findings(table: xarray.Dataset) -> list[str]:
    """What a reader wants to know first, a sentence each."""
    rate = table["rate"].values
    known = np.isfinite(rate)
    told = []
    if known.any():
        told.append(
            f"spring rate {signed(float(np.nanmin(rate)))} .. {signed(float(np.nanmax(rate)))} N/m"
            f" at {known.sum()} stator positions"
        )
    frequency = table["natural_frequency"].values
    if np.isfinite(frequency).any():
        low, high = float(np.nanmin(frequency)), float(np.nanmax(frequency))
        told.append(f"natural frequency {low:.3f} .. {high:.3f} Hz (eq. 3.1)")
    stroke, station = table["reversal_stroke"].values, table["station"].values
    if np.isfinite(stroke).any():
        i = int(np.argmin(stroke))
        told.append(
            f"the stator's force reverses at {np.isfinite(stroke).sum()} of them, soonest at "
            f"{signed(float(station[i]))} %: {stroke[i]:.3f} m from balance"
        )
    else:
        told.append("the stator's force reverses nowhere on the travel seen")
    if left_out := table.attrs.get("left_out"):
        told.append(str(left_out))
    return [*told, *_doubts(table)]


def _doubts(table: xarray.Dataset) -> Iterator[str]:
    """What makes a map no map, or another cell's."""
    half = math.degrees(FIT)
    for one in (table.isel(station=i) for i in range(table.sizes["station"])):
        at, rate = f"{signed(float(one['station']))} %", float(one["rate"])
        other = float(one["rate_column"])
        if math.isnan(rate):
            yield f"at {at} the travel does not lead through ±{half:.2f} deg both ways: no rate"
        elif abs(rate - other) > DISAGREE * max(abs(rate), abs(other), 1000.0):
            yield (
                f"at {at} the column load cell gives {signed(other)} N/m where the slew cell "
                f"gives {signed(rate)}: a lever or a scale is wrong"
            )
