"""Wave calibration: elevation of a sea without the device, by spectral line.

Identification divides by the mean over repeat periods and uses its standard error. Waves of a run
with the device contain reflected and radiated waves and are no substitute (MASK4 report (Sandia),
section 3.2.2). A repeat period for which the record lacks ticks is withheld unless requested; a
period in which the loop only skipped ticks is not. A probe may stand in a node of some lines. The
report names these lines, because dividing by them would amplify noise.
"""

import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.recording.runs import RunError, reader, run_info
from rig.recording.runs.mcap_file import Records
from rig.recording.runs.windows import Window, lost_between_rows, read_windows
from rig.recording.table_file import write_table
from rig.spectra.periods import Floats
from rig.spectra.wave_lines import (
    Samples,
    estimate_lines,
    finite_samples,
    mean_period,
    period_edges,
    significant_height,
    split_periods,
)

PROBE_FIELDS = ("probes.probe_1", "probes.probe_2", "probes.probe_3")
AGE_FIELDS = ("probes.probe_age", "probes.age")  # s, of the probe values
ELEVATION_FIELD = "wave.elevation"  # undisturbed, at the device; only a simulated basin logs it

STEP = 0.02  # s, sampling of values known in every tick: 50 Hz, as for probes
MIN_SIGNAL_TO_ERROR = 5.0  # standard errors; a line below is too weak for identification
MIN_TARGET_SHARE = 0.1  # of the target amplitude; a line below is too weak
MIN_LINE_SHARE = 1e-3  # of the largest line; a line below is too weak

_CLOCK = "plan.wave_clock"


class WaveMakerLines(NamedTuple):
    """The target lines commanded to the wave maker."""

    repeat: float  # s
    cycles: Any
    amplitude: Floats  # m
    phase: Floats  # rad


def is_calibration(plan: dict[str, Any]) -> bool:
    """Return whether a plan is that of a run without the device."""
    return plan.get("device") == "absent"


def calibrate_waves(
    run: str | os.PathLike[str], *, incomplete_rows: bool = False
) -> xarray.Dataset:
    """Return the wave calibration of a run by probe, line and period; units in the attributes.

    Amplitudes and phases are those of A cos(2 pi f t + phase), t on the wave clock. The attribute
    ``withheld`` names the periods for which the record lacks ticks; ``incomplete_rows`` includes
    them if they have at least 90 % of their samples. Raises RunError if the run is not a wave
    calibration, or if no whole period was measured.
    """
    source = reader.open_files(run)
    run_facts = run_info(run, source.contents)
    if not is_calibration(run_facts.plan):
        raise RunError(f"{run}: no wave calibration (its plan has no device: absent)")
    target = _target_lines(run_facts.plan)
    # A run without the device has no rows: one window, from the lead-in to its end.
    fields = [_CLOCK, *_wave_fields(source)]
    window = next(read_windows(source, fields, run_facts.plan, incomplete_rows=True), None)
    channels = _channels(window.data) if window else []
    incomplete, withheld = set[int](), ""
    if window and not incomplete_rows:
        incomplete = _incomplete_periods(window, channels, target.repeat)
    if window and incomplete:
        numbers = ", ".join(str(i + 1) for i in sorted(incomplete))
        withheld = f"repeat period{'s' if len(incomplete) > 1 else ''} {numbers} withheld: "
        withheld += f"{window.missing_text} (--incomplete-rows uses the remaining ticks)"
    by_probe = {
        name: periods
        for name, samples, start in channels
        if (periods := split_periods(samples, target.repeat, start, incomplete))
    }
    if not by_probe:
        reason = "no whole repeat period was measured"
        raise RunError(f"{run}: {'; '.join(filter(None, [reason, withheld]))}")
    return _build_dataset(by_probe, target).assign_attrs(
        run_facts.attributes()
        | {
            "repeat_s": target.repeat,
            "sea": str((run_facts.plan.get("sea") or {}).get("words", "")),
        }
        | ({"withheld": withheld} if withheld else {})
    )


def _target_lines(plan: dict[str, Any]) -> WaveMakerLines:
    sea = plan["requested_sea"]
    columns = (np.array(sea[key], dtype=np.float64) for key in ("amplitude_m", "phase_rad"))
    return WaveMakerLines(float(sea["repeat_s"]), np.array(sea["cycles"], dtype=np.int64), *columns)


