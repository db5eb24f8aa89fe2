"""What a wave calibration gives: the elevation of a sea without the device, line by line.

The mean over repeat periods with its standard error is what identification divides by; waves of a
run with the device in the water hold what it reflects and radiates, so they are no substitute
(MASK4 report (Sandia), section 3.2.2). A repeat period of which the record lacks ticks is withheld
unless asked for; one in which the loop only skipped ticks is not. A probe may stand in a node of
some lines: those are named, because to divide by them is to divide by noise.
"""

import csv
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.analysis.wave_lines import (
    Floats,
    Lines,
    Samples,
    by_period,
    finite,
    lines,
    mean_period,
    period_edges,
    significant_height,
)
from rig.analysis.windows import Window, lost_after, windows
from rig.recording.runs import RunError, reader
from rig.recording.runs.folder import facts
from rig.recording.runs.mcap_file import Records

PROBES = ("probes.probe_1", "probes.probe_2", "probes.probe_3")
AGES = ("probes.probe_age", "probes.age")  # s, of what the probes say
TRUTH = "wave.elevation"  # undisturbed at the device: only a simulated basin knows it

STEP = 0.02  # s between samples of what is known in every tick: 50 Hz, as probes are read
WEAK = 5.0  # standard errors: a line below is not to be divided by
FAINT = 0.1  # of the asked amplitude: so is a line below this
NOTHING = 1e-3  # of the largest line: and one below this

_CLOCK = "plan.wave_clock"


class WaveMakerLines(NamedTuple):
    """The lines that the wave maker was asked for."""

    repeat: float  # s
    cycles: Any
    amplitude: Floats  # m
    phase: Floats  # rad


def is_calibration(plan: dict[str, Any]) -> bool:
    """True for the plan of a run without the device."""
    return plan.get("device") == "absent"


def calibration(run: str | os.PathLike[str], *, incomplete_rows: bool = False) -> xarray.Dataset:
    """The calibration of a run: by probe, line and period; units in the attributes.

    Amplitudes and phases are those of A cos(2 pi f t + phase), t on the wave clock. The attribute
    ``withheld`` names the periods of which the record lacks ticks; with ``incomplete_rows`` they
    are read from the samples that are there, if those are nine in ten. RunError if the run is none,
    or no whole period of it was measured.
    """
    source = reader.source(run)
    known = facts(run, source.contents)
    if not is_calibration(known.plan):
        raise RunError(f"{run}: no wave calibration (its plan does not say device: absent)")
    asked = _asked(known.plan)
    found: dict[str, tuple[Lines, list[Samples], float]] = {}
    # A run without the device has no rows: one window, from the lead-in to its end.
    fields = [_CLOCK, *_fields(source)]
    window = next(windows(source, fields, known.plan, incomplete_rows=True), None)
    channels = _channels(window.data) if window else []
    lacking = _lacking(window, channels, asked.repeat) if window and not incomplete_rows else set()
    for name, samples, start in channels:
        pieces = by_period(samples, asked.repeat, start, lacking)
        if pieces:
            made = lines(pieces, asked.repeat, asked.cycles)
            found[name] = (
                made,
                pieces,
                4.0 * float(np.std(np.concatenate([p.value for p in pieces]))),
            )
    said = ""
    if window and lacking:
        numbers = ", ".join(str(i + 1) for i in sorted(lacking))
        said = f"repeat period{'s' if len(lacking) > 1 else ''} {numbers} withheld: "
        said += f"{window.missing_words} (--incomplete-rows reads what is there)"
    if not found:
        nothing = "no whole repeat period was measured"
        raise RunError(f"{run}: {'; '.join(filter(None, [nothing, said]))}")
    return _dataset(found, asked).assign_attrs(
        known.attributes()
        | {"repeat_s": asked.repeat, "sea": str(_words(known.plan))}
        | ({"withheld": said} if said else {})
    )


def _words(plan: dict[str, Any]) -> str:
    return str((plan.get("sea") or {}).get("words", ""))


def _asked(plan: dict[str, Any]) -> WaveMakerLines:
    told = plan["asked_sea"]
    columns = (np.array(told[key], dtype=np.float64) for key in ("amplitude_m", "phase_rad"))
    return WaveMakerLines(
        float(told["repeat_s"]), np.array(told["cycles"], dtype=np.int64), *columns
    )


def _fields(source: reader.Source) -> list[str]:
    """Probes that the run holds, with the age of what they say, and the truth if it is known."""
    names = {leaf.name for leaf in source.leaves}
    age = [name for name in AGES if name in names][:1]
    return [
        *age,
        *(name for name in PROBES if name in names and age),
        *([TRUTH] if TRUTH in names else []),
    ]


def _tick(data: Records) -> float:
    """Seconds from tick to tick."""
    clock, ticks = data[_CLOCK], data["tick"]
    return float((clock[-1] - clock[0]) / (ticks[-1] - ticks[0]))


def _taken(data: Records) -> Any:
    """When the probes took what they say in each tick, s of the wave clock."""
    age = [name for name in AGES if name in (data.dtype.names or ())]
    return data[_CLOCK] - data[age[0]] if age else data[_CLOCK]


def _channels(data: Records) -> list[tuple[str, Samples, float]]:
    """Every probe that the run holds: its name, its samples and where the first period begins."""
    if len(data) < 2:
        return []
    names, clock, tick = data.dtype.names or (), data[_CLOCK], _tick(data)
    channels = []
    if probes := [name for name in PROBES if name in names]:
        taken = _taken(data)
        fresh = np.append(True, np.diff(taken) > 0.5 * tick)
        begin = clock[0] - 0.25 * tick  # what was taken before the window is not in it
        fresh &= taken >= begin
        times = taken[fresh]
        channels += [
            (name.rpartition(".")[2], Samples(times, data[name][fresh]), float(times[0]))
            for name in probes
            if len(times)
        ]
    if TRUTH in names:
        thin = data["tick"] % max(1, round(STEP / tick)) == 0
        times = clock[thin]
        if len(times):
            channels.append(("elevation", Samples(times, data[TRUTH][thin]), float(times[0])))
    return channels


def _lacking(window: Window, channels: list[tuple[str, Samples, float]], repeat: float) -> set[int]:
    """Numbers of the repeat periods of which the record lacks ticks."""
    if not window.missing or not channels:
        return set()
    data = window.data
    clock, tick = data[_CLOCK], _tick(data)
    before = np.flatnonzero(lost_after(data))
    # A lost tick had what the probes took after the tick before it.
    gaps = list(zip(_taken(data)[before] + tick, clock[before + 1] - tick, strict=True))
    found: set[int] = set()
    whole = 0
    for _, samples, start in channels:
        edges = period_edges(finite(samples), repeat, start)
        whole = max(whole, len(edges) - 1)
        for low, high in gaps:
            first, last = np.searchsorted(edges, (low, high), side="right") - 1
            found |= set(range(max(0, int(first)), int(last) + 1))
    # What is lost beside the window is missing in its last period, where that is too short.
    if window.edge and window.span * tick < whole * repeat - 0.5 * tick:
        found.add(whole - 1)
    return {number for number in found if number < whole}