def _wave_fields(source: reader.RunFiles) -> list[str]:
    """Return the log fields of probes with their age, and of the elevation if it is logged."""
    names = {leaf.name for leaf in source.leaves}
    age = [name for name in AGE_FIELDS if name in names][:1]
    return [
        *age,
        *(name for name in PROBE_FIELDS if name in names and age),
        *([ELEVATION_FIELD] if ELEVATION_FIELD in names else []),
    ]


def _tick_period(data: Records) -> float:
    """Return the tick period in s."""
    clock, ticks = data[_CLOCK], data["tick"]
    return float((clock[-1] - clock[0]) / (ticks[-1] - ticks[0]))


def _sample_times(data: Records) -> Any:
    """Return the sampling times of the probe values in each tick, s of the wave clock."""
    age_fields = [name for name in AGE_FIELDS if name in (data.dtype.names or ())]
    return data[_CLOCK] - data[age_fields[0]] if age_fields else data[_CLOCK]


def _channels(data: Records) -> list[tuple[str, Samples, float]]:
    """Return name, samples and start of the first period (s) of every probe in the run."""
    if len(data) < 2:
        return []
    names, clock, tick = data.dtype.names or (), data[_CLOCK], _tick_period(data)
    channels = []
    if probes := [name for name in PROBE_FIELDS if name in names]:
        sample_times = _sample_times(data)
        fresh = np.append(True, np.diff(sample_times) > 0.5 * tick)
        earliest = clock[0] - 0.25 * tick  # excludes samples taken before the window
        fresh &= sample_times >= earliest
        times = sample_times[fresh]
        channels += [
            (name.rpartition(".")[2], Samples(times, data[name][fresh]), float(times[0]))
            for name in probes
            if len(times)
        ]
    if ELEVATION_FIELD in names:
        sampled = data["tick"] % max(1, round(STEP / tick)) == 0
        times = clock[sampled]
        if len(times):
            channels.append(
                ("elevation", Samples(times, data[ELEVATION_FIELD][sampled]), float(times[0]))
            )
    return channels


def _incomplete_periods(
    window: Window, channels: list[tuple[str, Samples, float]], repeat: float
) -> set[int]:
    """Return the numbers of the repeat periods for which the record lacks ticks."""
    if not window.missing or not channels:
        return set()
    data = window.data
    clock, tick = data[_CLOCK], _tick_period(data)
    gap_starts = np.flatnonzero(lost_between_rows(data))
    # A lost tick contained the samples taken after the tick before it.
    gaps = list(
        zip(_sample_times(data)[gap_starts] + tick, clock[gap_starts + 1] - tick, strict=True)
    )
    incomplete: set[int] = set()
    period_count = 0
    for _, samples, start in channels:
        edges = period_edges(finite_samples(samples), repeat, start)
        period_count = max(period_count, len(edges) - 1)
        for low, high in gaps:
            first, last = np.searchsorted(edges, (low, high), side="right") - 1
            incomplete |= set(range(max(0, int(first)), int(last) + 1))
    # Ticks lost next to the window are missing in its last period if that is too short.
    if window.lost_at_edges and window.span * tick < period_count * repeat - 0.5 * tick:
        incomplete.add(period_count - 1)
    return {number for number in incomplete if number < period_count}