def _dataset(
    found: dict[str, tuple[Lines, list[Samples], float]], asked: WaveMakerLines
) -> xarray.Dataset:
    names = list(found)
    count = round(asked.repeat / STEP)
    each = {
        name: (made, mean_period(pieces, asked.repeat, count), total)
        for name, (made, pieces, total) in found.items()
    }
    most = max(len(made.periods) for made, _, _ in each.values())
    frequency = asked.cycles / asked.repeat

    def stack(of: Any) -> Any:
        return np.array([of(*each[name]) for name in names])

    mean = stack(lambda made, period, total: made.mean)
    error = stack(lambda made, period, total: made.standard_error)
    heights = stack(
        lambda made, period, total: [
            significant_height(made.periods[i]) if i < len(made.periods) else np.nan
            for i in range(most)
        ]
    )
    hm0 = stack(lambda made, period, total: significant_height(made.mean))
    size = np.abs(mean)
    weak = (size < FAINT * asked.amplitude) | (size < WEAK * error)
    weak |= size < NOTHING * size.max(axis=1, keepdims=True)
    by_line, by_probe = ("probe", "line"), ("probe",)
    metres, radians = {"units": "m"}, {"units": "rad"}
    return xarray.Dataset(
        {
            "cycles": ("line", asked.cycles, {"long_name": "whole periods in a repeat period"}),
            "asked_amplitude": ("line", asked.amplitude, metres),
            "asked_phase": ("line", asked.phase, radians),
            "amplitude": (by_line, size, metres),
            "phase": (by_line, np.angle(mean), radians),
            "amplitude_se": (by_line, error, metres),
            "weak": (by_line, weak.astype(np.int64), {"long_name": "1: not to be divided by"}),
            "mean_period": (("probe", "time"), stack(lambda made, p, total: p[0]), metres),
            "mean_period_se": (("probe", "time"), stack(lambda made, p, total: p[1]), metres),
            "periods": (by_probe, stack(lambda made, p, total: len(made.periods))),
            "hm0": (by_probe, hm0, {**metres, "long_name": "of the mean lines"}),
            "hm0_by_period": (("probe", "period"), heights, metres),
            "hm0_total": (
                by_probe,
                stack(lambda made, p, total: total),
                {**metres, "long_name": "of all that was measured, 4 standard deviations"},
            ),
        },
        {
            "probe": ("probe", np.array(names)),
            "frequency": ("line", frequency, {"units": "Hz"}),
            "time": ("time", np.arange(count) * (asked.repeat / count), {"units": "s"}),
        },
        {
            "hm0_asked_m": significant_height(asked.amplitude),
            "convention": "A cos(2 pi f t + phase), t on the wave clock",
        },
    )


def findings(table: xarray.Dataset) -> list[str]:
    """What a reader wants to know first: what is withheld, then a sentence for each probe."""
    asked = table.attrs["hm0_asked_m"]
    told = [str(table.attrs["withheld"])] if "withheld" in table.attrs else []
    for name in table["probe"].values.tolist():
        one = table.sel(probe=name)
        hm0, total = float(one["hm0"]), float(one["hm0_total"])
        heights = one["hm0_by_period"].values
        heights = heights[np.isfinite(heights)]
        error = np.std(heights, ddof=1) / np.sqrt(len(heights)) if len(heights) > 1 else np.nan
        weak = one["frequency"].values[one["weak"].values == 1]
        text = f"{name}: Hm0 {1e3 * hm0:.1f} mm"
        if np.isfinite(error):
            text += f" ± {1e3 * error:.2f}" if 1e3 * error >= 0.005 else " ± <0.01"
            text += " by scatter of periods"
        text += (
            f" ({100.0 * (hm0 / asked - 1.0):+.1f} % of the asked {1e3 * asked:.1f} mm)"
            if asked
            else ""
        )
        count = int(one["periods"])
        text += f" over {count} period{'s' if count != 1 else ''}; "
        text += f"{100.0 * (hm0 / total) ** 2:.1f} % of what was"
        text += " measured repeats on the asked lines"
        if len(weak):
            shown = ", ".join(f"{f:.4g}" for f in weak[:5])
            more = f" and {len(weak) - 5} more" if len(weak) > 5 else ""
            lines = f"{len(weak)} line{'s' if len(weak) > 1 else ''}"
            text += f"; {lines} too weak to divide by ({shown}{more} Hz)"
        told.append(text)
    return told


def write_calibration(table: xarray.Dataset, folder: Path) -> list[Path]:
    """``wave_calibration.nc`` with everything and ``.csv`` with a line for each wave line."""
    text, binary = folder / "wave_calibration.csv", folder / "wave_calibration.nc"
    names = table["probe"].values.tolist()
    columns = {
        "cycles": table["cycles"].values,
        "frequency [Hz]": table["frequency"].values,
        "asked_amplitude [m]": table["asked_amplitude"].values,
        "asked_phase [rad]": table["asked_phase"].values,
    }
    for i, name in enumerate(names):
        for key, unit in (("amplitude", "m"), ("amplitude_se", "m"), ("phase", "rad")):
            columns[f"{name}_{key} [{unit}]"] = table[key].values[i]
        columns[f"{name}_weak"] = table["weak"].values[i]
    with text.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    table.to_netcdf(binary, engine="h5netcdf")
    return [text, binary]