def _build_dataset(by_probe: dict[str, list[Samples]], target: WaveMakerLines) -> xarray.Dataset:
    count = round(target.repeat / STEP)
    estimates = [
        estimate_lines(periods, target.repeat, target.cycles) for periods in by_probe.values()
    ]
    means, mean_errors = np.swapaxes(
        [mean_period(periods, target.repeat, count) for periods in by_probe.values()], 0, 1
    )
    values = [np.concatenate([p.value for p in periods]) for periods in by_probe.values()]
    heights = np.full((len(estimates), max(len(each.periods) for each in estimates)), np.nan)
    for i, each in enumerate(estimates):
        heights[i, : len(each.periods)] = [significant_height(period) for period in each.periods]
    mean = np.array([each.mean for each in estimates])
    error = np.array([each.standard_error for each in estimates])
    size = np.abs(mean)
    weak = (size < MIN_TARGET_SHARE * target.amplitude) | (size < MIN_SIGNAL_TO_ERROR * error)
    weak |= size < MIN_LINE_SHARE * size.max(axis=1, keepdims=True)

    def variable(dimensions: str, data: Any, units: str = "", name: str = "") -> Any:
        attributes = {"units": units, "long_name": name}
        return dimensions.split(), data, {key: text for key, text in attributes.items() if text}

    return xarray.Dataset(
        {
            "cycles": variable("line", target.cycles, name="wave cycles in a repeat period"),
            "commanded_amplitude": variable("line", target.amplitude, "m"),
            "commanded_phase": variable("line", target.phase, "rad"),
            "amplitude": variable("probe line", size, "m"),
            "phase": variable("probe line", np.angle(mean), "rad"),
            "amplitude_se": variable("probe line", error, "m"),
            "weak": variable(
                "probe line", weak.astype(np.int64), name="1: too weak for identification"
            ),
            "mean_period": variable("probe time", means, "m"),
            "mean_period_se": variable("probe time", mean_errors, "m"),
            "periods": variable("probe", np.array([len(each.periods) for each in estimates])),
            "hm0": variable(
                "probe",
                np.array([significant_height(each.mean) for each in estimates]),
                "m",
                "of the mean lines",
            ),
            "hm0_by_period": variable("probe period", heights, "m"),
            "hm0_total": variable(
                "probe",
                np.array([4.0 * float(np.std(each)) for each in values]),
                "m",
                "of all that was measured, 4 standard deviations",
            ),
        },
        {
            "probe": variable("probe", np.array(list(by_probe))),
            "frequency": variable("line", target.cycles / target.repeat, "Hz"),
            "time": variable("time", np.arange(count) * (target.repeat / count), "s"),
        },
        {
            "hm0_asked_m": significant_height(target.amplitude),
            "convention": "A cos(2 pi f t + phase), t on the wave clock",
        },
    )


def findings(table: xarray.Dataset) -> list[str]:
    """Return the withheld periods and a message for each probe."""
    target = table.attrs["hm0_asked_m"]
    messages = [str(table.attrs["withheld"])] if "withheld" in table.attrs else []
    for name in table["probe"].values.tolist():
        probe = table.sel(probe=name)
        hm0, total = float(probe["hm0"]), float(probe["hm0_total"])
        heights = probe["hm0_by_period"].values
        heights = heights[np.isfinite(heights)]
        error = np.std(heights, ddof=1) / np.sqrt(len(heights)) if len(heights) > 1 else np.nan
        weak = probe["frequency"].values[probe["weak"].values == 1]
        text = f"{name}: Hm0 {1e3 * hm0:.1f} mm"
        if np.isfinite(error):
            text += f" ± {1e3 * error:.2f}" if 1e3 * error >= 0.005 else " ± <0.01"
            text += " by scatter of periods"
        text += (
            f" ({100.0 * (hm0 / target - 1.0):+.1f} % from the target of {1e3 * target:.1f} mm)"
            if target
            else ""
        )
        count = int(probe["periods"])
        text += f" over {count} period{'s' if count != 1 else ''}; "
        text += f"{100.0 * (hm0 / total) ** 2:.1f} % of the measured variance"
        text += " is periodic on the target lines"
        if len(weak):
            shown = ", ".join(f"{f:.4g}" for f in weak[:5])
            more = f" and {len(weak) - 5} more" if len(weak) > 5 else ""
            lines = f"{len(weak)} line{'s' if len(weak) > 1 else ''}"
            text += f"; {lines} too weak for identification ({shown}{more} Hz)"
        messages.append(text)
    return messages


def write_calibration(table: xarray.Dataset, folder: Path) -> list[Path]:
    """Write ``wave_calibration.nc`` with all data and ``.csv`` with a row for each wave line."""
    binary = folder / "wave_calibration.nc"
    names = table["probe"].values.tolist()
    columns = {
        "cycles": table["cycles"].values,
        "frequency [Hz]": table["frequency"].values,
        "commanded_amplitude [m]": table["commanded_amplitude"].values,
        "commanded_phase [rad]": table["commanded_phase"].values,
    }
    for i, name in enumerate(names):
        for key, unit in (("amplitude", "m"), ("amplitude_se", "m"), ("phase", "rad")):
            columns[f"{name}_{key} [{unit}]"] = table[key].values[i]
        columns[f"{name}_weak"] = table["weak"].values[i]
    text = {name: values.tolist() for name, values in columns.items()}
    table.to_netcdf(binary, engine="h5netcdf")
    return [write_table(text, folder / "wave_calibration.csv"), binary]
